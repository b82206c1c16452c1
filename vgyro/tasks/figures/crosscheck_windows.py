"""Cross-check of rolling windows: fitted and weighed again by the other engine, and by plain independent routes."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import get_args

import numpy as np

from vgyro import engine as engines
from vgyro.config import Definition, Mode
from vgyro.engine.independent import nnls_weights
from vgyro.engine.models import NOT_POSITIVE_DEFINITE, OUTLIER_DOMINATED, DccModel
from vgyro.engine.recursions import correlation_target, dcc_log_likelihood, garch_log_likelihood, garch_variance
from vgyro.storage.tables import read_rows
from vgyro.tasks.common import Task
from vgyro.tasks.figures.crosscheck_rows import Check, CrosscheckRow, compare, compare_maximum
from vgyro.tasks.volatility import layout
from vgyro.tasks.volatility.stored import ArraySeries, open_series, stored_model
from vgyro.volatility.check import covariance_after, greatest_log_likelihood
from vgyro.volatility.rolling import WindowModels, rows_needed, weights_of_windows

# Log-likelihood a sample. A search may end on a lesser maximum now and then; 0.004 in a window of 360 samples is far
# below the 1.92 that tells two models apart.
MAXIMUM_TOLERANCE = 1e-5
# Of one likelihood at the same parameters, a sample: rounding only.
STORED_TOLERANCE = 1e-9
WEIGHT_TOLERANCE = 1e-8
# What the other engine is made of.
LIBRARIES = {
    "reference": {"garch": "arch", "dcc": "SciPy's SLSQP", "weights": "NumPy recursions and cvxpy"},
    "native": {"garch": "native engine", "dcc": "native engine", "weights": "native engine"},
}
LOOPS, GRID = "loops and scipy.optimize.nnls", "dense grid and SciPy"
NUMPY = "recursion in NumPy"


@dataclass(frozen=True)
class Fitted:
    """One definition's series and where its fits are."""

    array: ArraySeries
    garch: Path
    dcc: Path
    weights: Path

    @property
    def other(self) -> str:
        """The engine that did not make them."""
        return "native" if self.array.engine == "reference" else "reference"


def window_rows(task: Task, count: int, rng: np.random.Generator) -> Iterator[CrosscheckRow]:
    """Compare `count` random windows, of all definitions of r_t."""
    fitted = [_fitted(task, path) for path in sorted(task.inputs.get("garch", []))]
    first = np.cumsum([0, *(len(one.array.plan) for one in fitted)])
    chosen = rng.choice(first[-1], size=min(count, int(first[-1])), replace=False) if first[-1] else np.empty(0, int)
    for place in np.sort(chosen):
        index = int(np.searchsorted(first, place, side="right")) - 1
        one, number = fitted[index], int(place - first[index])
        logging.info("window %d of %s", number, one.array.definition)
        model = stored_model(one.array, one.garch, one.dcc, number)
        r = one.array.residuals(number)
        gyros = np.isfinite(model.omega[0])
        if gyros.any():
            yield from garch_rows(one, number, r)
        if gyros.sum() > 1:
            yield from dcc_rows(one, number, r[:, gyros], model, gyros)
            yield from loop_rows(one, number, r, model)
        if len(gyros) > 1:
            yield from weight_rows(one, number, model)


def _fitted(task: Task, garch: Path) -> Fitted:
    folder = garch.parent
    definition = folder.name
    if definition not in get_args(Definition):
        raise ValueError(f"{garch} is not in the folder of a definition")
    array = open_series(replace(task, options={**task.options, "definition": definition}))
    places = {name: {path.parent: path for path in task.inputs[name]} for name in ("dcc", "weights")}
    return Fitted(array, garch, places["dcc"][folder], places["weights"][folder])


def garch_rows(one: Fitted, number: int, r: np.ndarray) -> Iterator[CrosscheckRow]:
    """Each gyro's likelihood at our parameters: as stored, and against the greatest that others find."""
    definition = one.array.definition
    names = ["omega", "alpha", "beta", "log_likelihood", "status"]
    table = layout.garch_rows(one.garch, names, number, len(one.array.gyros))
    gyros = np.flatnonzero(np.isfinite(table["omega"]))
    e = r[:, gyros]
    ours = garch_log_likelihood(e, garch_variance(e, *(table[name][gyros] for name in names[:3])))
    check = f"GARCH log-likelihood as stored [{definition}], worst gyro"
    tolerance = STORED_TOLERANCE * len(r)
    yield compare(Check(check, NUMPY, number, "all gyros"), table["log_likelihood"][gyros], ours, tolerance, "1")
    theirs = engines.get(one.other).garch.fit_garch(e).log_likelihood
    for place, gyro in enumerate(gyros):
        name, likelihood = one.array.gyros[gyro], float(ours[place])
        status = table["status"][gyro]
        check = f"GARCH log-likelihood [{definition}], {status}"
        # One sample that dominates makes a likelihood of spikes at the bounds, which no search climbs for certain.
        tolerance = np.inf if status == OUTLIER_DOMINATED else MAXIMUM_TOLERANCE * len(r)
        yield compare_maximum(
            Check(check, LIBRARIES[one.other]["garch"], number, name), likelihood, float(theirs[place]), tolerance
        )
        yield compare_maximum(
            Check(check, GRID, number, name), likelihood, greatest_log_likelihood(e[:, place]), tolerance
        )


