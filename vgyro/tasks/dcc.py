"""Dcc: DCC(1,1) and the test of constant correlation, in each rolling window and on the whole record."""

from __future__ import annotations

import numpy as np
import pyarrow as pa

from vgyro.storage.tables import write_table
from vgyro.tasks.common import Task
from vgyro.tasks.volatility_series import ArraySeries, enough, open_series, stored_garch, with_progress
from vgyro.volatility.stretches import Window
from vgyro.volatility.windowed import fit_array_dcc


def main(task: Task) -> None:
    """Read one array's rates and GARCH fits, fit every window, write dcc.parquet."""
    array = open_series(task)
    margins = stored_garch(task.input("garch"), array.gyros)
    rows = [row_of(array, number, window, margins[number]) for number, window in with_progress(array.jobs)]
    columns: dict[str, object] = {name: [row[name] for row in rows] for name in rows[0]}
    columns["target"] = pa.array(columns["target"], type=pa.list_(pa.float64()))
    write_table(task.output("dcc"), columns, "dcc", task.provenance())


def row_of(array: ArraySeries, number: int, window: Window, garch: dict[str, np.ndarray]) -> dict[str, object]:
    """The row of one window; NaN and a status where it is too short."""
    r = array.residuals(window) if enough(window) else np.empty((0, len(array.gyros)))
    found = fit_array_dcc(r, garch["omega"], garch["alpha"], garch["beta"], garch["status"], array.engine)
    fit, test = found.fit, found.test
    return {
        **array.place(number, window),
        "a": float(fit.a),
        "b": float(fit.b),
        "se_a": float(fit.stderr[0]),
        "se_b": float(fit.stderr[1]),
        "se_a_hessian": float(fit.stderr_hessian[0]),
        "se_b_hessian": float(fit.stderr_hessian[1]),
        "log_likelihood": float(fit.log_likelihood),
        "log_likelihood_ccc": float(fit.log_likelihood_ccc),
        "target": fit.target[np.triu_indices(len(array.gyros), 1)].tolist(),
        "statistic": test.statistic,
        "p_value": test.p_value,
        "p_value_s": test.p_value_s,
        "status": fit.status,
    }
