"""The two recursions of the model and their likelihoods, in NumPy: what every engine computes, written once plainly."""

from __future__ import annotations

import itertools

import numpy as np

from vgyro.arrays import Floats

SHORT = 20_000
"""Samples of a series that NumPy goes through one by one sooner than scipy.signal is imported."""


def garch_variance(
    r: np.ndarray, omega: np.ndarray, alpha: np.ndarray, beta: np.ndarray, start: np.ndarray | None = None
) -> np.ndarray:
    """Conditional variance h_t = ω + α e²_{t-1} + β h_{t-1} of N series.

    r                  : [T, N] deg/s
    omega, alpha, beta : [N], ω in (deg/s)²
    start              : [N] h of the first sample; None: ω + (α + β)·mean(e²), that is ε_0² = h_0 = mean(e²)
                         (Fiorentini, Calzolari & Panattoni 1996)
    returns            : [T, N] (deg/s)²
    Bollerslev (1986); Liu et al. (2015), eq. 1.
    """
    square = np.square(np.asarray(r, dtype=float))
    omega, alpha, beta = (np.broadcast_to(np.asarray(p, dtype=float), square.shape[1:]) for p in (omega, alpha, beta))
    if start is None:
        start = omega + (alpha + beta) * square.mean(axis=0)
    driven = np.empty_like(square)
    driven[0] = start
    driven[1:] = omega + alpha * square[:-1]
    return _carried(driven, beta)


def _carried(driven: np.ndarray, share: np.ndarray) -> np.ndarray:
    """x_t = driven_t + share·x_{t-1} along axis 0, [T, ...]; share : [] or [N], one a column.

    Sample by sample where that takes no longer than importing scipy.signal: the bits are the same.
    """
    if len(driven) <= SHORT:
        carried = driven.copy()
        for before, now in itertools.pairwise(carried):
            now += share * before
        return carried
    from scipy.signal import lfilter

    if not share.ndim:
        filtered: Floats = lfilter([1.0], [1.0, -float(share)], driven, axis=0)
        return filtered
    columns = [lfilter([1.0], [1.0, -one], column) for one, column in zip(share, driven.T, strict=True)]
    return np.stack(columns, axis=1) if columns else driven


def garch_log_likelihood(r: Floats, variance: Floats) -> Floats:
    """Gaussian log-likelihood of each series, [N]: -½Σ(log 2π + log h + e²/h)."""
    likelihood: Floats = -0.5 * np.sum(np.log(2 * np.pi) + np.log(variance) + np.square(r) / variance, axis=0)
    return likelihood


def correlation_target(z: np.ndarray) -> np.ndarray:
    """S = z'z/T scaled to unit diagonal, [N, N] (the model's mean is zero)."""
    return unit_diagonal(z.T @ z / len(z))


def unit_diagonal(matrix: Floats) -> Floats:
    """diag(M)^-½ M diag(M)^-½ of [..., N, N]."""
    scale = 1 / np.sqrt(np.diagonal(matrix, axis1=-2, axis2=-1))
    scaled = matrix * scale[..., :, None] * scale[..., None, :]
    index = np.arange(matrix.shape[-1])
    scaled[..., index, index] = 1.0
    return scaled


def dcc_q(z: Floats, a: float, b: float, target: Floats, start: Floats | None = None) -> Floats:
    """Q_t = (1-a-b)S + a z_{t-1}z'_{t-1} + b Q_{t-1}, [T, N, N]; Q_1 = start, by default S.

    Engle (2002); Liu et al. (2015), eq. 4.
    """
    driven = np.empty((*z.shape, z.shape[1]))
    driven[0] = 0.0 if start is None else start - target
    driven[1:] = a * (z[:-1, :, None] * z[:-1, None, :] - target)
    q: Floats = target + _carried(driven, np.asarray(b))
    return q


def dcc_correlation(
    z: np.ndarray, a: float, b: float, target: np.ndarray, start: np.ndarray | None = None
) -> np.ndarray:
    """Dynamic conditional correlation R_t = diag(Q)^-½ Q diag(Q)^-½.

    z      : [T, N] standardised residuals
    target : [N, N] S
    start  : [N, N] Q of the first sample; None: S
    returns: [T, N, N]
    Engle (2002); Liu et al. (2015), eq. 4-6.
    """
    return unit_diagonal(dcc_q(z, a, b, target, start))


def dcc_log_likelihood(z: Floats, a: float, b: float, target: Floats) -> Floats:
    """Each sample's share of L_c, [T]: -½(log|R| + z'R⁻¹z - z'z).

    raises : numpy.linalg.LinAlgError where some Q_t is not positive definite
    Liu et al. (2015), eq. 10.
    """
    q = dcc_q(z, a, b, target)
    diagonal = np.diagonal(q, axis1=1, axis2=2)
    lower = np.linalg.cholesky(q)
    scaled = np.linalg.solve(lower, (np.sqrt(diagonal) * z)[..., None])[..., 0]
    log_det = 2 * np.log(np.diagonal(lower, axis1=1, axis2=2)).sum(axis=1) - np.log(diagonal).sum(axis=1)
    likelihood: Floats = -0.5 * (log_det + np.square(scaled).sum(axis=1) - np.square(z).sum(axis=1))
    return likelihood


def dcc_score(z: np.ndarray, a: float, b: float, target: np.ndarray) -> tuple[float, np.ndarray]:
    """L_c and its gradient in (a, b).

    With u = Q⁻¹v, v = √diag(Q)·z:  dl = -½⟨Q⁻¹ - uu' + diag((uv - 1)/q), dQ⟩,  and dQ is filtered like Q itself:
    ∂Q_t/∂a = z_{t-1}z'_{t-1} - S + b ∂Q_{t-1}/∂a,  ∂Q_t/∂b = Q_{t-1} - S + b ∂Q_{t-1}/∂b.
    raises : numpy.linalg.LinAlgError where some Q_t is not positive definite
    """
    from scipy.signal import lfilter

    moved = [0.0, 1.0]
    slope_a = lfilter(moved, [1.0, -b], z[:, :, None] * z[:, None, :] - target, axis=0)
    away = a * slope_a
    slope_b = lfilter(moved, [1.0, -b], away, axis=0)
    q = target + away
    diagonal = np.diagonal(q, axis1=1, axis2=2)
    lower = np.linalg.cholesky(q)
    inverse = np.linalg.inv(q)
    v = np.sqrt(diagonal) * z
    u = np.einsum("tij,tj->ti", inverse, v)
    log_det = 2 * np.log(np.diagonal(lower, axis1=1, axis2=2)).sum() - np.log(diagonal).sum()
    value = -0.5 * (log_det + np.sum(u * v) - np.sum(np.square(z)))
    weight = inverse - u[:, :, None] * u[:, None, :]
    index = np.arange(z.shape[1])
    weight[:, index, index] += (u * v - 1) / diagonal
    # Not a BLAS product: its rounding depends on the number of threads.
    gradient = -0.5 * np.array([np.sum(weight * slope_a), np.sum(weight * slope_b)])
    return float(value), gradient
