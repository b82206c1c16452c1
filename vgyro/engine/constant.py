"""Constant correlation: CCC and the test against it. Nothing is optimised, so it is the same for every engine."""

from __future__ import annotations

import numpy as np

from vgyro.engine.models import CONVERGED, EIGENVALUE_MIN, FAILED, NOT_POSITIVE_DEFINITE, ONE_GYRO, DccFit
from vgyro.engine.recursions import correlation_target, dcc_log_likelihood


def fit_ccc(z: np.ndarray) -> DccFit:
    """Constant conditional correlation (Bollerslev 1990): DCC with a = b = 0. z [T, N]; statuses as in fit_dcc."""
    z = np.ascontiguousarray(z, dtype=float)
    n = z.shape[1]
    if n < 2:
        return constant_fit(z, np.eye(n), ONE_GYRO)
    if not np.all(np.isfinite(z)):
        return constant_fit(z, np.eye(n), FAILED)
    target = correlation_target(z)
    if singular(target):
        return constant_fit(z, np.eye(n), NOT_POSITIVE_DEFINITE)
    return constant_fit(z, target, CONVERGED)


def singular(target: np.ndarray) -> bool:
    """Has S [N, N] an eigenvalue below EIGENVALUE_MIN? True too where it holds NaN (a series of zeros)."""
    return not (bool(np.all(np.isfinite(target))) and np.linalg.eigvalsh(target)[0] >= EIGENVALUE_MIN)


def constant_fit(z: np.ndarray, target: np.ndarray, status: str) -> DccFit:
    """The DccFit of a = b = 0 with R_t = target [N, N] throughout; L_c is NaN where z [T, N] is not finite."""
    value = float(dcc_log_likelihood(z, 0.0, 0.0, target).sum()) if np.all(np.isfinite(z)) else np.nan
    return DccFit(
        a=0.0,
        b=0.0,
        stderr=np.full(2, np.nan),
        stderr_hessian=np.full(2, np.nan),
        target=target,
        log_likelihood=value,
        log_likelihood_ccc=value,
        correlation=np.broadcast_to(target, (len(z), *target.shape)).copy(),
        status=status,
    )


def constant_correlation_statistic(z: np.ndarray, lags: int = 1) -> float:
    """Statistic of Engle & Sheppard's test; see vgyro.volatility.constant_correlation_test. z [T, N].

    NaN for one series, a singular correlation, values that are not finite, or fewer than lags + 3 samples.
    """
    samples, n = z.shape
    if n < 2 or samples < lags + 3 or not np.all(np.isfinite(z)):
        return np.nan
    target = correlation_target(z)
    if singular(target):
        return np.nan
    values, vectors = np.linalg.eigh(target)
    white = z @ ((vectors / np.sqrt(values)) @ vectors.T)
    first, second = np.triu_indices(n, 1)
    products = white[:, first] * white[:, second]
    response = products[lags:].ravel()
    design = np.stack(
        [np.ones_like(response)] + [products[lags - lag : samples - lag].ravel() for lag in range(1, lags + 1)], axis=1
    )
    moments = np.einsum("ij,ik->jk", design, design)
    coefficients = np.linalg.solve(moments, np.einsum("ij,i->j", design, response))
    rest = response - (design * coefficients).sum(axis=1)
    return float(coefficients @ moments @ coefficients / np.mean(np.square(rest)))
