"""GARCH by `arch` (Sheppard): Gaussian quasi maximum likelihood, mean zero, our start of the recursion."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np

from vgyro.arrays import Floats
from vgyro.engine import status as rules
from vgyro.engine.models import (
    CONVERGED,
    FAILED,
    GARCH_STATUSES,
    NO_VARIANCE,
    PERSISTENCE_MAX,
    TOO_SHORT,
    GarchFit,
    GarchWindows,
)
from vgyro.engine.recursions import garch_log_likelihood, garch_variance

# Starts: the best point of each part is handed to the optimiser, so that no start depends on another window.
ALPHAS = (0.005, 0.02, 0.05, 0.1, 0.2, 0.35, 0.6, 0.95)
SLOW = (0.8, 0.9, 0.95, 0.98, 0.995)
FAST = (0.01, 0.05, 0.2, 0.4, 0.6, 0.97)
# Trends of the variance, α = 0: from h_0 = 1 to a level, within so many samples.
LEVELS = (0.5, 0.75, 0.9, 1.1, 1.3, 2.0)
SHORT = (0.5, 2.0, 10.0)
LONG = (50.0, 250.0, 2000.0)
# Outliers, which raise the mean square: (ω, α) in units of 1 - β.
RAISED = ((0.2, 1.0), (0.6, 1.0), (0.3, 0.5), (0.8, 0.1))
RAISED_BETA = (0.0, 0.4, 0.7, 0.85, 0.93)
OPTIONS = {"ftol": 1e-9, "maxiter": 300}


@dataclass(frozen=True)
class _Series:
    """One fitted column, in units of its own mean square."""

    parameters: np.ndarray
    stderr: np.ndarray
    status: str


def fit_garch(r: np.ndarray) -> GarchFit:
    """As vgyro.engine.protocols.volatility.GarchEngine.fit_garch; each column by arch, from the best of its starts."""
    r = np.asarray(r, dtype=float)
    fits, scales = [], []
    # Contiguous columns: the rounding of a mean depends on the stride.
    for column in np.ascontiguousarray(r.T):
        scale = float(np.mean(np.square(column)))
        fits.append(_fit_column(column, scale))
        scales.append(scale)
    omega, alpha, beta = np.array([fit.parameters for fit in fits]).reshape(-1, 3).T
    stderr = np.array([fit.stderr for fit in fits]).reshape(-1, 3)
    size = np.array(scales)
    stderr[:, 0] *= size
    variance = garch_variance(r, omega * size, alpha, beta)
    return GarchFit(
        omega=omega * size,
        alpha=alpha,
        beta=beta,
        stderr=stderr,
        log_likelihood=garch_log_likelihood(r, variance),
        variance=variance,
        status=np.array([fit.status for fit in fits], dtype=object),
    )


def fit_garch_windows(r: np.ndarray) -> GarchWindows:
    """As vgyro.engine.protocols.volatility.GarchEngine.fit_garch_windows: fit_garch of each window."""
    windows, _, n = r.shape
    omega, alpha, beta, likelihood = (np.full((windows, n), np.nan) for _ in range(4))
    stderr, status = np.full((windows, n, 3), np.nan), np.zeros((windows, n), dtype=np.uint8)
    for k, window in enumerate(r):
        fit = fit_garch(window)
        omega[k], alpha[k], beta[k], likelihood[k] = fit.omega, fit.alpha, fit.beta, fit.log_likelihood
        stderr[k] = fit.stderr
        status[k] = [rules.garch_code(name) for name in fit.status]
    return GarchWindows(omega, alpha, beta, stderr, likelihood, status)


def _fit_column(column: np.ndarray, scale: float) -> _Series:
    nothing = np.full(3, np.nan)
    if len(column) < rules.MIN_SAMPLES:
        return _Series(nothing, nothing, TOO_SHORT)
    if not np.all(np.isfinite(column)):
        return _Series(nothing, nothing, FAILED)
    if np.ptp(column) <= rules.FLAT * np.max(np.abs(column)):
        return _Series(nothing, nothing, NO_VARIANCE)
    e = column / np.sqrt(scale)
    model = _model(e, 1, 1)
    constant = np.array([1.0, 0.0, 0.0])
    best, best_value, fit = constant, _value(e, constant) + rules.GAIN * len(e), None
    results = [result for result in (_fit_from(model, start) for start in _starts(e)) if _ended_well(result)]
    for result in results:
        parameters = _inside(np.asarray(result.params, dtype=float))
        value = _value(e, parameters)
        if value >= best_value:
            best, best_value, fit = parameters, value, result
    if not results:
        return _Series(constant, nothing, FAILED)
    outlier = rules.outlier_dominated(e[:, None])
    status = GARCH_STATUSES[rules.garch_status_codes(best[[0]], best[[1]], best[[2]], outlier)[0]]
    return _Series(best, _stderr(fit) if status == CONVERGED else nothing, status)


def _model(e: np.ndarray, arch_lags: int, garch_lags: int) -> Any:
    from arch import arch_model

    return arch_model(e, mean="Zero", vol="GARCH", p=arch_lags, q=garch_lags, rescale=False)


def _fit_from(model: Any, start: np.ndarray) -> Any:
    # e has a mean square of 1, which is therefore the backcast; arch's own default makes spurious optima.
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return model.fit(disp="off", show_warning=False, starting_values=start, backcast=1.0, options=dict(OPTIONS))


def _ended_well(result: Any) -> bool:
    # 8: no step improves the likelihood any more, which at this tolerance is the optimum to rounding.
    return result.convergence_flag in (0, 8)


def _inside(parameters: np.ndarray) -> np.ndarray:
    """Clip what the optimiser returned to the constraints; an α or β of rounding is 0."""
    omega = max(parameters[0], rules.OMEGA_MIN)
    alpha = min(parameters[1], PERSISTENCE_MAX) if parameters[1] >= rules.BETA_NEAR_ZERO else 0.0
    beta = min(parameters[2], PERSISTENCE_MAX - alpha) if parameters[2] >= rules.BETA_NEAR_ZERO else 0.0
    return np.array([omega, alpha, beta])


def _value(e: np.ndarray, parameters: np.ndarray) -> float:
    omega, alpha, beta = parameters
    variance = garch_variance(e[:, None], np.array([omega]), np.array([alpha]), np.array([beta]))
    return float(garch_log_likelihood(e[:, None], variance)[0])


def _starts(e: np.ndarray) -> list[np.ndarray]:
    parts = [
        [(1 - total, alpha, total - alpha) for alpha in ALPHAS for total in part if total > alpha]
        for part in (SLOW, FAST)
    ]
    parts += [
        [(level * (1 - np.exp(-1 / time)), 0.0, np.exp(-1 / time)) for level in LEVELS for time in part]
        for part in (SHORT, LONG)
    ]
    parts += [[(omega * (1 - beta), alpha * (1 - beta), beta) for omega, alpha in RAISED for beta in RAISED_BETA]]
    starts = []
    for points in map(np.array, parts):
        series = np.repeat(e[:, None], len(points), axis=1)
        best = int(np.argmax(garch_log_likelihood(series, garch_variance(series, *points.T))))
        starts.append(points[best])
    return starts


def _stderr(result: Any) -> Floats:
    """Bollerslev & Wooldridge's robust standard errors, as arch computes them, but with 1/T where it has 1/(T - 1)."""
    try:
        with np.errstate(invalid="ignore"):
            stderr: Floats = np.asarray(result.std_err, dtype=float) * np.sqrt(1 - 1 / result.nobs)
            return stderr
    except np.linalg.LinAlgError:
        return np.full(3, np.nan)


