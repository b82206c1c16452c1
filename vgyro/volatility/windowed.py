"""One window of an array, some gyros of which may have no model: the fits of those that have."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vgyro.config import Definition
from vgyro.engine.models import ONE_GYRO, TOO_SHORT, DccFit, GarchFit
from vgyro.volatility.dcc import Test, constant_correlation_test, fit_dcc
from vgyro.volatility.garch import garch_from_parameters
from vgyro.volatility.series import window_residuals
from vgyro.volatility.stretches import Window

MIN_SAMPLES = 50
"""A stretch with fewer samples is not fitted at all."""


@dataclass(frozen=True)
class ArrayDcc:
    """DCC of the gyros that have a GARCH model.

    fit  : its target has all N gyros, NaN for those without a model; its correlation only those with one
    test : constant-correlation test of the same standardised residuals
    """

    fit: DccFit
    test: Test


def fitted_residuals(
    values: np.ndarray, window: Window, definition: Definition, span: int = 15, segment_start: int | None = None
) -> np.ndarray:
    """r_t that the models of a window are fitted to, [T, N] deg/s.

    As window_residuals, but without the first sample where it has no difference, and zero throughout for a gyro whose
    output does not change in the window: whatever is subtracted from it, it measures nothing, and its fit says so.
    """
    r = window_residuals(values, window, definition, span, segment_start=segment_start)
    if definition == "difference" and np.isnan(r[0]).all():
        r = r[1:]
    stuck = np.ptp(values[window.start : window.stop], axis=0) == 0
    return np.where(stuck, 0.0, r)


def fit_array_dcc(
    r: np.ndarray,
    omega: np.ndarray,
    alpha: np.ndarray,
    beta: np.ndarray,
    status: np.ndarray,
    engine: str = "reference",
    lags: int = 1,
) -> ArrayDcc:
    """Fit DCC(1,1) to the gyros that have a GARCH model, and test for constant correlation.

    r : [T, N] deg/s, of `fitted_residuals`;  omega (deg/s)², alpha, beta, status : [N], NaN for a gyro without a model
    lags : of the test
    """
    n = r.shape[1]
    gyros = np.isfinite(omega)
    target = np.full((n, n), np.nan)
    if not gyros.any():
        short = len(status) > 0 and bool(np.all(status == TOO_SHORT))
        return ArrayDcc(_no_fit(target, TOO_SHORT if short else ONE_GYRO), Test(np.nan, lags + 1, np.nan, np.nan))
    e = r[:, gyros]
    margins: GarchFit = garch_from_parameters(e, omega[gyros], alpha[gyros], beta[gyros], status[gyros])
    z = e / np.sqrt(margins.variance)
    fit = fit_dcc(z, engine, r=e, margins=margins)
    target[np.ix_(gyros, gyros)] = fit.target
    if fit.status == ONE_GYRO:
        fit = replace(fit, a=np.nan, b=np.nan, log_likelihood=np.nan, log_likelihood_ccc=np.nan)
    return ArrayDcc(replace(fit, target=target), constant_correlation_test(z, lags))


def _no_fit(target: np.ndarray, status: str) -> DccFit:
    nothing = np.full(2, np.nan)
    empty = np.empty((0, 0, 0))
    return DccFit(np.nan, np.nan, nothing, nothing, target, np.nan, np.nan, empty, status)
