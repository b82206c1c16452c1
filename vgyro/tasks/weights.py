"""Weights: the minimum-variance weights of every sample of the volatility series, by model and mode."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from vgyro.config import CorrelationModel, Mode
from vgyro.engine.models import FAILED, NOT_POSITIVE_DEFINITE
from vgyro.fusion.weights import min_variance_weights, usable
from vgyro.storage.tables import TableWriter, read_columns
from vgyro.tasks.common import Task
from vgyro.tasks.volatility_series import WHOLE, ArraySeries, open_series, stored_garch
from vgyro.volatility.rolling import ModelWindow, RollingWeights, rolling_weights


def main(task: Task) -> None:
    """Read one array's rates and fits, weigh every sample, write weights.parquet."""
    array = open_series(task)
    models = stored_models(array, task.input("garch"), task.input("dcc"))
    with TableWriter(task.output("weights"), "weights", task.provenance()) as writer:
        for model in array.options.models:
            for mode in array.options.modes:
                found = weigh_series(array, models, model, mode)
                writer.append(columns_of(array, model, mode, found))
                logging.info("%s, %s: %d samples", model, mode, len(found.weights))


def weigh_series(array: ArraySeries, models: list[ModelWindow], model: CorrelationModel, mode: Mode) -> RollingWeights:
    """Weights of every sample of the series for one correlation model and mode."""

    def weigh(covariance: np.ndarray) -> np.ndarray:
        good = usable(covariance)
        weights = np.full(covariance.shape[:2], np.nan)
        weights[good] = min_variance_weights(covariance[good], array.engine)
        return weights

    return rolling_weights(
        array.series.values,
        array.series.stretch,
        models,
        array.definition,
        mode,
        model,
        weigh,
        array.options.step,
        array.options.residual_span,
        array.too_short,
    )


def stored_models(array: ArraySeries, garch_path: Path, dcc_path: Path) -> list[ModelWindow]:
    """The fitted model of every window, as the earlier tasks stored it."""
    garch = stored_garch(garch_path, array.gyros)
    dcc = read_columns(dcc_path, ["window", "a", "b", "target", "status"])
    row = {int(number): index for index, number in enumerate(dcc["window"])}
    n = len(array.gyros)
    models = []
    for number, window in array.jobs:
        if number == WHOLE:
            continue
        found, index = garch[number], row[number]
        target = np.eye(n)
        target[np.triu_indices(n, 1)] = dcc["target"][index]
        target = np.triu(target) + np.triu(target, 1).T
        a, b = float(np.nan_to_num(dcc["a"][index])), float(np.nan_to_num(dcc["b"][index]))
        note = _note(array.gyros, found, str(dcc["status"][index]))
        models.append(ModelWindow(window, found["omega"], found["alpha"], found["beta"], a, b, target, note))
    return models


def _note(gyros: list[str], garch: dict[str, np.ndarray], dcc_status: str) -> str:
    notes = [
        f"without {gyro}: {status}"
        for gyro, omega, status in zip(gyros, garch["omega"], garch["status"], strict=True)
        if not np.isfinite(omega)
    ]
    if dcc_status == NOT_POSITIVE_DEFINITE:
        notes.append("correlation not positive definite, taken as 0")
    if dcc_status == FAILED:
        notes.append("DCC failed, correlation taken as constant")
    return "; ".join(notes)


def columns_of(array: ArraySeries, model: str, mode: str, found: RollingWeights) -> dict[str, object]:
    """Columns of weights.parquet."""
    count = len(found.weights)
    return {
        "time": array.series.time,
        "segment": array.series.segment,
        "model": np.full(count, model, dtype=object),
        "mode": np.full(count, mode, dtype=object),
        "sigma": found.sigma,
        **{f"w_{gyro}": found.weights[:, i] for i, gyro in enumerate(array.gyros)},
        **{f"sd_{gyro}": found.deviation[:, i] for i, gyro in enumerate(array.gyros)},
        "status": found.status,
    }
