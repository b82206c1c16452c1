"""Which of the byte stretches that pass for frames are frames, where they overlap."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Ints

# Two frames further apart than this are not asked whether they are in step.
LINK_FRAMES = 3
STRAY_FRAMES = 64


@dataclass(frozen=True)
class CounterRule:
    """What the counters of two frames say: step a frame, and the modulus."""

    step: int
    modulus: int

    @property
    def is_long(self) -> bool:
        """Whether a step forward is shorter than the way back."""
        return self.modulus > 2 * self.step

    def frames(self, later: np.ndarray, earlier: np.ndarray) -> np.ndarray:
        """Frames from `earlier` to `later`, modulo the counter's wrap; -1 where the counter is between two steps."""
        difference = (later - earlier) % self.modulus
        return np.where(difference % self.step == 0, difference // self.step, -1)


def alone(start: np.ndarray, length: int) -> np.ndarray:
    """bool [n]: true for a candidate that overlaps no other; start [n] ascending."""
    apart = np.diff(start) >= length
    result = np.ones(len(start), dtype=bool)
    result[1:] &= apart
    result[:-1] &= apart
    return result


def last_alone(start: np.ndarray, length: int, limit: int) -> int | None:
    """The last candidate that begins at or before `limit` and overlaps no other; None if there is none."""
    seen = 16
    while True:
        # One more than is asked, for the neighbour of the first.
        begin = max(0, len(start) - seen)
        part = start[max(0, begin - 1) :]
        lone = alone(part, length) & (part <= limit)
        lone[: begin - max(0, begin - 1)] = False
        rows = np.flatnonzero(lone)
        if len(rows):
            return max(0, begin - 1) + int(rows[-1])
        if not begin:
            return None
        seen *= 16


def breaks_of(start: np.ndarray, stop: np.ndarray, counter: np.ndarray | None, rule: CounterRule | None) -> np.ndarray:
    """Rows that do not begin where the one before ends, or whose counter is not a step further; row 0 is among them."""
    follows = start[1:] == stop[:-1]
    if counter is not None and rule is not None:
        difference = np.diff(counter)
        follows &= (difference == rule.step) | (difference == rule.step - rule.modulus)
    return np.flatnonzero(np.insert(~follows, 0, True)) if len(start) else np.empty(0, dtype=np.int64)


def select(start: np.ndarray, length: int, counter: np.ndarray | None, rule: CounterRule | None) -> np.ndarray:
    """Choose among overlapping candidates the largest number of frames; among equals, the chain that is in step.

    start   : int64 [n], ascending offsets of candidates, all of the same length;  counter : int64 [n] or None
    returns : bool [n]
    A candidate that overlaps nothing is always chosen, so the choice falls apart into runs of overlapping ones, each
    with the lone neighbours that it must be in step with.
    """
    chosen = alone(start, length)
    contested = np.flatnonzero(~chosen)
    if not len(contested):
        return chosen
    for run in np.split(contested, np.flatnonzero(np.diff(contested) > 1) + 1):
        first, last = max(0, run[0] - 1), min(len(start) - 1, run[-1] + 1)
        part = slice(first, last + 1)
        values = None if counter is None else counter[part]
        chosen[part] = _best_chain(start[part], length, values, rule)
    return chosen


def _best_chain(start: np.ndarray, length: int, counter: np.ndarray | None, rule: CounterRule | None) -> np.ndarray:
    """Weighted interval selection: most frames first, then most links between neighbours. bool [n]"""
    places = start.tolist()
    best: list[tuple[int, int]] = []
    before: list[int] = []
    # champion[i]: the best chain that ends with one of the first i candidates
    champion: list[int] = [-1]
    ended = 0
    for index, place in enumerate(places):
        while ended < index and places[ended] + length <= place:
            ended += 1
        previous = champion[ended]
        score = (1, 0) if previous < 0 else (best[previous][0] + 1, best[previous][1])
        for other in range(ended - 1, -1, -1):
            if place - places[other] > LINK_FRAMES * length:
                break
            links = best[other][1] + _links(other, index, places, length, counter, rule)
            if (best[other][0] + 1, links) > score:
                score, previous = (best[other][0] + 1, links), other
        best.append(score)
        before.append(previous)
        leader = champion[-1]
        champion.append(index if leader < 0 or score > best[leader] else leader)
    chosen = np.zeros(len(places), dtype=bool)
    index = champion[-1]
    while index >= 0:
        chosen[index] = True
        index = before[index]
    return chosen


def _links(
    earlier: int, later: int, places: list[int], length: int, counter: np.ndarray | None, rule: CounterRule | None
) -> int:
    apart = places[later] - places[earlier]
    links = int(apart == length)
    if counter is not None and rule is not None:
        links += int(rule.frames(counter[later], counter[earlier]) == round(apart / length))
    return links


def strays(
    start: Ints,
    length: float,
    counter: Ints,
    rule: CounterRule,
    rows: Ints,
    previous: tuple[int, int] | None = None,
) -> Ints:
    """Which of `rows` are candidates whose checksum holds by chance: they stand where their neighbours need another.

    start, counter : int64 [n], of chosen frames in order;  previous : start and counter of the frame before them
    returns        : int64, as in `rows`; the first and the last frame are never strays, for lack of a neighbour
    Its neighbours agree with each other and with the bytes between them, and its counter is not between theirs.
    """
    rows = rows[(rows < len(start) - 1) & (rows >= (1 if previous is None else 0))]
    start_before, counter_before = start[rows - 1], counter[rows - 1]
    if previous is not None:
        start_before[rows == 0], counter_before[rows == 0] = previous
    apart = start[rows + 1] - start_before
    expected = np.rint(apart / length)
    whole = rule.frames(counter[rows + 1], counter_before)
    first = rule.frames(counter[rows], counter_before)
    near = (apart <= STRAY_FRAMES * length) & (whole >= expected) & (whole <= expected + STRAY_FRAMES)
    return rows[near & (whole <= rule.modulus // rule.step // 2) & ((first < 0) | (first > whole))]