def dcc_rows(
    one: Fitted, number: int, r: np.ndarray, model: WindowModels, gyros: np.ndarray
) -> Iterator[CrosscheckRow]:
    """The correlation likelihood at our (a, b), given our margins: as stored, and against the other's maximum."""
    stored = layout.dcc_row(one.dcc, ["a", "b", "log_likelihood", "status"], number)
    a, b = float(stored["a"][0]), float(stored["b"][0])
    status = str(stored["status"][0])
    if status == NOT_POSITIVE_DEFINITE or not np.isfinite(stored["log_likelihood"][0]):
        return
    z = r / np.sqrt(garch_variance(r, model.omega[0, gyros], model.alpha[0, gyros], model.beta[0, gyros]))
    theirs = engines.get(one.other).dcc.fit_dcc(z)
    ours = float(dcc_log_likelihood(z, a, b, correlation_target(z)).sum())
    check, definition = "DCC log-likelihood", one.array.definition
    yield compare(
        Check(f"{check} as stored [{definition}]", NUMPY, number, "array"),
        stored["log_likelihood"][0],
        ours,
        STORED_TOLERANCE * len(r),
        "1",
    )
    yield compare_maximum(
        Check(f"{check} [{definition}], {status}", LIBRARIES[one.other]["dcc"], number, "array"),
        ours,
        theirs.log_likelihood,
        MAXIMUM_TOLERANCE * len(r),
    )


def weight_rows(one: Fitted, number: int, model: WindowModels) -> Iterator[CrosscheckRow]:
    """The weights of every sample that is this window's, from the stored parameters by the other engine."""
    array = one.array
    needed = rows_needed(model, array.plan.runs, array.options.step)
    values = array.rows(needed.start, needed.stop)
    for correlation in array.options.models:
        found = weights_of_windows(
            values, model, array.plan.runs, array.definition, array.options.modes, correlation, array.options.step,
            array.options.residual_span, one.other, needed.start, array.too_short,
        )  # fmt: skip
        for mode, theirs in found.items():
            if not len(theirs.weights):
                continue
            stop = theirs.begin + len(theirs.weights)
            ours = stored_weights(one, correlation, mode, theirs.begin, stop)[0]
            series = f"{correlation}_{mode}[{array.definition}]"
            check = f"weights, worst of {len(ours)} samples"
            against = LIBRARIES[one.other]["weights"]
            yield compare(Check(check, against, number, series), ours, theirs.weights, WEIGHT_TOLERANCE, "1")


def loop_rows(one: Fitted, number: int, r: np.ndarray, model: WindowModels) -> Iterator[CrosscheckRow]:
    """Weights of the last sample of a window (in-sample) and of the first one after it (causal), by plain loops."""
    array = one.array
    window, gyros = array.window(number), np.isfinite(model.omega[0])
    omega, alpha, beta = (values[0, gyros] for values in (model.omega, model.alpha, model.beta))
    target, stretch_stop = model.target[0][np.ix_(gyros, gyros)], int(array.plan.stretch_stop[number])
    for correlation in array.options.models:
        a, b = (float(model.a[0]), float(model.b[0])) if correlation == "dcc" else (0.0, 0.0)
        last, following = covariance_after(r[:, gyros], DccModel(omega, alpha, beta, a, b, target))
        places: dict[Mode, tuple[int, np.ndarray]] = {
            "in_sample": (window.stop - 1, last), "causal": (window.stop, following)
        }  # fmt: skip
        for mode in array.options.modes:
            sample, H = places[mode]
            if sample >= stretch_stop:
                continue
            ours, sigma = stored_weights(one, correlation, mode, sample, sample + 1)
            if not np.isfinite(sigma[0]):
                continue
            theirs = np.zeros(len(gyros))
            theirs[gyros] = nnls_weights(H)
            series = f"{correlation}_{mode}[{array.definition}]"
            yield compare(Check("weights, worst gyro", LOOPS, number, series), ours[0], theirs, WEIGHT_TOLERANCE, "1")


def stored_weights(one: Fitted, model: str, mode: str, start: int, stop: int) -> tuple[np.ndarray, np.ndarray]:
    """Weights [stop - start, N] and sigma of samples start to stop - 1, from their block of weights.parquet."""
    first = layout.weight_blocks(one.weights)[0][model, mode]
    names = [f"w_{gyro}" for gyro in one.array.gyros]
    rows = read_rows(one.weights, [*names, "sigma"], first + start, first + stop)
    return np.column_stack([rows[name] for name in names]), rows["sigma"]
