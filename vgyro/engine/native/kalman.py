"""Filters and smoother of a scalar rate that N gyros measure.

The N gyros say of the rate at sample t what one gyro would say that reads their weighted mean 1'R⁻¹z/1'R⁻¹1 with the
variance 1/1'R⁻¹1 (information form, by the Cholesky factor of R_t without its roots). These means do not depend on each
other: four samples in lockstep, pieces in threads. What then runs sample by sample is a filter of one gyro.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vgyro.engine.finite import not_positive_definite, refuse_broken
from vgyro.engine.native import _kalman, pool
from vgyro.errors import DataError

PIECE = 1 << 14
"""Samples a thread takes at a time."""


def kalman_filter(
    rate: np.ndarray,
    transition: float,
    process: float | np.ndarray,
    noise: np.ndarray,
    start: float,
    variance: float,
) -> tuple[np.ndarray, np.ndarray]:
    """As vgyro.engine.protocols.filters.KalmanEngine.kalman_filter.

    P and x stay accurate for an ill-conditioned R: the common rate is taken out before R is solved for, and P = K·P⁻
    of one weighted mean has no cancellation.
    """
    samples, gyros = rate.shape
    matrices = np.ascontiguousarray(noise, dtype=float).reshape(-1, gyros, gyros)
    if len(matrices) not in (1, samples):
        raise DataError(
            f"noise {np.shape(noise)} does not fit the rate {rate.shape}", remedy="give [N, N] or [T, N, N]"
        )
    estimate, spread = np.empty(samples), np.empty(samples)
    if samples == 0:
        return estimate, spread

    def weigh(begin: int, end: int) -> None:
        piece = np.ascontiguousarray(rate[begin:end], dtype=float)
        own = matrices[begin:end] if len(matrices) > 1 else matrices
        broken = _kalman.mean(piece, own, estimate[begin:end], spread[begin:end])
        if broken >= 0:
            refuse_broken("rate", rate[: begin + broken + 1])
            refuse_broken("noise covariance R", matrices[: begin + broken + 1])
            raise not_positive_definite(begin + broken)

    pool.run(weigh, samples, PIECE)
    _kalman.filter(transition, _process(process, samples), start, variance, estimate, spread)
    return estimate, spread


def rts_smoother(
    estimate: np.ndarray, variance: np.ndarray, transition: float, process: float | np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """As vgyro.engine.protocols.filters.KalmanEngine.rts_smoother."""
    estimate, variance = np.ascontiguousarray(estimate, dtype=float), np.ascontiguousarray(variance, dtype=float)
    smoothed, spread = np.empty(len(estimate)), np.empty(len(estimate))
    if len(estimate):
        _kalman.smooth(estimate, variance, transition, _process(process, len(estimate)), smoothed, spread)
        # What is not finite spreads to the first sample.
        if not np.isfinite(smoothed[0] + spread[0]):
            refuse_broken("estimate", estimate)
            refuse_broken("variance", variance)
    return smoothed, spread


def constant_gain_filter(rate: np.ndarray, transition: float, gain: np.ndarray, start: float) -> np.ndarray:
    """As vgyro.engine.protocols.filters.KalmanEngine.constant_gain_filter."""
    driven = np.zeros(len(rate))
    for column, share in zip(rate.T, gain, strict=True):
        driven += np.multiply(column, share, dtype=float)
    return low_pass(driven, transition * (1.0 - float(np.sum(gain))), 1.0, start)


def low_pass(signal: np.ndarray, keep: float, gain: float, start: float) -> np.ndarray:
    """As vgyro.engine.protocols.filters.KalmanEngine.low_pass."""
    return _run(signal, _kalman.low_pass, keep, gain, start)


def settling_filter(signal: np.ndarray, keep: float, fading: float, start: float) -> np.ndarray:
    """As vgyro.engine.protocols.filters.KalmanEngine.settling_filter."""
    return _run(signal, _kalman.settling, keep, fading, start)


def _run(signal: np.ndarray, recursion: Callable[..., None], *parameters: float) -> np.ndarray:
    signal = np.ascontiguousarray(signal, dtype=float)
    out = np.empty(len(signal))
    if len(signal):
        recursion(signal, *parameters, out)
        # What is not finite stays in the recursion.
        if not np.isfinite(out[-1]):
            refuse_broken("signal", signal)
    return out


def _process(process: float | np.ndarray, samples: int) -> np.ndarray:
    variances = np.ascontiguousarray(process, dtype=float).reshape(-1)
    if len(variances) not in (1, samples):
        raise DataError(f"process {np.shape(process)} does not fit {samples} samples", remedy="give a number or [T]")
    return variances
