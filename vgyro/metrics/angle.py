"""Drift of the angle: the error of a rate integrated over a minute, and what the noise coefficients say of it.

Jiang et al. (2012), section 3.4: the bound of the angle's error follows by integrating the outputs over time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Floats
from vgyro.metrics.allan.coefficients import Coefficient
from vgyro.metrics.figures import Reading
from vgyro.metrics.sampling import Sampling
from vgyro.runs import runs

WINDOW_S, UNIT_S = 60.0, 1.0
FEWEST_WINDOWS = 3
"""A series that is shorter than so many windows has no drift: its own mean, taken off, is too near to that of one."""
SCORING_STEPS, LEAST = 12, 1e-12
FULL = 0.5
"""Share of a unit's samples that must be there; the mean of those stands for all."""

_Term = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class AngleGrid:
    """Where T samples are cut into units of 1 s, and which windows of units are integrated.

    edges [2·U]   : first sample, and last + 1, of each unit;  count [U] : samples there
    unit_s        : length of a unit, s;  units : in a window
    first [W]     : first unit of each window; windows overlap, begin at every unit, and lie in one stretch
    group [U]     : units whose common mean is taken off
    span, share   : length, s, and share of the windows, of each such group that holds a window
    """

    edges: np.ndarray
    count: np.ndarray
    unit_s: float
    units: int
    first: np.ndarray
    group: np.ndarray
    span: np.ndarray
    share: np.ndarray

    @classmethod
    def of(cls, sampling: Sampling, window_s: float = WINDOW_S, each: bool = False) -> AngleGrid:
        """sampling : of the T samples;  window_s : length of a window, s

        each : the mean of each stretch is taken off (poses of a free recording), not that of the whole series
        """
        length = max(round(UNIT_S * sampling.rate_hz), 1)
        unit_s = length / sampling.rate_hz
        units = max(round(window_s / unit_s), 1)
        none = np.empty(0, dtype=np.int64)
        edges, stretch = [none.reshape(0, 2)], [none]
        for number, (start, stop) in enumerate(runs(sampling.stretch).tolist()):
            position = sampling.position[start:stop]
            whole = int(position[-1] - position[0] + 1) // length if stop > start else 0
            at = start + np.searchsorted(position, (position[0] if whole else 0) + length * np.arange(whole + 1))
            edges.append(np.stack([at[:-1], at[1:]], axis=1))
            stretch.append(np.full(whole, number))
        pairs, of = np.concatenate(edges), np.concatenate(stretch)
        count = pairs[:, 1] - pairs[:, 0]
        good = np.concatenate([[0], np.cumsum(count >= FULL * length)])
        begin = np.arange(max(len(of) - units + 1, 0))
        inside = (of[begin + units - 1] == of[begin]) & (good[begin + units] - good[begin] == units)
        group = of if each else np.zeros_like(of)
        first = begin[inside]
        held, windows = np.unique(group[first], return_counts=True)
        span = unit_s * np.bincount(group, minlength=1)[held] if len(group) else np.empty(0)
        return cls(pairs.ravel(), count, unit_s, units, first, group, span, windows / max(windows.sum(), 1))

    @property
    def window_s(self) -> float:
        """Length of a window, s."""
        return self.units * self.unit_s

    @property
    def note(self) -> str:
        """Why there is no drift; "" where there is."""
        if len(self.count) * self.unit_s < FEWEST_WINDOWS * self.window_s:
            return f"shorter than {FEWEST_WINDOWS * self.window_s:g} s"
        return "" if self.first.size else f"no stretch is as long as {self.window_s:g} s"

    def drift(self, error: np.ndarray, confidence: float = 0.95) -> Reading:
        """R.m.s. of the error integrated over a window, its mean taken off, deg.

        error   : array [T], deg/s: rate - true rate
        returns : Reading; limits by chi², with the degrees of freedom of white noise and a random walk as the series
                  shows them: 95 % limits held the expected r.m.s. in 87 to 100 % of simulated hours of white noise,
                  flicker and random walk, 87 % where white noise hides a random walk that matters
        """
        from scipy.special import chdtri

        if self.note:
            return Reading(math.nan, math.nan, math.nan, self.note)
        unit = self._unit_means(np.asarray(error))
        angle = np.concatenate([[0.0], np.cumsum(unit * self.unit_s)])
        value = math.sqrt(float(np.mean((angle[self.first + self.units] - angle[self.first]) ** 2)))
        if value == 0:
            return Reading(0.0, 0.0, 0.0, "the error does not change")
        freedom = _freedom(unit, self.units)
        tail = (1 - confidence) / 2
        low, high = (value * math.sqrt(freedom / float(chdtri(freedom, share))) for share in (tail, 1 - tail))
        return Reading(value, low, high, f"{freedom:.3g} degrees of freedom")

    def bound(
        self,
        white: Coefficient | float,
        flicker: Coefficient | float = 0.0,
        walk: Coefficient | float = 0.0,
        ramp: Coefficient | float = 0.0,
    ) -> Reading:
        """1σ of what `drift` measures, of a rate with these noise coefficients, deg.

        white, flicker, walk, ramp : N deg/s/√Hz (two-sided), B deg/s, K deg/s/√s, R deg/s², independent of each other
        returns : Reading; limits where coefficients have them: those of the four terms' variances, combined as
                  independent
        With D(h) the mean square of the difference of the noise over a lag h (Allan model: white -2N²δ(h), flicker
        (2B²/π)·ln h, random walk K²h, ramp R²h²), G'' = D and H' = G, the integral over τ, less τ/T times that over the
        whole length T, has, in the mean over all windows, the variance
            -G(τ) - (τ/T)²·G(T) + 2τ/(T(T-τ))·(H(T) - H(τ) - H(T-τ)):
        N²τ(1 - τ/T) of white noise, nearly K²τ²T/6 of a random walk, whose value at the start of a window is not known.
        Ours; the Allan model is that of IEEE Std 952-1997.
        """
        if self.note:
            return Reading(math.nan, math.nan, math.nan, self.note)
        size = [self._variance(term) for term in (_white, _flicker, _walk, _ramp)]
        given = (white, flicker, walk, ramp)
        terms = [one if isinstance(one, Coefficient) else Coefficient(one, one, one) for one in given]
        value, low, high = (
            np.array([getattr(one, name) ** 2 for one in terms]) * size for name in ("value", "low", "high")
        )
        below, above = (math.sqrt(float(np.sum((value - limit) ** 2))) for limit in (low, high))
        total = float(value.sum())
        return Reading(math.sqrt(total), math.sqrt(max(total - below, 0.0)), math.sqrt(total + above))

    def _unit_means(self, error: np.ndarray) -> np.ndarray:
        """Means of the units without the mean of their group [U], deg/s."""
        edges = self.edges[:-1] if self.edges[-1] == len(error) else self.edges
        sums = np.where(self.count > 0, np.add.reduceat(error, edges, dtype=float)[::2], 0.0)
        mean = np.bincount(self.group, sums) / np.maximum(np.bincount(self.group, self.count), 1)
        return np.where(self.count > 0, sums / np.maximum(self.count, 1) - mean[self.group], 0.0)

    def _variance(self, term: _Term) -> float:
        """The variance that a coefficient of 1 gives."""
        tau, span = self.window_s, np.maximum(self.span, self.window_s + self.unit_s)
        (g_tau, h_tau), (g_span, h_span), (_, h_rest) = term(np.array(tau)), term(span), term(span - tau)
        between = 2 * tau / (span * (span - tau)) * (h_span - h_tau - h_rest)
        return max(float(self.share @ (between - g_tau - (tau / span) ** 2 * g_span)), 0.0)


