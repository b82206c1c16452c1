"""Garch: GARCH(1,1) of each gyro in each rolling window, and of the whole record."""

from __future__ import annotations

import numpy as np

from vgyro.engine.models import TOO_SHORT
from vgyro.storage.tables import write_table
from vgyro.tasks.common import Task
from vgyro.tasks.volatility_series import ArraySeries, enough, open_series, with_progress
from vgyro.volatility.garch import fit_garch
from vgyro.volatility.stretches import Window


def main(task: Task) -> None:
    """Read one array's rates, fit every window, write garch.parquet."""
    array = open_series(task)
    rows = [row for number, window in with_progress(array.jobs) for row in rows_of(array, number, window)]
    columns = {name: [row[name] for row in rows] for name in rows[0]}
    write_table(task.output("garch"), columns, "garch", task.provenance())


def rows_of(array: ArraySeries, number: int, window: Window) -> list[dict[str, object]]:
    """One row a gyro."""
    place = array.place(number, window)
    n = len(array.gyros)
    if not enough(window):
        nothing = np.full(n, np.nan)
        return _rows(place, array.gyros, *[nothing] * 7, np.full(n, TOO_SHORT, dtype=object))
    fit = fit_garch(array.residuals(window), array.engine)
    return _rows(
        place, array.gyros, fit.omega, fit.alpha, fit.beta, *fit.stderr.T, fit.log_likelihood, fit.status
    )  # fmt: skip


def _rows(place: dict[str, object], gyros: list[str], *figures: np.ndarray) -> list[dict[str, object]]:
    names = ("omega", "alpha", "beta", "se_omega", "se_alpha", "se_beta", "log_likelihood")
    *numbers, status = figures
    return [
        {
            **place,
            "gyro": gyro,
            **{name: float(values[i]) for name, values in zip(names, numbers, strict=True)},
            "status": str(status[i]),
        }
        for i, gyro in enumerate(gyros)
    ]
