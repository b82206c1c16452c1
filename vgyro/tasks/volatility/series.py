"""Series: the volatility series of one array, once for all definitions of r_t, made and written piece by piece."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from vgyro.board import Board
from vgyro.config import VolatilityOptions
from vgyro.errors import DataError
from vgyro.storage.tables import ROW_GROUP, RowStream, TableWriter, read_batches, read_metadata
from vgyro.tasks.common import Task, run_task
from vgyro.tasks.rates.rates_file import has_moved
from vgyro.volatility.blocks import BlockMeans, Blocks, RunFinder, Runs, block_length

SECTIONS = ("board", "volatility")

IN_MOTION = ("constant", "random", "sinusoid")


def main(task: Task) -> None:
    """inputs : rates;  outputs : series;  options : board, kind, axis, analysis.volatility.rate_hz

    Where the board is known to stand still at times, only those samples are used; a recording in motion is used whole.
    """
    options = task.section("volatility", VolatilityOptions)
    gyros = [gyro.name for gyro in task.section("board", Board).array(task.option("axis"))]
    path = task.input("rates")
    rate_hz = read_metadata(path).get("rate_hz")
    if rate_hz is None:
        raise DataError("rates without a sample rate", str(path), "run the stage `convert` again")
    length = block_length(float(rate_hz), options.rate_hz)
    share = share_at_rest(path)
    # What is declared to be at rest is no motion to analyse where nothing of it is.
    whole = task.option("kind") in IN_MOTION or (share == 0 and not has_moved(path))
    runs = find_runs(path, float(rate_hz), length, whole)
    present = present_of(path, gyros)
    # Where no gyro has a value there is no block: that shows only with the gyros.
    found = stretches_of(blocks_of(path, runs, gyros if present else [], present))
    use = "in motion, all of it used" if whole else f"{share:.1%} of the recording at rest and used"
    samples = found[-1][1] if found else 0
    logging.info("%d samples at %g Hz in %d stretches, %s", samples, float(rate_hz) / length, len(found), use)
    extra = {"rate_hz": float(rate_hz) / length, "runs": found, "use": use}
    with TableWriter(task.output("series"), "series", task.provenance(), extra) as writer:
        rows = RowStream(table_of(blocks, gyros) for blocks in blocks_of(path, runs, gyros, present))
        while (table := rows.take(ROW_GROUP)).num_rows or not writer.begun:
            writer.append(table)


def share_at_rest(path: Path) -> float:
    """Share of the samples that are at rest; 0 of an empty recording."""
    rest = [(int(piece["at_rest"].sum()), len(piece["at_rest"])) for piece in read_batches(path, ["at_rest"])]
    still, samples = np.sum(rest, axis=0) if rest else (0, 0)
    return float(still / samples) if samples else 0.0


def find_runs(path: Path, rate_hz: float, length: int, whole: bool) -> Runs:
    """The runs of samples that the series is made of: all of them, or those at rest."""
    finder = RunFinder(rate_hz, length)
    for piece in read_batches(path, ["time", "segment", "at_rest"]):
        finder.add(piece["time"], piece["segment"], np.ones_like(piece["at_rest"]) if whole else piece["at_rest"])
    return finder.runs()


def present_of(path: Path, gyros: list[str]) -> dict[int, float]:
    """Place of each gyro that lacks values → share of the samples in which it has one; it is NaN in the others."""
    missing = read_metadata(path).get("missing", {})
    samples = pq.read_metadata(path).num_rows
    return {place: 1 - missing[gyro] / samples for place, gyro in enumerate(gyros) if missing.get(gyro)}


def blocks_of(path: Path, runs: Runs, gyros: list[str], present: Mapping[int, float]) -> Iterator[Blocks]:
    """The blocks of some gyros, or of none: where they are is known without them.  present : as BlockMeans takes it"""
    means = BlockMeans(runs, present if gyros else None)
    for piece in read_batches(path, ["time", "segment", *gyros]):
        yield means.add([piece[gyro] for gyro in gyros], piece["time"], piece["segment"])
    if (last := means.rest()) is not None:
        yield last


def stretches_of(blocks: Iterator[Blocks]) -> list[list[int]]:
    """First sample, one past the last, and segment of each stretch of the series."""
    found: list[list[int]] = []
    count, last = 0, -1
    for part in blocks:
        for place in np.flatnonzero(np.diff(part.stretch, prepend=last)).tolist():
            found.append([count + place, 0, int(part.segment[place])])
        if len(part.stretch):
            count, last = count + len(part.stretch), int(part.stretch[-1])
    for here, following in zip(found, [*found[1:], [count]], strict=False):
        here[1] = following[0]
    return found


def table_of(blocks: Blocks, gyros: list[str]) -> pa.Table:
    """Columns of series.parquet."""
    head = {"time": blocks.time, "segment": blocks.segment.astype(np.int32), "stretch": blocks.stretch}
    return pa.table({**head, **{gyro: blocks.values[:, i] for i, gyro in enumerate(gyros)}})


if __name__ == "__main__":
    run_task(main)
