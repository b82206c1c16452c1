"""DCC(1,1): the correlation likelihood of pymgarch in NumPy, maximised by SLSQP; two-step errors by pymgarch.

pymgarch's own recursion is plain Python, 20-30 ms an evaluation and seconds a window, so the likelihood is computed by
vgyro.engine.recursions (the same to rounding, by test) and handed to pymgarch's `two_stage_vcov`. `fit_by_pymgarch`
runs pymgarch itself, for tests and for the cross-check of sampled windows.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Floats
from vgyro.engine.constant import (
    constant_correlation_statistic,
    constant_fit,
    fit_ccc,
    unusable,
)
from vgyro.engine.models import (
    BOUNDARY_MARGIN,
    CONVERGED,
    DCC_STATUSES,
    FAILED,
    GARCH_STATUSES,
    PERSISTENCE_MAX,
    DccFit,
    DccWindows,
    GarchFit,
)
from vgyro.engine.recursions import (
    correlation_target,
    dcc_correlation,
    dcc_log_likelihood,
    dcc_score,
    garch_variance,
)
from vgyro.engine.status import GAIN, MIN_SAMPLES, dcc_code, dcc_status_codes, garch_code

__all__ = ["fit_by_pymgarch", "fit_ccc", "fit_dcc", "fit_dcc_windows"]

STARTS = ((0.02, 0.95), (0.05, 0.90), (0.10, 0.80), (0.15, 0.40), (0.10, 0.05))
RIM = (0.0, 0.12, 0.24, 0.36, 0.48, 0.6, 0.7, 0.78, 0.84, 0.88, 0.91, 0.935, 0.955, 0.97, 0.98, 0.988, 0.994, 0.998)
"""Values of b at which the slope of L_c at a = 0 is looked at."""
INFEASIBLE = 1e10
HESSIAN_STEP = 1e-4


def fit_dcc_windows(
    r: np.ndarray, omega: np.ndarray, alpha: np.ndarray, beta: np.ndarray, status: np.ndarray, lags: int = 1
) -> DccWindows:
    """As vgyro.engine.protocols.volatility.DccEngine.fit_dcc_windows: fit_dcc in a loop."""
    fits, statistics = [], []
    for k in range(len(r)):
        window = np.ascontiguousarray(r[k], dtype=float)
        variance = garch_variance(window, omega[k], alpha[k], beta[k])
        z = window / np.sqrt(variance)
        nothing = np.full(window.shape[1], np.nan)
        names = np.array(GARCH_STATUSES, dtype=object)[status[k]]
        margins = GarchFit(omega[k], alpha[k], beta[k], nothing, nothing, variance, names)
        fits.append(fit_dcc(z, window, margins))
        statistics.append(constant_correlation_statistic(z, lags))
    n = r.shape[2]

    def stacked(name: str, *shape: int) -> np.ndarray:
        return np.array([getattr(fit, name) for fit in fits], dtype=float).reshape(-1, *shape)

    return DccWindows(
        a=stacked("a"),
        b=stacked("b"),
        stderr=stacked("stderr", 2),
        stderr_hessian=stacked("stderr_hessian", 2),
        target=stacked("target", n, n),
        log_likelihood=stacked("log_likelihood"),
        log_likelihood_ccc=stacked("log_likelihood_ccc"),
        statistic=np.array(statistics, dtype=float),
        status=np.array([dcc_code(fit.status) for fit in fits], dtype=np.uint8),
    )


def fit_dcc(z: np.ndarray, r: np.ndarray | None = None, margins: GarchFit | None = None) -> DccFit:
    """As vgyro.engine.protocols.volatility.DccEngine.fit_dcc; by SLSQP from several starts."""
    # Contiguous: the rounding of a sum depends on the stride.
    z = np.ascontiguousarray(z, dtype=float)
    n = z.shape[1]
    reason = unusable(z, max(MIN_SAMPLES, n + 2), r)
    if reason:
        return constant_fit(z, np.eye(n), reason)
    target = correlation_target(z)
    names = np.full(n, CONVERGED) if margins is None else margins.status
    codes = np.array([[garch_code(name) for name in names]])
    a, b, ended_well = _maximise(z, target)
    status = DCC_STATUSES[dcc_status_codes(np.array([a]), np.array([b]), codes)[0]] if ended_well else FAILED
    if a == 0:
        return constant_fit(z, target, status)
    hessian, robust = np.full((2, 2), np.nan)
    if status in (CONVERGED, BOUNDARY_MARGIN):
        hessian = _hessian_stderr(z, a, b, target)
    if status == CONVERGED and margins is not None and r is not None:
        robust = _two_step_stderr(np.asarray(r, dtype=float), margins, z, a, b, target)
    return DccFit(
        a=a,
        b=b,
        stderr=robust,
        stderr_hessian=hessian,
        target=target,
        log_likelihood=float(dcc_log_likelihood(z, a, b, target).sum()),
        log_likelihood_ccc=float(dcc_log_likelihood(z, 0.0, 0.0, target).sum()),
        correlation=dcc_correlation(z, a, b, target),
        status=status,
    )


def _maximise(z: np.ndarray, target: np.ndarray) -> tuple[float, float, bool]:
    """Best (a, b) over the starts, (0, 0) where it gains next to nothing; and whether the optimiser ended well."""
    from scipy.optimize import minimize

    def cost(x: np.ndarray) -> tuple[float, np.ndarray]:
        try:
            value, gradient = dcc_score(z, float(x[0]), float(x[1]), target)
        except np.linalg.LinAlgError:
            return INFEASIBLE, np.zeros(2)
        return -value, -gradient

    stationary = {
        "type": "ineq",
        "fun": lambda x: PERSISTENCE_MAX - x[0] - x[1],
        "jac": lambda _: np.array([-1.0, -1.0]),
    }
    constant = -float(dcc_log_likelihood(z, 0.0, 0.0, target).sum())
    best, best_cost = (0.0, 0.0), constant
    ended_well = False
    for start in (*STARTS, *_starts_at_rim(z, target)):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            result = minimize(
                cost,
                start,
                jac=True,
                method="SLSQP",
                bounds=[(0.0, PERSISTENCE_MAX)] * 2,
                constraints=[stationary],
                options={"maxiter": 300, "ftol": 1e-9},
            )
        # 8: no step improves the likelihood any more, which at this tolerance is the optimum to rounding.
        good = result.status in (0, 8)
        ended_well = ended_well or good
        if good and result.fun < best_cost:
            best, best_cost = (max(float(result.x[0]), 0.0), max(float(result.x[1]), 0.0)), float(result.fun)
    if constant - best_cost < GAIN * len(z):
        return 0.0, 0.0, ended_well
    return best[0], min(best[1], PERSISTENCE_MAX - best[0]), ended_well


def _starts_at_rim(z: np.ndarray, target: np.ndarray) -> list[tuple[float, float]]:
    """(a, b) of small maxima next to a = 0, where no start of a fixed size finds them.

    With Q_t = S the slope of a sample's likelihood in a is ⟨w_t, A_t⟩, w_t = ½(u u' - S⁻¹ - diag(uz - 1)), u = S⁻¹z,
    and A the mean of zz' - S over the past, with memory b. With the sum of its squares as the information, L_c rises
    by (Σ slope)²/(2·Σ slope²) at most: a start at each maximum of that over b.
    """
    from scipy.signal import lfilter

    inverse = np.linalg.inv(target)
    u = z @ inverse
    weight = 0.5 * (u[:, :, None] * u[:, None, :] - inverse)
    index = np.arange(len(target))
    weight[:, index, index] -= 0.5 * (u * z - 1)
    past = z[:, :, None] * z[:, None, :] - target
    slopes = [np.sum(weight * lfilter([0.0, 1.0], [1.0, -b], past, axis=0), axis=(1, 2)) for b in RIM]
    rise, square = (np.array([np.sum(one**power) for one in slopes]) for power in (1, 2))
    promise = np.divide(rise**2, 2 * square, out=np.zeros(len(RIM)), where=rise > 0)
    padded = np.concatenate([[-np.inf], promise, [-np.inf]])
    peaks = (promise > padded[:-2]) & (promise >= padded[2:]) & (promise > 0)
    return [(min(rise[k] / square[k], (1 - RIM[k]) / 2), RIM[k]) for k in np.flatnonzero(peaks)]


def _hessian_stderr(z: np.ndarray, a: float, b: float, target: np.ndarray) -> np.ndarray:
    """Square roots of the diagonal of the inverse negative Hessian, by central differences of the gradient."""
    hessian = np.empty((2, 2))
    room = min(a, b, (1 - a - b) / 2)
    step = min(HESSIAN_STEP, room / 2)
    for j, move in enumerate(np.eye(2) * step):
        _, above = dcc_score(z, a + move[0], b + move[1], target)
        _, below = dcc_score(z, a - move[0], b - move[1], target)
        hessian[:, j] = -(above - below) / (2 * step)
    return _root_of_diagonal(np.linalg.pinv((hessian + hessian.T) / 2))


def _root_of_diagonal(covariance: np.ndarray) -> np.ndarray:
    diagonal = np.diagonal(covariance)
    return np.where(diagonal > 0, np.sqrt(np.abs(diagonal)), np.nan)


class _Margins:
    """The GARCH margins as pymgarch's two_stage_vcov asks for them, each in units of its own mean square."""

    def __init__(self, r: np.ndarray, margins: GarchFit, z: np.ndarray) -> None:
        scale = np.mean(np.square(r), axis=0)
        self._e = r / np.sqrt(scale)
        self._parameters = np.stack([margins.omega / scale, margins.alpha, margins.beta], axis=1)
        self.std_resid = z
        self.nobs, self.nassets = r.shape
        self.total_params = self._parameters.size

    def n_params(self, _series: int) -> int:
        return 3

    def full_params(self, series: int) -> Floats:
        parameters: Floats = self._parameters[series].copy()
        return parameters

    def per_obs_loglik(self, series: int, parameters: Floats) -> Floats:
        variance = self._variance(series, parameters)
        likelihood: Floats = -0.5 * (np.log(2 * np.pi) + np.log(variance) + np.square(self._e[:, series]) / variance)
        return likelihood

    def std_resid_at(self, series: int, parameters: Floats) -> Floats:
        residual: Floats = self._e[:, series] / np.sqrt(self._variance(series, parameters))
        return residual

    def _variance(self, series: int, parameters: np.ndarray) -> np.ndarray:
        omega, alpha, beta = parameters[:, None]
        return garch_variance(self._e[:, [series]], omega, alpha, beta)[:, 0]


