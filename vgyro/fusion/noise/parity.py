"""Parity: the noise of each gyro from the differences between them, at rest and in any motion.

What the gyros have in common, motion or noise, is in no difference. So in motion only the part of the noise can be
known that is not common to all of them. Their correlation is that of the noise record, which was measured at rest, in
this recording or another one of the array; none where there is no such record.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from vgyro.arrays import Floats, Ints
from vgyro.fusion.blocks import PIECE, SampleWeights
from vgyro.fusion.noise.ar1 import colour
from vgyro.fusion.noise.changing import changing_variances
from vgyro.fusion.noise.changing_at_rest import Resting, resting_noise
from vgyro.fusion.noise.changing_in_motion import alike, compared, moving_noise
from vgyro.fusion.noise.cornered_hat import (
    ConstantVariances,
    best_weights,
    constant_variances,
    patterns,
    scaled_to_pairs,
)
from vgyro.fusion.noise.cornered_hat import cornered_hat as cornered_hat
from vgyro.fusion.noise.cornered_hat import pair_variances as pair_variances
from vgyro.fusion.noise.difference_blocks import BlockMoments, block_moments
from vgyro.fusion.noise.motion_noise import motion_noise
from vgyro.fusion.noise.quiet_frequencies import against, good_blocks, quiet_noise
from vgyro.fusion.noise.variance_model import CONSTANT
from vgyro.fusion.types import ArrayRates, CannotRun, FilterParameters
from vgyro.fusion.weights import min_variance_weights

FEWEST_BLOCKS = 16
WORTH = 1.02
"""Variance that the weights so far have over the least possible, below which they stay: noise that comes and goes makes
correlations look a little smaller than they are."""
MORE = 1.1
"""Noise at a flat floor so many times as high as record and differences say counts, though it changes no weights: else
it is taken for motion."""
SMALLEST_EIGENVALUE = 1e-3
"""A correlation matrix with a smaller one is too near to singular to weight by."""


@dataclass(frozen=True)
class Variances:
    """Noise variance of each gyro in M blocks of samples.

    start, stop [M] int64 : samples of each block; in order, every sample is in one, none reaches over a gap
    variance [M, N]  : (deg/s)² a sample, with its colour; above zero, also where the gyro is excluded
    excluded [M, N]  : at fault, or stuck
    tau_s [N]        : time constant of the two-sided EWMA, s; infinite: constant
    correlation [N, N] : of the noise, the same all the time, or about the mean of
    moving [M, N, N] : that of each block; None: the same all the time
    phi [N]          : correlation of a gyro's noise from one sample to the next; 0 where it is not significant
    note             : what to know before using it
    added [M]        : what motion adds to each gyro's variance, correlated with nothing; None: nothing
    """

    start: np.ndarray
    stop: np.ndarray
    variance: np.ndarray
    excluded: np.ndarray
    tau_s: np.ndarray
    correlation: np.ndarray
    phi: np.ndarray
    note: str = ""
    moving: np.ndarray | None = None
    added: np.ndarray | None = None

    @property
    def gyros(self) -> int:
        """N."""
        gyros: int = self.variance.shape[1]
        return gyros

    @property
    def shares(self) -> Ints:
        """Samples of each block [M]."""
        shares: Ints = self.stop - self.start
        return shares

    def weights(self, engine: str = "native") -> np.ndarray:
        """Minimum-variance weights [M, N] of R_t = σσ'∘C: Σ = 1, 0 where excluded; equal if all are.

        Of either sign where the correlation is the same all the time, since it is known from many samples; not negative
        where it moves.
        """
        if self.moving is None:
            weights = best_weights(self.variance, self.excluded, self.correlation).weights
        else:
            weights = self._bounded(self.moving, engine)
        if self.added is not None and not np.array_equal(self.correlation, np.eye(self.gyros)):
            self._beside_motion(weights)
        weights[self.excluded.all(axis=1)] = 1.0 / self.gyros
        return weights

    def _beside_motion(self, weights: np.ndarray) -> None:
        """Weights [M, N] of R = σσ'∘C + qI where motion adds q to each variance, in place."""
        assert self.added is not None
        for pattern, rows in patterns(self.excluded):
            rows, kept = rows[self.added[rows] > 0], np.flatnonzero(~pattern)
            for begin in range(0, len(rows), PIECE):
                piece = rows[begin : begin + PIECE]
                share = np.linalg.solve(self.covariance(piece)[:, kept[:, None], kept], np.ones((len(kept), 1)))[
                    :, :, 0
                ]
                weights[piece] = 0.0
                weights[np.ix_(piece, kept)] = share / share.sum(axis=1, keepdims=True)

    def covariance(self, rows: np.ndarray) -> np.ndarray:
        """R [B, N, N], (deg/s)², of some blocks, by their numbers, with the constant correlation."""
        added = np.zeros(len(rows)) if self.added is None else self.added[rows]
        sigma = np.sqrt(np.maximum(self.variance[rows] - added[:, None], 0.0))
        own = sigma[:, :, None] * sigma[:, None, :] * self.correlation
        return np.asarray(own + added[:, None, None] * np.eye(self.gyros))

    def scaled(self, factor: np.ndarray) -> Variances:
        """The same with the gyros' own variances times factor [N]."""
        added = 0.0 if self.added is None else self.added[:, None]
        return replace(self, variance=(self.variance - added) * factor + added)

    def _bounded(self, moving: np.ndarray, engine: str) -> np.ndarray:
        weights = np.zeros(self.variance.shape)
        sigma = np.sqrt(self.variance)
        for pattern, rows in patterns(self.excluded):
            kept = np.flatnonzero(~pattern)
            for begin in range(0, len(rows), PIECE):
                piece = rows[begin : begin + PIECE]
                here = np.ix_(piece, kept)
                part = moving[np.ix_(piece, kept, kept)]
                weights[here] = min_variance_weights(sigma[here][:, :, None] * sigma[here][:, None, :] * part, engine)
        return weights

    def block_of_sample(self) -> np.ndarray:
        """Number of the block of each sample [T], int32."""
        return np.repeat(np.arange(len(self.start), dtype=np.int32), self.shares)

    def sample_weights(self, engine: str = "native") -> SampleWeights:
        """The weights of the samples."""
        return SampleWeights.of(self.weights(engine), self.block_of_sample())

    def combined_variance(self, weights: Floats | None = None) -> Floats:
        """u'Ru [M], (deg/s)², of one sample of the combination; weights u [M, N], None: those of least variance."""
        weights = self.weights() if weights is None else weights
        if self.added is not None:
            own = weights * np.sqrt(np.maximum(self.variance - self.added[:, None], 0.0))
            variance: Floats = np.sum((own @ self.correlation) * own, axis=1) + self.added * np.sum(weights**2, axis=-1)
            return variance
        parts = weights * np.sqrt(self.variance)
        if self.moving is not None:
            variance = np.einsum("bi,bij,bj->b", parts, self.moving, parts)
            return variance
        variance = np.sum((parts @ self.correlation) * parts, axis=1)
        return variance

    def colour(self, weights: np.ndarray | None = None) -> float:
        """φ of the combination: mean of the gyros', by their shares u_i²σ_i² of its variance."""
        return float(self._parts(weights) @ self.phi)

    def _parts(self, weights: Floats | None) -> Floats:
        """Shares [N] of the gyros in the variance of the combination, of Σ = 1, correlations left out."""
        parts = (self.weights() if weights is None else weights) ** 2 * self.variance
        share = (parts / parts.sum(axis=1, keepdims=True) * self.shares[:, None]).sum(axis=0)
        shares: Floats = share / share.sum()
        return shares


