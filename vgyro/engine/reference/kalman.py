"""Kalman filters by filterpy, one sample at a time: slow, for checks."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from filterpy.kalman import KalmanFilter


def constant_gain_filter(rate: np.ndarray, transition: float, gain: np.ndarray, start: float) -> np.ndarray:
    """x ← F·x, then x ← x + K(z - 1·x), with a fixed gain, by filterpy's steady-state steps.

    rate    : array [T, N], deg/s;  transition : F;  gain : K [N];  start : x before the first sample, deg/s
    returns : x after each sample [T], deg/s
    """
    filter_ = _filter(rate.shape[1], transition, start)
    filter_.K = gain[None, :]
    estimate = np.empty(len(rate))
    for index, sample in enumerate(rate):
        filter_.predict_steadystate()
        filter_.update_steadystate(sample[:, None])
        estimate[index] = filter_.x[0, 0]
    return estimate


def kalman_filter(
    rate: np.ndarray, transition: float, process: float, noise: np.ndarray, start: float, variance: float
) -> tuple[np.ndarray, np.ndarray]:
    """The discrete Kalman filter of a scalar rate that N gyros measure: predict, then update, each sample.

    rate       : array [T, N], deg/s
    transition : F, from one sample to the next;  process : variance of the step, (deg/s)²
    noise      : array [N, N], covariance of a sample, (deg/s)²
    start, variance : mean and variance before the first sample
    returns    : estimate [T], deg/s, and its variance [T], (deg/s)², after each update
    """
    filter_ = _filter(rate.shape[1], transition, start)
    filter_.P[:] = variance
    filter_.Q[:] = process
    filter_.R = noise
    estimate, spread = np.empty(len(rate)), np.empty(len(rate))
    for index, sample in enumerate(rate):
        filter_.predict()
        filter_.update(sample[:, None])
        estimate[index], spread[index] = filter_.x[0, 0], filter_.P[0, 0]
    return estimate, spread


def _filter(gyros: int, transition: float, start: float) -> KalmanFilter:
    from filterpy.kalman import KalmanFilter

    filter_ = KalmanFilter(dim_x=1, dim_z=gyros)
    filter_.x[:] = start
    filter_.F[:] = transition
    filter_.H = np.ones((gyros, 1))
    return filter_
