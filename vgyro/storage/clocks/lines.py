"""From stamps and sample numbers to the line of sampling times, without keeping the stamps."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import solveh_banded

from vgyro.arrays import Floats, Ints

KNOT_BINS = (24, 8)  # bins from knot to knot of a line that bends; the second if the first does not bend enough
MIN_BEND_BINS = 48
LEVEL_BINS = 24
BEND = 1.5  # variance about the straight line over that about the bent one
MIN_OWN_BINS = 8  # a piece with fewer takes the slope of the others
MOST_OFF = 0.1  # by which the period of a piece, or a stretch of it, may differ from the usual one
PARTS = 8
MIN_PART_BINS = 4
DRIFT_SIGMAS = 5.0


@dataclass
class Bins:
    """Summary of one piece: means and minima of the stamps' distance from a line, over bins of equal rows.

    period : of that line, s
    size   : rows of a bin
    """

    period: float
    size: int
    _parts: list[np.ndarray] = field(default_factory=list)
    _rest: np.ndarray = field(default_factory=lambda: np.empty((2, 0)))

    def add(self, counter: np.ndarray, times: np.ndarray) -> None:
        """counter: [n], sample numbers in the piece; times: [n], s"""
        rows = np.concatenate([self._rest, [counter, times - self.period * counter]], axis=1)
        whole = rows.shape[1] // self.size * self.size
        self._rest = rows[:, whole:]
        if whole:
            self._parts.append(_summary(rows[:, :whole].reshape(2, -1, self.size)))

    def close(self) -> np.ndarray:
        """[5, bins]: mean number, mean distance, number of the minimum, minimum, rows."""
        if self._rest.shape[1]:
            self._parts.append(_summary(self._rest[:, None, :]))
            self._rest = np.empty((2, 0))
        return np.concatenate(self._parts, axis=1) if self._parts else np.empty((5, 0))


def _summary(rows: np.ndarray) -> np.ndarray:
    counter, distance = rows
    least = distance.argmin(axis=1)
    at = np.arange(len(least))
    size = np.full(len(least), counter.shape[1])
    return np.array([counter.mean(axis=1), distance.mean(axis=1), counter[at, least], distance[at, least], size])


@dataclass(frozen=True)
class ClockLine:
    """Sampling time of a piece, s: period · c + a bent line through knots; c is the sample's number in the piece."""

    period: float
    knots: np.ndarray
    values: np.ndarray

    def __call__(self, counter: Ints) -> Floats:
        """[n] sample numbers → [n] s, 0 at the first."""
        zero = float(np.interp(0.0, self.knots, self.values))
        time: Floats = self.period * counter + (np.interp(counter, self.knots, self.values) - zero)
        return time


@dataclass(frozen=True)
class StampFit:
    """period: s; period_sd: its uncertainty; drift: largest less smallest period of eight parts, relative; or None."""

    period: float
    period_sd: float
    drift: float | None
    lines: list[ClockLine]


def fit_lines(pieces: list[np.ndarray], last: list[int], period: float, lowest: bool) -> StampFit:
    """One line a piece; all have one slope where they are short.

    Bins that lie above the line by more than three sigma (stalls) are left out of an envelope.

    pieces : what `Bins.close` gives, per piece
    last   : number of the last sample of each piece
    period : that of the bins, s
    lowest : through the minima (an envelope), not the means
    """
    points = [(bins[2], bins[3]) if lowest else (bins[0], bins[1]) for bins in pieces]
    weights = [bins[4] for bins in pieces]
    slope, slope_sd = 0.0, 0.0
    used = [np.ones(len(x), dtype=bool) for x, _ in points]
    for _ in range(6 if lowest else 1):
        slope, slope_sd = _pooled(points, weights, used)
        if lowest:
            used = _without_stalls(points, slope)
    lines = []
    for (x, y), weight, keep, end in zip(points, weights, used, last, strict=True):
        lines.append(_line(x[keep], y[keep], weight[keep], slope, period, end))
    longest = max(range(len(points)), key=lambda piece: len(points[piece][0]))
    x, y = points[longest]
    drift = _drift(x[used[longest]], y[used[longest]], period)
    return StampFit(period + slope, slope_sd, drift, lines)


