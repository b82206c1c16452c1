"""Volatility: the tables of one array and one definition of r_t, put together from their parts."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pyarrow as pa

from vgyro.storage.tables import ROW_GROUP, Provenance, RowStream, TableWriter, row_groups, words, write_table
from vgyro.tasks.common import Task, run_task
from vgyro.tasks.volatility.arch_lm import series_of
from vgyro.tasks.volatility.chunk import blocks_of, write_parts
from vgyro.tasks.volatility.columns import (
    arch_lm_columns,
    canonical,
    dcc_columns,
    garch_columns,
    place_columns,
    with_p_values,
)  # fmt: skip
from vgyro.tasks.volatility.fits_map import FitsMap
from vgyro.tasks.volatility.layout import WHOLE
from vgyro.tasks.volatility.stored import ArraySeries, open_series
from vgyro.volatility.fits import fit_windows
from vgyro.volatility.windowed import MIN_SAMPLES

SECTIONS = ("board", "engine", "volatility")

Parts = dict[str, list[Path]]


def main(task: Task) -> None:
    """inputs : series; garch, dcc, weights (the parts, in order; none: they are made here)

    outputs : garch, dcc, arch_lm, weights, fits;  options : as open_series
    The tables do not depend on how many parts there are.
    """
    array = open_series(task)
    provenance = replace(task, inputs={"series": task.inputs["series"]}).provenance()
    logging.info("%d samples, %d windows", array.samples, len(array.plan))
    parts = {name: task.inputs.get(name, []) for name in ("garch", "dcc", "weights")}
    if all(parts.values()):
        gather(array, parts, task.outputs, provenance)
        return
    with TemporaryDirectory(dir=task.output("weights").parent, prefix=".parts") as folder:
        made = {name: Path(folder) / f"{name}.parquet" for name in parts}
        write_parts(array, 0, len(array.plan), made)
        gather(array, {name: [path] for name, path in made.items()}, task.outputs, provenance)


def gather(array: ArraySeries, parts: Parts, outputs: dict[str, Path], provenance: Provenance) -> None:
    """Write the five tables."""
    garch, dcc = fit_whole(array, outputs["arch_lm"], provenance)
    fits = FitsMap(array)
    for name, whole in (("garch", garch), ("dcc", dcc)):
        rows = RowStream(chain([whole], *(row_groups(path) for path in parts[name])))
        with TableWriter(outputs[name], name, provenance) as writer:
            while (table := rows.take(ROW_GROUP)).num_rows:
                table = canonical(table)
                fits.count(table)
                writer.append(with_p_values(table) if name == "dcc" else table)
    write_table(outputs["fits"], fits.table(), "fits", provenance)
    blocks = blocks_of(array)
    extra = {"blocks": blocks, "samples": array.samples}
    with TableWriter(outputs["weights"], "weights", provenance, extra) as writer:
        for number, (model, mode) in enumerate(blocks):
            groups = chain.from_iterable(row_groups(path, None, number, len(blocks)) for path in parts["weights"])
            for table in weights_tables(array, RowStream(groups), {"model": model, "mode": mode}):
                writer.append(table)
            logging.info("%s, %s: %d samples", model, mode, array.samples)


def fit_whole(array: ArraySeries, arch_lm: Path, provenance: Provenance) -> tuple[pa.Table, pa.Table]:
    """Fit the longest stretch; write arch_lm.parquet; return its rows of garch and dcc."""
    window = array.whole
    values, time = array.table(*window)
    start, length, span = np.zeros(1, dtype=np.int64), window.length, array.options.residual_span
    fits = fit_windows(values, start, length, array.definition, span, start, array.engine)
    tests = [
        arch_lm_columns(array.gyros, name, series, array.options.arch_lags, length >= MIN_SAMPLES)
        for name, series in series_of(array, values, fits.garch).items()
    ]
    write_table(arch_lm, pa.concat_tables(tests), "arch_lm", provenance)
    place = place_columns(np.array([WHOLE]), start + window.start, length, time, window.start)
    return garch_columns(place, array.gyros, fits.garch), dcc_columns(place, fits.dcc)


def weights_tables(array: ArraySeries, parts: RowStream, labels: Mapping[str, str]) -> Iterator[pa.Table]:
    """Rows of one block of weights.parquet, ROW_GROUP at a time; equal weights where a stretch holds no window.

    parts : the rows of the stretches that hold one;  labels : columns that say which block it is
    """
    series = RowStream(row_groups(array.path, ["time", "segment"]))
    edges = np.array(array.plan.runs, dtype=np.int64).reshape(-1, 2)
    holds = edges[:, 1] - edges[:, 0] >= array.plan.length
    for begin in range(0, max(array.samples, 1), ROW_GROUP):
        head = series.take(ROW_GROUP)
        sample = begin + np.arange(head.num_rows)
        weighed = holds[np.searchsorted(edges[:, 0], sample, side="right") - 1]
        table = parts.take(int(weighed.sum()))
        if not weighed.all():
            table = filled(table, weighed, array)
        label = {name: words(np.zeros(len(sample), dtype=np.int32), [label]) for name, label in labels.items()}
        yield canonical(pa.table({**columns_of(head), **label, **columns_of(table)}))


def columns_of(table: pa.Table) -> dict[str, pa.ChunkedArray]:
    """The columns of a table by name."""
    return {name: table.column(name) for name in table.column_names}


def filled(table: pa.Table, there: np.ndarray, array: ArraySeries) -> pa.Table:
    """Rows [T] of which `there` [T] are the table's and the others have equal weights, for want of a window."""
    columns: dict[str, object] = {}
    for name in table.column_names[:-1]:
        given = table.column(name).to_numpy()
        column = np.full(len(there), 1 / len(array.gyros) if name.startswith("w_") else np.nan, dtype=given.dtype)
        column[there] = given
        columns[name] = column
    status = canonical(table.select(["status"])).column("status").combine_chunks()
    codes = np.zeros(len(there), dtype=np.int64)
    codes[there] = status.indices.to_numpy() + 1
    columns["status"] = words(codes, [array.too_short, *status.dictionary.to_pylist()])
    return pa.table(columns)


if __name__ == "__main__":
    run_task(main)
