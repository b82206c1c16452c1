"""The volatility tables as a page shows them: counted and thinned, for a day at the full rate has millions of rows."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from vgyro.report.envelope import places_of
from vgyro.report.model import DccSummary, GarchSummary, VolatilityPart, WeightCurves, rows_of
from vgyro.report.volatility.section import LEVEL_OF_TEST
from vgyro.storage.tables import read_columns
from vgyro.tasks.volatility.layout import WHOLE, weight_blocks

CURVE_POINTS = 600


def read_volatility(paths: Mapping[str, Path], gyros: tuple[str, ...]) -> VolatilityPart:
    """The part of one definition. paths : arch_lm, garch, dcc, weights, fits, as far as there are"""
    return VolatilityPart(
        arch_lm=read_columns(paths["arch_lm"]) if "arch_lm" in paths else None,
        garch=read_garch(paths["garch"], gyros) if "garch" in paths else (),
        dcc=read_dcc(paths["dcc"]) if "dcc" in paths else None,
        weights=read_weights(paths["weights"], gyros) if "weights" in paths else (),
        fits=read_columns(paths["fits"]) if "fits" in paths else None,
    )


def read_garch(path: Path, gyros: tuple[str, ...]) -> tuple[GarchSummary, ...]:
    """Medians and statuses of each gyro, and its row of the whole record."""
    table = pq.read_table(path, columns=["window", "gyro", "alpha", "beta", "status"])
    window, alpha, beta = (table.column(name).to_numpy() for name in ("window", "alpha", "beta"))
    gyro, names = _codes(table.column("gyro"))
    status, words = _codes(table.column("status"))
    del table
    whole = _whole_rows(path)
    found = []
    for name in gyros:
        if name not in names:
            continue
        mine = (gyro == names.index(name)) & (window != WHOLE)
        found.append(
            GarchSummary(
                name, int(mine.sum()), _median(alpha[mine]), _median(beta[mine]), _counts(status[mine], words),
                next((row for row in whole if row["gyro"] == name), None),
            )
        )  # fmt: skip
    return tuple(found)


def read_dcc(path: Path) -> DccSummary:
    """Medians, statuses and rejections, the row of the whole record, and some of the windows for a curve."""
    names = ["window", "time_stop", "a", "b", "p_value", "p_value_s", "status"]
    table = pq.read_table(path, columns=names)
    table = table.filter(pc.not_equal(table.column("window"), WHOLE))
    columns = {name: table.column(name).to_numpy() for name in names[1:-1]}
    status, words = _codes(table.column("status"))
    fitted = np.flatnonzero(np.isfinite(columns["a"]))
    tested = np.isfinite(columns["p_value"])
    drawn = fitted[places_of(len(fitted), CURVE_POINTS)]
    return DccSummary(
        windows=len(status),
        a=_median(columns["a"]),
        b=_median(columns["b"]),
        rejects={
            name: float(np.mean(columns[name][tested] < LEVEL_OF_TEST)) if tested.any() else np.nan
            for name in ("p_value", "p_value_s")
        },
        statuses=_counts(status, words),
        whole=next(iter(_whole_rows(path, without=("target",))), None),
        curves={"time": columns["time_stop"][drawn], "a": columns["a"][drawn], "b": columns["b"][drawn]},
    )


def read_weights(path: Path, gyros: tuple[str, ...]) -> tuple[WeightCurves, ...]:
    """Some samples of every model and mode, and the statuses of all."""
    blocks, samples = weight_blocks(path)
    shown = ["time", "sigma", *(f"w_{name}" for name in gyros), *(f"sd_{name}" for name in gyros)]
    file = pq.ParquetFile(path)
    parts: list[list[pa.Table]] = [[] for _ in blocks]
    counts: list[Counter[str]] = [Counter() for _ in blocks]
    places = places_of(samples, CURVE_POINTS)
    begin = 0
    for group in range(file.num_row_groups):
        rows = file.metadata.row_group(group).num_rows
        if rows:
            block, first = divmod(begin, samples)
            group_table = file.read_row_group(group, columns=[*shown, "status"])
            here = places[(places >= first) & (places < first + rows)] - first
            parts[block].append(group_table.select(shown).take(here))
            for entry in pc.value_counts(group_table.column("status")).to_pylist():
                counts[block][entry["values"]] += entry["counts"]
        begin += rows
    return tuple(
        WeightCurves(model, mode, _arrays(tables, shown), dict(count.most_common()))
        for (model, mode), tables, count in zip(blocks, parts, counts, strict=True)
    )


def _arrays(tables: list[pa.Table], names: list[str]) -> dict[str, np.ndarray]:
    if not tables:
        return {name: np.empty(0) for name in names}
    table = pa.concat_tables(tables)
    return {name: table.column(name).to_numpy() for name in names}


def _whole_rows(path: Path, without: tuple[str, ...] = ()) -> list[dict[str, Any]]:
    """Rows of the whole record."""
    names = [name for name in pq.read_schema(path).names if name not in without]
    table = pq.read_table(path, columns=names, filters=[("window", "=", WHOLE)])
    return list(rows_of({name: table.column(name).to_numpy() for name in names}))


def _codes(column: pa.ChunkedArray) -> tuple[np.ndarray, list[str]]:
    """A column of words as places in a list of words."""
    if not pa.types.is_dictionary(column.type):
        column = column.dictionary_encode()
    whole = column.unify_dictionaries().combine_chunks()
    if isinstance(whole, pa.ChunkedArray):
        return np.empty(0, dtype=np.int32), []
    return whole.indices.to_numpy(), whole.dictionary.to_pylist()


def _counts(codes: np.ndarray, words: list[str]) -> dict[str, int]:
    """How many of each word, the most frequent first."""
    counts = np.bincount(codes, minlength=len(words)) if len(codes) else np.zeros(len(words), dtype=int)
    found = {word: int(count) for word, count in zip(words, counts, strict=True) if count}
    return dict(sorted(found.items(), key=lambda item: (-item[1], item[0])))


def _median(values: np.ndarray) -> float:
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if len(finite) else np.nan
