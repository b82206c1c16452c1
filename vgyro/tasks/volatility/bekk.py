"""Bekk: CCC, DCC and both kinds of BEKK on a random sample of the rolling windows."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pyarrow as pa

from vgyro import engine as engines
from vgyro.config import CrossCheckOptions, Definition
from vgyro.engine.models import BOUNDARY_MARGIN, CONVERGED
from vgyro.storage.tables import write_table
from vgyro.tasks.common import Task, run_task
from vgyro.tasks.volatility.columns import place_columns
from vgyro.tasks.volatility.layout import dcc_row, garch_rows
from vgyro.tasks.volatility.stored import ArraySeries, open_series, stored_model
from vgyro.volatility.bekk import BekkFit, bekk_covariance, fit_bekk
from vgyro.volatility.rolling import WindowModels
from vgyro.volatility.series import window_residuals
from vgyro.volatility.stretches import Window

SECTIONS = ("board", "engine", "volatility", "crosscheck")

FEWEST_GYROS = 2


@dataclass(frozen=True)
class BekkRow:
    """A row of bekk.parquet."""

    window: int
    start: int
    stop: int
    time_start: float
    time_stop: float
    definition: str
    model: str
    parameters: int
    log_likelihood: float
    bic: float
    sigma: float
    status: str


@dataclass(frozen=True)
class Sample:
    """One window as its models see it.

    r [T + ahead, n] : r_t of the gyros that have a GARCH model, deg/s: T samples of the window and those after it
    inside : T;  likelihood, status [n] : of the margins;  model : GARCH and DCC as stored, of all gyros;  gyros [N]
    place  : the columns that say where the window is
    """

    r: np.ndarray
    inside: int
    likelihood: np.ndarray
    status: np.ndarray
    model: WindowModels
    gyros: np.ndarray
    place: dict[str, Any]

    @property
    def fitted(self) -> np.ndarray:
        """r_t of the window itself."""
        return self.r[: self.inside]


def main(task: Task) -> None:
    """inputs : series; garch, dcc, of every definition of r_t, each in its folder;  outputs : bekk

    options : as open_series without definition; analysis.crosscheck
    Each definition has the same windows, those with a whole step after them first.
    """
    options = task.section("crosscheck", CrossCheckOptions)
    rows: list[BekkRow] = []
    dcc = {path.parent.name: path for path in task.inputs.get("dcc", [])}
    for garch in task.inputs.get("garch", []):
        definition = garch.parent.name
        if definition not in get_args(Definition):
            raise ValueError(f"{garch} is not in the folder of a definition")
        array = open_series(replace(task, options={**task.options, "definition": definition}))
        for number in chosen_windows(array, options.windows, options.seed):
            logging.info("window %d of %s", number, definition)
            rows += window_rows(array, garch, dcc[definition], number)
    write_table(task.output("bekk"), table_of(rows), "bekk", task.provenance())


def chosen_windows(array: ArraySeries, count: int, seed: int) -> list[int]:
    """Numbers of `count` random windows, in order."""
    plan = array.plan
    whole = np.flatnonzero(plan.start + plan.length + plan.step <= plan.stretch_stop)
    eligible = whole if len(whole) else np.arange(len(plan))
    found = np.random.default_rng(seed).permutation(eligible)[:count]
    return sorted(found.tolist())


def window_rows(array: ArraySeries, garch: Path, dcc: Path, number: int) -> Iterator[BekkRow]:
    """A row a model of one window; none where fewer than two gyros have a GARCH model."""
    sample = read_sample(array, garch, dcc, number)
    if sample.gyros.sum() < FEWEST_GYROS:
        return
    yield from engine_rows(array, sample, dcc, number)
    scalar = fit_bekk(sample.fitted)
    for fit in (scalar, fit_bekk(sample.fitted, "diagonal", scalar=scalar)):
        name = f"bekk_{fit.kind}"
        yield _row(array, sample, name, fit.parameters, fit.log_likelihood, bekk_sigma(sample, fit, array), fit.status)


def read_sample(array: ArraySeries, garch: Path, dcc: Path, number: int) -> Sample:
    """A window, the samples of the step after it, and its fits."""
    window, plan = array.window(number), array.plan
    model = stored_model(array, garch, dcc, number)
    gyros = np.isfinite(model.omega[0])
    stored = garch_rows(garch, ["log_likelihood", "status"], number, len(array.gyros))
    begin, stop = int(plan.stretch_start[number]), min(window.stop + plan.step, int(plan.stretch_stop[number]))
    first = max(begin, window.start - 1)
    values, time = array.table(first, stop)
    here = Window(window.start - first, window.stop - first)
    span, ahead = array.options.residual_span, stop - window.stop
    r = window_residuals(values, here, array.definition, span, ahead, begin - first)[:, gyros]
    # The first difference of a stretch is not known.
    lost = int(np.isnan(r[:1]).any())
    # A gyro with a model may lack values after its window: no shock, as in its weights.
    r[window.length :] = np.nan_to_num(r[window.length :])
    place = place_columns(np.array([number]), np.array([window.start]), window.length, time, first)
    return Sample(
        r[lost:], window.length - lost, stored["log_likelihood"][gyros], stored["status"][gyros], model, gyros,
        {name: column[0].item() for name, column in place.items()},
    )  # fmt: skip


def engine_rows(array: ArraySeries, sample: Sample, dcc: Path, number: int) -> Iterator[BekkRow]:
    """CCC and DCC, as they are stored: the margins' log-likelihoods and that of the correlation."""
    n = int(sample.gyros.sum())
    stored = dcc_row(dcc, ["log_likelihood", "log_likelihood_ccc", "status"], number)
    margins = float(sample.likelihood.sum())
    steady = CONVERGED if (sample.status == CONVERGED).all() else BOUNDARY_MARGIN
    for name, column, own, status in (
        ("ccc", "log_likelihood_ccc", 0, steady),
        ("dcc", "log_likelihood", 2, str(stored["status"][0])),
    ):
        parameters = 3 * n + n * (n - 1) // 2 + own
        likelihood = margins + float(stored[column][0])
        yield _row(array, sample, name, parameters, likelihood, engine_sigma(sample, array, dynamic=own > 0), status)


