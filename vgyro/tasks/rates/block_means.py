"""Columns of frames in pieces: one of them whole, or means of blocks of time of several."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vgyro.arrays import Floats, Ints
from vgyro.board import Board, Temperature
from vgyro.runs import run_starts
from vgyro.storage.tables import read_batches

HALF = 0.5


@dataclass(frozen=True)
class FrameMeans:
    """Means of blocks that lie within one gap-free segment each.

    seconds : length of a block;  time [M] : mean time of its samples, s;  segment [M];  values : column → [M]
    """

    seconds: float
    time: np.ndarray
    segment: np.ndarray
    values: dict[str, np.ndarray]


def block_means(
    frames: Path, columns: list[str], seconds: float = 1.0, rails: Mapping[str, tuple[float, float]] | None = None
) -> FrameMeans:
    """Means of blocks of `seconds` of the recording's clock; the memory is that of a row group and of the means.

    rails : column → counts at which the converter clips; a block with a clipped sample is NaN there
    A column that lacks values in a block has the mean of those that are there, and NaN where there are none.
    Blocks with fewer than half as many samples as usual are left out, and so is what is cut off by a gap.
    """
    names = list(dict.fromkeys(columns))
    blocks: list[np.ndarray] = []
    rest = {name: np.empty(0) for name in ("time", "segment", *names)}
    for raw in read_batches(frames, ["time", "segment", *names]):
        rest = {name: np.concatenate([rest[name], raw[name].astype(float)]) for name in rest}
        _hide_clipped(rest, rails or {})
        starts = _starts(rest, seconds)
        blocks.append(_means(rest, starts, names))
        rest = {name: values[starts[-1] :] if starts.size else values for name, values in rest.items()}
    last = np.zeros(1 if rest["time"].size else 0, dtype=np.int64)
    blocks.append(_means(rest, np.append(last, rest["time"].size) if last.size else last, names))
    table = np.concatenate(blocks, axis=1)
    samples = table[0]
    kept = samples >= HALF * (np.median(samples) if samples.size else 0.0)
    values = {name: table[3 + index][kept] for index, name in enumerate(names)}
    return FrameMeans(seconds, table[1][kept], table[2][kept].astype(np.int64), values)


def _hide_clipped(columns: dict[str, np.ndarray], rails: Mapping[str, tuple[float, float]]) -> None:
    for name, (low, high) in rails.items():
        values = columns[name]
        # A mean with it is infinite, which _means tells from values that are not there.
        values[(values <= low) | (values >= high)] = np.inf


def _starts(columns: dict[str, np.ndarray], seconds: float) -> np.ndarray:
    """Rows where a block begins; the last of them may go on in the next piece."""
    return run_starts(np.floor(columns["time"] / seconds), columns["segment"])


def _means(columns: dict[str, np.ndarray], starts: np.ndarray, names: list[str]) -> np.ndarray:
    """[samples, time, segment, columns…] of the blocks between two starts, [3 + n, M]."""
    blocks = max(len(starts) - 1, 0)
    if blocks == 0:
        return np.empty((3 + len(names), 0))
    samples = np.diff(starts)
    stop = int(starts[-1])
    head = [np.add.reduceat(columns[name][:stop], starts[:-1]) / samples for name in ("time", "segment")]
    return np.vstack([samples, *head, *(_mean(columns[name][:stop], starts[:-1], samples) for name in names)])


def _mean(values: Floats, begins: Ints, samples: Ints) -> Floats:
    """Means [M] of the values that are there in each block; NaN: none is, or one of them was clipped."""
    total, count = np.add.reduceat(values, begins), samples.astype(float)
    if np.isnan(total).any():
        there = ~np.isnan(values)
        total = np.add.reduceat(np.where(there, values, 0.0), begins)
        count = np.add.reduceat(there, begins, dtype=float)
    mean: Floats = np.divide(total, count, out=np.full(len(total), np.nan), where=count > 0)
    mean[np.isinf(mean)] = np.nan
    return mean


def between(time: Floats, values: Floats) -> Floats:
    """values [M] at time [M], s, with those that are NaN interpolated in time, and held at the ends; all NaN: as is."""
    there = np.isfinite(values)
    if there.all() or not there.any():
        return values
    return np.interp(time, time[there], values[there])


def thermometer_of(board: Board, gyro: str) -> Temperature | None:
    """The gyro's own thermometer, else the board's, where it has only one that is nobody else's; else None."""
    own = [thermometer for thermometer in board.temperatures if thermometer.gyro == gyro]
    free = [thermometer for thermometer in board.temperatures if thermometer.gyro is None]
    if own:
        return own[0]
    return free[0] if len(free) == 1 else None
