"""What the methods are measured against on the faulty twin: written out here, but for the oracle's smoother."""

from __future__ import annotations

import math

import numpy as np
from harness import Case, error_sd
from scipy.linalg import solve_discrete_are
from scipy.optimize import minimize_scalar
from scipy.signal import lfilter, ss2tf

from vgyro.fusion.motion.noisy_rate import NoisyRate
from vgyro.fusion.motion.smoother import Smoothed, choose_motion, smooth

SETTLED = 400
"""Samples left out of the likelihood, while the filter forgets its start."""


def average_kf(one: Case) -> np.ndarray:
    """The average through a causal Kalman filter whose rate has a random walk as derivative; q by likelihood [T].

    It is given the true mean variance of the average's noise. Steady state: Riccati equation by scipy.
    """
    average, variance = _average(one)
    return _filter(average, variance, _likeliest(average, variance, one.array.period), one.array.period)[1]


def earlier_study(one: Case) -> dict[str, float]:
    """Error s.d. of the smoothers of docs/methods.md, deg/s: the rate's derivative is a random walk, q by
    the likelihood of the filter with the mean variance. True variances are given; fixed ones are means of them.
    """
    average, variance = _average(one)
    median = np.median(one.array.rate, axis=1)
    of_median = np.full(len(median), np.var(median - one.truth))
    fixed = one.variance.mean(axis=0)
    u = 1.0 / fixed / (1.0 / fixed).sum()
    known, r = known_weights(one)
    series = {
        "average": (average, np.full(len(average), variance)),
        "median": (median, of_median),
        "fixed variances": (one.array.rate @ u, np.full(len(average), float(u**2 @ fixed))),
        "oracle": (known, r),
    }
    found = {"average + KF": error_sd(one, average_kf(one))}
    for name, (z, each) in series.items():
        q = _likeliest(z, float(each.mean()), one.array.period)
        found[name] = error_sd(one, _smoothed(z, each, q, one.array.period))
    return found


def _average(one: Case) -> tuple[np.ndarray, float]:
    gyros = one.array.rate.shape[1]
    return one.array.rate.mean(axis=1), float(one.variance.mean(axis=0).sum()) / gyros**2


def _likeliest(z: np.ndarray, r: float, period: float) -> float:
    """q of the greatest likelihood, deg²/s⁵."""
    found = minimize_scalar(
        lambda log_q: -_filter(z, r, math.exp(log_q), period)[0],
        bounds=(-5.0, 18.0), method="bounded", options={"xatol": 0.01},
    )  # fmt: skip
    return math.exp(found.x)


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


def _smoothed(z: np.ndarray, r: np.ndarray, q: float, period: float) -> np.ndarray:
    """Smoothed rate [T] for variances r [T]: Kalman filter, and the smoother of Bryson & Frazier, for two states."""
    samples, noise, seen = len(z), r.tolist(), z.tolist()
    q00, q01, q11 = q * period**3 / 3, q * period**2 / 2, q * period
    rate, slope = seen[0], 0.0
    p00, p01, p11 = 1e4, 0.0, 1e6
    kept = []
    for k in range(samples):
        S = p00 + noise[k]
        g0, g1, e = p00 / S, p01 / S, seen[k] - rate
        kept.append((rate, p00, p01, e / S, g0, g1))
        rate, slope = rate + g0 * e + period * (slope + g1 * e), slope + g1 * e
        p11 -= g1 * p01
        p00, p01 = p00 * (1 - g0), p01 * (1 - g0)
        p00, p01, p11 = p00 + 2 * period * p01 + period**2 * p11 + q00, p01 + period * p11 + q01, p11 + q11
    smoothed, a0, a1 = np.empty(samples), 0.0, 0.0
    for k in range(samples - 1, -1, -1):
        rate, p00, p01, weighted, g0, g1 = kept[k]
        a1 += period * a0
        a0 += weighted - g0 * a0 - g1 * a1
        smoothed[k] = rate + p00 * a0 + p01 * a1
    return smoothed


def known_weights(one: Case) -> tuple[np.ndarray, np.ndarray]:
    """z [T] = Σ u_i (y_i - b_i) with the minimum-variance weights of the true covariance of each sample, and its
    variance [T]. Uncorrelated noise: u_i ∝ 1/σ_i².
    """
    assert np.array_equal(one.correlation, np.eye(len(one.correlation)))
    inverse = 1.0 / one.variance
    r = 1.0 / inverse.sum(axis=1)
    return ((one.array.rate - one.bias) * inverse).sum(axis=1) * r, r


def oracle(one: Case) -> Smoothed:
    """Smoothed by one who knows the variance of every sample and the bias of every gyro; motion by likelihood."""
    z, r = known_weights(one)
    noisy = NoisyRate(z, r, one.array.segment, one.array.rate_hz)
    return smooth(noisy, choose_motion(noisy, models=one.parameters.motion_models))


def wiener_sd(one: Case, motion_sd: float, bandwidth_hz: float) -> float:
    """Least error s.d. that a linear smoother can have that knows the spectrum of the motion, deg/s.

    √∫ S·R/(S + R) df over ±bandwidth, S = motion_sd²/(2·bandwidth), R = mean variance of the known weights × period.
    """
    R = float(np.mean(known_weights(one)[1])) * one.array.period
    S = motion_sd**2 / (2 * bandwidth_hz)
    return math.sqrt(2 * bandwidth_hz * S * R / (S + R))
