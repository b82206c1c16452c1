"""Where the rows of a window, and of a block of weights, are in the volatility tables. Nobody else counts rows."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vgyro.storage.tables import read_metadata, read_rows

WHOLE = -1
"""Number of the fit to the longest stretch; the rolling windows have numbers from 0."""


def garch_rows(path: Path, columns: list[str], number: int, gyros: int) -> dict[str, np.ndarray]:
    """Columns of garch.parquet for one window, each [N], the gyros in their order.

    raises : ValueError if the rows are not of that window
    """
    return _of_window(path, columns, number, gyros)


def dcc_row(path: Path, columns: list[str], number: int) -> dict[str, np.ndarray]:
    """Columns of dcc.parquet for one window, each [1].  raises : ValueError if the row is not of that window"""
    return _of_window(path, columns, number, 1)


def _of_window(path: Path, columns: list[str], number: int, each: int) -> dict[str, np.ndarray]:
    row = number - WHOLE
    found = read_rows(path, ["window", *columns], row * each, (row + 1) * each)
    if not np.array_equal(found["window"], np.full(each, number)):
        raise ValueError(f"window {number} is not where it should be in {path}")
    return {name: found[name] for name in columns}


def weight_blocks(path: Path) -> tuple[dict[tuple[str, str], int], int]:
    """First row of each block (model, mode) of weights.parquet, and the samples that every block has a row for."""
    about = read_metadata(path)
    samples = int(about["samples"])
    return {(model, mode): place * samples for place, (model, mode) in enumerate(about["blocks"])}, samples
