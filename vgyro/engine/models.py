"""What the volatility models return: the same for every engine."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

CONVERGED = "converged"
ALPHA_ZERO = "boundary: α = 0"
BETA_ZERO = "boundary: β = 0"
OMEGA_ZERO = "boundary: ω = 0"
PERSISTENCE_ONE = "boundary: α + β = 1"
A_ZERO = "boundary: a = 0"
B_ZERO = "boundary: b = 0"
SUM_ONE = "boundary: a + b = 1"
BOUNDARY_MARGIN = "boundary margin"
OUTLIER_DOMINATED = "outlier-dominated"
NO_VARIANCE = "no variance"
TOO_SHORT = "too short"
NOT_POSITIVE_DEFINITE = "not positive definite"
ONE_GYRO = "one gyro"
FAILED = "failed"
TESTED = "tested"
DEGENERATE = "degenerate"

GARCH_STATUSES = (
    CONVERGED, ALPHA_ZERO, BETA_ZERO, PERSISTENCE_ONE, OUTLIER_DOMINATED, NO_VARIANCE, TOO_SHORT, FAILED,
    OMEGA_ZERO,
)  # fmt: skip
"""What a fit of GARCH(1,1) may end as; a code of GarchWindows.status is a place in this tuple."""

DCC_STATUSES = (
    CONVERGED, A_ZERO, B_ZERO, SUM_ONE, BOUNDARY_MARGIN, OUTLIER_DOMINATED, NOT_POSITIVE_DEFINITE, ONE_GYRO, TOO_SHORT,
    FAILED, NO_VARIANCE,
)  # fmt: skip
"""What a fit of DCC(1,1) may end as; a code of DccWindows.status is a place in this tuple."""

TEST_STATUSES = (TESTED, ONE_GYRO, TOO_SHORT, NO_VARIANCE, NOT_POSITIVE_DEFINITE, FAILED, DEGENERATE)
"""What the test of constant correlation may end as; only `tested` has a statistic."""

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
    status         : [N] one of GARCH_STATUSES. At a boundary, or where one sample dominates, the parameters are those
                     of the greatest likelihood, without standard errors
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
    status         : one of DCC_STATUSES. boundary margin: a GARCH margin is at its boundary, so there are no two-step
                     standard errors; outlier-dominated: a margin is; not positive definite: S is singular, correlation
                     is the identity; no variance: a series does not vary, or is NaN throughout, as its GARCH margin
                     then is: likewise, without a likelihood; failed: the optimiser did, or a value is not finite,
                     a = b = 0
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


@dataclass(frozen=True)
class GarchWindows:
    """GARCH(1,1) of K windows of N series: GarchFit without the paths.

    omega (deg/s)², alpha, beta, log_likelihood [K, N]; stderr [K, N, 3]; status [K, N] uint8, places in GARCH_STATUSES
    """

    omega: np.ndarray
    alpha: np.ndarray
    beta: np.ndarray
    stderr: np.ndarray
    log_likelihood: np.ndarray
    status: np.ndarray


@dataclass(frozen=True)
class DccWindows:
    """DCC(1,1) of K windows of N series: DccFit without the paths, and the test of constant correlation.

    a, b, log_likelihood, log_likelihood_ccc [K]; stderr, stderr_hessian [K, 2]; target [K, N, N]
    statistic [K] : of Engle & Sheppard's test, NaN where there is none
    status [K]    : uint8, places in DCC_STATUSES
    """

    a: np.ndarray
    b: np.ndarray
    stderr: np.ndarray
    stderr_hessian: np.ndarray
    target: np.ndarray
    log_likelihood: np.ndarray
    log_likelihood_ccc: np.ndarray
    statistic: np.ndarray
    status: np.ndarray


class DccModel(NamedTuple):
    """GARCH(1,1) margins and DCC(1,1) of N series.

    omega (deg/s)², alpha, beta [N];  a, b : of DCC, 0 for a constant correlation;  target : S [N, N]
    """

    omega: np.ndarray
    alpha: np.ndarray
    beta: np.ndarray
    a: float
    b: float
    target: np.ndarray


class LossyDifferences(NamedTuple):
    """Differences of means over samples some of which are lost, at M averaging factors.

    sums [M] of their squares, (deg/s)²; excess [M]; counts [M]; possible [M], as many as there were without a loss
    """

    sums: np.ndarray
    excess: np.ndarray
    counts: np.ndarray
    possible: np.ndarray


@dataclass(frozen=True)
class ConditionalWeights:
    """Minimum-variance weights of E samples of K windows.

    weights [K, E, N]; deviation [K, E, N] √h and sigma [K, E] √(w'Hw), deg/s
    good [K, E] : False where H_t cannot be used (vgyro.engine.covariance.usable); the weights are equal there
    """

    weights: np.ndarray
    deviation: np.ndarray
    sigma: np.ndarray
    good: np.ndarray
