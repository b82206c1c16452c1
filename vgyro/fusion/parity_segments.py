"""Change points of a variance: where it jumps, and what it is in between."""

from __future__ import annotations

import math
from bisect import bisect_left, insort
from itertools import pairwise

import numpy as np

FEWEST_VALUES = 8.0
"""Degrees of freedom that a segment has at least."""
TRIES = 64
"""Places in an interval at which a change is looked for; the exact place is found afterwards."""
AT_A_TIME = 1 << 18
ROUNDS = 3


def change_points(square: np.ndarray, freedom: np.ndarray) -> np.ndarray:
    """First blocks [C] of the segments of constant variance, but for the first of them.

    square  : [M] mean squares of the blocks, of expectation σ²;  freedom : [M] their degrees of freedom; 0: left out
    Gaussian likelihood of the variance: a segment with Σ freedom = n and the mean square s costs n·log s. Changes are
    looked for in seeded intervals of all lengths (Kovács, Bühlmann, Li & Munk 2023, Biometrika 110, 249-256), the
    narrowest first. Then, in turn, a segment is split where that brings more than 3·log M (Zhang & Siegmund 2007,
    Biometrics 63, 22-32), each change is moved to its best place, and dropped where it brings less.
    """
    sums = _Sums(square, freedom)
    penalty = 3.0 * math.log(max(len(square), 2))
    chosen: list[int] = []
    for first, last, place in _candidates(sums, penalty):
        inside = bisect_left(chosen, first + 1)
        if inside == len(chosen) or chosen[inside] >= last:
            insort(chosen, place)
    points = np.array(chosen, dtype=np.int64)
    for _ in range(ROUNDS):
        points = _pruned(sums, _moved(sums, _split(sums, points, penalty)), penalty)
    return points


def segment_sums(points: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Sum of values [M] over the segment that each block lies in [M]."""
    edges = np.concatenate([[0], points])
    return np.repeat(np.add.reduceat(values, edges), np.diff(np.append(edges, len(values))))


class _Sums:
    """Running sums, from which the cost of any segment follows."""

    def __init__(self, square: np.ndarray, freedom: np.ndarray) -> None:
        self.freedom = np.concatenate([[0.0], np.cumsum(freedom)])
        self.square = np.concatenate([[0.0], np.cumsum(freedom * square)])

    def cost(self, first: np.ndarray, last: np.ndarray) -> np.ndarray:
        """n·log s of blocks [first, last); infinite where there are too few."""
        number, total = self.freedom[last] - self.freedom[first], self.square[last] - self.square[first]
        enough = (number >= FEWEST_VALUES * (1 - 1e-9)) & (total > 0)
        ratio = np.where(enough, total, 1.0) / np.where(enough, number, 1.0)
        return np.where(enough, number * np.log(ratio), np.inf)

    def gain(self, first: np.ndarray, place: np.ndarray, last: np.ndarray) -> np.ndarray:
        """What a change at `place` brings in [first, last); -infinite where a side is too short."""
        whole = self.cost(first, last)
        parts = self.cost(first, place) + self.cost(place, last)
        return np.where(np.isfinite(parts), np.where(np.isfinite(whole), whole, 0.0) - parts, -np.inf)


def _candidates(sums: _Sums, penalty: float) -> list[tuple[int, int, int]]:
    """Intervals with a change that is worth its penalty, the narrowest first, the clearest of these first."""
    blocks = len(sums.freedom) - 1
    found: list[tuple[int, int, int]] = []
    length = 2
    while length < 2 * blocks:
        starts = np.arange(0, max(blocks - length // 2, 1), max(length // 2, 1))
        steps = np.unique(np.linspace(1, length - 1, min(length - 1, TRIES)).astype(np.int64))
        here = []
        for begin in range(0, len(starts), max(1, AT_A_TIME // len(steps))):
            first = starts[begin : begin + max(1, AT_A_TIME // len(steps))]
            last = np.minimum(first + length, blocks)
            place = np.minimum(first[:, None] + steps, last[:, None])
            gain = sums.gain(first[:, None], place, last[:, None])
            best = gain.argmax(axis=1)
            most = gain[np.arange(len(first)), best]
            good = np.flatnonzero(most > penalty)
            here += [(-float(most[i]), int(first[i]), int(last[i]), int(place[i, best[i]])) for i in good]
        found += [one[1:] for one in sorted(here)]
        length *= 2
    return found


def _split(sums: _Sums, points: np.ndarray, penalty: float) -> np.ndarray:
    """With one change more in each segment where that is worth its penalty."""
    edges = [0, *points.tolist(), len(sums.freedom) - 1]
    more = []
    for low, high in pairwise(edges):
        if high - low < 2:
            continue
        place = np.arange(low + 1, high)
        gain = sums.gain(np.array(low), place, np.array(high))
        if gain.max() > penalty:
            more.append(int(place[int(gain.argmax())]))
    return np.array(sorted([*points.tolist(), *more]), dtype=np.int64)


def _moved(sums: _Sums, points: np.ndarray) -> np.ndarray:
    """Each change at its best place between its neighbours, one after the other."""
    edges = np.concatenate([[0], points, [len(sums.freedom) - 1]])
    for number in range(1, len(edges) - 1):
        low, high = int(edges[number - 1]), int(edges[number + 1])
        place = np.arange(low + 1, high)
        gain = sums.gain(np.array(low), place, np.array(high))
        edges[number] = place[int(gain.argmax())]
    return edges[1:-1]


def _pruned(sums: _Sums, points: np.ndarray, penalty: float) -> np.ndarray:
    """Without the changes that bring less than the penalty, the least first."""
    while len(points):
        edges = np.concatenate([[0], points, [len(sums.freedom) - 1]])
        gain = sums.gain(edges[:-2], edges[1:-1], edges[2:])
        beside = np.concatenate([[np.inf], gain, [np.inf]])
        # Of two neighbours only the lesser goes at a time: the other may be needed once it is gone.
        drop = (gain < penalty) & (gain <= beside[:-2]) & (gain < beside[2:])
        if not drop.any():
            drop = (gain < penalty) & (gain == gain.min()) if (gain < penalty).any() else drop
        if not drop.any():
            break
        points = points[~drop]
    return points
