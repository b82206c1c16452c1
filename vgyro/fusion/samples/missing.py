"""Samples in which one gyro has no value: filled from the others, so that the array can be fused as if it had."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vgyro.arrays import Bools, Floats, Ints
from vgyro.runs import true_runs

if TYPE_CHECKING:
    from vgyro.fusion.types import ArrayRates

BLOCK_S = 10.0
"""Length of the means in which a gyro's offset from the others is followed, s: long enough to average its noise, short
beside what a bias drifts in."""
ROUNDS = 4
PIECE = 1 << 18


def fill_missing(rate: np.ndarray, rate_hz: float) -> np.ndarray | None:
    """Fill the samples without a value, in their place.

    rate    : array [T, N], deg/s, one array; NaN where a gyro has no value;  rate_hz : sample rate, Hz
    returns : bool [T, N], true where a value was filled in; None where nothing was missing, and nothing was touched

    A missing value becomes the mean of the gyros that have one at that moment, each less its own constant offset, plus
    the gyro's own offset from that mean at that time (means of BLOCK_S, straight lines between their middles, the
    nearest of them at the ends). A linear method whose weights sum to one then acts as if it had left the gyro out and
    spread its weight evenly over the others, and neither its bias nor a motion jumps where a value is missing. Where no
    gyro has a value the row is lost: the common rate runs in a straight line from the last row with one to the next.
    What is filled in has no noise of its own: figures of a gyro must leave it out.
    """
    missing = _missing(rate)
    if missing is None:
        return None
    length = max(round(BLOCK_S * rate_hz), 1)
    offset = _offsets(rate, missing, length)
    common = np.empty(len(rate))
    for rows in _pieces(len(rate)):
        common[rows] = _common(rate[rows], missing[rows], offset)
    lost = missing.all(axis=1)
    if lost.any():
        places, there = np.flatnonzero(lost), np.flatnonzero(~lost)
        common[places] = np.interp(places, there, common[there]) if there.size else 0.0
    for gyro in np.flatnonzero(missing.any(axis=0)):
        gone = missing[:, gyro]
        rate[gone, gyro] = common[gone] + _own_offset(rate[:, gyro], gone, common, length)
    return missing


def unseen(array: ArrayRates) -> np.ndarray | None:
    """Samples of which no gyro says anything, bool [T]; None: there are none. Made once for a recording."""

    def find() -> np.ndarray | None:
        if array.missing is None:
            return None
        lost = np.asarray(array.missing.all(axis=1))
        return lost if lost.any() else None

    return array.once("unseen", find)


def away(missing: np.ndarray, least: int) -> np.ndarray:
    """Stretches [M, 2] of `least` samples or more in which one gyro has no value; missing [T] of bool."""
    edges = true_runs(missing)
    long: Ints = edges[edges[:, 1] - edges[:, 0] >= least]
    return long


def _pieces(samples: int) -> list[slice]:
    return [slice(start, min(start + PIECE, samples)) for start in range(0, samples, PIECE)]


def _missing(rate: np.ndarray) -> np.ndarray | None:
    """Where values are missing [T, N], each gyro contiguous; None: nowhere."""
    found = None
    for gyro, column in enumerate(rate.T):
        for rows in _pieces(len(column)):
            gone = np.isnan(column[rows])
            if gone.any():
                found = np.zeros(rate.shape[::-1], dtype=bool) if found is None else found
                found[gyro, rows] = gone
    return None if found is None else found.T


def _common(rate: Floats, missing: Bools, offset: Floats) -> Floats:
    """Mean of the gyros that have a value, each less its offset [N]; NaN where none has one. rate [n, N]"""
    present = ~missing
    count = present.sum(axis=1)
    total = np.where(present, rate - offset, 0.0).sum(axis=1)
    common: Floats = np.divide(total, count, out=np.full(len(rate), np.nan), where=count > 0)
    return common


def _offsets(rate: np.ndarray, missing: np.ndarray, length: int) -> np.ndarray:
    """Mean offset of each gyro from the common rate [N]; 0 for one without a value.

    So that the common rate does not jump where another gyro comes in. A first guess is from means of blocks, in which
    gyros that are never there in the same row meet; rows, from which motion cancels, put it right in a few rounds.
    """
    offset = _block_offsets(rate, missing, length)
    for _ in range(ROUNDS):
        total, count = np.zeros(rate.shape[1]), np.zeros(rate.shape[1])
        for rows in _pieces(len(rate)):
            part, present = rate[rows], ~missing[rows]
            common = _common(part, missing[rows], offset)
            total += np.where(present, part - common[:, None], 0.0).sum(axis=0)
            count += present.sum(axis=0)
        offset = np.divide(total, count, out=np.zeros_like(total), where=count > 0)
    return offset


def _block_offsets(rate: np.ndarray, missing: np.ndarray, length: int) -> np.ndarray:
    """The same [N] from means of blocks of `length` samples."""
    begins = np.arange(0, len(rate), length)
    columns = zip(rate.T, missing.T, strict=True)
    total, count = np.stack([
        (np.add.reduceat(np.where(gone, 0.0, column), begins), np.add.reduceat(~gone, begins, dtype=float))
        for column, gone in columns
    ], axis=1)  # fmt: skip
    there = count.T > 0
    means = np.where(there, total.T / np.maximum(count.T, 1.0), 0.0)
    offset = np.zeros(rate.shape[1])
    for _ in range(ROUNDS):
        common = np.where(there, means - offset, 0.0).sum(axis=1) / np.maximum(there.sum(axis=1), 1)
        offset = np.where(there, means - common[:, None], 0.0).sum(axis=0) / np.maximum(there.sum(axis=0), 1)
    return offset


def _own_offset(column: np.ndarray, gone: np.ndarray, common: np.ndarray, length: int) -> np.ndarray | float:
    """Offset of one gyro [T] from the common rate at the samples that it lacks."""
    begins = np.arange(0, len(column), length)
    difference = np.where(gone, 0.0, column - common)
    count = np.add.reduceat(~gone, begins, dtype=float)
    known = count > 0
    if not known.any():
        return 0.0
    mean = np.add.reduceat(difference, begins)[known] / count[known]
    middle = np.add.reduceat(np.where(gone, 0.0, np.arange(len(column))), begins)[known] / count[known]
    return np.interp(np.flatnonzero(gone), middle, mean)
