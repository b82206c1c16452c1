"""From rates to the analysed series: block means, and the four definitions of r_t."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Floats
from vgyro.config import Definition
from vgyro.volatility.batches import median_of_gyros, span_about
from vgyro.volatility.blocks import PIECE, BlockMeans, RunFinder, block_length
from vgyro.volatility.stretches import Window


@dataclass(frozen=True)
class Series:
    """The series that is analysed: means of blocks of samples.

    values [M, N] deg/s; time [M] s, of the block's first sample; segment [M], of the rates;
    stretch [M]: number of the run without a missing block, within which windows lie;
    rate_hz : blocks a second
    """

    values: np.ndarray
    time: np.ndarray
    segment: np.ndarray
    stretch: np.ndarray
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
    A recording too long to be held goes through vgyro.volatility.blocks piece by piece.
    """
    rate = np.asarray(rate, dtype=float)
    samples = len(rate)
    length = block_length(rate_hz, block_hz)
    segment = np.zeros(samples, dtype=np.int32) if segment is None else np.asarray(segment)
    use = np.ones(samples, dtype=bool) if rest is None else np.asarray(rest, dtype=bool)
    time = np.arange(samples) / rate_hz if time is None else np.asarray(time, dtype=float)
    finder = RunFinder(rate_hz, length)
    finder.add(time, segment, use)
    means = BlockMeans(finder.runs())
    pieces = [slice(start, start + PIECE) for start in range(0, max(samples, 1), PIECE)]
    parts = [means.add(list(rate[piece].T), time[piece], segment[piece]) for piece in pieces]
    if (last := means.rest()) is not None:
        parts.append(last)
    values, when, where, stretch = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("values", "time", "segment", "stretch")
    )
    return Series(values, when, where, stretch, rate_hz / length)


def window_residuals(
    values: Floats,
    window: Window,
    definition: Definition,
    span: int = 15,
    ahead: int = 0,
    segment_start: int | None = None,
) -> Floats:
    """r_t of the samples of one window and of `ahead` samples after it.

    values  : [M, N] deg/s, the series; NaN where a gyro has no value, and so is r_t then
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
        residuals: Floats = block - block[: window.length].mean(axis=0)
        return residuals
    if definition == "difference":
        before = window.start - 1
        known = before >= (window.start if segment_start is None else segment_start)
        first = values[before : before + 1] if known else np.full((1, block.shape[1]), np.nan)
        return np.diff(block, axis=0, prepend=first)
    return block - _running_mean(median_of_gyros(block)[:, None], window.length, span // 2)


def detrended(r: Floats, span: int) -> Floats:
    """r minus its running mean over `span` samples about t (fewer at the ends), [T, N]. One segment at a time."""
    return r - _running_mean(r, len(r), span // 2)


def _running_mean(series: Floats, inside: int, half: int) -> Floats:
    """Mean over t - half to t + half of [T, N]: no further than sample `inside` - 1, and beyond that than t itself."""
    low, high = span_about(len(series), inside, half)
    total = np.concatenate([np.zeros((1, series.shape[1])), np.cumsum(series, axis=0)])
    mean: Floats = (total[high + 1] - total[low]) / (high + 1 - low)[:, None]
    return mean
