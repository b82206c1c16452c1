"""GARCH(1,1) of windows of 360 samples, against arch and multigarch."""

from __future__ import annotations

import warnings
from importlib.metadata import version

import numpy as np

from benchmarks.contest import Accuracy, Contest, Rival, Side
from benchmarks.limits import arithmetic
from benchmarks.series import GYROS, WINDOW, dcc_windows
from vgyro import engine
from vgyro.engine.recursions import garch_log_likelihood, garch_variance

TOLERANCE = 1e-6 * WINDOW
# A pass over a series for the likelihood: h = ω + αe² + βh is 4 operations, Σ log h as a running product 1, Σ e²/h 1
# and a division. With gradient and Hessian: derivatives of h, three first and three second, and their sums, about 45.
PASS, NEWTON = 6, 45
# The grid of starts, and a usual number of passes of all searches together; one division serves two samples.
GRID, STEPS = 32, 12


def contests(quick: bool) -> list[Contest]:
    """One contest: all our windows in one call, the libraries series by series, as their interfaces want it."""
    windows, slow = (100, 10) if quick else (1000, 60)
    r = dcc_windows(windows, seed=11)
    series = [np.ascontiguousarray(r[k, :, i]) for k in range(slow // GYROS + 1) for i in range(GYROS)][:slow]
    native = engine.get("native").garch
    ours = Side("vgyro", lambda: native.fit_garch_windows(r), windows * GYROS)
    arch = Side(f"arch {version('arch')}", lambda: [fit_arch(one) for one in series], slow)
    multigarch = Side(f"multigarch {version('multigarch')}", lambda: [fit_multigarch(one) for one in series], slow)

    def accuracy() -> list[Accuracy]:
        found = native.fit_garch_windows(r)
        parameters = np.stack([found.omega, found.alpha, found.beta], axis=-1).reshape(-1, 3)[:slow]
        mine = np.array([log_likelihood(one, p) for one, p in zip(series, parameters, strict=True)])
        figures = []
        for name, fit in (("arch", fit_arch), ("multigarch", fit_multigarch)):
            theirs = np.array([log_likelihood(one, fit(one)) for one in series])
            figures += both_ways(name, mine, theirs, TOLERANCE)
        return figures

    passes = GRID * PASS + STEPS * NEWTON
    limit = arithmetic(WINDOW * passes, WINDOW * (GRID + STEPS) / 2)
    return [
        Contest(
            "garch", "GARCH(1,1), T = 360, many starts", "fit", ours, (Rival(arch, 300), Rival(multigarch, 10)), limit,
            accuracy,
        )
    ]  # fmt: skip


def both_ways(name: str, ours: np.ndarray, theirs: np.ndarray, tolerance: float) -> list[Accuracy]:
    """How much worse ours is at worst, which is judged, and how much worse theirs is, which is shown."""
    return [
        Accuracy(f"log-likelihood, {name} − ours, greatest", float(np.max(theirs - ours)), tolerance),
        Accuracy(f"log-likelihood, ours − {name}, greatest", float(np.max(ours - theirs))),
    ]


def fit_arch(e: np.ndarray) -> np.ndarray:
    """(ω, α, β) by arch: its own default start, our first variance (backcast = mean(e²))."""
    from arch import arch_model

    model = arch_model(e, mean="Zero", vol="GARCH", p=1, q=1, rescale=False)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        result = model.fit(disp="off", show_warning=False, backcast=float(np.mean(e**2)))
    return np.asarray(result.params, dtype=float)


def fit_multigarch(e: np.ndarray) -> np.ndarray:
    """(ω, α, β) by multigarch: two starts, in compiled code; its first variance is its own."""
    from multigarch import GARCH

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model = GARCH().fit(e)
    return np.array([model.omega, model.alpha[0], model.beta[0]])


def log_likelihood(e: np.ndarray, parameters: np.ndarray) -> float:
    """One yardstick for all: the likelihood of vgyro's convention, in NumPy."""
    omega, alpha, beta = (np.array([value]) for value in parameters)
    return float(garch_log_likelihood(e[:, None], garch_variance(e[:, None], omega, alpha, beta))[0])
