"""The definitions of r_t for many windows at once: what vgyro.volatility.series says of one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import as_strided

from vgyro.arrays import Floats, Ints
from vgyro.config import Definition


class WindowPlaces(NamedTuple):
    """Where K windows lie in a series.

    starts : [K] first sample of each window;  length : of each window
    ahead  : samples after each window; beyond the end of the series its last sample is repeated
    stretch_starts : [K] first sample of each window's stretch, for `difference`; None: starts
    """

    starts: Ints
    length: int
    ahead: int = 0
    stretch_starts: Ints | None = None


def window_batch(values: Floats, windows: WindowPlaces, definition: Definition, span: int = 15) -> Floats:
    """r_t of K windows and of `ahead` samples after each: window_residuals, window by window.

    values  : [m, N] deg/s, samples of the series; NaN where a gyro has no value, and so is r_t then
    windows : their samples are counted in `values`
    span    : samples of the first-pass rate estimate of `residual`
    returns : [K, length + ahead, N] deg/s, of `level` perhaps a view of `values`; `difference` is NaN in the first
              sample of a stretch
    """
    starts, length, ahead, stretch_starts = windows
    total = length + ahead
    block = _cut(values, starts, total)
    if definition == "level":
        return block
    if definition == "demeaned":
        centred: Floats = block - block[:, :length].mean(axis=1, keepdims=True)
        return centred
    if definition == "difference":
        r = np.empty(block.shape)
        np.subtract(block[:, 1:], block[:, :-1], out=r[:, 1:])
        known = starts > (starts if stretch_starts is None else stretch_starts)
        r[:, 0] = block[:, 0] - np.where(known[:, None], values[np.maximum(starts - 1, 0)], np.nan)
        return r
    low, high = span_about(total, length, span // 2)
    median = _cut(median_of_gyros(values), starts, total)
    sums = np.concatenate([np.zeros((len(starts), 1)), np.cumsum(median, axis=1)], axis=1)
    centred = block - ((sums[:, high + 1] - sums[:, low]) / (high + 1 - low))[:, :, None]
    return centred


def median_of_gyros(values: Floats) -> Floats:
    """Median [m] over the gyros [m, N] that have a value; in no row all of them lack one."""
    if not np.isnan(values).any():
        return np.median(values, axis=1)
    return np.nanmedian(values, axis=1)


def fitted_batch(
    values: np.ndarray,
    starts: np.ndarray,
    length: int,
    definition: Definition,
    span: int = 15,
    stretch_starts: np.ndarray | None = None,
) -> np.ndarray:
    """r_t that the models of K windows are fitted to: fitted_residuals, window by window.

    Arguments as in window_batch. With `difference`, all windows begin their stretch or none does.
    returns : [K, length, N] deg/s, or one sample fewer where there is no first difference; zero throughout for a gyro
              whose output does not change in the window
    """
    r = window_batch(values, WindowPlaces(starts, length, 0, stretch_starts), definition, span)
    if definition == "difference" and len(r) and np.isnan(r[0, 0]).all():
        r = r[:, 1:]
    stuck = values[starts] == values[starts + length - 1]
    for window, gyro in zip(*np.nonzero(stuck), strict=True):
        stuck[window, gyro] = np.ptp(values[starts[window] : starts[window] + length, gyro]) == 0
    return np.where(stuck[:, None, :], 0.0, r) if stuck.any() else r


def span_about(total: int, inside: int, half: int) -> tuple[np.ndarray, np.ndarray]:
    """First and last sample [total] that a running mean at each sample takes.

    t - half to t + half, no further than sample `inside` - 1, and beyond that no further than t itself.
    """
    index = np.arange(total)
    high = np.where(index < inside, np.minimum(index + half, inside - 1), index)
    return np.maximum(index - half, 0), high


def _cut(values: np.ndarray, starts: np.ndarray, total: int) -> np.ndarray:
    """Rows start to start + total - 1 for each start, [K, total, ...]: a view where the starts are evenly spaced."""
    values = np.asarray(values, dtype=float)
    step = int(starts[1] - starts[0]) if len(starts) > 1 else 1
    if step > 0 and starts[-1] + total <= len(values) and np.all(np.diff(starts) == step):
        strides = (step * values.strides[0], *values.strides)
        return as_strided(values[starts[0] :], (len(starts), total, *values.shape[1:]), strides)
    rows = np.minimum(starts[:, None] + np.arange(total), len(values) - 1)
    return values[rows]