def parity_variances(array: ArrayRates, parameters: FilterParameters, changing: bool = True) -> Variances:
    """Variances of the gyros' noise from the residuals against the array's own estimate, which know no motion.

    At rest as a whole those that change are of the rates themselves, and their correlation may change as well.
    changing : False gives constant variances. Otherwise each is a two-sided EWMA over blocks whose time constant
               predicts each block best from the others, gyro by gyro, and must pay for itself, so that white noise
               keeps a constant variance. Where the differences are predicted better if the correlation changes as
               well, it does (parity_moving)
    returns  : Variances; faults of the array and stuck gyros are left out
    raises   : CannotRun for one gyro, or fewer than 16 blocks (of 0.25 s; of a sample below 8 Hz) without fault
    Two gyros cannot be told apart by parity: each has half the variance of their difference.
    """
    gyros = array.rate.shape[1]
    if gyros < 2:
        raise CannotRun("one gyro: there are no differences")
    moments = block_moments(array)
    pairs = (~moments.excluded).sum(axis=1) > 1
    if pairs.sum() < FEWEST_BLOCKS:
        raise CannotRun(f"fewer than {FEWEST_BLOCKS} blocks with two good gyros", remedy="a longer recording is needed")
    correlation = _correlation(array)
    every, motion = moments, motion_noise(array, moments) if parameters.in_motion and parameters.has("motion") else None
    if motion is not None:
        moments = motion.calm(moments)
    constant, outlier = constant_variances(moments, correlation)
    quiet = False
    if parameters.has("quiet") and not array.at_rest.all():
        constant, correlation, quiet = _in_quiet(array, moments, constant, outlier, correlation)
    even = parameters.has("guard") and not quiet and alike(moments, constant, outlier, correlation)
    if even:
        constant = np.full(gyros, float(constant[~moments.excluded.all(axis=0)].mean()))
    variance = np.broadcast_to(constant, moments.excluded.shape)
    memories = [CONSTANT] * gyros
    moving, changing = None, changing and parameters.has("changing")
    if changing:
        found = _changing(array, moments, ConstantVariances(constant, outlier), correlation, parameters, motion is None)
        variance, memories, correlation, moving = found.variance, found.memories, found.correlation, found.moving
    tau = np.array([memory.tau_s for memory in memories])
    if motion is not None:
        variance = variance + motion.variance[:, None]
    phi = colour(array, moments, constant)
    note = _note(every, correlation, gyros, changing and bool(array.at_rest.all()), moving, quiet)
    if even and not np.ptp(variance, axis=1).any():
        note += "; no gyro is shown to be better than another: equal variances"
    if motion is not None:
        note += f"; {motion.note}"
    return Variances(
        every.start, every.stop, variance, every.excluded, tau, correlation, phi, note, moving,
        None if motion is None else motion.variance,
    )  # fmt: skip


