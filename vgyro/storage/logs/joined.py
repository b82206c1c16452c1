"""Streams of several clocks → one array: brought to one time, then read at the times of the slowest of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from vgyro.alignment import FOUND, Stream, interpolate, noise_gain, positions, refuse_clock, relative_clock, stretches
from vgyro.board import Board, Gyro
from vgyro.dataset import AT_REST, Recording
from vgyro.errors import DataError
from vgyro.log import Log
from vgyro.storage.frames import Frames
from vgyro.storage.integrity import Ledger
from vgyro.storage.logs.intake import Intake
from vgyro.storage.logs.reader import Placing

SINCE_1970_S = 1e8
"""A stamp later than this, in s, counts from 1970: three years of any other clock."""
BLOCK = 1 << 18


class Whole(NamedTuple):
    """All rows of one stream on its own clock."""

    placing: Placing
    frames: Frames
    rate_hz: float


class Joined:
    """The array that several streams make. Times are those of the slowest stream, the first of equals.

    At rest on one clock each reading is paired with the nearest and nothing is interpolated; else the others are read
    between their samples (vgyro.alignment.interpolate), which takes the white noise above 0.85 of Nyquist away: the
    share that is left is in the record of each clock.
    raises : DataError where the streams have neither a clock nor motion in common
    """

    def __init__(self, intakes: Sequence[Intake], recording: Recording, rate_hz: float | None, board: Board) -> None:
        assert recording.log is not None
        self.placings = [Placing(intake, rate_hz, board) for intake in intakes]
        self._log, self._kind, self._board = recording.log, recording.kind, board
        self.notes: list[str] = []

    def frames(self, ledger: Ledger) -> Iterator[Frames]:
        """The array, block by block; a gyro has no value where its stream has none."""
        wholes = [self._whole(placing) for placing in self.placings]
        first = min(wholes, key=lambda whole: (round(whole.rate_hz, 1), self.placings.index(whole.placing)))
        for gap in first.placing.clock.record().gaps:
            ledger.add_gap(gap.time, gap.duration, gap.lost, gap.cause)
        one_clock = self._one_clock()
        columns: dict[str, np.ndarray] = {}
        grid = first.frames
        for whole in wholes:
            if whole is first:
                columns.update(grid.counts)
            else:
                columns.update(self._read_at(first, whole, one_clock))
        order = [name for name in dict.fromkeys(self._channels()) if name in columns]
        for start in range(0, len(grid.time), BLOCK):
            part = slice(start, start + BLOCK)
            counts = {name: columns[name][part] for name in order}
            yield Frames(counts, grid.counter[part], grid.time[part], grid.segment[part])

    def _channels(self) -> list[str]:
        return [*(gyro.field for gyro in self._board.gyros), *self._board.channels]

    def _whole(self, placing: Placing) -> Whole:
        parts = list(placing.frames(Ledger()))
        if not parts:
            raise DataError("has no row", placing.intake.stream.name, "check `log.columns` in the manifest")
        counts = {name: np.concatenate([part.counts[name] for part in parts]) for name in parts[0].counts}
        counter, time, segment = (np.concatenate([part[place] for part in parts]) for place in (1, 2, 3))
        return Whole(placing, Frames(counts, counter, time, segment), float(placing.clock.record().rate_hz))

    def _one_clock(self) -> bool:
        """Do the stamps of all streams count on one clock?"""
        if self._log.clocks != "auto":
            return self._log.clocks == "one"
        if any(placing.intake.time is None for placing in self.placings):
            return False
        if len({placing.intake.stream.files for placing in self.placings}) == 1:
            return True
        starts = [placing.zero_s for placing in self.placings]
        return all(start > SINCE_1970_S for start in starts)

    def _read_at(self, first: Whole, other: Whole, one_clock: bool) -> dict[str, np.ndarray]:
        """Channels of a stream at the times of the first, NaN where it has none."""
        grid, frames = first.frames, other.frames
        if one_clock:
            readings = grid.time + first.placing.zero_s - other.placing.zero_s
            found: dict[str, Any] = {"offset_s": other.placing.zero_s - first.placing.zero_s, "by": "stamps"}
        else:
            fit = relative_clock(self._motion(first, other), self._motion(other, first))
            if fit.status != FOUND:
                raise refuse_clock(fit, f"{first.placing.intake.stream.name} and {other.placing.intake.stream.name}")
            readings = fit.on_other(grid.time)
            found = {
                "offset_s": fit.offset_s, "offset_low_s": fit.offset_low, "offset_high_s": fit.offset_high,
                "drift_ppm": fit.drift_ppm, "drift_low_ppm": fit.drift_low, "drift_high_ppm": fit.drift_high,
                "by": "common motion",
            }  # fmt: skip
        paired = one_clock and self._kind in AT_REST
        at = nearest(frames.time, readings) if paired else positions(Stream(frames.time, readings, other.rate_hz), readings)
        segment = stretches(frames.time, other.rate_hz)
        gain = noise_gain(at[np.isfinite(at)])
        other.placing.alignment = {**found, "to": first.placing.intake.stream.name, "interpolated": not paired,
                                   "noise_gain": float(gain.mean()) if gain.size else 1.0}  # fmt: skip
        return {name: interpolate(values, at, segment) for name, values in frames.counts.items()}

    def _motion(self, whole: Whole, other: Whole) -> Stream:
        """The gyro of a stream about the axis that moves most of those that both have."""
        axes = [gyro.axis for gyro in self._gyros(whole) if gyro.axis in {one.axis for one in self._gyros(other)}]
        if not axes:
            what = "have no axis in common, so their clocks cannot be compared"
            raise DataError(what, f"{whole.placing.intake.stream.name} and {other.placing.intake.stream.name}",
                            "give their gyros the axes of the assembly, or set `log.clocks: one`")  # fmt: skip
        axis = max(sorted(set(axes)), key=lambda name: min(self._spread(whole, name), self._spread(other, name)))
        gyro = next(gyro for gyro in self._gyros(whole) if gyro.axis == axis)
        rate = gyro.sign * (whole.frames.counts[gyro.field] - gyro.bias) * gyro.scale
        return Stream(whole.frames.time, rate, whole.rate_hz)

    def _spread(self, whole: Whole, axis: str) -> float:
        gyro = next(gyro for gyro in self._gyros(whole) if gyro.axis == axis)
        return float(np.nanstd(whole.frames.counts[gyro.field]) * gyro.scale)

    def _gyros(self, whole: Whole) -> list[Gyro]:
        return [gyro for gyro in self._board.gyros if gyro.field in whole.frames.counts]


def nearest(time: np.ndarray, readings: np.ndarray) -> np.ndarray:
    """The sample nearest to each reading, as a position; NaN where none is within half a step of its neighbours."""
    after = np.clip(np.searchsorted(time, readings), 1, max(len(time) - 1, 1))
    if len(time) < 2:
        return np.full(len(readings), np.nan)
    near = np.where(readings - time[after - 1] < time[after] - readings, after - 1, after)
    usual = np.median(np.diff(time))
    return np.where(np.abs(time[near] - readings) <= usual / 2, near, np.nan).astype(float)
