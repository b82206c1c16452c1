"""How fast the biases walk, and whether they follow the temperature: by the likelihood of the blocks."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from vgyro.fusion.slow_blocks import SlowBlocks
from vgyro.fusion.slow_model import Evidence, empirical_prior, log_likelihood, log_likelihood_slope, walk_covariance
from vgyro.fusion.slow_smoother import Filtered, Information

MOST_BLOCKS, WINDOWS = 1000, 5
"""K is chosen on at most about so many blocks, in windows spread over the recording."""
FINENESS = 8.0
"""Blocks are merged to this part of the time in which the fastest walk is as large as the white noise."""
FASTEST = 10.0
"""Fastest K: over a block the walk is so many times as large as the white noise of the block's mean."""
STARTS, PRECISION, ROUNDS = 9, 0.05, 30
"""Scales tried at a time, and again between the neighbours of the best; precision and trials of each log K."""
ALIKE = 3.0
"""Factor by which the ratios of the K of the gyros differ from those that are known, one standard deviation."""
SIGNIFICANT = 0.95
"""Another K is believed from this quantile of chi² on, with as many degrees of freedom as there are more parameters."""
BROAD = 100.0
"""Variance of the initial biases, of that found with the K that was given, while models are compared."""


@dataclass(frozen=True)
class Walk:
    """What was chosen.

    rrw : K [N], deg/s/√s, as used;  gain : 2Δ log likelihood of them over those given, less what other ratios cost
    how : as given; all of one size or multiplied by one number; each by its own
    """

    rrw: np.ndarray
    gain: float = 0.0
    how: Literal["given", "together", "each"] = "given"


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
    """The random walks' K with and without temperature slopes, and which of the two models the data support.

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
    gain = 2.0 * (_best_slopes(both, search.broad)[1] - log_likelihood(plain, search.broad))
    needed = math.log(len(blocks))
    if gain > needed:
        return Choice(other, information, both, True, gain, needed)
    return Choice(walk, information.first_regressors(gyros), plain, False, gain, needed)


@dataclass(frozen=True)
class _Search:
    """Likelihood of the walks on some of the blocks.

    given [N] : K as given, 0 where unknown;  bounds : of K;  broad [N] : prior of the initial biases
    """

    evidence: Evidence
    information: Information
    given: np.ndarray
    correlation: np.ndarray
    bounds: tuple[float, float]
    broad: np.ndarray

    @classmethod
    def of(
        cls, evidence: Evidence, blocks: SlowBlocks, rrw: np.ndarray, correlation: np.ndarray, arw: np.ndarray
    ) -> _Search:
        given = np.where(np.isfinite(rrw), rrw, 0.0)
        block_s = float(np.median(np.diff(blocks.time))) if len(blocks) > 1 else 1.0
        duration = max(float(blocks.time[-1] - blocks.time[0]), block_s)
        # Over the whole recording the smallest walk that could be seen is as large as the mean of the white noise.
        bounds = (float(np.median(arw)) / duration, FASTEST * float(np.median(arw)) / block_s)
        kept, first = _thinned(blocks, float((arw / np.maximum(given, bounds[0])).min()) / block_s)
        part = evidence.part(kept)
        information = part.information().merged(first)
        still = part.filtered(information.first_regressors(len(rrw)), walk_covariance(given, correlation))
        broad = np.full(len(rrw), BROAD * float(empirical_prior(still, len(rrw)).max()))
        return cls(part, information, given, correlation, bounds, broad)

    def best(self, tune: bool, slopes: bool) -> Walk:
        """The K with the highest likelihood, with or without temperature slopes.

        As given; all multiplied by one number, or of one size; or each its own: the more, the more
        likelihood they must gain.
        """
        from scipy.stats import chi2

        walk = Walk(self.given)
        if not tune:
            return walk
        part = self.information if slopes else self.information.first_regressors(len(self.given))
        least, most = self.bounds
        start, one_size = self._likelihoods(part, self.given[None])[0], np.ones(len(self.given))
        for shape in (self.given / self.given.max(), one_size) if self.given.any() else (one_size,):
            scale, highest = self._together(part, shape)
            if 2.0 * (highest - start) > max(walk.gain, chi2.ppf(SIGNIFICANT, 1)):
                walk = Walk(scale * shape, 2.0 * (highest - start), "together")
        each, own = self._each(part, np.clip(walk.rrw, least, most))
        more = 2.0 * (own - start) - walk.gain
        if more > chi2.ppf(SIGNIFICANT, len(one_size)):
            walk = Walk(each, walk.gain + more, "each")
        return walk

    def _together(self, part: Information, shape: np.ndarray) -> tuple[float, float]:
        """The multiple of `shape` [N] with the highest likelihood, and its logarithm."""
        return _highest(lambda scales: self._likelihoods(part, np.outer(scales, shape)), self.bounds)

    def _each(self, part: Information, start: np.ndarray) -> tuple[np.ndarray, float]:
        """K [N] with the highest likelihood, and its logarithm, less what holds their ratios to those of `start`.

        The ratios are log-normal about those of `start`, of a factor ALIKE: what the likelihood leaves open is not at
        the end of its range.
        """
        from scipy.optimize import minimize

        def negative(logarithms: np.ndarray) -> tuple[float, np.ndarray]:
            value, slope = self._likelihood(part, np.exp(logarithms))
            other = (logarithms - np.log(start)) / math.log(ALIKE)
            other -= other.mean()
            return 0.5 * float(other @ other) - value, other / math.log(ALIKE) - slope

        limits = [tuple(np.log(self.bounds))] * len(start)
        options = {"maxiter": ROUNDS, "maxfun": 2 * ROUNDS, "ftol": 1e-5, "gtol": PRECISION}
        found = minimize(negative, np.log(start), jac=True, method="L-BFGS-B", bounds=limits, options=options)
        return np.exp(found.x), -float(found.fun)

    def _likelihoods(self, part: Information, rrws: np.ndarray) -> list[float]:
        """Log likelihoods of several K [S, N]."""
        walks = np.stack([walk_covariance(one, self.correlation) for one in rrws])
        return [self._of(filtered)[1] for filtered in self.evidence.filtered_with(part, walks)]

    def _likelihood(self, part: Information, rrw: np.ndarray) -> tuple[float, np.ndarray]:
        """Log likelihood of K [N], and its derivatives by log K [N]."""
        filtered = self.evidence.filtered(part, walk_covariance(rrw, self.correlation))
        prior, value = self._of(filtered)
        return value, log_likelihood_slope(part, filtered, prior, rrw, self.correlation)

    def _of(self, filtered: Filtered) -> tuple[np.ndarray, float]:
        """Prior of the constants and log likelihood, with the best variance of temperature slopes if there are any."""
        if len(filtered.squares) > 1 + len(self.broad):
            return _best_slopes(filtered, self.broad)
        return self.broad, log_likelihood(filtered, self.broad)

    def filtered(self, information: Information, walk: Walk) -> Filtered:
        """All blocks, with a walk."""
        return self.evidence.filtered(information, walk_covariance(walk.rrw, self.correlation))


def _thinned(blocks: SlowBlocks, crossing: float) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the blocks that are kept, and first of each group of them that is merged, counted among those kept.

    crossing : blocks in which the fastest walk becomes as large as the white noise. No group reaches over a gap.
    """
    begin = np.flatnonzero(np.diff(blocks.stretch, prepend=-1))
    inside = np.arange(len(blocks)) - begin[blocks.stretch]
    most = -(-len(blocks) // MOST_BLOCKS)
    together = int(min(max(crossing / FINENESS, 1.0), most))
    starts = inside % together == 0
    group = np.cumsum(starts) - 1
    stride = max((int(group[-1]) + 1) // WINDOWS, 1)
    kept = np.flatnonzero(group % stride < max(MOST_BLOCKS // WINDOWS, 1))
    return kept, np.flatnonzero(starts[kept])


def _highest(values: Callable[[np.ndarray], Sequence[float]], bounds: tuple[float, float]) -> tuple[float, float]:
    """Where a function of a positive scale is highest, and its value there.

    values : scales [S] → the function at each. Tried evenly in the logarithm, again between the neighbours of the
    best, and a parabola through the best three.
    """
    low, high = math.log(bounds[0]), math.log(bounds[1])
    for _ in range(2):
        grid = np.linspace(low, high, STARTS)
        found = np.asarray(values(np.exp(grid)))
        top = int(np.argmax(found))
        low, high = grid[max(top - 1, 0)], grid[min(top + 1, STARTS - 1)]
    if top in (0, STARTS - 1):
        return math.exp(grid[top]), float(found[top])
    before, best, after = found[top - 1 : top + 2]
    bend = before - 2 * best + after
    shift = (before - after) / (2 * bend) if bend < 0 else 0.0
    return math.exp(grid[top] + shift * (grid[1] - grid[0])), float(best + (after - before) * shift / 4)


def _best_slopes(filtered: Filtered, broad: np.ndarray) -> tuple[np.ndarray, float]:
    """Prior [2N] with the common variance of the temperature slopes that makes the likelihood highest, and its log."""
    gyros = len(broad)
    seen = float(np.diag(filtered.squares)[1 + gyros :].max())

    def prior(variance: float) -> np.ndarray:
        return np.concatenate([broad, np.full(gyros, variance)])

    if seen <= 0:
        return prior(0.0), log_likelihood(filtered, prior(0.0))

    def values(variances: np.ndarray) -> list[float]:
        return [log_likelihood(filtered, prior(one)) for one in variances]

    # From slopes that the data could hardly show to those ten thousand times as large.
    variance, value = _highest(values, (1e-2 / seen, 1e6 / seen))
    return prior(variance), value
