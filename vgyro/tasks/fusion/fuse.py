"""Fuse: one virtual gyroscope a method, from the rates, the noise and the weights of one array."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from math import isfinite
from os import SEEK_END
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any, BinaryIO

import numpy as np
import pyarrow as pa

from vgyro.dataset import AT_REST
from vgyro.fusion import Method, Outcome, measured_response, run_methods, select
from vgyro.fusion.registry import LEFT_OUT, failure
from vgyro.storage.tables import ROW_GROUP, TableWriter, write_table
from vgyro.tasks.common import Task, run_task
from vgyro.tasks.fusion.array_inputs import OpenArray, open_array
from vgyro.tasks.rates.rates_file import DEVIATION

SECTIONS = ("board", "engine", "volatility", "fusion")

TEXTS = ("method", "definition", "column", "state", "title", "source", "family", "needs", "inferred")
FIGURES = ("dc_gain", "bandwidth_hz", "noise_bandwidth_hz", "delay_s")
Row = dict[str, Any]
ONE_GYRO = "one gyro: there is nothing to fuse"


def main(task: Task) -> None:
    """Read one array's rates, run every chosen method, write fused.parquet, methods.parquet and moved.parquet.

    inputs  : as open_array
    options : board, axis, kind, injected_rate, analysis.volatility, .fusion, .engine
    moved.parquet is of the same recording with injected_rate added to every gyro, less that rate: of the methods that
    answer to a constant rate. An array of one gyro gives tables without a method, and a note in their metadata.
    """
    for problem in LEFT_OUT:
        logging.warning(problem)
    opened = open_array(task)
    extra = {"rate_hz": opened.rates.rate_hz}
    note = {}
    if len(opened.gyros) == 1:
        note = {"note": ONE_GYRO}
        logging.info(ONE_GYRO)
    with kept_columns(task.output("fused")) as fused:
        rows = [] if note else run_all(opened, fused)
        write_columns(task, "fused", opened, fused, {**extra, **note})
    why = why_not_moved(opened.injected_rate, task.option("kind"), opened.file.moved)
    with kept_columns(task.output("moved")) as moved:
        rows = run_moved(opened, rows, moved, why)
        write_columns(
            task, "moved", opened, moved, {**extra, "injected_rate": opened.injected_rate, "note": why, **note}
        )
    write_table(task.output("methods"), table_of(rows), "methods", task.provenance(), note)


def why_not_moved(injected_rate: float | None, kind: str, moves: bool) -> str:
    """Why no constant rate is added; "" where it is.  moves : the board moves though it is declared to be at rest"""
    if kind not in AT_REST or moves:
        return "the recording is not one at rest"
    return "" if injected_rate is not None else "analysis.metrics.injected_rate is null"


class Columns:
    """Fused rates, kept in a file until all of them are there: they do not fit into memory together."""

    def __init__(self, file: BinaryIO) -> None:
        self._file, self._places = file, dict[str, tuple[int, np.dtype]]()

    def add(self, name: str, values: np.ndarray) -> None:
        """Take a column [T]."""
        self._places[name] = self._file.seek(0, SEEK_END), values.dtype
        values.tofile(self._file)

    def pieces(self, time: np.ndarray, segment: np.ndarray) -> Iterator[dict[str, np.ndarray]]:
        """The table, a row group at a time."""
        for start in range(0, len(time), ROW_GROUP):
            rows = slice(start, min(start + ROW_GROUP, len(time)))
            columns = {"time": time[rows], "segment": segment[rows]}
            for name, (place, dtype) in self._places.items():
                self._file.seek(place + start * dtype.itemsize)
                columns[name] = np.fromfile(self._file, dtype, rows.stop - start)
            yield columns


@contextmanager
def kept_columns(table: Path) -> Iterator[Columns]:
    """Columns, in a file without a name beside the table that they are for."""
    table.parent.mkdir(parents=True, exist_ok=True)
    with TemporaryFile(dir=table.parent) as file:
        yield Columns(file)


def write_columns(task: Task, name: str, opened: OpenArray, columns: Columns, extra: Mapping[str, object]) -> None:
    """Write the table `name`, an output of the same name."""
    with TableWriter(task.output(name), name, task.provenance(), dict(extra)) as writer:
        for part in columns.pieces(opened.file.time, opened.rates.segment):
            writer.append(part)


def run_all(opened: OpenArray, fused: Columns) -> list[Row]:
    """Run the chosen methods one after the other, keep their rates in `fused`, return the rows of methods.parquet."""

    def keep(outcome: Outcome) -> Row:
        logging.info("%s: %s", outcome.column or outcome.method.name, outcome.note or "ok")
        if outcome.fused is not None:
            fused.add(outcome.column, outcome.fused.rate)
            if outcome.fused.sd is not None:
                fused.add(DEVIATION.format(outcome.column), outcome.fused.sd.astype(np.float32, copy=False))
        return describe(outcome, opened)

    methods = select(opened.fusion.methods)
    # No outcome is held while the next one is made.
    return list(map(keep, run_methods(opened.rates, opened.parameters, methods, opened.volatility.definitions)))


def run_moved(opened: OpenArray, rows: list[Row], moved: Columns, why: str) -> list[Row]:
    """Run what answers to a constant rate again, with one added; keep the errors in `moved`; fill in the rows.

    The rates that are open hold the added rate afterwards.  why : nothing is added
    """
    methods = select(opened.fusion.methods)
    same = {
        (method.name, definition): f"the same at any constant rate: {reason}"
        for method in methods
        for definition, reason in method.same_at_any_rate.items()
    }
    found = dict.fromkeys(((row["method"], row["definition"]) for row in rows), f"not known: {why}")
    if not why and rows:
        definitions = opened.volatility.definitions
        outcomes = run_methods(opened.move(), opened.parameters, methods, definitions, moved=True)
        # No outcome is held while the next one is made.
        found = dict(map(partial(keep_error, opened.injected_rate or 0.0, moved), outcomes))
    said = {**found, **same}
    return [{**row, "moved": said[row["method"], row["definition"]] if row["column"] else ""} for row in rows]


def keep_error(added: float, moved: Columns, outcome: Outcome) -> tuple[tuple[str, str], str]:
    """Keep the error of a fused rate; the method and definition, and its column or why there is none."""
    key = (outcome.method.name, outcome.definition)
    logging.info("%s at %g deg/s: %s", outcome.column or outcome.method.name, added, outcome.note or "ok")
    if outcome.fused is None:
        return key, f"not known: {outcome.note}"
    error = outcome.fused.rate
    error -= added
    moved.add(outcome.column, error)
    return key, outcome.column


def describe(outcome: Outcome, opened: OpenArray) -> Row:
    """A row of methods.parquet but for `moved`; figures are NaN where they are not known."""
    method = outcome.method
    texts = (
        method.name, outcome.definition, outcome.column, outcome.state, method.title, method.source, method.family,
        ", ".join(method.needs), method.inferred,
    )  # fmt: skip
    figures, how, why_not = response_of(outcome, opened)
    row = {**dict(zip(TEXTS, texts, strict=True)), "operations": operations_of(method, len(opened.gyros))}
    row |= {"causal": method.causal, **figures, "passes": 0 if outcome.fused is None else outcome.fused.passes}
    return {**row, "response": how, "note": "; ".join(part for part in (outcome.note, why_not) if part)}


def response_of(outcome: Outcome, opened: OpenArray) -> tuple[dict[str, float], str, str]:
    """FIGURES of what came out; how they are known, "" where they are not; and why not."""
    unknown = dict.fromkeys(FIGURES, float("nan"))
    if outcome.fused is None:
        return unknown, "", ""
    if isfinite(outcome.fused.dc_gain):
        return {name: float(getattr(outcome.fused, name)) for name in FIGURES}, "analytic", ""
    # Gain and delay are the method's, whoever computes: the fast engine measures them.
    parameters = replace(opened.parameters, definition=outcome.definition, engine="native")
    try:
        measured = measured_response(outcome.method.fuse, opened.rates, parameters)
    except (Exception, SystemExit) as error:
        logging.exception("the response of %s is not known", outcome.method.name)
        return unknown, "", f"its response could not be measured: {failure(outcome.method, error)}"
    return {name: getattr(measured, name) for name in FIGURES}, "measured", ""


def operations_of(method: Method, gyros: int) -> float:
    """Floating-point operations a sample; NaN where the method cannot tell."""
    try:
        return float(method.operations(gyros))
    except Exception:
        logging.exception("the operations of %s are not known", method.name)
        return float("nan")


def table_of(rows: list[Row]) -> pa.Table:
    """Rows → table; without rows, too, the columns have their types."""
    fields = [(name, pa.string()) for name in TEXTS] + [("operations", pa.float64()), ("causal", pa.bool_())]
    fields += [*((name, pa.float64()) for name in FIGURES), ("passes", pa.int64())]
    fields += [(name, pa.string()) for name in ("response", "moved", "note")]
    return pa.Table.from_pylist(rows, schema=pa.schema(fields))


if __name__ == "__main__":
    run_task(main)
