"""Changes of level: fitted by least squares near a block, and to a whole run with what the level does in health."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from vgyro.arrays import Floats, Ints
from vgyro.fusion.faults.levels.drift_variance import Slow
from vgyro.fusion.faults.levels.health import covariances

SIDE = 1.5  # of the window, on each side, is fitted
BINS = 192
KNOTS = 48
POINTS, EVERY = 96, 2
"""Points of the fit that knows of the wander, and between the knots that are tried first."""
NEAR_POINTS = 16
LEAST_POWER, UNKNOWN_TIMES = 1e-9, 1e9


@dataclass(frozen=True)
class LevelChange:
    """The level is `level` until block `first`, goes straight to level + size, and is there from block `last` on.

    evidence : size over its standard deviation, where the fit knows of the wander
    """

    first: int
    last: int
    level: float
    size: float
    evidence: float = 0.0


def fit_change(slow: Slow, place: int, length: int) -> LevelChange:
    """Least-squares change of level near a block; the stretch that is fitted grows until the change lies inside it."""
    low, high = run_of(slow, place)
    reach = max(4, int(SIDE * length))
    first, last = max(low, place - reach), min(high, place + reach)
    for _ in range(12):
        change = hinge(slow, first, last)
        margin = max(1, (last - first) // 8)
        wider = (first - (last - first) // 2 if change.first < first + margin else first,
                 last + (last - first) // 2 if change.last > last - margin else last)  # fmt: skip
        wider = max(low, wider[0]), min(high, wider[1])
        if wider == (first, last):
            break
        first, last = wider
    return change


def hinge(slow: Slow, first: int, last: int) -> LevelChange:
    """The best of all changes that begin and end between two blocks: on a grid, then once more near its best."""
    step = max(1, (last - first) // BINS)
    begins = np.arange(first, last, step)
    size = np.diff(np.append(begins, last))
    weight = size / np.maximum(np.add.reduceat(slow.white[first:last], begins - first) / size, 1e-300)
    mean = np.add.reduceat(slow.mean[first:last], begins - first) / size
    middle = begins + 0.5 * size
    knots = np.unique(np.linspace(first + 1, last - 1, min(KNOTS, last - first - 1)).astype(int))
    spacing = max(1, int(np.ceil((last - first) / KNOTS)))
    change = _best_knots(middle, mean, weight, knots, knots)
    while spacing > 1:
        near = [np.unique(np.clip(one + np.linspace(-spacing, spacing, 17).astype(int), first, last))
                for one in (change.first, change.last)]  # fmt: skip
        if step > 1 and spacing <= step:
            # Within a bin the single blocks decide.
            return _sharpened(slow, change, step, first, last)
        change = _best_knots(middle, mean, weight, *near)
        spacing = max(1, spacing // 4)
    return change


def _sharpened(slow: Slow, change: LevelChange, step: int, first: int, last: int) -> LevelChange:
    low, high = max(first, change.first - 16 * step), min(last, change.last + 16 * step)
    if high - low > 8 * BINS:
        return change
    rows = slice(low, high)
    near = [np.unique(np.clip(one + np.arange(-2 * step, 2 * step + 1, max(1, step // 4)), low, high))
            for one in (change.first, change.last)]  # fmt: skip
    middle = np.arange(low, high) + 0.5
    return _best_knots(middle, slow.mean[rows], 1.0 / slow.white[rows], *near)


def _best_knots(
    middle: np.ndarray, mean: np.ndarray, weight: np.ndarray, begins: np.ndarray, ends: np.ndarray
) -> LevelChange:
    """The pair of knots with the least squares, level and size free."""
    begin, end = (grid.ravel() for grid in np.meshgrid(begins, ends, indexing="ij"))
    begin, end = begin[end >= begin], end[end >= begin]
    ramp = np.clip((middle - begin[:, None]) / np.maximum(end - begin, 1e-9)[:, None], 0.0, 1.0)
    total = weight.sum()
    centred = ramp - (ramp @ weight / total)[:, None]
    own = (weight * mean).sum() / total
    along = centred @ (weight * (mean - own))
    power = np.maximum((centred**2) @ weight, 1e-300)
    gain = along**2 / power
    place = int(np.argmax(gain))
    size = float(along[place] / power[place])
    level = float(own - size * (ramp[place] @ weight) / total)
    return LevelChange(int(begin[place]), int(end[place]), level, size)


def run_of(slow: Slow, place: int) -> tuple[int, int]:
    """Blocks [low, high) of the run of a block."""
    run = np.flatnonzero(slow.run == slow.run[min(place, len(slow.run) - 1)])
    return int(run[0]), int(run[-1]) + 1


def lasting_change(slow: Slow, low: int, high: int) -> LevelChange:
    """The clearest change of level in blocks [low, high), by generalised least squares: flicker and walk are known.

    After the whole stretch ever nearer ones about the change are fitted, until single blocks are the points.
    """
    first, last = low, high
    change = _general_hinge(slow, first, last)
    evidence = change.evidence
    while last - first > POINTS:
        around = NEAR_POINTS * -(-(last - first) // POINTS)
        closer = max(low, change.first - around), min(high, change.last + around)
        if closer[1] - closer[0] > 0.75 * (last - first):
            break
        first, last = closer
        change = _general_hinge(slow, first, last)
        evidence = max(evidence, change.evidence)
    return replace(change, evidence=evidence)


def _general_hinge(slow: Slow, first: int, last: int) -> LevelChange:
    points = min(POINTS, last - first)
    edges = first + np.arange(points + 1) * (last - first) // points
    number = np.add.reduceat(slow.counts[first:last].astype(float), edges[:-1] - first)
    mean = np.add.reduceat(slow.counts[first:last] * slow.mean[first:last], edges[:-1] - first)
    white = np.add.reduceat(slow.counts[first:last] * slow.white[first:last], edges[:-1] - first)
    known, number = number > 0, np.maximum(number, 1.0)
    mean, white = mean / number, np.where(known, white / number**2, UNKNOWN_TIMES * white.max())
    flicker, walk = covariances(points)
    inverse = np.linalg.inv(np.diag(white) + slow.flicker * flicker + slow.walk * (last - first) / points * walk)
    column = inverse.sum(axis=1)
    inverse -= np.outer(column, column) / column.sum()
    begin, end, ramp = _ramps(points)
    tried = _best_ramp(inverse, mean, ramp)
    begins, ends = (one[tried[0]] + np.arange(1 - EVERY, EVERY) for one in (begin, end))
    begin, end = (grid.ravel() for grid in np.meshgrid(begins, ends, indexing="ij"))
    inside = (begin >= 0) & (begin <= end) & (end <= points)
    begin, end = begin[inside], end[inside]
    ramp = _ramp(points, begin, end)
    best, size, evidence = _best_ramp(inverse, mean, ramp)
    level = float(column @ (mean - size * ramp[best]) / column.sum())
    return LevelChange(int(edges[begin[best]]), int(edges[end[best]]), level, size, evidence)


def _best_ramp(inverse: np.ndarray, mean: np.ndarray, ramp: np.ndarray) -> tuple[int, float, float]:
    """Which of the ramps [R, n] fits the means best, its size, and that over its standard deviation."""
    along = ramp @ (inverse @ mean)
    power = ((ramp @ inverse) * ramp).sum(axis=1)
    seen = power > LEAST_POWER * power.max()
    evidence = np.where(seen, np.abs(along) / np.sqrt(np.maximum(power, 1e-300)), 0.0)
    best = int(np.argmax(evidence))
    return best, float(along[best] / power[best]) if seen[best] else 0.0, float(evidence[best])


def _ramp(points: int, begin: Ints, end: Ints) -> Floats:
    """Ramps from 0 at `begin` to 1 at `end` [R, n] in the middles of the points."""
    middle = np.arange(points) + 0.5
    ramps: Floats = np.clip((middle - begin[:, None]) / np.maximum(end - begin, 1e-9)[:, None], 0.0, 1.0)
    return ramps


@lru_cache(maxsize=4)
def _ramps(points: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Begins and ends [R], and the ramps between them [R, n]."""
    knots = np.unique(np.append(np.arange(0, points + 1, EVERY), points))
    begin, end = (knots[place] for place in np.triu_indices(len(knots)))
    return begin, end, _ramp(points, begin, end)
