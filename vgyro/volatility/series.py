"""From rates to the analysed series: block means, and the four definitions of r_t."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vgyro.config import Definition
from vgyro.errors import ConfigError
from vgyro.volatility.stretches import Window, stretches


@dataclass(frozen=True)
class Series:
    """The series that is analysed: means of blocks of samples.

    values [M, N] deg/s; time [M] s, of the block's first sample; segment [M], of the rates;
    stretch [M]: number of the run without a missing block, within which windows lie;
    block_index [T]: the block that each sample of the rates is in, -1: in none (motion, or too few left for a block);
    rate_hz : blocks a second
    """

    values: np.ndarray
    time: np.ndarray
    segment: np.ndarray
    stretch: np.ndarray
    block_index: np.ndarray
    rate_hz: float


def block_means(
    rate: np.ndarray,
    rate_hz: float,
    block_hz: float | str,
    segment: np.ndarray | None = None,
    rest: np.ndarray | None = None,
    time: np.ndarray | None = None,
) -> Series:
    """Means over blocks of rate_hz/block_hz samples (rounded), never from rest into motion.

    A few lost samples do not break the series: a block in which at least half of the samples are there is the mean of
    those. A longer gap ends a stretch, and so does a restart of the board.

    rate     : [T, N] deg/s at rate_hz
    block_hz : rate of the series, or "full": every sample is a block
    segment  : [T] number of the gap-free stretch; None: one stretch
    rest     : [T] true for the samples to use; None: all
    time     : [T] s; None: sample number / rate_hz
    returns  : Series; samples left over at the end of a stretch are in no block
    raises   : ConfigError if block_hz is above rate_hz
    """
    rate = np.asarray(rate, dtype=float)
    samples, n = rate.shape
    if block_hz != "full" and float(block_hz) > rate_hz * (1 + 1e-6):
        raise ConfigError(
            f"a series of {block_hz} Hz cannot be made of rates of {rate_hz:g} Hz",
            "analysis.volatility.rate_hz",
            "lower it, or write full",
        )
    length = 1 if block_hz == "full" else max(1, round(rate_hz / float(block_hz)))
    segment = np.zeros(samples, dtype=np.int32) if segment is None else np.asarray(segment)
    use = np.ones(samples, dtype=bool) if rest is None else np.asarray(rest, dtype=bool)
    time = np.arange(samples) / rate_hz if time is None else np.asarray(time, dtype=float)
    step = _slots_to_next(time, segment, use, rate_hz, length)
    block_index = np.full(samples, -1, dtype=np.int64)
    starts, numbers, values = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int32)], [np.empty((0, n))]
    blocks, number = 0, 0
    for run in stretches(np.cumsum(step == 0), use):
        if not use[run.start]:
            continue
        block = np.concatenate([[0], np.cumsum(step[run.start + 1 : run.stop])]) // length
        count = np.bincount(block)
        # A block is complete when the run reaches its last slot, and good when at least half of its samples are there.
        last_slot = int(step[run.start + 1 : run.stop].sum()) + 1
        good = (2 * count >= length) & (length * (np.arange(len(count)) + 1) <= last_slot)
        sums = np.column_stack([np.bincount(block, weights=rate[run.start : run.stop, i]) for i in range(n)])
        values.append(sums[good] / count[good, None])
        block_number = np.where(good, blocks + np.cumsum(good) - 1, -1)
        block_index[run.start : run.stop] = block_number[block]
        starts.append(run.start + np.searchsorted(block, np.flatnonzero(good)))
        # A block that is not good ends a stretch.
        numbers.append((number + np.cumsum(~good)[good]).astype(np.int32))
        blocks += int(good.sum())
        number += int((~good).sum()) + 1
    start = np.concatenate(starts)
    stretch = np.unique(np.concatenate(numbers), return_inverse=True)[1].astype(np.int32)
    return Series(np.concatenate(values), time[start], segment[start], stretch, block_index, rate_hz / length)


def _slots_to_next(time: np.ndarray, segment: np.ndarray, use: np.ndarray, rate_hz: float, length: int) -> np.ndarray:
    """Sample periods from the sample before to each sample, [T]; 0 where a new run begins.

    1 inside a segment. A gap of known duration, no longer than half a block, counts its lost samples; any other gap,
    and a change between rest and motion, begins a new run.
    """
    step = np.ones(len(time), dtype=np.int64)
    if len(time) == 0:
        return step
    border = np.concatenate([[False], segment[1:] != segment[:-1]])
    periods = np.rint(np.diff(time, prepend=time[0]) * rate_hz).astype(np.int64)
    # Without lost samples in between, the time that passed is not known: the board was restarted.
    bridged = border & (periods >= 2) & (periods - 1 <= length // 2)
    step[bridged] = periods[bridged]
    step[border & ~bridged] = 0
    step[1:][use[1:] != use[:-1]] = 0
    step[0] = 0
    return step


def residuals(
    values: np.ndarray, definition: Definition, span: int = 15, segment: np.ndarray | None = None
) -> np.ndarray:
    """r_t of a whole series, segment by segment, [M, N] deg/s. Rolling windows take `window_residuals` instead.

    `demeaned` removes the mean of each segment; `difference` is NaN in the first sample of a segment.
    """
    segment = np.zeros(len(values), dtype=np.int32) if segment is None else segment
    parts = [window_residuals(values, stretch, definition, span) for stretch in stretches(segment)]
    return np.concatenate(parts) if parts else np.empty_like(values)


def window_residuals(
    values: np.ndarray,
    window: Window,
    definition: Definition,
    span: int = 15,
    ahead: int = 0,
    segment_start: int | None = None,
) -> np.ndarray:
    """r_t of the samples of one window and of `ahead` samples after it.

    values  : [M, N] deg/s, the series
    window  : start and stop in it
    span    : samples of the first-pass rate estimate of `residual`
    ahead   : samples after the window, within its segment, over which its model is carried forward
    segment_start : first sample of the window's segment, for `difference`; None: window.start
    returns : [window + ahead, N] deg/s

    level      : y, second moment about zero (what Liu et al. 2015 imply)
    demeaned   : y - mean of the window
    difference : y_t - y_{t-1} (Liu et al. 2015, the printed mean equation); NaN in the first sample of a segment
    residual   : y - first-pass rate. That is the median over the gyros, averaged over `span` samples about t, fewer at
                 the window's edges. Not the plain mean over the gyros at t: those residuals sum to zero, their
                 correlation is singular and the weights fall back to 1/N.
    The window uses no sample after its own last one; a sample ahead of it uses none after itself.
    """
    block = np.asarray(values[window.start : window.stop + ahead], dtype=float)
    if definition == "level":
        return block.copy()
    if definition == "demeaned":
        return block - block[: window.length].mean(axis=0)
    if definition == "difference":
        before = window.start - 1
        known = before >= (window.start if segment_start is None else segment_start)
        first = values[before : before + 1] if known else np.full((1, block.shape[1]), np.nan)
        return np.diff(block, axis=0, prepend=first)
    return block - _running_mean(np.median(block, axis=1)[:, None], window.length, span // 2)


def detrended(r: np.ndarray, span: int) -> np.ndarray:
    """r minus its running mean over `span` samples about t (fewer at the ends), [T, N]. One segment at a time."""
    return r - _running_mean(r, len(r), span // 2)


def _running_mean(series: np.ndarray, inside: int, half: int) -> np.ndarray:
    """Mean over t - half to t + half of [T, N]: no further than sample `inside` - 1, and beyond that than t itself."""
    index = np.arange(len(series))
    low = np.maximum(index - half, 0)
    high = np.where(index < inside, np.minimum(index + half, inside - 1), index)
    total = np.concatenate([np.zeros((1, series.shape[1])), np.cumsum(series, axis=0)])
    return (total[high + 1] - total[low]) / (high + 1 - low)[:, None]
