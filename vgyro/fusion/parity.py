"""Parity: the noise of each gyro from the differences between them, at rest and in any motion.

What the gyros have in common, motion or noise, is in no difference. So in motion only the part of the noise can be
known that is not common to all of them, and their correlation is taken as none; where the whole recording is at rest
the correlation that was measured there is used.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vgyro import engine as engines
from vgyro.fusion.array import ArrayRates, CannotRun, FilterParameters
from vgyro.fusion.blocks import PIECE, SampleWeights
from vgyro.fusion.parity_blocks import BlockMoments, block_moments
from vgyro.fusion.parity_colour import colour
from vgyro.fusion.parity_hat import LEAST_SHARE, best_weights, constant_variances, outliers, patterns
from vgyro.fusion.parity_hat import cornered_hat as cornered_hat
from vgyro.fusion.parity_hat import pair_variances as pair_variances
from vgyro.fusion.parity_memory import LowPass, Memory, chosen_memory
from vgyro.fusion.weights import min_variance_weights

FEWEST_BLOCKS = 16
PASSES = 3
SETTLING = 10
SMALLEST_EIGENVALUE = 1e-3
"""A correlation matrix with a smaller one is too near to singular to weight by."""


@dataclass(frozen=True)
class Variances:
    """Noise variance of each gyro in M blocks of samples.

    start, stop [M] int64 : samples of each block; in order, every sample is in one, none reaches over a gap
    variance [M, N]  : (deg/s)² a sample, with its colour; above zero, also where the gyro is excluded
    excluded [M, N]  : at fault, or stuck
    tau_s [N]        : time constant of the two-sided EWMA, s; infinite: constant, but for the change points
    changes [N]      : number of change points
    correlation [N, N] : of the noise, the same all the time
    phi [N]          : correlation of a gyro's noise from one sample to the next; 0 where it is not significant
    note             : what to know before using it
    """

    start: np.ndarray
    stop: np.ndarray
    variance: np.ndarray
    excluded: np.ndarray
    tau_s: np.ndarray
    changes: np.ndarray
    correlation: np.ndarray
    phi: np.ndarray
    note: str = ""

    @property
    def shares(self) -> np.ndarray:
        """Samples of each block [M]."""
        return self.stop - self.start

    def weights(self, engine: str = "native") -> np.ndarray:
        """Minimum-variance weights [M, N] of R_t = σσ'∘C: Σ = 1, not negative, 0 where excluded; equal if all are."""
        weights = np.zeros(self.variance.shape)
        sigma = np.sqrt(self.variance)
        for pattern, rows in patterns(self.excluded):
            kept = np.flatnonzero(~pattern)
            part = self.correlation[np.ix_(kept, kept)]
            for begin in range(0, len(rows), PIECE):
                here = np.ix_(rows[begin : begin + PIECE], kept)
                weights[here] = min_variance_weights(sigma[here][:, :, None] * sigma[here][:, None, :] * part, engine)
        weights[self.excluded.all(axis=1)] = 1.0 / self.variance.shape[1]
        return weights

    def block_of_sample(self) -> np.ndarray:
        """Number of the block of each sample [T], int32."""
        return np.repeat(np.arange(len(self.start), dtype=np.int32), self.shares)

    def sample_weights(self, engine: str = "native") -> SampleWeights:
        """The weights of the samples."""
        return SampleWeights.of(self.weights(engine), self.block_of_sample())

    def combined_variance(self, weights: np.ndarray | None = None) -> np.ndarray:
        """u'Ru [M], (deg/s)², of one sample of the combination; weights u [M, N], None: those of least variance."""
        parts = (self.weights() if weights is None else weights) * np.sqrt(self.variance)
        return np.sum((parts @ self.correlation) * parts, axis=1)

    def colour(self, weights: np.ndarray | None = None) -> float:
        """φ of the combination: mean of the gyros', by their shares u_i²σ_i² of its variance."""
        parts = (self.weights() if weights is None else weights) ** 2 * self.variance
        share = (parts / parts.sum(axis=1, keepdims=True) * self.shares[:, None]).sum(axis=0)
        return float(share @ self.phi / share.sum())


def parity_variances(array: ArrayRates, parameters: FilterParameters, changing: bool = True) -> Variances:
    """Variances of the gyros' noise from the residuals against the array's own estimate, which know no motion.

    changing : False gives constant variances. Otherwise each is a two-sided EWMA over blocks, or constant between
               change points, or both; time constant and change points are those that predict each block best from the
               others, gyro by gyro, and must pay for themselves, so that white noise keeps a constant variance
    returns  : Variances; faults of the array and stuck gyros are left out
    raises   : CannotRun for one gyro, or fewer than 16 blocks (of 0.25 s; of a sample below 8 Hz) without fault
    Two gyros cannot be told apart: each has half the variance of their difference.
    """
    gyros = array.rate.shape[1]
    if gyros < 2:
        raise CannotRun("one gyro: there are no differences")
    moments = block_moments(array)
    pairs = (~moments.excluded).sum(axis=1) > 1
    if pairs.sum() < FEWEST_BLOCKS:
        raise CannotRun(f"fewer than {FEWEST_BLOCKS} blocks with two good gyros", remedy="a longer recording is needed")
    correlation = _correlation(array, parameters)
    constant, outlier = constant_variances(moments, correlation)
    variance = np.broadcast_to(constant, moments.excluded.shape)
    memories: Sequence[Memory] = [Memory(np.empty(0, dtype=np.int64), 1.0, math.inf)] * gyros
    if changing:
        block_s = float(np.median(moments.size)) / array.rate_hz
        low_pass = engines.get(parameters.engine).kalman.low_pass
        variance, memories = _changing(moments, constant, outlier, correlation, block_s, low_pass)
    tau = np.array([memory.tau_s for memory in memories])
    changes = np.array([len(memory.points) for memory in memories])
    phi = colour(array, moments, constant)
    note = _note(moments, correlation, gyros)
    return Variances(
        moments.start, moments.stop, variance, moments.excluded, tau, changes, correlation, phi, note
    )  # fmt: skip


