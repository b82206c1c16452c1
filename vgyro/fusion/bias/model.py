"""Model of the gyros' slow errors: what a block of samples says of them, and what is known beforehand.

ȳ = 1·w̄ + b + n̄ in each block. Where the board may move w̄ is unknown: what is left is the parity, the differences
between gyros, with the weight matrix G = R⁻¹ - R⁻¹11'R⁻¹/(1'R⁻¹1), G1 = 0. Where it stands still for certain (anchors)
w̄ = 0 and G = R⁻¹. b = constant + step after a fault + temperature slope × (T - T̄) + random walk, which may fade.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from vgyro.arrays import Floats
from vgyro.errors import DataError
from vgyro.fusion.bias.blocks import SlowBlocks
from vgyro.fusion.bias.common_walk import walk_correlation
from vgyro.fusion.bias.smoother import Filtered, Information, run_back, run_filters
from vgyro.fusion.types import ArrayRates, TemperatureAtRest

WIDE = 100.0
"""Variance of the temperature slope that all share, beforehand, of that with which a rate that is constant shows it."""


@dataclass(frozen=True)
class Walk:
    """The random walks of the biases of N gyros, and how they were chosen.

    rrw   : [N], deg/s/√s, rate random walk K of each gyro
    tau_s : time constant in s with which the walks fade. A walk that fades is a Gauss-Markov process about a constant,
            of the standard deviation K·√(tau_s/2); infinite: the walks never fade
    gain  : 2Δ log likelihood of these walks over those that were given, less what it costs that their ratios differ
    how   : "given" as they were; "together": all of one size, or all multiplied by one number; "each": each by its own
    """

    rrw: np.ndarray
    tau_s: float = math.inf
    gain: float = 0.0
    how: Literal["given", "together", "each"] = "given"

    @property
    def parameters(self) -> int:
        """How many numbers were chosen."""
        return {"given": 0, "together": 1, "each": len(self.rrw)}[self.how] + math.isfinite(self.tau_s)


class BlockNoise(NamedTuple):
    """Noise of the gyros, block by block.

    variance    : [B, N], (deg/s)² of a sample; not finite or not above 0: the gyro says nothing in this block
    correlation : [N, N]
    """

    variance: np.ndarray
    correlation: np.ndarray


class Regressor(NamedTuple):
    """What a part of the biases goes with: the temperature [B], K about a reference, or another series.

    known : slopes of a record at rest; None: nothing is known of them
    """

    values: np.ndarray
    known: TemperatureAtRest | None = None


@dataclass(frozen=True)
class BiasEvidence:
    """Means of N gyros over B blocks of samples, how much they weigh, and which constants explain them.

    means    : [B, N], deg/s, block means of the gyros, less `shared`
    shared   : [B], deg/s, mean of the gyros in the blocks in which the board may move, 0 in the others
    weight   : [B, N, N], s²/deg², weight matrix G of each block (see the head of this module)
    total    : [B, N], s²/deg², row sums R⁻¹·1 of the inverse noise covariance of each block
    time     : [B], s, middle of each block
    design   : [B, N, k], regressors D of the k constants: N biases, E steps after faults and, where the biases may
               follow a temperature or another course, N slopes
    steps    : [E], (deg/s)², variance of each step beforehand
    walks    : [N, N], correlation of the gyros' random walks
    anchored : the board stands still in some blocks, so that the mean of all biases is seen there
    common   : (deg/s)²/s, covariance rate of a walk that all gyros share; 0: there is none
    known_slopes : a record at rest knows the slopes: its values are taken off the means, and what stands in `design`
               are corrections √Γ·z, with Γ [N, N] the covariance that it left and z normal of variance 1 beforehand
    """

    means: np.ndarray
    shared: np.ndarray
    weight: np.ndarray
    total: np.ndarray
    time: np.ndarray
    design: np.ndarray
    steps: np.ndarray
    walks: np.ndarray
    anchored: bool
    common: float = 0.0
    known_slopes: bool = False

    @classmethod
    def of(
        cls,
        array: ArrayRates,
        blocks: SlowBlocks,
        noise: BlockNoise,
        resting: np.ndarray,
        regressor: Regressor | None = None,
        common: float = 0.0,
    ) -> BiasEvidence:
        """All blocks of a recording.

        resting   : [B] of bool, the board stands still for certain
        regressor : None: no slopes;  common : variance of a walk that all share
        """
        variance, correlation = noise
        used = np.isfinite(variance) & (variance > 0) & ~blocks.at_fault(array)
        weight = _inverse_covariance(used, variance / blocks.length[:, None], correlation)
        total = weight.sum(axis=2)
        parity = ~resting & (used.sum(axis=1) > 1)
        weight[parity] -= total[parity, :, None] * (total[parity] / total[parity].sum(axis=1)[:, None])[:, None, :]
        weight[~resting & ~parity] = 0.0
        means = np.stack([blocks.mean(column) for column in array.rate.T], axis=1)
        root = None
        if regressor is not None and regressor.known is not None:
            means -= np.outer(regressor.values, regressor.known.slope)
            root = root_of(regressor.known.covariance)
        # G1 = 0: a rate that all share is taken out first, so that not even its rounding is left.
        shared = np.where(resting, 0.0, means.mean(axis=1))
        means -= shared[:, None]
        steps = blocks.steps(array)
        design = _design(len(blocks), means.shape[1], steps, None if regressor is None else regressor.values, root)
        sizes = np.array([size**2 for _, _, size in steps])
        return cls(
            means,
            shared,
            weight,
            total,
            blocks.time,
            design,
            sizes,
            walk_correlation(array.noise),
            bool(resting.any()),
            common,
            root is not None,
        )

    @property
    def gyros(self) -> int:
        """N."""
        gyros: int = self.means.shape[1]
        return gyros

    @property
    def plain(self) -> int:
        """Number of constants that are no slopes: N biases and E steps."""
        return self.gyros + len(self.steps)

    @property
    def has_slopes(self) -> bool:
        """Temperature slopes are among the constants."""
        slopes: bool = self.design.shape[2] > self.plain
        return slopes

    @cached_property
    def unseen(self) -> np.ndarray:
        """Rows of Filtered.squares of the gyros that no block uses: at fault throughout, or without any value."""
        gone = np.flatnonzero(~(self.weight != 0).any(axis=(0, 2)))
        starts = [0, *([self.plain] if self.has_slopes and not self.known_slopes else [])]
        return np.concatenate([1 + start + gone for start in starts])

    def part(self, kept: np.ndarray) -> BiasEvidence:
        """Some of the blocks, by their numbers, increasing: the others are as if they had not been measured."""
        chosen = {name: getattr(self, name)[kept] for name in ("means", "shared", "weight", "total", "time", "design")}
        return replace(self, **chosen)

    def information(self) -> Information:
        """The block means and the regressors of the k constants as measurements for the filter."""
        columns = np.concatenate([self.means[..., None], self.design], axis=2)
        vector = self.weight @ columns
        total = np.tensordot(columns, vector, axes=([0, 1], [0, 1]))
        return Information(self.weight, vector, total, np.diff(self.time, prepend=self.time[:1]))

    def filtered(self, information: Information, walk: Walk) -> Filtered:
        """The filter's forward pass with one walk."""
        return self.filtered_with(information, [walk])[0]

    def filtered_with(self, information: Information, walks: Sequence[Walk]) -> list[Filtered]:
        """The filter's forward pass with each of several walks.

        Without anchors nothing is seen of what all share, and the walk that they share is left out.
        What rounding takes for information on the constants, or against it, is taken out: without anchors their common
        parts are not seen at all, nor is a gyro that no block uses, and nowhere is there less than none.
        """
        steps = np.stack([np.outer(one.rrw, one.rrw) * self.walks + self.anchored * self.common for one in walks])
        taus = np.array([one.tau_s for one in walks])
        return [self._cleared(filtered) for filtered in run_filters(information, steps, taus)]

    def _cleared(self, filtered: Filtered) -> Filtered:
        squares = filtered.squares.copy()
        starts = () if self.anchored else (1, 1 + self.plain)[: 1 if self.known_slopes else 2]
        for start in starts:
            rows = slice(start, start + self.gyros)
            if start < len(squares):
                squares[rows] -= squares[rows].mean(axis=0)
                squares[:, rows] -= squares[:, rows].mean(axis=1)[:, None]
        values, vectors = np.linalg.eigh((squares[1:, 1:] + squares[1:, 1:].T) / 2)
        squares[1:, 1:] = (vectors * np.maximum(values, 0.0)) @ vectors.T
        unseen = self.unseen[self.unseen < len(squares)]  # The slopes may have been left out.
        squares[unseen] = squares[:, unseen] = 0.0
        return replace(filtered, squares=squares)