def _freedom(unit: np.ndarray, units: int) -> float:
    """Equivalent degrees of freedom of the mean square of `units` successive values of a series [U], summed.

    The squares of the series' cosine transform have the means N² + K²/(4 sin²(πk/2U)), k = 1, 2, …, for white noise and
    a random walk (there cosines are the eigenfunctions), each with one degree of freedom. N and K by Whittle's
    likelihood; then edf = (Σv)²/Σv², v those means times the sum's gain, (sin(units·πk/2U)/sin(πk/2U))².
    """
    from scipy.fft import dct

    squares = dct(unit, norm="ortho")[1:] ** 2
    angle = np.arange(1, len(unit)) * (math.pi / 2 / len(unit))
    rows = np.stack([np.ones(len(angle)), 1 / (4 * np.sin(angle) ** 2)])
    size, least = np.array([squares.mean(), 0.0]), LEAST * squares.mean()
    for _ in range(SCORING_STEPS):
        weighted = rows / np.maximum(size @ rows, least) ** 2
        size = _not_negative(weighted @ rows.T, weighted @ squares)
    means = (size @ rows) * (np.sin(units * angle) / np.sin(angle)) ** 2
    return max(float(means.sum()) ** 2 / float(means @ means), 1.0)


def _not_negative(gram: Floats, right: Floats) -> Floats:
    """Least squares of two coefficients, neither below zero."""
    from scipy.optimize import nnls

    factor = np.linalg.cholesky(gram)
    solution: Floats = nnls(factor.T, np.linalg.solve(factor, right))[0]
    return solution


def _white(lag: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """G and H of N = 1 at lags, s."""
    return -lag, -(lag**2) / 2


def _flicker(lag: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """G and H of B = 1."""
    log = np.log(lag)
    return lag**2 * (log - 1.5) / math.pi, lag**3 * (log / 3 - 11 / 18) / math.pi


def _walk(lag: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """G and H of K = 1."""
    return lag**3 / 6, lag**4 / 24


def _ramp(lag: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """G and H of R = 1."""
    return lag**4 / 12, lag**5 / 60
