"""DCC(1,1) of 6 gyros and 360 samples with its margins, against multigarch and pymgarch."""

from __future__ import annotations

import warnings
from importlib.metadata import version

import numpy as np

from benchmarks.contest import Accuracy, Contest, Rival, Side
from benchmarks.garch import GRID, NEWTON, PASS, STEPS, both_ways
from benchmarks.limits import arithmetic
from benchmarks.series import GYROS, WINDOW, dcc_windows
from vgyro import engine
from vgyro.engine.models import CONVERGED, GARCH_STATUSES, DccWindows, GarchWindows
from vgyro.engine.recursions import correlation_target, dcc_log_likelihood, garch_variance

TOLERANCE = 1e-6 * WINDOW
STDERR_TOLERANCE = 0.02
# Of one sample: Q and its two slopes 3·3·21, Cholesky 70, inverse 110, the products with z and the traces 150.
EVALUATION = 520
EVALUATIONS = 12


def contests(quick: bool) -> list[Contest]:
    """Both contests; ours does the two-step standard errors in each, multigarch has none."""
    windows, slow = (24, 3) if quick else (240, 12)
    r = dcc_windows(windows, seed=12)
    ours = Side("vgyro", lambda: fit_ours(r), windows)
    multigarch = Side(f"multigarch {version('multigarch')}", lambda: [fit_multigarch(w) for w in r[:slow]], slow)
    few = 1 if quick else 2
    pymgarch = Side(f"pymgarch {version('pymgarch')}", lambda: [fit_pymgarch(w) for w in r[:few]], few)
    margins = GYROS * WINDOW * (GRID * PASS + STEPS * NEWTON)
    divisions = GYROS * WINDOW * (GRID + STEPS) / 2 + WINDOW * EVALUATIONS * 2 * GYROS
    limit = arithmetic(margins + WINDOW * EVALUATIONS * EVALUATION, divisions)
    note = "ours includes the two-step standard errors and the test of constant correlation"
    return [
        Contest(
            "dcc", "DCC(1,1), 6 × 360, with margins", "fit", ours, (Rival(multigarch, 15),), limit,
            lambda: against_multigarch(r[:slow]), note,
        ),
        Contest(
            "dcc_stderr", "DCC(1,1), 6 × 360, margins and two-step s.e.", "fit", ours, (Rival(pymgarch, 150),), limit,
            lambda: against_pymgarch(r[:few]), note,
        ),
    ]  # fmt: skip


def fit_ours(r: np.ndarray) -> tuple[GarchWindows, DccWindows]:
    """Margins, then the correlation of all windows."""
    native = engine.get("native")
    margins = native.garch.fit_garch_windows(r)
    fit = native.dcc.fit_dcc_windows(r, margins.omega, margins.alpha, margins.beta, margins.status)
    return margins, fit


def fit_multigarch(r: np.ndarray) -> tuple[float, float]:
    """(a, b) by multigarch, one thread."""
    from multigarch import DCC

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model = DCC(n_jobs=1).fit(r)
    return float(model.a), float(model.b)


def fit_pymgarch(r: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(a, b), their two-step standard errors and the standardised residuals, by pymgarch with margins of mean zero."""
    import pymgarch
    from pymgarch.marginals import MarginalSet

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = pymgarch.DCC().fit(r, marginals=_margins(r))
    assert isinstance(found.mset, MarginalSet)
    return np.asarray(found.psi), np.asarray(found.se), np.asarray(found.eps)


def _margins(r: np.ndarray) -> list:
    from arch import arch_model

    models = [arch_model(e, mean="Zero", vol="GARCH", p=1, q=1, rescale=False) for e in r.T]
    return [
        model.fit(disp="off", show_warning=False, backcast=float(np.mean(e**2)))
        for model, e in zip(models, r.T, strict=True)
    ]


def against_multigarch(r: np.ndarray) -> list[Accuracy]:
    """Correlation likelihood of both (a, b), given our margins."""
    margins, fit = fit_ours(r)
    mine, theirs = [], []
    for k, window in enumerate(r):
        z = standardised(window, margins, k)
        mine.append(correlation_likelihood(z, float(fit.a[k]), float(fit.b[k])))
        theirs.append(correlation_likelihood(z, *fit_multigarch(window)))
    return both_ways("multigarch", np.array(mine), np.array(theirs), TOLERANCE)


def against_pymgarch(r: np.ndarray) -> list[Accuracy]:
    """Correlation likelihood given our margins, and the standard errors where the margins have them."""
    margins, fit = fit_ours(r)
    mine, theirs, errors = [], [], []
    for k, window in enumerate(r):
        z = standardised(window, margins, k)
        parameters, stderr, _ = fit_pymgarch(window)
        mine.append(correlation_likelihood(z, float(fit.a[k]), float(fit.b[k])))
        theirs.append(correlation_likelihood(z, float(parameters[0]), float(parameters[1])))
        if np.all(margins.status[k] == GARCH_STATUSES.index(CONVERGED)) and np.isfinite(fit.stderr[k]).all():
            errors.append(np.max(np.abs(fit.stderr[k] / stderr - 1)))
    figures = both_ways("pymgarch", np.array(mine), np.array(theirs), TOLERANCE)
    if errors:
        figures.append(Accuracy("standard errors, largest relative difference", float(max(errors)), STDERR_TOLERANCE))
    return figures


def standardised(r: np.ndarray, margins: GarchWindows, window: int) -> np.ndarray:
    """z = r/√h of one window, by the recursion in NumPy."""
    return r / np.sqrt(garch_variance(r, margins.omega[window], margins.alpha[window], margins.beta[window]))


def correlation_likelihood(z: np.ndarray, a: float, b: float) -> float:
    """L_c of vgyro's convention, in NumPy."""
    return float(dcc_log_likelihood(z, a, b, correlation_target(z)).sum())
