"""A suspected fault in blocks, and helpers that all searches share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vgyro.fusion.events import FaultKind

NORMAL_MEDIAN = 0.6745
"""Median of |x| of a standard normal x."""


@dataclass(frozen=True)
class SuspectedFault:
    """A gyro suspected over blocks [first, last). evidence, size, unit : as of FaultEvent"""

    gyro: int
    kind: FaultKind
    first: int
    last: int
    evidence: float
    size: float
    unit: str


def lengths_up_to(longest: int) -> list[int]:
    """1, 2, 4, … blocks, at most `longest`."""
    return [1 << power for power in range(max(longest, 0).bit_length())]


def running_sum(values: np.ndarray) -> np.ndarray:
    """[B + 1]: the sum of the first b values."""
    return np.concatenate([[0.0], np.cumsum(values)])


def spread(values: np.ndarray) -> float:
    """Standard deviation of most of the values about zero, by the median of |x|."""
    return float(np.median(np.abs(values))) / NORMAL_MEDIAN if values.size else 0.0


def weighted_median(values: np.ndarray, weight: np.ndarray) -> float:
    """The value below which half of the weight lies."""
    order = np.argsort(values)
    heap = np.cumsum(weight[order])
    return float(values[order][np.searchsorted(heap, 0.5 * heap[-1])])


def best_interval(sums: np.ndarray, first: int, last: int, rounds: int = 4) -> tuple[int, int]:
    """Maximum-likelihood ends of a stretch of another mean, near [first, last).

    sums : [B + 1] running sums of values that are zero on average outside
    Each end in turn maximises (Σx)²/n, the log-likelihood ratio of a shift in white noise, within one length of the
    stretch, until none moves.
    """
    blocks, sign = len(sums) - 1, np.sign(sums[last] - sums[first])
    for _ in range(rounds):
        before, reach = (first, last), max(last - first, 8)
        begins = np.arange(max(0, first - reach), last)
        first = int(begins[np.argmax(sign * (sums[last] - sums[begins]) / np.sqrt(last - begins))])
        ends = np.arange(first + 1, min(blocks, last + reach) + 1)
        last = int(ends[np.argmax(sign * (sums[ends] - sums[first]) / np.sqrt(ends - first))])
        if (first, last) == before:
            break
    return first, last
