"""Change points of a variance: where it jumps, and what it is in between."""

from __future__ import annotations

import math
from bisect import bisect_left, insort

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

    def gain(self, first: np.ndarray, place: np.ndarray, last: np.ndarray) -> np.ndarray:
        """What a change at `place` brings in [first, last); -infinite where a side is too short."""
        n, s = ([total[one] for one in (first, place, last)] for total in (self.freedom, self.square))
        whole = _cost(n[2] - n[0], s[2] - s[0])
        # A whole that is too short has no cost of its own, and no place that is good.
        whole[whole == np.inf] = 0.0
        return whole - _cost(n[1] - n[0], s[1] - s[0]) - _cost(n[2] - n[1], s[2] - s[1])

    def best(self, first: np.ndarray, last: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Best place of one change in each of the segments [first, last), of two blocks or more, and what it brings."""
        inner = last - first - 1
        begin = np.cumsum(inner) - inner
        which = np.repeat(np.arange(len(first)), inner)
        place = np.arange(len(which)) - begin[which] + first[which] + 1
        gain = self.gain(first[which], place, last[which])
        most = np.maximum.reduceat(gain, begin)
        hits = np.flatnonzero(gain == most[which])
        hits = hits[np.searchsorted(which[hits], np.arange(len(first)))]
        return place[hits], most


def _cost(number: np.ndarray, total: np.ndarray) -> np.ndarray:
    """n·log s of segments of Σ freedom = n and Σ freedom·square = total; infinite where there is too little."""
    short = (number < FEWEST_VALUES * (1 - 1e-9)) | (total <= 0)
    number = np.maximum(number, 1.0)
    cost = np.asarray(number * np.log(np.where(short, 1.0, total) / number))
    cost[short] = np.inf
    return cost


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
    edges = np.concatenate([[0], points, [len(sums.freedom) - 1]])
    wide = np.flatnonzero(np.diff(edges) > 1)
    if len(wide) == 0:
        return points
    place, gain = sums.best(edges[wide], edges[wide + 1])
    return np.sort(np.concatenate([points, place[gain > penalty]]))


def _moved(sums: _Sums, points: np.ndarray) -> np.ndarray:
    """Each change at its best place between its neighbours: first every other one, then those between."""
    edges = np.concatenate([[0], points, [len(sums.freedom) - 1]])
    for turn in (1, 2):
        these = np.arange(turn, len(edges) - 1, 2)
        if len(these):
            edges[these] = sums.best(edges[these - 1], edges[these + 1])[0]
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
