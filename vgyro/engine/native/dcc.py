"""DCC(1,1) in C: four quarters of a window in lockstep, BFGS over the triangle of (a, b), exact adjoint gradients."""

from __future__ import annotations

import numpy as np

from vgyro.engine.constant import constant_fit, fit_ccc, without_variance
from vgyro.engine.models import (
    BOUNDARY_MARGIN,
    CONVERGED,
    DCC_STATUSES,
    EIGENVALUE_MIN,
    FAILED,
    NO_VARIANCE,
    NOT_POSITIVE_DEFINITE,
    ONE_GYRO,
    PERSISTENCE_MAX,
    TOO_SHORT,
    DccFit,
    DccWindows,
    GarchFit,
)
from vgyro.engine.native import _dcc, pool
from vgyro.engine.recursions import dcc_correlation
from vgyro.engine.status import FLAT, GAIN, MIN_SAMPLES, PIVOT_MIN, dcc_code, dcc_status_codes, garch_code
from vgyro.errors import EngineError

__all__ = ["fit_ccc", "fit_dcc", "fit_dcc_windows"]

PIECE = 64
"""Windows a thread takes at a time."""
STATES = np.array(
    [dcc_code(status) for status in (CONVERGED, FAILED, NOT_POSITIVE_DEFINITE, NO_VARIANCE)], dtype=np.uint8
)
"""Status of a window by its state in c/dcc.h."""


def fit_dcc_windows(
    r: np.ndarray, omega: np.ndarray, alpha: np.ndarray, beta: np.ndarray, status: np.ndarray, lags: int = 1
) -> DccWindows:
    """As vgyro.engine.protocols.volatility.DccEngine.fit_dcc_windows; at most 32 series."""
    r = np.ascontiguousarray(r, dtype=float)
    margins = np.stack([np.asarray(part, dtype=float) for part in (omega, alpha, beta)])
    return _fit(r, margins, np.asarray(status), lags)


def fit_dcc(z: np.ndarray, r: np.ndarray | None = None, margins: GarchFit | None = None) -> DccFit:
    """As vgyro.engine.protocols.volatility.DccEngine.fit_dcc; at most 32 series."""
    z = np.ascontiguousarray(z, dtype=float)
    n = z.shape[1]
    known = np.full((1, n), garch_code(CONVERGED), dtype=np.uint8)
    found = _fit(z[None], None, known, 1)
    status = DCC_STATUSES[found.status[0]]
    if status == NO_VARIANCE and not without_variance(z, r):
        status = FAILED
    a, b, target = float(found.a[0]), float(found.b[0]), found.target[0]
    if a == 0:
        return constant_fit(z, target, status)
    hessian, robust = found.stderr_hessian, np.full((1, 2), np.nan)
    if margins is not None and r is not None:
        parameters = np.stack([margins.omega, margins.alpha, margins.beta])[:, None]
        codes = np.array([[garch_code(name) for name in margins.status]], dtype=np.uint8)
        status = DCC_STATUSES[dcc_status_codes(found.a, found.b, codes)[0]]
        series = np.ascontiguousarray(r, dtype=float)[None]
        hessian, robust = _errors(series, parameters, found.a, found.b, np.array([dcc_code(status)]))
    return DccFit(
        a=a,
        b=b,
        stderr=robust[0],
        stderr_hessian=hessian[0],
        target=target,
        log_likelihood=float(found.log_likelihood[0]),
        log_likelihood_ccc=float(found.log_likelihood_ccc[0]),
        correlation=dcc_correlation(z, a, b, target),
        status=status,
    )


def _fit(series: np.ndarray, margins: np.ndarray | None, margin_codes: np.ndarray, lags: int) -> DccWindows:
    """Series are r where there are margins [3, K, N], else z."""
    count, samples, n = series.shape
    if n > _dcc.MAX_SERIES:
        raise EngineError(f"DCC of {n} series", remedy=f"The native engine takes at most {_dcc.MAX_SERIES}")
    values, target = np.zeros((count, 5)), np.tile(np.eye(n), (count, 1, 1))
    values[:, 4] = np.nan
    state = np.zeros(count, dtype=np.uint8)
    if n < 2 or samples < max(MIN_SAMPLES, n + 2):
        codes = np.full(count, dcc_code(ONE_GYRO if n < 2 else TOO_SHORT), dtype=np.uint8)
    elif count == 0:
        codes = state
    else:
        windows = _dcc.Windows(series, margins)
        rules = {
            "persistence_max": PERSISTENCE_MAX, "eigenvalue_min": EIGENVALUE_MIN, "gain": GAIN, "flat": FLAT,
            "pivot_min": PIVOT_MIN, "lags": lags,
        }  # fmt: skip
        pool.run(lambda start, stop: windows.fit(rules, values, target, state, start, stop), count, PIECE)
        codes = np.where(state == 0, dcc_status_codes(values[:, 0], values[:, 1], margin_codes), STATES[state])
    a, b, likelihood, constant, statistic = np.ascontiguousarray(values.T)
    unknown = np.isin(codes, [dcc_code(FAILED), dcc_code(NO_VARIANCE)])
    likelihood[unknown] = constant[unknown] = np.nan
    hessian, robust = _errors(series, margins, a, b, codes)
    return DccWindows(a, b, robust, hessian, target, likelihood, constant, statistic, codes)


def _errors(
    series: np.ndarray, margins: np.ndarray | None, a: np.ndarray, b: np.ndarray, codes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Inverse-Hessian and two-step standard errors [K, 2] of the windows whose status has them."""
    converged = codes == dcc_code(CONVERGED)
    wanted = np.where(converged, 1 if margins is None else 2, codes == dcc_code(BOUNDARY_MARGIN)).astype(np.uint8)
    hessian, robust = np.full((2, len(codes), 2), np.nan)
    if wanted.any():
        windows, optimum = _dcc.Windows(series, margins), np.stack([a, b], axis=1)
        pool.run(lambda start, stop: windows.errors(optimum, wanted, hessian, robust, start, stop), len(codes), PIECE)
    return hessian, robust
