"""How fast the biases walk, and whether they follow the temperature: by the likelihood of the blocks."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np

from vgyro.fusion.bias.blocks import SlowBlocks
from vgyro.fusion.bias.model import BiasEvidence, Walk, log_likelihood, log_likelihood_slope
from vgyro.fusion.bias.prior import empirical_prior
from vgyro.fusion.bias.smoother import Filtered, Information
from vgyro.runs import run_starts

MOST_BLOCKS, WINDOWS = 1000, 5
"""K is chosen on at most about so many blocks, in windows spread over the recording."""
FINENESS = 8.0
"""Blocks are merged to this part of the time in which the fastest walk is as large as the white noise."""
FASTEST = 10.0
"""Fastest K: over a block the walk is so many times as large as the white noise of the block's mean."""
STARTS, FLAT, TRIALS = 9, 0.5, 40
"""Scales tried at a time, and again between the neighbours of the best; slope of the log likelihood by log K at which
it is at its highest, and trials of that."""
FADING, SHORTEST = (3.0, 10.0, 30.0, 100.0), 5.0
"""Parts of the recording in which walks may fade, and blocks that this takes at least."""
ALIKE = 3.0
"""Factor by which the ratios of the K of the gyros differ from those that are known, one standard deviation."""
SIGNIFICANT = 0.95
"""Another K is believed from this quantile of chi² on, with as many degrees of freedom as there are more parameters."""
QUICK = (0.25, 1.0, 4.0)
"""Multiples of K with which models are looked at before their walks are chosen."""
BROAD = 100.0
"""Variance of the biases, of that found with the K that was given, while models are compared."""


@dataclass(frozen=True)
class Choice:
    """The model of the biases that the likelihood prefers, and the filter's pass with it.

    walk        : the random walks
    information : the measurements as they were filtered, with the slopes among the regressors or without
    filtered    : the forward pass with `walk`
    slopes      : the biases follow the regressor (a temperature, or a course in time): their slopes are among the
                  constants
    slopes_gain : 2Δ log likelihood of the slopes over the walks alone; NaN where there is no regressor
    needed      : what slopes_gain has to exceed for the slopes to be kept
    """

    walk: Walk
    information: Information
    filtered: Filtered
    slopes: bool
    slopes_gain: float
    needed: float


def choose(evidence: BiasEvidence, blocks: SlowBlocks, rrw: np.ndarray, arw: np.ndarray, known: Walk | None) -> Choice:
    """The random walks with and without temperature slopes, and which of the two models the data support.

    rrw : K [N], deg/s/√s, as measured, NaN if unknown;  arw : [N], deg/s/√Hz, of the white noise, about
    known : the walks; None: they are chosen
    Both models choose their own walks, so that a walk is not taken for temperature, nor the reverse. The slopes' common
    variance is their one parameter: they are kept if 2Δ log likelihood > log(number of blocks) (BIC; Schwarz 1978), or
    more if the walks beside them have more parameters. Slopes that a record at rest knows are kept unless slopes of
    another common variance about them are more likely by as much: then they are others than at rest.
    """
    information = evidence.information()
    search = _Search.of(evidence, blocks, rrw, arw)
    walk = known or search.best(slopes=evidence.known_slopes)
    if not evidence.has_slopes:
        return Choice(walk, information, evidence.filtered(information, walk), False, math.nan, math.nan)
    if evidence.known_slopes:
        filtered, needed = evidence.filtered(information, walk), -math.log(len(blocks))
        gain = 2.0 * (search.weighed(filtered)[1] - search.of_slopes(filtered)[1])
        return Choice(walk, information, filtered, gain > needed, gain, needed)
    other = known or search.best(slopes=True)
    both = evidence.filtered(information, other)
    without = information.first_regressors(evidence.plain)
    same = walk.tau_s == other.tau_s and np.array_equal(walk.rrw, other.rrw)
    plain = both.first_regressors(evidence.plain) if same else evidence.filtered(without, walk)
    gain = 2.0 * (search.of_slopes(both)[1] - log_likelihood(plain, search.broad))
    needed = math.log(len(blocks)) * max(1 + other.parameters - walk.parameters, 1)
    if gain > needed:
        return Choice(other, information, both, True, gain, needed)
    return Choice(walk, without, plain, False, gain, needed)


