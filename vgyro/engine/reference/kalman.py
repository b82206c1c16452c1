"""Kalman filters by filterpy, one sample at a time, and recursions by scipy: slow, for checks."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vgyro.arrays import Floats
from vgyro.engine.finite import not_positive_definite, refuse_broken

if TYPE_CHECKING:
    from filterpy.kalman import KalmanFilter


def kalman_filter(
    rate: np.ndarray,
    transition: float,
    process: float | np.ndarray,
    noise: np.ndarray,
    start: float,
    variance: float,
) -> tuple[np.ndarray, np.ndarray]:
    """As vgyro.engine.protocols.filters.KalmanEngine.kalman_filter, by filterpy."""
    rate, noise = np.asarray(rate, dtype=float), np.asarray(noise, dtype=float)
    noises = np.broadcast_to(noise, (len(rate), *noise.shape[-2:]))
    steps = np.broadcast_to(process, len(rate))
    refuse_broken("rate", rate)
    refuse_broken("noise covariance R", noises)
    filter_ = _filter(rate.shape[1], transition, start)
    filter_.P[:] = variance
    estimate, spread = np.empty(len(rate)), np.empty(len(rate))
    for index, sample in enumerate(rate):
        filter_.predict(Q=steps[index])
        try:
            np.linalg.cholesky(noises[index])
        except np.linalg.LinAlgError:
            raise not_positive_definite(index) from None
        filter_.update(sample[:, None], R=noises[index])
        estimate[index], spread[index] = filter_.x[0, 0], filter_.P[0, 0]
    return estimate, spread


def rts_smoother(
    estimate: np.ndarray, variance: np.ndarray, transition: float, process: float | np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """As vgyro.engine.protocols.filters.KalmanEngine.rts_smoother, by filterpy."""
    refuse_broken("estimate", estimate)
    refuse_broken("variance", variance)
    if len(estimate) == 0:
        return np.empty(0), np.empty(0)
    samples = len(estimate)
    steps = np.broadcast_to(process, samples).reshape(-1, 1, 1)
    smoothed, spread, _, _ = _filter(1, transition, 0.0).rts_smoother(
        np.asarray(estimate, dtype=float)[:, None],
        np.asarray(variance, dtype=float)[:, None, None],
        np.broadcast_to(float(transition), (samples, 1, 1)),
        steps,
    )
    return smoothed[:, 0], spread[:, 0, 0]


def constant_gain_filter(rate: np.ndarray, transition: float, gain: np.ndarray, start: float) -> np.ndarray:
    """As vgyro.engine.protocols.filters.KalmanEngine.constant_gain_filter, by filterpy's steady-state steps."""
    return _steady_state(rate, transition, np.broadcast_to(gain, rate.shape), start)


def low_pass(signal: Floats, keep: float, gain: float, start: float) -> Floats:
    """As vgyro.engine.protocols.filters.KalmanEngine.low_pass, by scipy.signal.lfilter."""
    from scipy.signal import lfilter

    refuse_broken("signal", signal)
    filtered: Floats
    filtered, _ = lfilter([gain], [1.0, -keep], np.asarray(signal, dtype=float), zi=[keep * start])
    return filtered


def settling_filter(signal: np.ndarray, keep: float, fading: float, start: float) -> np.ndarray:
    """As vgyro.engine.protocols.filters.KalmanEngine.settling_filter.

    filterpy's steady-state steps, given the gain 1 - φ_k of each sample.
    """
    faded = 1.0 - fading * keep ** (2.0 * np.arange(len(signal) + 1))
    return _steady_state(signal[:, None], 1.0, 1.0 - keep * faded[:-1, None] / faded[1:, None], start)


def _steady_state(rate: np.ndarray, transition: float, gains: np.ndarray, start: float) -> np.ndarray:
    """Steady-state steps with a gain [N] for each sample, gains [T, N]."""
    refuse_broken("rate", rate)
    filter_ = _filter(rate.shape[1], transition, start)
    estimate = np.empty(len(rate))
    for index, sample in enumerate(np.asarray(rate, dtype=float)):
        filter_.K = gains[index][None, :]
        filter_.predict_steadystate()
        filter_.update_steadystate(sample[:, None])
        estimate[index] = filter_.x[0, 0]
    return estimate


def _filter(gyros: int, transition: float, start: float) -> KalmanFilter:
    from filterpy.kalman import KalmanFilter

    filter_ = KalmanFilter(dim_x=1, dim_z=gyros)
    filter_.x[:] = start
    filter_.F[:] = transition
    filter_.H = np.ones((gyros, 1))
    return filter_
