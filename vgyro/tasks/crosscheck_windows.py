"""Cross-check of rolling windows: GARCH maximised again on a grid, weights again from the stored parameters."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from vgyro.engine.independent import nnls_weights
from vgyro.engine.models import ALPHA_ZERO, CONVERGED
from vgyro.storage.tables import read_columns
from vgyro.tasks.common import Task
from vgyro.tasks.crosscheck_rows import Row, compare
from vgyro.tasks.volatility_series import WHOLE, ArraySeries, open_series
from vgyro.tasks.weights import stored_models
from vgyro.volatility.check import covariance_after, greatest_log_likelihood
from vgyro.volatility.rolling import ModelWindow

# Log-likelihood. At the boundary α = 0 leaves β without a meaning, and along β runs a ridge of nearly equal likelihood;
# half a unit is far below the 1.92 that would tell two models apart at 5 %.
GARCH_TOLERANCE = {CONVERGED: 0.01, ALPHA_ZERO: 0.5}
WEIGHT_TOLERANCE = 1e-8


def window_rows(task: Task, gyros: list[str], count: int, rng: np.random.Generator) -> Iterator[Row]:
    """Compare `count` random windows, of all definitions of r_t."""
    paths = {
        name: {path.parent.name: path for path in task.inputs.get(name, [])} for name in ("garch", "dcc", "weights")
    }
    opened: dict[str, ArraySeries] = {}
    for definition in sorted(paths["garch"]):
        opened[definition] = open_series(replace(task, options={**task.options, "definition": definition}))
    pairs = [(name, number) for name, array in opened.items() for number, _ in array.jobs if number != WHOLE]
    for index in np.sort(rng.permutation(len(pairs))[:count]):
        definition, number = pairs[index]
        array = opened[definition]
        yield from garch_rows(array, paths["garch"][definition], number)
        if len(gyros) > 1:
            models = stored_models(array, paths["garch"][definition], paths["dcc"][definition])
            yield from weight_rows(array, paths["weights"][definition], number, models)


def garch_rows(array: ArraySeries, path: Path, number: int) -> Iterator[Row]:
    """Greatest log-likelihood of each gyro in one window."""
    table = read_columns(path, ["window", "gyro", "log_likelihood", "status"])
    r = array.residuals(dict(array.jobs)[number])
    for row in np.flatnonzero(table["window"] == number):
        status, gyro = str(table["status"][row]), str(table["gyro"][row])
        if status not in GARCH_TOLERANCE:
            continue
        theirs = greatest_log_likelihood(r[:, array.gyros.index(gyro)])
        check = f"GARCH log-likelihood [{array.definition}], {status}"
        ours = float(table["log_likelihood"][row])
        yield compare(check, "dense grid and scipy", number, gyro, ours, theirs, GARCH_TOLERANCE[status], "1")


def weight_rows(array: ArraySeries, path: Path, number: int, models: list[ModelWindow]) -> Iterator[Row]:
    """Weights of the last sample of a window (in-sample) and of the first one after it (causal)."""
    window = dict(array.jobs)[number]
    model = next(model for model in models if model.window == window)
    gyros = np.isfinite(model.omega)
    if gyros.sum() < 2:
        return
    r = array.residuals(window)[:, gyros]
    target = model.target[np.ix_(gyros, gyros)]
    rows = read_columns(path)
    for name, a, b in (("dcc", model.a, model.b), ("ccc", 0.0, 0.0)):
        last, following = covariance_after(r, model.omega[gyros], model.alpha[gyros], model.beta[gyros], a, b, target)
        for mode, sample, H in (("in_sample", window.stop - 1, last), ("causal", window.stop, following)):
            chosen = np.flatnonzero((rows["model"] == name) & (rows["mode"] == mode))
            in_stretch = sample < len(chosen) and array.series.stretch[sample] == array.series.stretch[window.start]
            if not in_stretch or not np.isfinite(rows["sigma"][chosen[sample]]):
                continue
            theirs = np.zeros(len(gyros))
            theirs[gyros] = nnls_weights(H)
            ours = np.array([rows[f"w_{gyro}"][chosen[sample]] for gyro in array.gyros])
            series = f"{name}_{mode}[{array.definition}]"
            check = "weights, the gyro that differs most"
            yield compare(check, "loops and scipy.optimize.nnls", number, series, ours, theirs, WEIGHT_TOLERANCE, "1")