def quick_gains(
    plain: BiasEvidence,
    walk: Walk,
    others: Sequence[BiasEvidence],
    blocks: SlowBlocks,
    rrw: np.ndarray,
    arw: np.ndarray,
) -> list[float]:
    """What several models with slopes gain over the walks alone, before walks of their own are chosen.

    plain  : the block means without slopes;  walk : the random walks that were chosen for them
    others : the same means, each with one regressor for the slopes
    rrw    : [N], deg/s/√s, K as measured, NaN if unknown;  arw : [N], deg/s/√Hz, about
    returns : for each of `others` 2Δ log likelihood over `plain` with `walk`. Its walks are those that were measured,
              or `walk` for a gyro without, all times the best number of QUICK
    """
    search = _Search.of(plain, blocks, rrw, arw)
    base = search.values(search.information.first_regressors(plain.plain), [walk])[0]
    known = np.where(search.given > 0, search.given, walk.rrw)
    found = []
    for other in others:
        own = _Search.of(other, blocks, rrw, arw)
        found.append(2.0 * (max(own.values(own.information, [Walk(scale * known) for scale in QUICK])) - base))
    return found


@dataclass(frozen=True)
class _Search:
    """Likelihood of the walks on some of the blocks.

    given [N] : K as given, 0 where unknown;  bounds : of K;  taus : times to fade in, s
    broad [N + E] : prior of the biases and steps
    """

    evidence: BiasEvidence
    information: Information
    given: np.ndarray
    bounds: tuple[float, float]
    taus: list[float]
    broad: np.ndarray

    @classmethod
    def of(cls, evidence: BiasEvidence, blocks: SlowBlocks, rrw: np.ndarray, arw: np.ndarray) -> _Search:
        given = np.where(np.isfinite(rrw), rrw, 0.0)
        block_s = float(np.median(np.diff(blocks.time))) if len(blocks) > 1 else 1.0
        duration = max(float(blocks.time[-1] - blocks.time[0]), block_s)
        # Over the whole recording the smallest walk that could be seen is as large as the mean of the white noise.
        bounds = (float(np.median(arw)) / duration, FASTEST * float(np.median(arw)) / block_s)
        kept, first = _thinned(blocks, float((arw / np.maximum(given, bounds[0])).min()) / block_s)
        part = evidence.part(kept)
        information = part.information().merged(first)
        taus = [duration / one for one in FADING if duration / one > SHORTEST * block_s]
        still = part.filtered(information.first_regressors(evidence.plain), Walk(given))
        spread = BROAD * empirical_prior(part, still).spread(slice(0, len(rrw)))
        return cls(part, information, given, bounds, taus, np.concatenate([np.full(len(rrw), spread), evidence.steps]))

    def best(self, slopes: bool) -> Walk:
        """The walks with the highest likelihood, with or without temperature slopes.

        K as given; all multiplied by one number, or of one size; and fading; or each its own: the more, the more
        likelihood they must gain.
        """
        from scipy.special import gammaincinv

        def quantile(freedom: int) -> float:
            return float(2 * gammaincinv(freedom / 2, SIGNIFICANT))

        part = self.information if slopes else self.information.first_regressors(self.evidence.plain)
        walk = Walk(self.given)
        start = self.values(part, [walk])[0]
        lasting, fading = self._together(part, start)
        for other, more in ((lasting, 1), (fading, 1)):
            if other.gain - walk.gain > quantile(more):
                walk = other
        each, own = self._each(part, np.clip(walk.rrw, *self.bounds), walk.tau_s)
        gain = 2.0 * (own - start)
        if gain - walk.gain > quantile(len(each)):
            walk = Walk(each, walk.tau_s, gain, "each")
        return walk

    def _together(self, part: Information, start: float) -> tuple[Walk, Walk]:
        """The best walks that last and the best that fade, K being multiples of those given, or all of one size.

        start : log likelihood of those given
        """
        one_size = np.ones(len(self.given))
        shapes = (self.given / self.given.max(), one_size) if self.given.any() else (one_size,)
        grid = np.geomspace(*self.bounds, STARTS)
        tried = [Walk(one * shape, tau) for shape, tau, one in product(shapes, (math.inf, *self.taus), grid)]
        values = np.reshape(self.values(part, tried), (len(shapes), -1, STARTS)).max(axis=2)
        found = []
        for taus in (slice(0, 1), slice(1, None) if self.taus else slice(0, 1)):
            shape, tau = np.unravel_index(np.argmax(values[:, taus]), values[:, taus].shape)
            time = (math.inf, *self.taus)[taus][tau]
            scale, highest = _highest(partial(self._of_scales, part, shapes[shape], time), self.bounds)
            found.append(Walk(scale * shapes[shape], time, 2.0 * (highest - start), "together"))
        return found[0], found[1]

    def _of_scales(self, part: Information, shape: np.ndarray, tau_s: float, scales: np.ndarray) -> list[float]:
        return self.values(part, [Walk(one * shape, tau_s) for one in scales])

    def _each(self, part: Information, start: np.ndarray, tau_s: float) -> tuple[np.ndarray, float]:
        """K [N] with the highest likelihood, and its logarithm, less what holds their ratios to those of `start`.

        The ratios are log-normal about those of `start`, of a factor ALIKE: what the likelihood leaves open is not at
        the end of its range.
        """
        from scipy.optimize import minimize

        def negative(logarithms: np.ndarray) -> tuple[float, np.ndarray]:
            value, slope = self._likelihood(part, Walk(np.exp(logarithms), tau_s))
            other = (logarithms - np.log(start)) / math.log(ALIKE)
            other -= other.mean()
            return 0.5 * float(other @ other) - value, other / math.log(ALIKE) - slope

        limits = [tuple(np.log(self.bounds))] * len(start)
        options = {"maxfun": TRIALS, "ftol": 1e-6, "gtol": FLAT}
        found = minimize(negative, np.log(start), jac=True, method="L-BFGS-B", bounds=limits, options=options)
        return np.exp(found.x), -float(found.fun)

    def values(self, part: Information, walks: Sequence[Walk]) -> list[float]:
        """Log likelihoods of several walks."""
        return [self.weighed(filtered)[1] for filtered in self.evidence.filtered_with(part, walks)]

    def _likelihood(self, part: Information, walk: Walk) -> tuple[float, np.ndarray]:
        """Log likelihood of a walk, and its derivatives by log K [N]."""
        filtered = self.evidence.filtered(part, walk)
        prior, value = self.weighed(filtered)
        return value, log_likelihood_slope(self.evidence, part, filtered, prior, walk.rrw)

    def weighed(self, filtered: Filtered) -> tuple[np.ndarray, float]:
        """Prior of the constants and log likelihood, with the best variance of slopes if it is not known."""
        if len(filtered.squares) == 1 + self.evidence.plain:
            return self.broad, log_likelihood(filtered, self.broad)
        if not self.evidence.known_slopes:
            return self.of_slopes(filtered)
        prior = np.concatenate([self.broad, np.ones(self.evidence.gyros)])
        return prior, log_likelihood(filtered, prior)

    def of_slopes(self, filtered: Filtered) -> tuple[np.ndarray, float]:
        """Prior [k] with the common variance of the temperature slopes of the highest likelihood, and its log."""
        seen = float(np.diag(filtered.squares)[1 + self.evidence.plain :].max())

        def prior(variance: float) -> np.ndarray:
            return np.concatenate([self.broad, np.full(self.evidence.gyros, variance)])

        def values(variances: np.ndarray) -> list[float]:
            return [log_likelihood(filtered, prior(one)) for one in variances]

        if seen <= 0:
            return prior(0.0), log_likelihood(filtered, prior(0.0))
        # From slopes that the data could hardly show to those ten thousand times as large.
        variance, value = _highest(values, (1e-2 / seen, 1e6 / seen))
        return prior(variance), value


def _thinned(blocks: SlowBlocks, crossing: float) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the blocks that are kept, and first of each group of them that is merged, counted among those kept.

    crossing : blocks in which the fastest walk becomes as large as the white noise. No group reaches over a gap.
    """
    begin = run_starts(blocks.stretch)
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