def _pooled(
    points: list[tuple[np.ndarray, np.ndarray]], weights: list[np.ndarray], used: list[np.ndarray]
) -> tuple[float, float]:
    """Slope that all pieces share, and its standard error."""
    square = product = rest = 0.0
    freedom = -1
    for (x, y), weight, keep in zip(points, weights, used, strict=True):
        if keep.sum() < 2:
            continue
        w = weight[keep] / weight.max()
        dx = x[keep] - np.average(x[keep], weights=w)
        dy = y[keep] - np.average(y[keep], weights=w)
        square += float(w @ dx**2)
        product += float(w @ (dx * dy))
        rest += float(w @ dy**2)
        freedom += int(keep.sum()) - 1
    if square <= 0:
        return 0.0, 0.0
    slope = product / square
    noise = max(0.0, rest - slope * product) / max(1, freedom)
    return slope, float(np.sqrt(noise / square))


def _without_stalls(points: list[tuple[np.ndarray, np.ndarray]], slope: float) -> list[np.ndarray]:
    used = []
    for x, y in points:
        rest = y - slope * x
        # A running level, lest slow drift be taken for a stall.
        width = max(1, min(LEVEL_BINS, len(rest)))
        blocks = np.arange(len(rest)) // width
        level = np.array([np.median(rest[blocks == block]) for block in range(blocks[-1] + 1)]) if len(rest) else rest
        rest = rest - level[blocks]
        used.append(rest <= 3 * 1.4826 * np.median(np.abs(rest)) + 1e-12 if len(rest) else np.empty(0, dtype=bool))
    return used


def _line(x: np.ndarray, y: np.ndarray, weight: np.ndarray, slope: float, period: float, end: int) -> ClockLine:
    edge = np.array([0.0, max(1.0, float(end))])
    if not len(x):
        return ClockLine(period, edge, slope * edge)
    if len(x) >= MIN_OWN_BINS:
        own = _pooled([(x, y)], [weight], [np.ones(len(x), dtype=bool)])[0]
        # Stamps of no sense: the slope of all pieces is the safer one.
        slope = own if abs(own - slope) < MOST_OFF * (period + slope) else slope
    straight = y - slope * x
    offset = float(np.average(straight, weights=weight))
    if len(x) >= MIN_BEND_BINS:
        best, scatter = (edge, np.zeros(2)), float(straight.var())
        for spacing in KNOT_BINS:
            knots, values = _bent(x, straight - offset, weight, spacing)
            rest = float((straight - offset - np.interp(x, knots, values)).var())
            gentle = np.abs(np.diff(values)) < MOST_OFF * (period + slope) * np.diff(knots)
            if scatter > BEND * rest + 1e-24 and gentle.all():
                best, scatter = _to_edges(knots, values, edge), rest
        return ClockLine(period, best[0], best[1] + slope * best[0] + offset)
    return ClockLine(period, edge, slope * edge + offset)


def _bent(x: np.ndarray, y: np.ndarray, weight: np.ndarray, spacing: int) -> tuple[np.ndarray, np.ndarray]:
    """Least-squares line with a knot every so many bins."""
    count = len(x) // spacing + 1
    knots = np.quantile(x, np.linspace(0, 1, count))
    left = np.clip(np.searchsorted(knots, x, side="right") - 1, 0, count - 2)
    right = (x - knots[left]) / (knots[left + 1] - knots[left])
    w = weight / weight.max()
    matrix = np.zeros((2, count))  # upper banded: off-diagonal, diagonal
    np.add.at(matrix[1], left, w * (1 - right) ** 2)
    np.add.at(matrix[1], left + 1, w * right**2)
    np.add.at(matrix[0], left + 1, w * right * (1 - right))
    target = np.zeros(count)
    np.add.at(target, left, w * (1 - right) * y)
    np.add.at(target, left + 1, w * right * y)
    matrix[1] += 1e-9
    return knots, solveh_banded(matrix, target)


def _to_edges(knots: np.ndarray, values: np.ndarray, edge: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The outermost stretches go on to the first and the last sample."""
    first = values[0] + (values[1] - values[0]) / (knots[1] - knots[0]) * (edge[0] - knots[0])
    last = values[-1] + (values[-1] - values[-2]) / (knots[-1] - knots[-2]) * (edge[1] - knots[-1])
    inside = (knots > edge[0]) & (knots < edge[1])
    return (
        np.concatenate([edge[:1], knots[inside], edge[1:]]),
        np.concatenate([[first], values[inside], [last]]),
    )


def _drift(x: np.ndarray, y: np.ndarray, period: float) -> float | None:
    if len(x) < PARTS * MIN_PART_BINS:
        return None
    slopes, errors = [], []
    for part in np.array_split(np.arange(len(x)), PARTS):
        every = np.ones(len(part), dtype=bool)
        slope, error = _pooled([(x[part], y[part])], [np.ones(len(part))], [every])
        slopes.append(slope)
        errors.append(error)
    drift = max(slopes) - min(slopes)
    return None if drift < DRIFT_SIGMAS * max(errors) else drift / period