def _design(
    blocks: int,
    gyros: int,
    steps: list[tuple[int, int, float]],
    temperature: np.ndarray | None,
    root: np.ndarray | None = None,
) -> np.ndarray:
    """Regressors [B, N, k] of the constants: the temperature's come after the biases and steps.

    root : √Γ [N, N], of slopes that are √Γ·z
    """
    plain = gyros + len(steps)
    design = np.zeros((blocks, gyros, plain if temperature is None else plain + gyros))
    each = np.arange(gyros)
    design[:, each, each] = 1.0
    for number, (back, gyro, _) in enumerate(steps):
        design[back:, gyro, gyros + number] = 1.0
    if temperature is not None:
        design[:, :, plain:] = temperature[:, None, None] * (np.eye(gyros) if root is None else root)
    return design


def root_of(covariance: np.ndarray) -> np.ndarray:
    """√Γ, symmetric."""
    values, vectors = np.linalg.eigh((covariance + covariance.T) / 2)
    return np.asarray((vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T)


def _inverse_covariance(used: np.ndarray, variance: np.ndarray, correlation: np.ndarray) -> np.ndarray:
    """Inverses [B, N, N] of σσ'∘C among the gyros that are used, 0 elsewhere; used, variance [B, N]."""
    scale = 1.0 / np.sqrt(np.where(used, variance, 1.0))
    inverse = np.zeros((*used.shape, used.shape[1]))
    patterns, which = np.unique(used, axis=0, return_inverse=True)
    for number, pattern in enumerate(patterns):
        present = np.ix_(pattern, pattern)
        try:
            np.linalg.cholesky(correlation[present])
        except np.linalg.LinAlgError:
            raise DataError("the correlation of the noise is not positive definite") from None
        among = np.zeros_like(correlation)
        among[present] = np.linalg.inv(correlation[present])
        inverse[which.ravel() == number] = among
    return inverse * (scale[:, :, None] * scale[:, None, :])


@dataclass(frozen=True)
class Constants:
    """Posterior of the constants β: biases [N] and steps [E], deg/s, then temperature slopes [N], deg/s/K.

    mean [k], covariance [k, k]
    """

    mean: np.ndarray
    covariance: np.ndarray


def posterior(filtered: Filtered, prior: np.ndarray) -> Constants:
    """The constants given the innovations, with independent normal priors of the variances `prior` [k], 0 allowed."""
    seen, score = filtered.squares[1:, 1:], filtered.squares[1:, 0]
    root = np.sqrt(prior)
    inside = np.linalg.inv(np.eye(len(prior)) + root[:, None] * seen * root)
    covariance = root[:, None] * (inside + inside.T) / 2 * root
    return Constants(covariance @ score, covariance)


def log_likelihood(filtered: Filtered, prior: np.ndarray) -> float:
    """Log likelihood of the blocks, less what depends neither on the walk nor on the prior."""
    seen, score = filtered.squares[1:, 1:], filtered.squares[1:, 0]
    root = np.sqrt(prior)
    factor = np.linalg.cholesky(np.eye(len(prior)) + root[:, None] * seen * root)
    explained = np.linalg.solve(factor, root * score)
    log_det = filtered.log_det + 2.0 * float(np.log(np.diag(factor)).sum())
    return -0.5 * (log_det + float(filtered.squares[0, 0]) - float(explained @ explained))


def log_likelihood_slope(
    evidence: BiasEvidence, blocks: Information, filtered: Filtered, prior: Floats, rrw: Floats
) -> Floats:
    """Derivatives [N] of log_likelihood by log K_i, exactly.

    With respect to Q_t it is ½(rr' - Λ), and with constants β that are not known ½(E rr' - Λ) over their posterior.
    Koopman & Shephard (1992), Biometrika 79, 823-826.
    """
    score, weight = run_back(blocks, filtered)
    found, grown = posterior(filtered, prior), filtered.grown
    left = score[..., 0] - score[..., 1:] @ found.mean
    values, vectors = np.linalg.eigh(found.covariance)
    spread = score[..., 1:] @ (vectors * np.sqrt(np.maximum(values, 0.0)))
    both = np.concatenate([left[..., None], spread], axis=2)
    excess = np.tensordot(grown[:, None, None] * both, both, axes=([0, 2], [0, 2])) - np.tensordot(
        grown, weight, axes=1
    )
    slope: Floats = rrw * ((excess * evidence.walks) @ rrw)
    return slope


def with_shared_slope(evidence: BiasEvidence, walk: Walk, bias: np.ndarray, constants: Constants) -> Constants:
    """Add what a rate that is constant throughout says of the temperature slope that all gyros share.

    bias      : [B, N], deg/s, the biases b̂ as estimated so far
    constants : posterior of the constants, whose last N are the slopes, deg/s/K
    returns   : the posterior with one more measurement, that of u'γ, γ being the slopes and u the gyros' mean shares;
                no difference between gyros shows it
    The measurement: z = u'(y - b̂) with u = R⁻¹1/(1'R⁻¹1) is what is left of the rate. It is regressed on a constant
    and on the temperature, with its white noise and a random walk of the variance u'Qu, as for gyros that are alike.
    """
    D = evidence.total.sum(axis=1)
    u = evidence.total / np.where(D > 0, D, 1.0)[:, None]
    temperature = evidence.design[:, 0, evidence.plain]
    z = np.sum(u * (evidence.means - bias), axis=1) + evidence.shared
    columns = np.stack([z - z.mean(), np.ones(len(z)), temperature], axis=1)[:, None, :]
    vector = D[:, None, None] * columns
    gap = np.diff(evidence.time, prepend=evidence.time[:1])
    left = Information(D[:, None, None], vector, np.tensordot(columns, vector, axes=([0, 1], [0, 1])), gap)
    mean = u.mean(axis=0)
    walks = (mean * walk.rrw) @ evidence.walks @ (mean * walk.rrw) + evidence.common * float(mean.sum()) ** 2
    squares = run_filters(left, np.array([[[walks]]]), np.array([walk.tau_s]))[0].squares
    # The constant is not known at all.
    seen = squares[2, 2] - squares[1, 2] ** 2 / squares[1, 1]
    score = squares[2, 0] - squares[1, 0] * squares[1, 2] / squares[1, 1]
    along = np.zeros(len(constants.mean))
    along[evidence.plain :] = mean
    # What the differences say of the slopes' spread says nothing of their common part.
    shared = np.r_[np.zeros(evidence.plain), np.ones(evidence.gyros)]
    before = constants.covariance + WIDE / seen * np.outer(shared, shared)
    known = before @ along
    gain = known / (along @ known + 1.0 / seen)
    covariance = before - np.outer(gain, known)
    return Constants(constants.mean + gain * (score / seen), covariance)
