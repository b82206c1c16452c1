"""Arch_lm: Engle's test on the series itself, on the detrended series and on the standardised residuals."""

from __future__ import annotations

import numpy as np

from vgyro.errors import TooShort
from vgyro.storage.tables import write_table
from vgyro.tasks.common import Task
from vgyro.tasks.volatility_series import WHOLE, ArraySeries, enough, open_series, stored_garch
from vgyro.volatility.arch_lm import arch_lm, kurtosis
from vgyro.volatility.garch import garch_variance
from vgyro.volatility.series import detrended


def main(task: Task) -> None:
    """Read one array's rates and GARCH fits, test the longest stretch, write arch_lm.parquet."""
    array = open_series(task)
    garch = stored_garch(task.input("garch"), array.gyros)[WHOLE]
    rows = [row for name, series in series_of(array, garch).items() for row in rows_of(array, name, series)]
    write_table(
        task.output("arch_lm"), {name: [row[name] for row in rows] for name in rows[0]}, "arch_lm", task.provenance()
    )


def series_of(array: ArraySeries, garch: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The three series that are tested, [T, N]. They lie in the longest stretch: no lag bridges a gap.

    level        : r_t of the definition
    detrended    : r_t minus its centred running mean
    standardised : r_t/√h_t with the GARCH fit of the same stretch; NaN for a gyro without one
    """
    window = dict(array.jobs)[WHOLE]
    if not enough(window):
        r = np.full((window.length, len(array.gyros)), np.nan)
        return {"level": r, "detrended": r, "standardised": r}
    r = array.residuals(window)
    variance = garch_variance(r, garch["omega"], garch["alpha"], garch["beta"])
    return {
        "level": r,
        "detrended": detrended(r, array.options.detrend_span),
        "standardised": r / np.sqrt(variance),
    }


def rows_of(array: ArraySeries, name: str, series: np.ndarray) -> list[dict[str, object]]:
    """One row a gyro."""
    n = len(array.gyros)
    lags = array.options.arch_lags
    statistic, p_value, tails = np.full((3, n), np.nan)
    status = "no variance"
    try:
        if not enough(dict(array.jobs)[WHOLE]):
            raise TooShort(f"{len(series)} samples")
        found = arch_lm(series, lags)
        statistic, p_value, tails = found.statistic, found.p_value, kurtosis(series)
    except TooShort:
        status = "too short"
    return [
        {
            "gyro": gyro,
            "series": name,
            "lags": lags,
            "samples": len(series),
            "statistic": float(statistic[i]),
            "p_value": float(p_value[i]),
            "kurtosis": float(tails[i]),
            "status": "ok" if np.isfinite(statistic[i]) else status,
        }
        for i, gyro in enumerate(array.gyros)
    ]
