"""Simulated series for the contests: the same for every side, from fixed seeds."""

from __future__ import annotations

import numpy as np

WINDOW, GYROS = 360, 6
ALPHA, BETA = 0.05, 0.90
A, B = 0.03, 0.95
CORRELATION = 0.2
BURN_IN = 200


def dcc_windows(count: int, seed: int, samples: int = WINDOW, gyros: int = GYROS) -> np.ndarray:
    """Windows [count, samples, gyros] of a DCC(1,1) with GARCH(1,1) margins of unit variance, all independent."""
    rng = np.random.default_rng(seed)
    target = np.full((gyros, gyros), CORRELATION)
    np.fill_diagonal(target, 1.0)
    Q = np.broadcast_to(target, (count, gyros, gyros)).copy()
    h = np.ones((count, gyros))
    r = np.empty((count, samples, gyros))
    for t in range(-BURN_IN, samples):
        scale = np.sqrt(np.einsum("kii->ki", Q))
        root = np.linalg.cholesky(Q / (scale[:, :, None] * scale[:, None, :]))
        z = np.einsum("kij,kj->ki", root, rng.standard_normal((count, gyros)))
        e = np.sqrt(h) * z
        if t >= 0:
            r[:, t] = e
        h = 1 - ALPHA - BETA + ALPHA * e**2 + BETA * h
        Q = (1 - A - B) * target + A * z[:, :, None] * z[:, None, :] + B * Q
    return r


def covariance_path(count: int, seed: int, gyros: int = GYROS) -> np.ndarray:
    """A path of covariance matrices [count, gyros, gyros], each near the one before; bounds are active in most.

    Correlation by a common part of unequal size, deviations that wander: the set of gyros with a weight changes.
    """
    rng = np.random.default_rng(seed)
    load = np.linspace(0.5, 0.9, gyros)
    base = np.outer(load, load) + np.diag(np.linspace(0.8, 1.0, gyros))
    deviation = np.empty((count, gyros))
    state = np.zeros(gyros)
    for t in range(count):
        state = 0.995 * state + 0.03 * rng.standard_normal(gyros)
        deviation[t] = np.exp(state / 2)
    return deviation[:, :, None] * base * deviation[:, None, :]


def rates(samples: int, seed: int, gyros: int | None = None) -> np.ndarray:
    """White noise on a random walk, [samples] or [samples, gyros]: what a gyro at rest looks like."""
    rng = np.random.default_rng(seed)
    walk = np.cumsum(rng.standard_normal(samples)) * 1e-4
    if gyros is None:
        return walk + rng.standard_normal(samples)
    return walk[:, None] + rng.standard_normal((samples, gyros))