def _changing(
    array: ArrayRates,
    moments: BlockMoments,
    known: ConstantVariances,
    correlation: np.ndarray,
    parameters: FilterParameters,
    together: bool = True,
) -> Resting:
    """Variances that change, and the correlation, if that changes as well and may."""
    constant, outlier = known
    engine, together = parameters.engine, together and parameters.has("changing_correlation")
    block_s = float(np.median(moments.size)) / array.rate_hz
    if array.at_rest.all():
        return resting_noise(block_moments(array, own=True), constant, correlation, block_s, engine, together)
    found = changing_variances(moments, constant, outlier, correlation, block_s, engine)
    both = moving_noise(moments, constant, correlation, block_s, found, engine) if together else None
    if both is None:
        rivals = compared(moments, constant, correlation, found)
        if rivals is not None and rivals.still <= rivals.changing:
            # An outlier has the variance that it shows.
            shown = np.maximum(constant, np.where(found.outlier, found.square, 0.0))
            return Resting(shown, [CONSTANT] * len(constant), correlation, None)
        return Resting(found.variance, found.memories, correlation, None)
    memory = replace(CONSTANT, keep=math.exp(-block_s / both.tau_s), tau_s=both.tau_s)
    return Resting(both.variance, [memory] * len(constant), correlation, both.correlation)


def shared_variances(array: ArrayRates, parameters: FilterParameters, changing: bool) -> Variances:
    """parity_variances, made once for all methods that need them."""
    return array.once(("variances", changing, parameters), lambda: parity_variances(array, parameters, changing))


def _correlation(array: ArrayRates) -> np.ndarray:
    """That of the noise record, where it was measured; else none."""
    measured = array.noise.correlation
    if not np.isfinite(measured).all():
        return np.eye(len(measured))
    return measured if np.linalg.eigvalsh(measured)[0] >= SMALLEST_EIGENVALUE else np.eye(len(measured))


def _in_quiet(
    array: ArrayRates, moments: BlockMoments, constant: np.ndarray, outlier: np.ndarray, correlation: np.ndarray
) -> tuple[np.ndarray, np.ndarray, bool]:
    """Variances [N] and correlation as the frequencies show them at which the motion is small.

    Only where that is clearly more likely than what the record and the differences say
    (vgyro.fusion.noise.quiet_frequencies).
    """
    best = best_weights(constant[None], np.zeros((1, len(constant)), dtype=bool), correlation).weights[0]
    clean = replace(moments, excluded=moments.excluded | outlier)
    found = quiet_noise(array, best, partial(good_blocks, clean))
    sigma = np.sqrt(constant)
    off = np.eye(len(constant)) - best
    expected = np.outer(sigma, sigma) * correlation
    expected *= len(constant) / float(np.trace(off @ expected @ off.T))
    if found is None or against(found, expected) <= 0.0:
        return constant, correlation, False
    covariance = scaled_to_pairs(found.noise(correlation), moments, outlier)
    own = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    if not (own > 0).all():
        return constant, correlation, False
    seen = covariance / np.outer(own, own)
    if np.linalg.eigvalsh(seen)[0] < SMALLEST_EIGENVALUE:
        return constant, correlation, False
    level = float(best @ covariance @ best)
    common = found.flat and level > MORE * float(best @ (np.outer(sigma, sigma) * correlation) @ best)
    if level < WORTH / float(np.linalg.inv(covariance).sum()) and not common:
        return constant, correlation, False
    return own**2, seen, True


def _note(
    moments: BlockMoments, correlation: np.ndarray, gyros: int, resting: bool, moving: np.ndarray | None, quiet: bool
) -> str:  # fmt: skip
    if resting:
        notes = ["at rest as a whole: noise of the rates themselves"]
    elif quiet:
        notes = ["correlations of the noise from the frequencies at which the motion is small"]
    else:
        notes = ["noise common to all gyros is in no difference between them"]
        if np.array_equal(correlation, np.eye(gyros)):
            notes[0] += ", and their correlation is taken as none"
        if gyros == 2:
            notes.append("two gyros cannot be told apart: equal shares")
    notes += ["their correlation changes"] if moving is not None else []
    size = moments.size
    none = float(size[moments.excluded.all(axis=1)].sum() / size.sum())
    if none > 0:
        notes.append(f"equal weights for {none:.1%} of the samples: every gyro is at fault")
    return "; ".join(notes)
