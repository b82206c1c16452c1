"""Our figures for the papers' tables: rows of the twin's artefacts, and those of the 1 Hz series, which is L's."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow.parquet as pq

from vgyro.board import Board
from vgyro.config import MetricsOptions, VolatilityOptions
from vgyro.dataset import ConstantReference, Manifest
from vgyro.papers import PaperEvidence, with_single
from vgyro.papers.beside import CASE_RATE
from vgyro.papers.series import Name, SlowSeries, extremes, paired_ratios, series_figures
from vgyro.storage.tables import read_columns, read_metadata
from vgyro.tasks.figures.measure import fused_series
from vgyro.tasks.rates.rates_file import read_array
from vgyro.volatility import Series, block_means

Rows = list[dict[str, Any]]
# 95 % limits of an estimate with this standard error.
TWO_SIDED = 1.959964
# Behind the names of artefacts: with a constant rate added (analysis.metrics.injected_rate).
MOVED = "_moved"
# Liu et al. (2015), section 5: the fourth gyro is faulty from 1000 s on, and its weight is near zero after 2500 s.
FAULTY, STRETCHES = 4, {"before 1000 s": (0.0, 1000.0), "after 2500 s": (2500.0, math.inf)}

# What the claims of Liu et al. (2015) compare their weights with.
AGAINST = {
    "average": ("average", ""),
    "xue_2012": ("xue_2012", ""),
    "chang_2012": ("chang_2012", ""),
    "jiang_markov": ("jiang_markov", ""),
    "ccc": ("ccc_in_sample", "level"),
}


class Wanted(NamedTuple):
    """What a paper's tables ask for.

    slow_series : whether the figures of the block means are wanted (L, Table 3)
    rivals      : methods of the paper's that ours are compared with
    """

    slow_series: bool
    rivals: Sequence[Name] = ()


def gather(
    paths: Sequence[Path],
    manifest: Manifest,
    board: Board,
    volatility: VolatilityOptions,
    metrics: MetricsOptions,
    wanted: Wanted,
) -> PaperEvidence:
    """Evidence of one twin from all its artefacts.

    paths : files under …/<recording>/[<axis>/[<definition>/]]<table>.parquet; tables that no cell needs are passed over
    """
    gyros = [gyro.name for gyro in board.array(board.axes[0])]
    rows: dict[str, Rows] = {}
    for path in paths:
        read = READERS.get(path.stem)
        if read is not None:
            rows.setdefault(path.stem, []).extend(read(path, gyros))
    if "metrics" in rows:
        still = [row for row in rows["metrics"] if row[CASE_RATE] == 0]
        rows[f"metrics{MOVED}"] = at_added_rate(rows["metrics"], manifest)
        rows["metrics"] = with_single(with_table_means(still, manifest), gyros)
    for static in at_rest(paths, manifest) if wanted.slow_series else ():
        for suffix, found in _slow_rows(static, gyros, volatility, metrics, wanted.rivals):
            for name, part in found.items():
                rows.setdefault(f"{name}{suffix}", []).extend(part)
    return PaperEvidence(rows, gyros)


def at_added_rate(rows: Rows, manifest: Manifest) -> Rows:
    """Figures at rest with a constant rate added; a method that such a rate does not change keeps its figures.

    rows : of metrics.parquet;  returns : [] if no rate was added
    """
    static = {recording.name for recording in manifest.recordings if recording.kind == "static"}
    rows = [row for row in rows if row["recording"] in static]
    moved = [row for row in rows if row[CASE_RATE] != 0]
    touched = {_series(row) for row in moved}
    return moved + [row for row in rows if moved and row[CASE_RATE] == 0 and _series(row) not in touched]


def _series(row: dict[str, Any]) -> tuple[str, ...]:
    """What tells a series from the others."""
    return row["recording"], row["axis"], row["method"], row["definition"]


def _slow_rows(
    fused: Path, gyros: list[str], volatility: VolatilityOptions, metrics: MetricsOptions, rivals: Sequence[Name]
) -> Iterator[tuple[str, dict[str, Rows]]]:
    """(suffix of the artefact, rows by artefact): figures of the block means at rest, and at an added constant rate."""
    place = {"recording": fused.parts[-3], "axis": fused.parts[-2]}
    for suffix, path in (("", None), (MOVED, fused.with_name("moved.parquet"))):
        rate = 0.0 if path is None else added_rate(path)
        if rate is None:
            continue
        series = _block_series(fused, gyros, volatility, path)
        figures = series_figures(place, series, len(gyros), metrics)
        over = {**AGAINST, **extremes(figures.metrics, gyros, gyros[FAULTY - 1])}
        over |= {f"{one[0]}[{one[1]}]": one for one in rivals if one not in AGAINST.values()}
        there = {label: name for label, name in over.items() if name in series.names}
        ratios = paired_ratios(place, series, there, metrics)
        found = {"metrics_1hz": figures.metrics, "factors_1hz": figures.factors, "ratios_1hz": ratios}
        yield suffix, {name: [{**row, CASE_RATE: rate} for row in part] for name, part in found.items()}


def _records(path: Path, **place: str) -> Rows:
    table = read_columns(path)
    return [{**place, **dict(zip(table, values, strict=True))} for values in zip(*table.values(), strict=True)]


def _metrics(path: Path, _gyros: Sequence[str]) -> Rows:
    return _records(path)


def _correlation(path: Path, _gyros: Sequence[str]) -> Rows:
    return _records(path, recording=path.parts[-3])


def _of_definition(path: Path) -> dict[str, str]:
    return {"recording": path.parts[-4], "axis": path.parts[-3], "definition": path.parts[-2]}


def _arch_lm(path: Path, _gyros: Sequence[str]) -> Rows:
    return _records(path, **_of_definition(path))


def _garch(path: Path, _gyros: Sequence[str]) -> Rows:
    return [_with_limits(row, ("omega", "alpha", "beta")) for row in _first_and_whole(path)]


def _dcc(path: Path, _gyros: Sequence[str]) -> Rows:
    return [_with_limits(row, ("a", "b")) for row in _first_and_whole(path)]


def _first_and_whole(path: Path) -> Rows:
    """Rows of window 0, the first 360 samples, and of window -1, the whole record."""
    return [row for row in _records(path, **_of_definition(path)) if row["window"] <= 0]


def _with_limits(row: dict[str, Any], names: Sequence[str]) -> dict[str, Any]:
    """Add low_x and high_x: the estimate ± 1.96 standard errors."""
    for name in names:
        half = TWO_SIDED * row[f"se_{name}"]
        row = {**row, f"low_{name}": row[name] - half, f"high_{name}": row[name] + half}
    return row


def _weights(path: Path, gyros: Sequence[str]) -> Rows:
    """Mean weight of each gyro before the fault and after 2500 s."""
    table, rows = read_columns(path), []
    for model, mode in sorted(set(zip(table["model"], table["mode"], strict=True))):
        chosen = (table["model"] == model) & (table["mode"] == mode)
        for name, (start, stop) in STRETCHES.items():
            inside = chosen & (table["time"] >= start) & (table["time"] < stop)
            for gyro in gyros:
                weights = table[f"w_{gyro}"][inside]
                value = float(np.mean(weights)) if weights.size else math.nan
                about = {"model": model, "mode": mode, "gyro": gyro, "stretch": name, "value": value}
                rows.append({**_of_definition(path), **about, "note": "" if weights.size else "no sample there"})
    return rows


READERS: dict[str, Callable[[Path, Sequence[str]], Rows]] = {
    "metrics": _metrics, "correlation": _correlation, "arch_lm": _arch_lm, "garch": _garch, "dcc": _dcc,
    "weights": _weights,
}  # fmt: skip


def with_table_means(rows: Rows, manifest: Manifest) -> Rows:
    """Add the mean output at a constant rate (J, Table 3): the set rate and the mean error."""
    known = {(row["recording"], row["method"], row["definition"]) for row in rows if row["metric"] == "mean"}
    for recording in manifest.recordings:
        if isinstance(recording.reference, ConstantReference):
            for row in [row for row in rows if row["recording"] == recording.name and row["metric"] == "error_mean"]:
                if (row["recording"], row["method"], row["definition"]) not in known:
                    moved = {name: row[name] + recording.reference.rate for name in ("value", "low", "high")}
                    rows = [*rows, {**row, **moved, "metric": "mean", "note": "set rate + mean error"}]
    return rows


def at_rest(paths: Sequence[Path], manifest: Manifest) -> list[Path]:
    """fused.parquet of every static recording."""
    static = {recording.name for recording in manifest.recordings if recording.kind == "static"}
    return [path for path in paths if path.stem == "fused" and path.parts[-3] in static]


def added_rate(moved: Path) -> float | None:
    """The rate that was added, deg/s; None: there is no such file, or it holds no method.  moved : moved.parquet"""
    if not moved.exists() or not set(pq.read_schema(moved).names) - {"time", "segment"}:
        return None
    rate = read_metadata(moved).get("injected_rate")
    return None if rate is None else float(rate)


def _block_series(
    fused: Path, gyros: list[str], volatility: VolatilityOptions, moved: Path | None = None
) -> SlowSeries:
    """Block means of single gyros and methods.

    fused : …/<recording>/<axis>/fused.parquet, with methods.parquet beside it and rates.parquet one folder up
    moved : moved.parquet: the errors at an added rate, where a method has some there
    """
    array = read_array(fused.parents[1] / "rates.parquet", gyros, fused.parts[-2])
    methods = fused_series(fused, read_columns(fused.with_name("methods.parquet")))
    block_hz = array.rate_hz if volatility.rate_hz == "full" else volatility.rate_hz
    at_a_rate = set(pq.read_schema(moved).names) if moved else set()

    def means(columns: np.ndarray) -> Series:
        return block_means(columns, array.rate_hz, block_hz, array.segment, array.at_rest, array.time)

    def values_of(column: str) -> np.ndarray:
        path = moved if moved and column in at_a_rate else fused
        return means(read_columns(path, [column])[column][:, None]).values

    # One column at a time: the record of all methods at the full rate is large.
    singles = means(array.rate)
    virtual = [values_of(one.column) for one in methods]
    names = [(gyro, "") for gyro in gyros] + [(one.method, one.definition) for one in methods]
    return SlowSeries(names, np.hstack([singles.values, *virtual]), singles.stretch, singles.rate_hz)