def _correlation(array: ArrayRates, parameters: FilterParameters) -> np.ndarray:
    """That of the noise, where the recording is at rest and it was measured; else none."""
    measured = array.noise.correlation
    if parameters.in_motion or not np.isfinite(measured).all():
        return np.eye(len(measured))
    return measured if np.linalg.eigvalsh(measured)[0] >= SMALLEST_EIGENVALUE else np.eye(len(measured))


def _changing(
    moments: BlockMoments, constant: np.ndarray, outlier: np.ndarray, correlation: np.ndarray, block_s: float,
    low_pass: LowPass,
) -> tuple[np.ndarray, list[Memory]]:  # fmt: skip
    """Variances [M, N] that change, and what each is an average over.

    Each pass takes the residual against the estimate with the weights of the pass before. These come from variances
    that do not know the block's own square, so that no gyro is favoured for a square that was small by chance.
    """
    alone = np.broadcast_to(constant, moments.excluded.shape)
    known = ~moments.excluded & ((~moments.excluded).sum(axis=1) > 1)[:, None]
    memories: list[Memory] = []
    variance = alone
    for _ in range(PASSES):
        square = _squares(moments, alone, known & ~outlier, correlation)
        square = _settled(moments, square, alone, outlier | outliers(np.where(known, square, 0.0)), correlation)
        outlier = outliers(np.where(known, square, 0.0))
        freedom = np.where(known & ~outlier, moments.size[:, None].astype(float), 0.0)
        columns = list(zip(square.T, freedom.T, strict=True))
        memories = [chosen_memory(*one, block_s, low_pass) for one in columns]
        found = [memory.average(*one, low_pass) for memory, one in zip(memories, columns, strict=True)]
        variance, alone = (np.column_stack([one[place] for one in found]) for place in (0, 1))
        # An outlier has the variance that it shows, and lends it to no other block.
        least = np.maximum(LEAST_SHARE * float(np.median(constant)), np.where(outlier, square, 0.0))
        variance, alone = (np.where(known.any(axis=0), one, constant) for one in (variance, alone))
        variance, alone = np.maximum(variance, least), np.maximum(alone, least)
    return variance, memories


def _settled(
    moments: BlockMoments, square: np.ndarray, variance: np.ndarray, outlier: np.ndarray, correlation: np.ndarray
) -> np.ndarray:
    """`square` [M, N] with the blocks of outliers put right: there each gyro's variance is the block's own.

    An outlier moves the estimate that it is measured against, so that all the other gyros look far off as well. With
    its own square as its variance, but not less than the `variance` of before, it loses its weight within a few rounds.
    """
    rows = np.flatnonzero(outlier.any(axis=1))
    if len(rows) == 0:
        return square
    part = moments.part(rows)
    found, least = square[rows], variance[rows]
    for _ in range(SETTLING):
        best = best_weights(np.maximum(found, least), part.excluded, correlation)
        found = part.residual(best.weights)[0] + best.variance[:, None]
    square = square.copy()
    square[rows] = found
    return square


def _squares(moments: BlockMoments, variance: np.ndarray, used: np.ndarray, correlation: np.ndarray) -> np.ndarray:
    """Mean squares [M, N] of the gyros' noise, (deg/s)², without bias where `variance` [M, N] is theirs.

    Residual against the best estimate less its slow part, which is the mean of the blocks about it, by their variances;
    what the estimate and the slow part took of it is added (see parity_hat).
    """
    best = best_weights(variance, moments.excluded, correlation)
    square, mean = moments.residual(best.weights)
    rest = np.maximum(variance - best.variance[:, None], 1e-6 * variance)
    sure = np.where(used, moments.size[:, None] / rest, 0.0)
    mass = moments.window_sum(sure)
    some = mass > 1e-9 * sure.max(axis=0)
    mass = np.where(some, mass, 1.0)
    slow = np.where(some, moments.window_sum(sure * mean) / mass, 0.0)
    less = np.maximum(square - 2.0 * mean * slow + slow**2, 0.0)
    return less + best.variance[:, None] + np.where(some, np.minimum(1.0 / mass, rest), 0.0)


def _note(moments: BlockMoments, correlation: np.ndarray, gyros: int) -> str:
    notes = ["noise common to all gyros is in no difference between them"]
    if np.array_equal(correlation, np.eye(gyros)):
        notes[0] += ", and their correlation is taken as none"
    if gyros == 2:
        notes.append("two gyros cannot be told apart: equal shares")
    size = moments.size
    none = float(size[moments.excluded.all(axis=1)].sum() / size.sum())
    if none > 0:
        notes.append(f"equal weights for {none:.1%} of the samples: every gyro is at fault")
    return "; ".join(notes)
