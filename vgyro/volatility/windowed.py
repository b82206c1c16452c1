"""Windows of an array, some gyros of which may have no model: the fits of those that have."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from vgyro import engine as engines
from vgyro.config import Definition
from vgyro.engine.models import ONE_GYRO, TOO_SHORT, DccWindows, GarchWindows
from vgyro.engine.status import dcc_code, garch_code
from vgyro.volatility.series import window_residuals
from vgyro.volatility.stretches import Window

MIN_SAMPLES = 50
"""A stretch with fewer samples is not fitted at all."""


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


def fit_array_dcc_windows(r: np.ndarray, garch: GarchWindows, engine: str = "native", lags: int = 1) -> DccWindows:
    """In each of K windows: DCC(1,1) of the gyros that have a GARCH model, and the test of constant correlation.

    r            : [K, T, N] deg/s, of `fitted_residuals`
    garch        : its models; ω is NaN for a gyro without one
    engine, lags : name of the engine; lags of the test
    returns      : DccWindows; its target is NaN in the rows and columns of a gyro without a model. Of one gyro there is
                   no correlation: a, b NaN, status `one gyro`; likewise of none, or `too short` where that is why
    """
    count, _, n = r.shape
    omega, alpha, beta, status = garch.omega, garch.alpha, garch.beta, np.asarray(garch.status)
    found = _nothing(count, n)
    short = (status == garch_code(TOO_SHORT)).all(axis=1)
    found.status[:] = np.where(short, dcc_code(TOO_SHORT), dcc_code(ONE_GYRO))
    present = np.isfinite(omega)
    sets, place = np.unique(present, axis=0, return_inverse=True)
    for number, gyros in enumerate(sets):
        chosen, used = np.flatnonzero(place.ravel() == number), np.flatnonzero(gyros)
        if len(used) == 1:
            found.target[chosen, used, used] = 1.0
        if len(used) < 2:
            continue
        some = np.ix_(chosen, used)
        fit = engines.get(engine).dcc.fit_dcc_windows(
            # A copy of what the engine needs, and only where some gyro or window is left out.
            r if present.all() else r[chosen][:, :, used],
            omega[some], alpha[some], beta[some], status[some], lags,
        )  # fmt: skip
        found.target[np.ix_(chosen, used, used)] = fit.target
        for field in fields(DccWindows):
            if field.name != "target":
                getattr(found, field.name)[chosen] = getattr(fit, field.name)
    return found


def _nothing(count: int, n: int) -> DccWindows:
    def nan(*shape: int) -> np.ndarray:
        return np.full((count, *shape), np.nan)

    status = np.zeros(count, dtype=np.uint8)
    return DccWindows(nan(), nan(), nan(2), nan(2), nan(n, n), nan(), nan(), nan(), status)
