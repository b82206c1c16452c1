"""Constant correlation: CCC and the test against it. Nothing is optimised, so it is the same for every engine."""

from __future__ import annotations

import numpy as np

from vgyro.engine.models import (
    CONVERGED,
    DEGENERATE,
    EIGENVALUE_MIN,
    FAILED,
    NO_VARIANCE,
    NOT_POSITIVE_DEFINITE,
    ONE_GYRO,
    TESTED,
    TOO_SHORT,
    DccFit,
)
from vgyro.engine.recursions import correlation_target, dcc_log_likelihood
from vgyro.engine.status import FLAT, PIVOT_MIN


def fit_ccc(z: np.ndarray) -> DccFit:
    """Constant conditional correlation (Bollerslev 1990): DCC with a = b = 0. z [T, N]; statuses as in fit_dcc."""
    z = np.ascontiguousarray(z, dtype=float)
    reason = unusable(z)
    return constant_fit(z, np.eye(z.shape[1]), reason) if reason else constant_fit(z, correlation_target(z), CONVERGED)


def unusable(z: np.ndarray, fewest: int = 0, r: np.ndarray | None = None) -> str:
    """Why the series z [T, N] have no correlation, as a status; empty where they have one. r [T, N]: as in fit_dcc."""
    samples, n = z.shape
    if n < 2:
        return ONE_GYRO
    if samples < fewest:
        return TOO_SHORT
    if without_variance(z, r):
        return NO_VARIANCE
    if not np.all(np.isfinite(z)):
        return FAILED
    return NOT_POSITIVE_DEFINITE if singular(correlation_target(z)) else ""


def without_variance(z: np.ndarray, r: np.ndarray | None = None) -> bool:
    """Does one of the series r [T, N] not vary? Where r is not known: is a z the same number, or NaN, throughout?"""
    series = z if r is None else np.asarray(r, dtype=float)
    first = series[:1]
    with np.errstate(invalid="ignore"):
        same = np.abs(series - first) <= FLAT * np.abs(first)
    unknown = np.isnan(series).all(axis=0) & (r is None)
    return bool(np.any(same.all(axis=0) | unknown))


def singular(target: np.ndarray) -> bool:
    """Has S [N, N] an eigenvalue below EIGENVALUE_MIN? True too where it holds NaN (a series of zeros)."""
    return not (bool(np.all(np.isfinite(target))) and np.linalg.eigvalsh(target)[0] >= EIGENVALUE_MIN)


def constant_fit(z: np.ndarray, target: np.ndarray, status: str) -> DccFit:
    """The DccFit of a = b = 0 with R_t = target [N, N] throughout; L_c is NaN where z [T, N] cannot be used."""
    known = status != NO_VARIANCE and np.all(np.isfinite(z))
    value = float(dcc_log_likelihood(z, 0.0, 0.0, target).sum()) if known else np.nan
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
    """The statistic of `constant_correlation` alone."""
    return constant_correlation(z, lags)[0]


def constant_correlation(z: np.ndarray, lags: int = 1) -> tuple[float, str]:
    """Statistic of Engle & Sheppard's test, and one of TEST_STATUSES; see vgyro.volatility.constant_correlation_test.

    z [T, N]. The statistic is NaN unless the status is `tested`.
    """
    samples, n = z.shape
    reason = unusable(z, lags + 3)
    if reason:
        return np.nan, reason
    values, vectors = np.linalg.eigh(correlation_target(z))
    white = z @ ((vectors / np.sqrt(values)) @ vectors.T)
    first, second = np.triu_indices(n, 1)
    products = white[:, first] * white[:, second]
    response = products[lags:].ravel()
    design = np.stack(
        [np.ones_like(response)] + [products[lags - lag : samples - lag].ravel() for lag in range(1, lags + 1)], axis=1
    )
    moments = np.einsum("ij,ik->jk", design, design)
    if collinear(moments):
        return np.nan, DEGENERATE
    coefficients = np.linalg.solve(moments, np.einsum("ij,i->j", design, response))
    rest = response - (design * coefficients).sum(axis=1)
    variance = float(np.mean(np.square(rest)))
    if not variance > PIVOT_MIN * float(np.mean(np.square(response))):
        return np.nan, DEGENERATE
    return float(coefficients @ moments @ coefficients / variance), TESTED


def collinear(moments: np.ndarray) -> bool:
    """Has a regression with these moments X'X [K, K] no unique answer? By the pivots of its elimination."""
    left = moments.copy()
    for j, size in enumerate(np.diagonal(moments).copy()):
        if not left[j, j] > PIVOT_MIN * size:
            return True
        left[j + 1 :] -= np.outer(left[j + 1 :, j] / left[j, j], left[j])
    return False
