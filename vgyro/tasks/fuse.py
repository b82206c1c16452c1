"""Fuse: one virtual gyroscope a method, from the rates, the noise and the weights of one array."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from tempfile import TemporaryFile
from typing import BinaryIO

import numpy as np
import pyarrow as pa

from vgyro.fusion import Outcome, run_methods, select
from vgyro.storage.tables import ROW_GROUP, TableWriter, write_table
from vgyro.tasks.common import Task, run_task
from vgyro.tasks.fusion_inputs import OpenArray, open_array

TEXTS = ("method", "definition", "column", "title", "source")
FIGURES = ("dc_gain", "bandwidth_hz", "noise_bandwidth_hz", "delay_s")
ONE_GYRO = "one gyro: there is nothing to fuse"


def main(task: Task) -> None:
    """Read one array's rates, run every chosen method, write fused.parquet and methods.parquet.

    An array of one gyro gives tables without a method, and a note in their metadata.
    """
    opened = open_array(task)
    extra = {}
    if len(opened.gyros) == 1:
        extra = {"note": ONE_GYRO}
        logging.info(ONE_GYRO)
    rate = {"rate_hz": opened.rates.rate_hz}
    task.output("fused").parent.mkdir(parents=True, exist_ok=True)
    with TemporaryFile(dir=task.output("fused").parent) as file:
        fused = Columns(file)
        rows = [] if extra else run_all(opened, fused)
        with TableWriter(task.output("fused"), "fused", task.provenance(), {**rate, **extra}) as writer:
            for part in fused.pieces(opened.file.time, opened.rates.segment):
                writer.append(part)
    write_table(task.output("methods"), table_of(rows), "methods", task.provenance(), extra)


class Columns:
    """Fused rates, kept in a file until all of them are there: they do not fit into memory together."""

    def __init__(self, file: BinaryIO) -> None:
        self._file, self._names = file, list[str]()

    def add(self, name: str, values: np.ndarray) -> None:
        """Take a column [T] of float64."""
        values.tofile(self._file)
        self._names.append(name)

    def pieces(self, time: np.ndarray, segment: np.ndarray) -> Iterator[dict[str, np.ndarray]]:
        """The table, a row group at a time."""
        for start in range(0, len(time), ROW_GROUP):
            rows = slice(start, min(start + ROW_GROUP, len(time)))
            columns = {"time": time[rows], "segment": segment[rows]}
            for place, name in enumerate(self._names):
                self._file.seek((place * len(time) + start) * np.dtype(float).itemsize)
                columns[name] = np.fromfile(self._file, count=rows.stop - start)
            yield columns


def run_all(opened: OpenArray, fused: Columns) -> list[dict[str, object]]:
    """Run the chosen methods one after the other, keep their rates in `fused`, return the rows of methods.parquet."""

    def keep(outcome: Outcome) -> dict[str, object]:
        logging.info("%s: %s", outcome.column or outcome.method.name, outcome.note or "ok")
        if outcome.fused is not None:
            fused.add(outcome.column, outcome.fused.rate)
        return describe(outcome)

    methods = select(opened.fusion.methods)
    # No outcome is held while the next one is made.
    return list(map(keep, run_methods(opened.rates, opened.parameters, methods, opened.volatility.definitions)))


def describe(outcome: Outcome) -> dict[str, object]:
    """A row of methods.parquet; figures are NaN where the method could not run."""
    method, fused = outcome.method, outcome.fused
    texts = (method.name, outcome.definition, outcome.column, method.title, method.source)
    figures = {name: getattr(fused, name) if fused is not None else float("nan") for name in FIGURES}
    return {**dict(zip(TEXTS, texts, strict=True)), "causal": method.causal, **figures, "note": outcome.note}


def table_of(rows: list[dict[str, object]]) -> pa.Table:
    """Rows → table; without rows, too, the columns have their types."""
    fields = [(name, pa.string()) for name in TEXTS] + [("causal", pa.bool_())]
    fields += [(name, pa.float64()) for name in FIGURES] + [("note", pa.string())]
    return pa.Table.from_pylist(rows, schema=pa.schema(fields))


if __name__ == "__main__":
    run_task(main)
