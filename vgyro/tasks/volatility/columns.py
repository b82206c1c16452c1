"""Columns of garch.parquet, dcc.parquet and arch_lm.parquet."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pyarrow as pa

from vgyro.engine.models import DCC_STATUSES, GARCH_STATUSES, DccWindows, GarchWindows
from vgyro.errors import TooShort
from vgyro.storage.tables import words
from vgyro.volatility.arch_lm import arch_lm, kurtosis


def place_columns(
    number: np.ndarray, start: np.ndarray, length: int, time: np.ndarray, offset: int
) -> dict[str, np.ndarray]:
    """Where K windows are; times are those of the first samples of their first and last block.

    number, start [K];  time : of the samples offset, offset + 1, … of the series
    """
    if length == 0:
        first = last = np.full(len(start), np.nan)
    else:
        first, last = time[start - offset], time[start - offset + length - 1]
    return {"window": number, "start": start, "stop": start + length, "time_start": first, "time_stop": last}


def garch_columns(place: dict[str, np.ndarray], gyros: Sequence[str], fits: GarchWindows) -> pa.Table:
    """One row a window and gyro."""
    windows, n = fits.omega.shape
    stderr = fits.stderr.reshape(-1, 3)
    return pa.table(
        {
            **{name: np.repeat(column, n) for name, column in place.items()},
            "gyro": words(np.tile(np.arange(n), windows), gyros),
            "omega": fits.omega.ravel(),
            "alpha": fits.alpha.ravel(),
            "beta": fits.beta.ravel(),
            "se_omega": stderr[:, 0],
            "se_alpha": stderr[:, 1],
            "se_beta": stderr[:, 2],
            "log_likelihood": fits.log_likelihood.ravel(),
            "status": words(fits.status.ravel(), GARCH_STATUSES),
        }
    )


def dcc_columns(place: dict[str, np.ndarray], fits: DccWindows) -> pa.Table:
    """One row a window, but for the p-values."""
    windows, n = fits.target.shape[:2]
    first, second = np.triu_indices(n, 1)
    above = pa.array(fits.target[:, first, second].ravel())
    return pa.table(
        {
            **place,
            "a": fits.a,
            "b": fits.b,
            "se_a": fits.stderr[:, 0],
            "se_b": fits.stderr[:, 1],
            "se_a_hessian": fits.stderr_hessian[:, 0],
            "se_b_hessian": fits.stderr_hessian[:, 1],
            "log_likelihood": fits.log_likelihood,
            "log_likelihood_ccc": fits.log_likelihood_ccc,
            "target": pa.ListArray.from_arrays(np.arange(windows + 1, dtype=np.int32) * len(first), above),
            "statistic": fits.statistic,
            "status": words(fits.status, DCC_STATUSES),
        }
    )


def with_p_values(table: pa.Table, lags: int = 1) -> pa.Table:
    """Add the p-values of the statistic of `lags` lags, before the status."""
    from scipy.special import chdtrc

    statistic = table.column("statistic").to_numpy()
    place = table.column_names.index("status")
    table = table.add_column(place, "p_value", pa.array(chdtrc(lags + 1, statistic)))
    return table.add_column(place + 1, "p_value_s", pa.array(chdtrc(lags, statistic)))


def canonical(table: pa.Table) -> pa.Table:
    """The same table with each dictionary as `words` makes it, whatever pieces the rows came from."""
    for place, field in enumerate(table.schema):
        if pa.types.is_dictionary(field.type):
            column = table.column(place).unify_dictionaries().combine_chunks()
            encoded = words(column.indices.to_numpy(), column.dictionary.to_pylist())
            table = table.set_column(place, field.name, encoded)
    return table


def arch_lm_columns(gyros: Sequence[str], name: str, series: np.ndarray, lags: int, enough: bool) -> pa.Table:
    """Engle's test of one series [T, N], one row a gyro; `enough`: was it long enough to be fitted?"""
    n = len(gyros)
    statistic, p_value, tails = np.full((3, n), np.nan)
    why = "no variance"
    try:
        if not enough:
            raise TooShort(f"{len(series)} samples")
        found = arch_lm(series, lags)
        statistic, p_value, tails = found.statistic, found.p_value, kurtosis(series)
    except TooShort:
        why = "too short"
    return pa.table(
        {
            "gyro": list(gyros),
            "series": [name] * n,
            "lags": np.full(n, lags),
            "samples": np.full(n, len(series)),
            "statistic": statistic,
            "p_value": p_value,
            "kurtosis": tails,
            "status": ["ok" if np.isfinite(value) else why for value in statistic],
        }
    )
