"""A small simulator, independent of the package: GARCH(1,1) margins, DCC(1,1) or constant correlation."""

import numpy as np
import pytest


def simulate(samples, omega, alpha, beta, a=0.0, b=0.0, target=None, seed=0, burn=300):
    """r [T, N] deg/s, the h [T, N] and R [T, N, N] that made it."""
    rng = np.random.default_rng(seed)
    omega, alpha, beta = (np.atleast_1d(np.asarray(p, dtype=float)) for p in (omega, alpha, beta))
    n = len(omega)
    target = np.eye(n) if target is None else np.asarray(target, dtype=float)
    h, q, z = omega / (1 - alpha - beta), target.copy(), np.zeros(n)
    r, variance, correlation = np.empty((samples, n)), np.empty((samples, n)), np.empty((samples, n, n))
    for t in range(-burn, samples):
        if t > -burn:
            h = omega + alpha * h * z**2 + beta * h
            q = (1 - a - b) * target + a * np.outer(z, z) + b * q
        matrix = q / np.sqrt(np.outer(np.diag(q), np.diag(q)))
        z = np.linalg.cholesky(matrix) @ rng.standard_normal(n)
        if t >= 0:
            r[t], variance[t], correlation[t] = np.sqrt(h) * z, h, matrix
    return r, variance, correlation


def equicorrelation(n, rho):
    return np.full((n, n), rho) + (1 - rho) * np.eye(n)


@pytest.fixture(scope="session")
def simulator():
    return simulate


@pytest.fixture(scope="session")
def equicorrelated():
    return equicorrelation