@dataclass(frozen=True)
class GarchPq:
    """GARCH(p,q) of N series; alpha [N, q] of past squares, beta [N, p] of past variances (Liu et al. 2015, eq. 1)."""

    omega: np.ndarray
    alpha: np.ndarray
    beta: np.ndarray
    log_likelihood: np.ndarray
    variance: np.ndarray
    status: np.ndarray


def fit_garch_pq(r: np.ndarray, p: int = 1, q: int = 1) -> GarchPq:
    """Fit GARCH(p,q), p past variances and q past squares, to each column of r [T, N], deg/s.

    Squares and variances before the first sample are mean(e²). One start (arch's own grid): for small orders, and to
    compare with (1,1), which is what the pipeline uses.
    Liu et al. (2015), eq. 1. Their p counts variances and q squares; arch names them the other way round.
    """
    r = np.asarray(r, dtype=float)
    samples, n = r.shape
    omega, alpha, beta = np.full(n, np.nan), np.full((n, q), np.nan), np.full((n, p), np.nan)
    variance, status = np.full((samples, n), np.nan), np.full(n, FAILED, dtype=object)
    for i, column in enumerate(r.T):
        if np.ptp(column) <= rules.FLAT * np.max(np.abs(column)):
            status[i] = NO_VARIANCE
            continue
        scale = float(np.mean(np.square(column)))
        model = _model(column / np.sqrt(scale), q, p)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            result = model.fit(disp="off", show_warning=False, backcast=1.0, options=dict(OPTIONS))
        found = np.asarray(result.params, dtype=float)
        omega[i], alpha[i], beta[i] = found[0] * scale, found[1 : 1 + q], found[1 + q :]
        variance[:, i] = np.square(result.conditional_volatility) * scale
        status[i] = CONVERGED if _ended_well(result) else FAILED
    return GarchPq(omega, alpha, beta, garch_log_likelihood(r, variance), variance, status)
