"""What the volatility tasks share: the series of one array, its windows, and the parameters stored before."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import TypeVar, get_args

import numpy as np

from vgyro.board import Board
from vgyro.config import Definition, VolatilityOptions
from vgyro.errors import ConfigError
from vgyro.storage.tables import read_columns
from vgyro.tasks.common import Task
from vgyro.tasks.rates_file import read_array
from vgyro.volatility.series import Series, block_means
from vgyro.volatility.stretches import Window, longest_stretch, stretches, windows
from vgyro.volatility.windowed import MIN_SAMPLES, fitted_residuals

WHOLE = -1
"""Number of the window that is the longest stretch of the record."""
IN_MOTION = ("constant", "random", "sinusoid")
PROGRESS_STEPS = 20

Item = TypeVar("Item")


@dataclass(frozen=True)
class ArraySeries:
    """One array's series and how it is analysed. `jobs`: number and samples of each window, the whole record first."""

    gyros: list[str]
    series: Series
    options: VolatilityOptions
    definition: Definition
    engine: str
    jobs: list[tuple[int, Window]]

    def residuals(self, window: Window) -> np.ndarray:
        """r_t that the models of a window are fitted to, [T, N] deg/s."""
        start = next(
            (run.start for run in stretches(self.series.stretch) if run.start <= window.start < run.stop), window.start
        )
        return fitted_residuals(self.series.values, window, self.definition, self.options.residual_span, start)

    def place(self, number: int, window: Window) -> dict[str, object]:
        """Columns that say where a window is; times are those of the first samples of its first and last block."""
        time = self.series.time
        first, last = (time[window.start], time[window.stop - 1]) if window.length else (np.nan, np.nan)
        return {
            "window": number,
            "start": window.start,
            "stop": window.stop,
            "time_start": float(first),
            "time_stop": float(last),
        }

    @property
    def too_short(self) -> str:
        """Why there is no window."""
        longest = longest_stretch(self.series.stretch).length
        return f"too short: {longest} samples, window {self.options.window}"


def open_series(task: Task) -> ArraySeries:
    """Read the rates of one array and make its series and windows.

    Where the board is known to stand still at times, only those samples are used; a recording in motion is used whole.
    """
    analysis = task.options["analysis"]
    options = VolatilityOptions.model_validate(analysis.get("volatility", {}))
    gyros = [gyro.name for gyro in Board.model_validate(task.options["board"]).array(task.options["axis"])]
    rates = read_array(task.input("rates"), gyros, task.options["axis"])
    rest = rates.at_rest
    in_motion = task.options.get("kind") in IN_MOTION or not rest.any()
    used = None if in_motion else rest
    series = block_means(rates.rate, rates.rate_hz, options.rate_hz, rates.segment, used, rates.time)
    found = windows(series.stretch, options.window, options.step)
    jobs = [(WHOLE, longest_stretch(series.stretch)), *enumerate(found)]
    logging.info(
        "%d samples at %g Hz, %s, %d windows", len(series.values), series.rate_hz, _use(in_motion, rest), len(found)
    )
    return ArraySeries(gyros, series, options, _definition(task), analysis.get("engine", "reference"), jobs)


def _use(in_motion: bool, rest: np.ndarray) -> str:
    return "in motion, all of it used" if in_motion else f"{rest.mean():.1%} of the recording at rest and used"


def _definition(task: Task) -> Definition:
    definition = task.options["definition"]
    if definition not in get_args(Definition):
        raise ConfigError(f"unknown definition {definition!r}", remedy=f"One of {', '.join(get_args(Definition))}")
    return definition


def enough(window: Window) -> bool:
    """True if the window is long enough to be fitted."""
    return window.length >= MIN_SAMPLES


def with_progress(items: Sequence[Item]) -> Iterator[Item]:
    """Pass the items on; log every 5 % how many are done, how many remain, how fast."""
    every = max(1, len(items) // PROGRESS_STEPS)
    begun = perf_counter()
    for done, item in enumerate(items, start=1):
        yield item
        if done % every == 0 or done == len(items):
            speed = done / max(perf_counter() - begun, 1e-9)
            logging.info("window %d of %d, %d remain, %.1f a second", done, len(items), len(items) - done, speed)


def stored_garch(path: Path, gyros: list[str]) -> dict[int, dict[str, np.ndarray]]:
    """garch.parquet as window → column → array [N] in the order of the gyros."""
    table = read_columns(path, ["window", "gyro", "omega", "alpha", "beta", "status"])
    found: dict[int, dict[str, np.ndarray]] = {}
    for number in np.unique(table["window"]):
        rows = np.flatnonzero(table["window"] == number)
        order = rows[[int(np.flatnonzero(table["gyro"][rows] == gyro)[0]) for gyro in gyros]]
        found[int(number)] = {name: table[name][order] for name in ("omega", "alpha", "beta", "status")}
    return found
