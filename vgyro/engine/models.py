"""What the volatility models return: the same for every engine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

CONVERGED = "converged"
BOUNDARY = "boundary"
NO_VARIANCE = "no variance"
TOO_SHORT = "too short"
FAILED = "failed"
BOUNDARY_MARGIN = "boundary margin"
NOT_POSITIVE_DEFINITE = "not positive definite"
ONE_GYRO = "one gyro"

PERSISTENCE_MAX = 1 - 1e-6
"""Largest α + β (and a + b) that a fit may return; a fit that reaches it is at the boundary."""

EIGENVALUE_MIN = 1e-8
"""A correlation matrix with a smaller eigenvalue counts as singular."""


@dataclass(frozen=True)
class GarchFit:
    """GARCH(1,1) of N series: h_t = ω + α e²_{t-1} + β h_{t-1}.

    omega [N] (deg/s)², alpha [N], beta [N]; NaN where the status is `no variance` or `too short`
    stderr         : [N, 3] robust standard errors of (ω, α, β); NaN unless the status is `converged`
    log_likelihood : [N] Gaussian, with its constant: -½Σ(log 2π + log h + e²/h), r in deg/s
    variance       : [T, N] h_t, (deg/s)²
    status         : [N] converged, boundary (α at 0, β at 0 or α + β at 1), no variance, too short, failed
    """

    omega: np.ndarray
    alpha: np.ndarray
    beta: np.ndarray
    stderr: np.ndarray
    log_likelihood: np.ndarray
    variance: np.ndarray
    status: np.ndarray


@dataclass(frozen=True)
class DccFit:
    """DCC(1,1) of N standardised residuals: Q_t = (1-a-b)S + a z_{t-1}z'_{t-1} + b Q_{t-1}, R_t = Q_t scaled.

    stderr         : [2] two-step robust standard errors of (a, b); NaN where there are none
    stderr_hessian : [2] inverse-Hessian ones, which take the margins as known and the likelihood as right
    target         : [N, N] S
    log_likelihood : L_c of Liu et al. (2015), eq. 10: -½Σ(log|R| + z'R⁻¹z - z'z); no constant
    log_likelihood_ccc : the same with a = b = 0
    correlation    : [T, N, N] R_t
    status         : converged; boundary (a or b at 0, a + b at 1); boundary margin (a GARCH margin is at its
                     boundary, so there are no two-step standard errors); not positive definite (S is singular:
                     correlation is the identity); one gyro; too short; failed (the optimiser: a = b = 0)
    """

    a: float
    b: float
    stderr: np.ndarray
    stderr_hessian: np.ndarray
    target: np.ndarray
    log_likelihood: float
    log_likelihood_ccc: float
    correlation: np.ndarray
    status: str
