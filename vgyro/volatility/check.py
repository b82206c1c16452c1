"""GARCH and DCC once more, slowly and plainly, for the cross-check: no code shared with the fits that it checks."""

from __future__ import annotations

import math

import numpy as np

from vgyro.arrays import Floats
from vgyro.engine.models import DccModel

PERSISTENCE_MAX = 1.0 - 1e-6
GRID_ALPHA = (0.0, 0.005, 0.01, 0.02, 0.04, 0.07, 0.11, 0.16, 0.23, 0.32, 0.45, 0.65, 0.9)
GRID_PERSISTENCE = (0.0, 0.1, 0.25, 0.4, 0.55, 0.7, 0.8, 0.87, 0.92, 0.95, 0.97, 0.985, 0.993, 0.998)
TREND_BETA = (0.3, 0.6, 0.9, 0.98, 0.996)
TREND_LEVEL = (0.6, 0.85, 1.15, 1.6)
BEST = 3
BOUNDS = ((1e-8, 5.0), (0.0, PERSISTENCE_MAX), (0.0, 1.0))
SLOPE_STEP = 1e-6


def greatest_log_likelihood(e: np.ndarray) -> float:
    """The largest Gaussian log-likelihood that GARCH(1,1) gives a series.

    e       : array [T], deg/s, zero mean, not constant
    returns : max of -½Σ(log 2π + log h + e²/h), h_t = ω + α e²_{t-1} + β h_{t-1}, h_1 = ω + (α + β)·mean(e²)
    The likelihood is evaluated on a dense grid of (α, α + β), with ω such that the mean variance is mean(e²), and on
    trends of the variance, where α = 0; from the best points of each scipy's bounded quasi-Newton search goes on in
    (ω, α + β, α/(α + β)).
    """
    from scipy.optimize import minimize

    scale = math.sqrt(float(np.mean(e**2)))
    unit = e / scale
    points = np.array([(total, alpha / total if total else 0.0) for total in GRID_PERSISTENCE for alpha in GRID_ALPHA
                       if alpha <= total])  # fmt: skip
    starts = np.column_stack([1.0 - points[:, 0], points])
    trends = np.array([(level * (1.0 - beta), beta, 0.0) for beta in TREND_BETA for level in TREND_LEVEL])
    best, chosen = -math.inf, []
    for part in (starts, trends):
        values = _log_likelihood(unit, part)
        best = max(best, float(values.max()))
        chosen += list(part[np.argsort(-values, kind="stable")[:BEST]])
    for start in chosen:
        found = minimize(
            _cost_and_slope, start, args=(unit,), jac=True, bounds=BOUNDS, method="L-BFGS-B",
            options={"ftol": 1e-13, "gtol": 1e-6, "maxiter": 500},
        )  # fmt: skip
        best = max(best, -float(found.fun))
    return best - len(e) * math.log(scale)


def _cost_and_slope(point: np.ndarray, e: np.ndarray) -> tuple[float, np.ndarray]:
    """Minus the log-likelihood and its slope by differences within the bounds, all in one pass over the series."""
    low, high = np.array(BOUNDS).T
    below = np.maximum(point - SLOPE_STEP * np.eye(3), low)
    above = np.minimum(point + SLOPE_STEP * np.eye(3), high)
    values = _log_likelihood(e, np.vstack([point, below, above]))
    width = np.diagonal(above - below)
    return -float(values[0]), -(values[4:] - values[1:4]) / width


def _log_likelihood(e: Floats, points: Floats) -> Floats:
    """Log-likelihood of a series of mean square 1 at many points (ω, α + β, α/(α + β)) [P, 3]."""
    from scipy.signal import lfilter

    omega, total, share = points.T
    alpha, beta = total * share, total * (1.0 - share)
    square = e**2
    variance = np.empty((len(e), len(points)))
    variance[0] = omega + total
    variance[1:] = omega + np.outer(square[:-1], alpha)
    for point, kept in enumerate(beta):
        variance[:, point] = lfilter([1.0], [1.0, -kept], variance[:, point])
    summed = (np.log(variance) + square[:, None] / variance).sum(axis=0)
    likelihood: Floats = -0.5 * (len(e) * math.log(2.0 * math.pi) + summed)
    return likelihood


def covariance_after(r: np.ndarray, model: DccModel) -> tuple[np.ndarray, np.ndarray]:
    """H of the last sample of a window and of the one after it, by the recursions written as loops.

    r       : array [T, N], deg/s, the window
    returns : H_T and H_{T+1} [N, N], (deg/s)²
    Liu et al. (2015), eq. 1-6, with h_0 = e_0² = mean(e²) and Q_1 = S.
    """
    omega, alpha, beta, a, b, target = model
    h = omega + (alpha + beta) * np.mean(r**2, axis=0)
    Q = target.copy()
    for row in r:
        last = _covariance(h, Q)
        z = row / np.sqrt(h)
        h = omega + alpha * row**2 + beta * h
        Q = (1.0 - a - b) * target + a * np.outer(z, z) + b * Q
    return last, _covariance(h, Q)


def _covariance(h: Floats, Q: Floats) -> Floats:
    scale = np.sqrt(h / np.diag(Q))
    covariance: Floats = Q * np.outer(scale, scale)
    return covariance