@dataclass(frozen=True)
class _SecondStage:
    """The second-stage fit as pymgarch's two_stage_vcov asks for it."""

    params: np.ndarray
    layout: object


def _two_step_stderr(
    r: np.ndarray, margins: GarchFit, z: np.ndarray, a: float, b: float, target: np.ndarray
) -> np.ndarray:
    """Robust standard errors of (a, b) that count the estimation of the margins (Engle & Sheppard 2001)."""
    from pymgarch.estimation import ParamLayout
    from pymgarch.inference import two_stage_vcov

    def likelihood(x: np.ndarray, moved: np.ndarray) -> np.ndarray | None:
        try:
            return dcc_log_likelihood(moved, float(x[0]), float(x[1]), target)
        except np.linalg.LinAlgError:
            return None

    stage = _SecondStage(np.array([a, b]), ParamLayout(asymmetric=False, studentt=False))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            found = two_stage_vcov(_Margins(r, margins, z), stage, llt_fn=likelihood)
        except RuntimeError:
            return np.full(2, np.nan)
    # Its fallback for a singular matrix ignores the margins: not the figure that was asked for.
    return found["se"] if found["method"] == "two-stage-robust" else np.full(2, np.nan)


def fit_by_pymgarch(z: np.ndarray) -> tuple[float, float, float]:
    """(a, b, L_c) by pymgarch's own stage-2 fit of z [T, N]: slow, independent of the code above."""
    from pymgarch.estimation import ParamLayout, fit_stage2

    z = np.ascontiguousarray(z, dtype=float)
    fit = fit_stage2(z, ParamLayout(asymmetric=False, studentt=False))
    constant = 0.5 * (z.size * np.log(2 * np.pi) + np.sum(np.square(z)))
    return float(fit.params[0]), float(fit.params[1]), float(fit.llt.sum() + constant)
