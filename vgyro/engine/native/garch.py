"""GARCH(1,1) by exact Newton from several starts, four series in lockstep: the kernels are in c/garch_kernels.h."""

from __future__ import annotations

import numpy as np

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
from vgyro.engine.native import _garch, pool

PIECE = 128
"""Series that one call of the kernel fits, a multiple of the lanes; fewer where the series are long."""
SCRATCH = 2**19
"""Samples that one call of the kernel may hold."""
LOG_2_PI = float(np.log(2 * np.pi))


def fit_garch_windows(r: np.ndarray) -> GarchWindows:
    """As vgyro.engine.protocols.volatility.GarchEngine.fit_garch_windows; a view of overlapping windows is not copied.

    A grid of 32 points (eight β, four α each, ω = 1 - α - β) and one step of scoring from the constant variance at
    each β show where searches begin: at the local optima along β. At eight more β the best trend of the variance with
    α = 0 shows where others begin. A series with an e² above 20 mean squares gets 32 points more, with ω off that
    line, and all its starts are tried. Each search is Newton's method with the analytic Hessian (Fiorentini, Calzolari
    & Panattoni 1996).
    """
    r = np.require(r, dtype=float, requirements="A")
    windows, samples, n = r.shape
    if samples < rules.MIN_SAMPLES or windows * n == 0:
        return _unfitted(windows, n)
    found = _search(r).reshape(windows, n)
    fitted = found["outcome"] == _garch.FITTED
    scale = np.where(fitted, found["mean_square"], np.nan)
    # Where next to nothing is gained, the simpler model: a constant variance.
    constant = 0.5 - found["cost"] < rules.GAIN
    parameters = np.where(constant[..., None], [1.0, 0.0, 0.0], found["parameters"])
    cost = np.where(constant, 0.5, found["cost"])
    omega, alpha, beta = np.moveaxis(np.where(fitted[..., None], parameters, np.nan), -1, 0).copy()
    status = rules.garch_status_codes(omega, alpha, beta, _outliers(r, found["largest_share"], fitted))
    status[found["outcome"] == _garch.FLAT] = rules.garch_code(NO_VARIANCE)
    status[found["outcome"] == _garch.FAILED] = rules.garch_code(FAILED)
    stderr = np.where((status == rules.garch_code(CONVERGED))[..., None], found["stderr"], np.nan)
    stderr[..., 0] *= scale
    likelihood = -0.5 * samples * (LOG_2_PI + np.log(scale) + 2 * cost)
    return GarchWindows(omega * scale, alpha, beta, stderr, likelihood, status)


def fit_garch(r: np.ndarray) -> GarchFit:
    """As vgyro.engine.protocols.volatility.GarchEngine.fit_garch: fit_garch_windows of one window."""
    r = np.require(r, dtype=float, requirements="A")
    fit = fit_garch_windows(r[None])
    omega, alpha, beta = fit.omega[0], fit.alpha[0], fit.beta[0]
    variance = np.empty(r.shape)
    if r.size:
        with np.errstate(over="ignore"):
            start = omega + (alpha + beta) * np.mean(np.square(r), axis=0)
        _garch.variance(r[None], start, omega, alpha, beta, variance)
    names = np.array(GARCH_STATUSES, dtype=object)[fit.status[0]]
    return GarchFit(omega, alpha, beta, fit.stderr[0], fit.log_likelihood[0], variance, names)


def _unfitted(windows: int, n: int) -> GarchWindows:
    nothing = np.full((windows, n), np.nan)
    status = np.full((windows, n), rules.garch_code(TOO_SHORT), dtype=np.uint8)
    return GarchWindows(nothing, nothing, nothing, np.full((windows, n, 3), np.nan), nothing, status)


def _search(r: np.ndarray) -> np.ndarray:
    """The optimum of every series of r [K, T, N] in units of its own mean square, [K·N] records of _garch.FIT."""
    windows, samples, n = r.shape
    found = np.zeros(windows * n, dtype=_garch.FIT)
    places = found.view(np.int8)

    def kernel(start: int, stop: int) -> None:
        _garch.fit(r, rules.OMEGA_MIN, PERSISTENCE_MAX, rules.FLAT, start, stop, places)

    pool.run(kernel, len(found), max(4, min(PIECE, SCRATCH // samples // 4 * 4)))
    return found


def _outliers(r: np.ndarray, largest_share: np.ndarray, fitted: np.ndarray) -> np.ndarray:
    """outlier_dominated of each series [K, N], asked only where one sample is large."""
    outlier = np.zeros(fitted.shape, dtype=bool)
    window, series = np.nonzero(fitted & (largest_share > rules.OUTLIER_SHARE))
    if len(window):
        outlier[window, series] = rules.outlier_dominated(r[window, :, series].T)
    return outlier