def engine_sigma(sample: Sample, array: ArraySeries, *, dynamic: bool) -> float:
    """r.m.s. of the fused r_t after the window by the weights of DCC, or of CCC; deg/s."""
    model, some = sample.model, np.ix_(np.array([0]), sample.gyros)
    if len(sample.r) == sample.inside:
        return math.nan
    target = model.target[0][np.ix_(sample.gyros, sample.gyros)]
    found = engines.get(array.engine).weights.conditional_weights(
        sample.r[None], sample.inside, model.omega[some], model.alpha[some], model.beta[some],
        model.a * dynamic, model.b * dynamic, target[None], sample.inside, len(sample.r),
    )  # fmt: skip
    return _fused(sample, found.weights[0]) if found.good.all() else math.nan


def bekk_sigma(sample: Sample, fit: BekkFit, array: ArraySeries) -> float:
    """r.m.s. of the fused r_t after the window by the weights of BEKK, its state carried on; deg/s."""
    if not np.isfinite(fit.log_likelihood) or len(sample.r) == sample.inside:
        return math.nan
    H = bekk_covariance(sample.r, fit.constant, fit.a, fit.b, fit.covariance[0])[sample.inside :]
    weights = engines.get(array.engine).weights.min_variance_weights(H)
    return _fused(sample, weights) if np.isfinite(weights).all() else math.nan


def _fused(sample: Sample, weights: np.ndarray) -> float:
    """r.m.s. about zero, which is the mean of every one of these models."""
    return float(np.sqrt(np.mean(np.square(np.sum(weights * sample.r[sample.inside :], axis=1)))))


def _row(
    array: ArraySeries, sample: Sample, model: str, parameters: int, likelihood: float, sigma: float, status: str
) -> BekkRow:
    bic = parameters * math.log(sample.inside) - 2 * likelihood
    return BekkRow(
        **sample.place, definition=str(array.definition), model=model, parameters=parameters,
        log_likelihood=likelihood, bic=bic, sigma=sigma, status=status,
    )  # fmt: skip


def table_of(rows: list[BekkRow]) -> pa.Table:
    """Rows → table; without rows, too, the columns have their types."""
    kinds = {"str": pa.string(), "int": pa.int64(), "float": pa.float64()}
    schema = pa.schema([(field.name, kinds[str(field.type)]) for field in fields(BekkRow)])
    return pa.Table.from_pylist([asdict(row) for row in rows], schema=schema)


if __name__ == "__main__":
    run_task(main)
