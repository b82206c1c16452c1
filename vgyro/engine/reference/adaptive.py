"""The adaptive filters by filterpy, one sample at a time, with dense matrices: slow, for checks."""

from __future__ import annotations

import numpy as np

from vgyro.arrays import Floats
from vgyro.engine.finite import not_positive_definite, refuse_broken


def scale_bias_filter(
    rate: np.ndarray,
    period: float,
    noise: np.ndarray,
    drive: np.ndarray,
    walk: np.ndarray,
    state: np.ndarray,
    covariance: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """As vgyro.engine.protocols.filters.AdaptiveEngine.scale_bias_filter.

    filterpy's ExtendedKalmanFilter with all 2+2N states; it updates by Joseph's form.
    """
    from filterpy.kalman import ExtendedKalmanFilter

    refuse_broken("rate", rate)
    _refuse_noise(noise)
    gyros = rate.shape[1]
    one = np.eye(gyros) - 1.0 / gyros
    kept = np.zeros((2 + 2 * gyros, 2 + 2 * gyros))
    kept[:2, :2], kept[2 : 2 + gyros, 2 : 2 + gyros], kept[2 + gyros :, 2 + gyros :] = np.eye(2), one, one
    filter_ = ExtendedKalmanFilter(dim_x=2 + 2 * gyros, dim_z=gyros)
    filter_.x, filter_.P = (kept @ state)[:, None], kept @ covariance @ kept
    filter_.F[0, 1], filter_.R = period, np.asarray(noise, dtype=float)
    filter_.Q = np.zeros_like(kept)
    filter_.Q[:2, :2], filter_.Q[2 : 2 + gyros, 2 : 2 + gyros] = drive, one @ np.diag(walk) @ one
    estimate = np.empty(len(rate))
    for index, sample in enumerate(np.asarray(rate, dtype=float)):
        filter_.predict()
        filter_.update(sample[:, None], _slope, _reading)
        estimate[index] = filter_.x[0, 0]
    return estimate, filter_.x[:, 0], filter_.P


def _reading(x: Floats) -> Floats:
    """(1 + s)·w + b [N, 1] of the state [2+2N, 1]."""
    biases, scales = np.split(x[2:], 2)
    reading: Floats = (1.0 + scales) * x[0] + biases
    return reading


def _slope(x: np.ndarray) -> np.ndarray:
    """Its derivative [N, 2+2N]."""
    scales = x[2 + len(x[2:]) // 2 :]
    one = np.eye(len(scales))
    return np.hstack([1.0 + scales, np.zeros_like(scales), one, x[0, 0] * one])


def filter_bank(
    rate: np.ndarray,
    noise: np.ndarray,
    process: np.ndarray,
    start: float,
    variance: float,
    probability: np.ndarray,
    least: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """As vgyro.engine.protocols.filters.AdaptiveEngine.filter_bank.

    One KalmanFilter of filterpy a member, and the densities of its N-dimensional innovations.
    """
    from filterpy.kalman import KalmanFilter

    refuse_broken("rate", rate)
    members = []
    for matrix in np.asarray(noise, dtype=float):
        _refuse_noise(matrix)
        for step in process:
            filter_ = KalmanFilter(dim_x=1, dim_z=rate.shape[1])
            filter_.x[:], filter_.P[:], filter_.Q[:], filter_.R = start, variance, step, matrix
            filter_.H = np.ones((rate.shape[1], 1))
            members.append(filter_)
    p = np.asarray(probability, dtype=float).ravel()
    estimate, total = np.empty(len(rate)), np.zeros(len(p))
    for index, sample in enumerate(np.asarray(rate, dtype=float)):
        for filter_ in members:
            filter_.predict()
            filter_.update(sample[:, None])
        likelihood = np.array([filter_.log_likelihood for filter_ in members])
        p = p * np.exp(likelihood - likelihood.max())
        p = np.maximum(p / p.sum(), least)
        p = p / p.sum()
        total += p
        estimate[index] = sum(share * filter_.x[0, 0] for share, filter_ in zip(p, members, strict=True))
    shape = np.shape(probability)
    return estimate, p.reshape(shape), (total / max(len(rate), 1)).reshape(shape)


def _refuse_noise(noise: np.ndarray) -> None:
    try:
        if not np.isfinite(noise).all():
            raise np.linalg.LinAlgError
        np.linalg.cholesky(noise)
    except np.linalg.LinAlgError:
        raise not_positive_definite(0) from None
