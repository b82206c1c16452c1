"""What the methods are measured against on the faulty twin: written out here, but for the oracle's smoother."""

from __future__ import annotations

import math

import numpy as np
from harness import Case
from scipy.linalg import solve_discrete_are
from scipy.optimize import minimize_scalar
from scipy.signal import lfilter, ss2tf

SETTLED = 400
"""Samples left out of the likelihood, while the filter forgets its start."""


def average_kf(one: Case) -> np.ndarray:
    """The average through a causal Kalman filter whose rate has a random walk as derivative; q by likelihood [T].

    It is given the true mean variance of the average's noise. Steady state: Riccati equation by scipy.
    """
    average = one.array.rate.mean(axis=1)
    variance = float(one.variance.mean(axis=0).sum()) / one.array.rate.shape[1] ** 2
    found = minimize_scalar(
        lambda log_q: -_filter(average, variance, math.exp(log_q), one.array.period)[0],
        bounds=(-5.0, 18.0), method="bounded", options={"xatol": 0.01},
    )  # fmt: skip
    return _filter(average, variance, math.exp(found.x), one.array.period)[1]


def _filter(z: np.ndarray, r: float, q: float, period: float) -> tuple[float, np.ndarray]:
    """Log likelihood and filtered rate: x = [w, w'], w'' white of density q."""
    F = np.array([[1.0, period], [0.0, 1.0]])
    Q = q * np.array([[period**3 / 3, period**2 / 2], [period**2 / 2, period]])
    H = np.array([[1.0, 0.0]])
    P = solve_discrete_are(F.T, H.T, Q, np.array([[r]]))
    S = P[0, 0] + r
    K = P[:, :1] / S
    numerator, denominator = ss2tf(F @ (np.eye(2) - K @ H), F @ K, H, np.zeros((1, 1)))
    predicted = lfilter(numerator[0], denominator, z - z[0]) + z[0]
    innovation = z - predicted
    squares = float((innovation[SETTLED:] ** 2).sum())
    return -0.5 * squares / S - 0.5 * (len(z) - SETTLED) * math.log(S), predicted + K[0, 0] * innovation


def known_weights(one: Case) -> tuple[np.ndarray, np.ndarray]:
    """z [T] = Σ u_i (y_i - b_i) with the minimum-variance weights of the true covariance of each sample, and its
    variance [T]. Uncorrelated noise: u_i ∝ 1/σ_i².
    """
    assert np.array_equal(one.correlation, np.eye(len(one.correlation)))
    inverse = 1.0 / one.variance
    r = 1.0 / inverse.sum(axis=1)
    return ((one.array.rate - one.bias) * inverse).sum(axis=1) * r, r


def oracle(one: Case) -> np.ndarray:
    """Smoothed by one who knows the variance of every sample and the bias of every gyro; motion by likelihood [T]."""
    from vgyro.fusion.smoother import choose_motion, smooth

    z, r = known_weights(one)
    rate_hz, segment = one.array.rate_hz, one.array.segment
    motion = choose_motion(z, r, segment, rate_hz, models=one.parameters.motion_models)
    return smooth(z, r, segment, rate_hz, motion).rate


def smoothed_average(one: Case) -> np.ndarray:
    """The average, smoothed; it is given the true mean variance of its noise [T]."""
    from vgyro.fusion.smoother import choose_motion, smooth

    average = one.array.rate.mean(axis=1)
    r = np.full(len(average), float(one.variance.mean(axis=0).sum()) / one.array.rate.shape[1] ** 2)
    rate_hz, segment = one.array.rate_hz, one.array.segment
    motion = choose_motion(average, r, segment, rate_hz, models=one.parameters.motion_models)
    return smooth(average, r, segment, rate_hz, motion).rate


def wiener_sd(one: Case, motion_sd: float, bandwidth_hz: float) -> float:
    """Least error s.d. that a linear smoother can have that knows the spectrum of the motion, deg/s.

    √∫ S·R/(S + R) df over ±bandwidth, S = motion_sd²/(2·bandwidth), R = mean variance of the known weights × period.
    """
    R = float(np.mean(known_weights(one)[1])) * one.array.period
    S = motion_sd**2 / (2 * bandwidth_hz)
    return math.sqrt(2 * bandwidth_hz * S * R / (S + R))
