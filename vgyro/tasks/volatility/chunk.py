"""Volatility chunk: GARCH, DCC and weights of some of the rolling windows of one array, one definition of r_t."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np
import pyarrow as pa

from vgyro.config import CorrelationModel, Mode
from vgyro.storage.tables import Provenance, TableWriter, words
from vgyro.tasks.common import Task, run_task
from vgyro.tasks.volatility.columns import dcc_columns, garch_columns, place_columns
from vgyro.tasks.volatility.stored import ArraySeries, Slab, open_series
from vgyro.volatility.fits import fit_windows, window_models
from vgyro.volatility.rolling import WindowModels, WindowWeights, weights_of_windows
from vgyro.volatility.stretches import Window

SECTIONS = ("board", "engine", "volatility")

BATCH_WINDOWS = 512
BATCH_SAMPLES = 1 << 18
"""A batch holds no more windows, and no more samples of windows (where two overlap, both count), but at least one."""
FAR = 1 << 16
"""Samples without a window that end a batch, so that it does not hold them."""
UNCUT = 1 << 62
NO_PROVENANCE = Provenance({}, "", "")
PROGRESS_SHARE, PROGRESS_S = 0.05, 10.0


def main(task: Task) -> None:
    """inputs : series;  outputs : garch, dcc, weights (parts, uncompressed);  options : as open_series, and chunk

    chunk : "3-of-29", the third of 29 parts of the windows; they differ by one window at most
    """
    array = open_series(task)
    chunk, chunks = (int(number) for number in str(task.option("chunk")).split("-of-"))
    edges = [len(array.plan) * number // chunks for number in (chunk - 1, chunk)]
    write_parts(array, edges[0], edges[1], task.outputs)


def write_parts(array: ArraySeries, first: int, last: int, paths: Mapping[str, Path]) -> None:
    """Fit and weigh windows first to last - 1; write the parts garch, dcc and weights.

    The rows of `weights` are the samples that the windows weigh, and those of their stretches before; one row group
    for each batch and each of `blocks_of`.
    """
    slab, progress = Slab(array), Progress(last - first)
    with ExitStack() as stack:
        garch, dcc, weights = (
            stack.enter_context(TableWriter(paths[name], name, NO_PROVENANCE, compression="none", row_group=UNCUT))
            for name in ("garch", "dcc", "weights")
        )
        for numbers in batches(array, first, last):
            begin, end = reach(array, numbers)
            values, time = slab.table(begin, end)
            start, stretch_start = array.plan.start[numbers], array.plan.stretch_start[numbers]
            length, span = array.plan.length, array.options.residual_span
            fits = fit_windows(
                values, start - begin, length, array.definition, span, stretch_start - begin, array.engine
            )
            place = place_columns(numbers, start, length, time, begin)
            garch.append(garch_columns(place, array.gyros, fits.garch))
            dcc.append(dcc_columns(place, fits.dcc))
            for found in weigh(array, values, begin, window_models(fits, start, length, array.gyros), numbers):
                weights.append(weights_columns(array, found))
            progress.add(len(numbers))


def batches(array: ArraySeries, first: int, last: int) -> Iterator[np.ndarray]:
    """Numbers of the windows that are fitted together; at least one batch, if an empty one."""
    start, length = array.plan.start[first:last], array.plan.length
    most = max(1, min(BATCH_WINDOWS, BATCH_SAMPLES // (length + array.plan.step)))
    far = np.flatnonzero(np.diff(start) > length + FAR) + 1
    for part in np.split(np.arange(first, last), far):
        for begin in range(0, max(len(part), 1), most):
            yield part[begin : begin + most]


def reach(array: ArraySeries, numbers: np.ndarray) -> Window:
    """The samples that a batch of windows needs, for fits, weights and differences."""
    if len(numbers) == 0:
        return Window(0, 0)
    plan = array.plan
    head, tail = (plan.runs[plan.run[number]] for number in (numbers[0], numbers[-1]))
    end = int(plan.start[numbers[-1]]) + plan.length + plan.step
    return Window(max(head.start, int(plan.start[numbers[0]]) - 1), min(tail.stop, end))


def blocks_of(array: ArraySeries) -> list[tuple[CorrelationModel, Mode]]:
    """The blocks of weights.parquet, in their order."""
    return [(model, mode) for model in array.options.models for mode in array.options.modes]


def weigh(
    array: ArraySeries, values: np.ndarray, offset: int, models: WindowModels, numbers: np.ndarray
) -> Iterator[WindowWeights]:
    """Weights of a batch of windows, one for each of `blocks_of`; values: samples from `offset` on."""
    plan, modes = array.plan, array.options.modes
    runs = plan.runs[plan.run[numbers[0]] : plan.run[numbers[-1]] + 1] if len(numbers) else ()
    # The stretches of the batch are the whole series to `weights_of_windows`: they begin at sample 0.
    origin = runs[0].start if runs else 0
    here = [Window(run.start - origin, run.stop - origin) for run in runs]
    moved = replace(models, start=models.start - origin)
    for model in array.options.models:
        found = weights_of_windows(
            values, moved, here, array.definition, modes, model, plan.step, array.options.residual_span, array.engine,
            offset - origin, array.too_short,
        )  # fmt: skip
        yield from (found[mode] for mode in modes)


def weights_columns(array: ArraySeries, found: WindowWeights) -> pa.Table:
    """Rows of the part `weights`, but for the stretches between that hold no window."""
    keep = found.status != found.statuses.index(array.too_short)
    kept = slice(None) if keep.all() else keep
    deviation, weights = found.deviation[kept].astype(np.float32), found.weights[kept]
    return pa.table(
        {
            "sigma": found.sigma[kept].astype(np.float32),
            **{f"w_{gyro}": weights[:, i] for i, gyro in enumerate(array.gyros)},
            **{f"sd_{gyro}": deviation[:, i] for i, gyro in enumerate(array.gyros)},
            "status": words(found.status[kept], found.statuses),
        }
    )


class Progress:
    """Tells the log how many windows are done, of how many, how fast, and how long the rest will take."""

    def __init__(self, total: int) -> None:
        self._total, self._done, self._told = total, 0, 0
        self._begun = self._last = perf_counter()

    def add(self, count: int) -> None:
        """So many more are done."""
        self._done += count
        now = perf_counter()
        share = (self._done - self._told) / max(self._total, 1)
        if share < PROGRESS_SHARE and now - self._last < PROGRESS_S and self._done < self._total:
            return
        speed = self._done / max(now - self._begun, 1e-9)
        left = (self._total - self._done) / max(speed, 1e-9)
        logging.info("window %d of %d, %.0f a second, %.0f s left", self._done, self._total, speed, left)
        self._told, self._last = self._done, now


if __name__ == "__main__":
    run_task(main)
