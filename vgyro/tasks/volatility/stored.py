"""What the volatility tasks share: where the series of one array and its windows are, and the models stored of them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import get_args

import numpy as np

from vgyro.board import Board
from vgyro.config import Definition, VolatilityOptions
from vgyro.engine.models import DCC_STATUSES, GARCH_STATUSES, DccWindows, GarchWindows
from vgyro.errors import ConfigError
from vgyro.storage.tables import read_metadata, read_rows
from vgyro.tasks.common import Task
from vgyro.tasks.volatility.layout import WHOLE, dcc_row, garch_rows
from vgyro.volatility.fits import WindowFits, window_models
from vgyro.volatility.rolling import WindowModels
from vgyro.volatility.stretches import RollingWindows, Window, rolling_windows
from vgyro.volatility.windowed import fitted_residuals

WHOLE_SAMPLES = 1_000_000
"""Of a longer stretch, that window is the first so many samples."""
SLAB = 1 << 20
LEVEL, MOVED = "level", "moved"
"""`moved` is the level of the series with a constant rate added: no definition of its own, but made as one is."""


@dataclass(frozen=True)
class ArraySeries:
    """One array's series, which stays in its file, and how it is analysed.

    added : constant rate that is added to every gyro, deg/s
    """

    path: Path
    gyros: list[str]
    rate_hz: float
    plan: RollingWindows
    options: VolatilityOptions
    definition: Definition
    engine: str
    added: float = 0.0

    @property
    def samples(self) -> int:
        """Samples of the series."""
        return self.plan.samples

    @property
    def longest(self) -> Window:
        """The longest stretch, the first of several; empty for an empty series."""
        return max(self.plan.runs, key=lambda run: run.length, default=Window(0, 0))

    @property
    def whole(self) -> Window:
        """Window WHOLE."""
        longest = self.longest
        return Window(longest.start, min(longest.stop, longest.start + WHOLE_SAMPLES))

    @property
    def too_short(self) -> str:
        """Why a stretch holds no window."""
        return f"too short: {self.longest.length} samples, window {self.options.window}"

    def window(self, number: int) -> Window:
        """Samples of a window."""
        return self.whole if number == WHOLE else self.plan.window(number)

    def rows(self, start: int, stop: int) -> np.ndarray:
        """Samples start to stop - 1, [stop - start, N] deg/s."""
        return self.table(start, stop)[0]

    def table(self, start: int, stop: int) -> tuple[np.ndarray, np.ndarray]:
        """Samples start to stop - 1, [stop - start, N] deg/s, and their time [stop - start], s."""
        found = read_rows(self.path, ["time", *self.gyros], start, stop)
        values = np.column_stack([found[gyro] for gyro in self.gyros]).astype(float, copy=False)
        return (values + self.added if self.added else values), found["time"]

    def residuals(self, number: int) -> np.ndarray:
        """r_t that the models of a window are fitted to, [T, N] deg/s."""
        window = self.window(number)
        begin = window.start if number == WHOLE else int(self.plan.stretch_start[number])
        first = max(begin, window.start - 1)
        here = Window(window.start - first, window.stop - first)
        values = self.rows(first, window.stop)
        return fitted_residuals(values, here, self.definition, self.options.residual_span, begin - first)


class Slab:
    """The series read forward, many samples at a time; what windows that follow each other share is read once."""

    def __init__(self, array: ArraySeries) -> None:
        self._array, self._start = array, 0
        self._values, self._time = np.empty((0, len(array.gyros))), np.empty(0)

    def table(self, start: int, stop: int) -> tuple[np.ndarray, np.ndarray]:
        """As ArraySeries.table."""
        if start < self._start or stop > self._start + len(self._time):
            until = min(max(stop, start + SLAB), self._array.samples)
            self._start, (self._values, self._time) = start, self._array.table(start, until)
        rows = slice(start - self._start, stop - self._start)
        return self._values[rows], self._time[rows]


def open_series(task: Task, name: str = "series") -> ArraySeries:
    """Where the series of one array is, from the input `name`.

    options : board, axis, definition, analysis.engine, analysis.volatility; of the definition `moved`, injected_rate
    raises  : ConfigError if the definition is not known
    """
    options = task.section("volatility", VolatilityOptions)
    gyros = [gyro.name for gyro in task.section("board", Board).array(task.option("axis"))]
    definition, added = task.option("definition"), 0.0
    if definition == MOVED:
        definition, added = LEVEL, float(task.option("injected_rate"))
    if definition not in get_args(Definition):
        raise ConfigError(f"unknown definition {definition!r}", remedy=f"One of {', '.join(get_args(Definition))}")
    path = task.input(name)
    about = read_metadata(path)
    plan = rolling_windows([Window(start, stop) for start, stop, _ in about["runs"]], options.window, options.step)
    engine = task.engine
    return ArraySeries(path, gyros, about["rate_hz"], plan, options, definition, engine, added)


def stored_model(array: ArraySeries, garch_path: Path, dcc_path: Path, number: int) -> WindowModels:
    """The model of one window, as garch.parquet and dcc.parquet hold it."""
    n = len(array.gyros)
    garch = garch_rows(garch_path, ["omega", "alpha", "beta", "status"], number, n)
    dcc = dcc_row(dcc_path, ["a", "b", "target", "status"], number)
    target = np.eye(n)
    target[np.triu_indices(n, 1)] = dcc["target"][0]
    target = np.triu(target) + np.triu(target, 1).T
    omega, alpha, beta = (garch[name][None] for name in ("omega", "alpha", "beta"))
    status = np.array([[GARCH_STATUSES.index(name) for name in garch["status"]]], dtype=np.uint8)
    found = np.array([DCC_STATUSES.index(dcc["status"][0])], dtype=np.uint8)
    nan, pair = np.full(1, np.nan), np.full((1, 2), np.nan)
    fits = WindowFits(
        GarchWindows(omega, alpha, beta, np.full((1, n, 3), np.nan), np.full((1, n), np.nan), status),
        DccWindows(dcc["a"], dcc["b"], pair, pair, target[None], nan, nan, nan, found),
    )
    window = array.window(number)
    return window_models(fits, np.array([window.start]), window.length, array.gyros)
