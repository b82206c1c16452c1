"""Faults: the stretches of one recording in which a gyro of an array is at fault."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from vgyro.board import Board, Gyro
from vgyro.calibration import compensate, to_rates
from vgyro.config import FaultOptions
from vgyro.fusion import ArrayNoise, ArrayRates
from vgyro.fusion.events import FaultEvent
from vgyro.fusion.faults import ALL_KINDS, search_faults, sentence
from vgyro.storage.tables import read_json, read_metadata, write_table
from vgyro.tasks.common import Task, run_task
from vgyro.tasks.rates.convert import compensations_of
from vgyro.tasks.rates.rates_file import (
    ArrayFile,
    read_array,
    read_temperature,
    stretch_times,
    thermometers,
    times_at,
)

SECTIONS = ("board", "faults")

OFF = "analysis.faults.detect is off: nothing was looked for"
FIGURES = ("start", "stop", "evidence", "size")
TEMPERATURES = 101
HALF_A_COUNT = 0.5


def main(task: Task) -> None:
    """inputs : rates, calibration;  outputs : faults;  options : board, axis, kind, analysis.faults

    A recording in which nothing could be looked for, or not every kind, has the reason as a note in the metadata.
    """
    options = task.section("faults", FaultOptions)
    board = task.section("board", Board)
    gyros = board.array(task.option("axis"))
    names = [gyro.name for gyro in gyros]
    rows: list[dict[str, Any]] = []
    note = OFF
    if options.detect == "auto":
        file = read_array(task.input("rates"), names, task.option("axis"))
        array = array_of(file, read_temperature(file, thermometers(board, names)))
        zero = zero_counts(file.path, gyros, task.inputs.get("calibration", []))
        search = search_faults(array, options, zero, in_hand=task.option("kind") == "free" or file.moved)
        note, events = search.note, search.events
        times = times_at(file.path, [sample for one in events for sample in (one.start, one.stop - 1)])
        ends = [one.stop == len(array.rate) for one in events]
        pairs = zip(events, times.reshape(-1, 2).tolist(), ends, strict=True)
        rows = [row_of(names, one, *time, to_the_end=end) for one, time, end in pairs]
    for row in rows:
        logging.info("%s", row["sentence"])
    extra = {"note": note, "gyros": names, "looked_for": ALL_KINDS, "threshold": options.threshold}
    write_table(task.output("faults"), table_of(rows), "faults", task.provenance(), extra)


def array_of(file: ArrayFile, temperature: np.ndarray | None) -> ArrayRates:
    """The array as the search takes it; it estimates the noise by itself."""
    gyros = file.rate.shape[1]
    unknown = ArrayNoise(np.full(gyros, math.nan), np.full(gyros, math.nan), np.eye(gyros))
    times = stretch_times(file)
    return ArrayRates(
        file.rate, file.rate_hz, file.segment, file.at_rest, unknown, temperature=temperature, stretch_time=times,
        missing=file.missing,
    )  # fmt: skip


def zero_counts(path: Path, gyros: Sequence[Gyro], calibration: Sequence[Path]) -> np.ndarray:
    """Least and greatest rate [N, 2] of a count of zero, deg/s, half a count added on both sides; NaN: not known."""
    zero = np.full((len(gyros), 2), math.nan)
    if not calibration:
        return zero
    metadata, known = read_metadata(path), read_json(calibration[0])["gyros"]
    compensations = compensations_of(known)
    for index, gyro in enumerate(gyros):
        row = known[gyro.name]
        if metadata["calibration"][gyro.name] == "rates as logged":
            zero[index] = 0.0
            continue
        rates = to_rates(np.zeros(1), gyro.sign, row["scale"], row["bias"])
        thermal = metadata["temperature"][gyro.name]
        if thermal["applied"]:
            low, high = _extremes(path, f"temp_{thermal['sensor']}")
            celsius = np.linspace(low, high, TEMPERATURES)
            rates = compensate(np.zeros(TEMPERATURES), celsius, gyro.sign, row["scale"], compensations[gyro.name])
        zero[index] = rates.min() - HALF_A_COUNT * row["scale"], rates.max() + HALF_A_COUNT * row["scale"]
    return zero


def _extremes(path: Path, column: str) -> tuple[float, float]:
    """Least and greatest value of a column, from the file's own statistics."""
    file = pq.ParquetFile(path)
    place = file.schema_arrow.names.index(column)
    parts = [file.metadata.row_group(group).column(place).statistics for group in range(file.num_row_groups)]
    # A row group in which the thermometer has no value has no extremes.
    known = [part for part in parts if part is not None and part.has_min_max]
    return min(part.min for part in known), max(part.max for part in known)


def row_of(gyros: Sequence[str], event: FaultEvent, start: float, stop: float, *, to_the_end: bool) -> dict[str, Any]:
    """A row of faults.parquet.  gyros : names of those of the array"""
    gyro, other = gyros[event.gyro], "" if event.other is None else gyros[event.other]
    return {
        "gyro": gyro, "kind": event.kind, "start": start, "stop": stop, "evidence": float(event.evidence),
        "size": float(event.size), "unit": event.unit, "other": other,
        "sentence": sentence(gyro, event, start, stop, to_the_end, other),
    }  # fmt: skip


def table_of(rows: list[dict[str, Any]]) -> pa.Table:
    """Rows → table; without rows, too, the columns have their types."""
    columns = ("gyro", "kind", "start", "stop", "evidence", "size", "unit", "other", "sentence")
    return pa.Table.from_pylist(
        rows, schema=pa.schema([(name, pa.float64() if name in FIGURES else pa.string()) for name in columns])
    )


if __name__ == "__main__":
    run_task(main)
