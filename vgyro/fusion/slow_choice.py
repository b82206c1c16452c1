"""How fast the biases walk, and whether they follow the temperature: by the likelihood of the blocks."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vgyro.fusion.slow_blocks import SlowBlocks
from vgyro.fusion.slow_model import Evidence, empirical_prior, log_likelihood, walk_covariance
from vgyro.fusion.slow_smoother import Filtered, Information

MOST_BLOCKS, WINDOWS = 2000, 10
"""K is chosen on at most about so many blocks, in windows spread over the recording."""
FINENESS = 8.0
"""Blocks are merged to this part of the time in which the fastest walk is as large as the white noise."""
LARGEST, LARGEST_UNKNOWN = 10.0, 1e4
"""K is multiplied by 1/LARGEST to LARGEST; where none is known the smallest to be seen, by 1 to LARGEST_UNKNOWN."""
STARTS, PRECISION = 5, 0.02
WORTH = 3.84
"""Gain of 2Δ log likelihood from which another K is believed: 95 % of chi² with one degree of freedom."""
BROAD = 100.0
"""Variance of the initial biases, of that found with the K that was given, while models are compared."""


@dataclass(frozen=True)
class Walk:
    """What was chosen.

    rrw  : K [N], deg/s/√s, as used;  multiplier : of the K that were given; NaN where none was known
    gain : 2Δ log likelihood of the K used over those given
    """

    rrw: np.ndarray
    multiplier: float
    gain: float


@dataclass(frozen=True)
class Choice:
    """The walk, the blocks filtered with it, and whether the biases follow the temperature.

    slopes : temperature slopes are among the constants
    slopes_gain : 2Δ log likelihood of them; NaN without temperature;  needed : what it must exceed
    """

    walk: Walk
    information: Information
    filtered: Filtered
    slopes: bool
    slopes_gain: float
    needed: float


def choose(
    evidence: Evidence, blocks: SlowBlocks, rrw: np.ndarray, correlation: np.ndarray, arw: np.ndarray, tune: bool
) -> Choice:
    """Multiplier of the random walks' K with and without temperature slopes, and which of the two the data support.

    rrw, correlation : K [N], deg/s/√s, NaN if unknown, and [N, N] of the walks
    arw  : [N], deg/s/√Hz, of the white noise, about;  tune : False leaves K as it is
    Both models choose their own K, so that a walk is not taken for temperature, nor the reverse. The slopes' common
    variance is their one parameter: they are kept if 2Δ log likelihood > log(number of blocks) (BIC; Schwarz 1978).
    """
    gyros, information = len(rrw), evidence.information()
    search = _Search.of(evidence, blocks, rrw, correlation, arw)
    walk = search.best(tune, slopes=False)
    if evidence.temperature is None:
        return Choice(walk, information, search.filtered(information, walk), False, math.nan, math.nan)
    other = search.best(tune, slopes=True)
    both = search.filtered(information, other)
    if np.array_equal(walk.rrw, other.rrw):
        plain = both.first_regressors(gyros)
    else:
        plain = search.filtered(information.first_regressors(gyros), walk)
    gain = 2.0 * (_best_slopes(both, search.broad) - log_likelihood(plain, search.broad))
    needed = math.log(len(blocks))
    if gain > needed:
        return Choice(other, information, both, True, gain, needed)
    return Choice(walk, information.first_regressors(gyros), plain, False, gain, needed)


@dataclass(frozen=True)
class _Search:
    """Likelihood of multiples of K on some of the blocks.

    shape [N] : K of multiple 1;  given : it was given;  bounds : of the multiple;  broad [N] : prior of initial biases
    """

    evidence: Evidence
    information: Information
    shape: np.ndarray
    correlation: np.ndarray
    given: bool
    bounds: tuple[float, float]
    broad: np.ndarray

    @classmethod
    def of(
        cls, evidence: Evidence, blocks: SlowBlocks, rrw: np.ndarray, correlation: np.ndarray, arw: np.ndarray
    ) -> _Search:
        known = np.where(np.isfinite(rrw), rrw, 0.0)
        given = bool(known.any())
        duration = float(blocks.time[-1] - blocks.time[0])
        # Over the whole recording the smallest walk that could be seen is as large as the mean of the white noise.
        smallest = float(np.median(arw)) / duration if duration > 0 else 0.0
        shape = known if given else np.full(len(rrw), smallest)
        kept, first = _thinned(blocks, float((arw / np.maximum(shape, smallest)).min()) if duration > 0 else 0.0)
        part = evidence.part(kept)
        information = part.information().merged(first)
        bounds = (1 / LARGEST, LARGEST) if given else (1.0, LARGEST_UNKNOWN)
        still = part.filtered(information.first_regressors(len(rrw)), walk_covariance(known, correlation))
        broad = np.full(len(rrw), BROAD * float(empirical_prior(still, len(rrw)).max()))
        return cls(part, information, shape, correlation, given, bounds, broad)

    def best(self, tune: bool, slopes: bool) -> Walk:
        """The K with the highest likelihood, with or without temperature slopes; as given, unless that is WORTH it."""
        gyros = len(self.shape)
        part = self.information if slopes else self.information.first_regressors(gyros)

        def likelihood(scale: float) -> float:
            walk = walk_covariance(scale * self.shape, self.correlation)
            filtered = self.evidence.filtered(part, walk)
            return _best_slopes(filtered, self.broad) if slopes else log_likelihood(filtered, self.broad)

        scale, gain = 1.0 if self.given else 0.0, 0.0
        if tune and self.shape.any():
            other, highest = _highest(likelihood, self.bounds)
            more = 2.0 * (highest - likelihood(scale))
            if more > WORTH:
                scale, gain = other, more
        return Walk(scale * self.shape, scale if self.given else math.nan, gain)

    def filtered(self, information: Information, walk: Walk) -> Filtered:
        """All blocks, with a walk."""
        return self.evidence.filtered(information, walk_covariance(walk.rrw, self.correlation))


def _thinned(blocks: SlowBlocks, crossing_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the blocks that are kept, and first of each group of them that is merged, counted among those kept.

    crossing_s : time in which the fastest walk is as large as the white noise. No group reaches over a gap.
    """
    begin = np.flatnonzero(np.diff(blocks.stretch, prepend=-1))
    inside = np.arange(len(blocks)) - begin[blocks.stretch]
    whole = float(np.median(np.diff(blocks.time))) if len(blocks) > 1 else 1.0
    most = -(-len(blocks) // MOST_BLOCKS)
    together = int(min(max(crossing_s / FINENESS / whole, 1.0), most))
    starts = inside % together == 0
    group = np.cumsum(starts) - 1
    stride = max((int(group[-1]) + 1) // WINDOWS, 1)
    kept = np.flatnonzero(group % stride < max(MOST_BLOCKS // WINDOWS, 1))
    return kept, np.flatnonzero(starts[kept])


def _highest(likelihood: Callable[[float], float], bounds: tuple[float, float]) -> tuple[float, float]:
    """Where a function of a positive scale is highest, and its value there; tried at some scales, then refined."""
    from scipy.optimize import minimize_scalar

    grid = np.linspace(math.log(bounds[0]), math.log(bounds[1]), STARTS)
    top = int(np.argmax([likelihood(math.exp(one)) for one in grid]))
    near = (grid[max(top - 1, 0)], grid[min(top + 1, STARTS - 1)])
    found = minimize_scalar(
        lambda one: -likelihood(math.exp(one)), bounds=near, method="bounded", options={"xatol": PRECISION}
    )
    return math.exp(float(found.x)), -float(found.fun)


def _best_slopes(filtered: Filtered, broad: np.ndarray) -> float:
    """Log likelihood with temperature slopes of the common variance that makes it highest."""
    gyros = len(broad)
    seen = float(np.diag(filtered.squares)[1 + gyros :].max())
    if seen <= 0:
        return log_likelihood(filtered, np.concatenate([broad, np.zeros(gyros)]))
    # From slopes that the data could hardly show to those a million times as large.
    smallest = 1e-2 / seen
    return _highest(
        lambda one: log_likelihood(filtered, np.concatenate([broad, np.full(gyros, one)])), (smallest, 1e12 * smallest)
    )[1]
