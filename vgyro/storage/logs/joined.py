"""Streams of several clocks → one array: brought to one time, then read at the times of the slowest of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vgyro.alignment import FOUND, AlignedStream, interpolate, noise_gain, positions, refuse_clock, relative_clock
from vgyro.board import Board, Gyro
from vgyro.dataset import AT_REST, Recording
from vgyro.errors import DataError
from vgyro.storage.frames import Frames
from vgyro.storage.integrity import Ledger
from vgyro.storage.logs.intake import Intake
from vgyro.storage.logs.placing import Placing

SINCE_1970_S = 1e8
"""A stamp later than this, in s, counts from 1970: three years of any other clock."""
SAME_RATE = 0.005
"""Rates that differ by no more are one: clocks of ceramic resonators are off by 0.5 %, and no two settings so near."""
BLOCK = 1 << 18


class Whole(NamedTuple):
    """All rows of one stream on its own clock."""

    placing: Placing
    frames: Frames
    rate_hz: float

    @property
    def name(self) -> str:
        """Of the stream, for people."""
        return self.placing.intake.stream.name


class Joined:
    """The array that several streams make. Times are those of the slowest stream with gyros, the first of equals.

    At rest on one clock each reading is paired with the nearest and nothing is interpolated; else the others are read
    between their samples (vgyro.alignment.interpolate), which takes the white noise above 0.85 of Nyquist away: the
    share that is left is in the record of each clock. Readings of thermometers are always paired with the nearest.

    placings : the streams that are read, that of the array's times first
    notes    : sentences on streams of thermometers that are left out; complete when the last frame was given
    raises   : DataError where streams with gyros have neither a clock nor motion in common, or no row
    """

    def __init__(self, intakes: Sequence[Intake], recording: Recording, rate_hz: float | None, board: Board) -> None:
        assert recording.log is not None
        self._log, self._kind, self._board = recording.log, recording.kind, board
        self.notes: list[str] = []
        gyros = {gyro.field for gyro in board.gyros}
        placings: list[Placing] = []
        units: dict[tuple[Path, ...], str] = {}
        for intake in sorted(intakes, key=lambda one: gyros.isdisjoint(one.stream.columns)):
            files = intake.stream.files
            try:
                # One column of one log has one unit, which a slow thermometer cannot tell.
                placing = Placing(intake, rate_hz, board, units.get(files))
            except DataError as error:
                if not gyros.isdisjoint(intake.stream.columns):
                    raise
                self._leave_out(intake, str(error))
                continue
            placings.append(placing)
            units.setdefault(files, placing.clock.record().unit)
        with_gyros = [placing for placing in placings if placing.has_gyros]
        # Rates that differ by less than clocks do are one rate.
        slowest = min(placing.rate_hz for placing in with_gyros)
        first = next(placing for placing in with_gyros if placing.rate_hz < (1 + SAME_RATE) * slowest)
        self.placings = [first, *(placing for placing in placings if placing is not first)]

    def _leave_out(self, intake: Intake, why: str) -> None:
        self.notes.append(f"left out {', '.join(intake.stream.columns)}: {why}")

    def frames(self, ledger: Ledger) -> Iterator[Frames]:
        """The array, block by block; a gyro has no value where its stream has none.

        ledger : gets what is missing of the stream of the array's times; what others lack shows in their channels
        """
        first = _whole(self.placings[0], ledger)
        grid, columns = first.frames, dict(first.frames.counts)
        for placing in self.placings[1:]:
            whole = _whole(placing, Ledger())
            one_clock = self._one_clock(first.placing, placing)
            if placing.has_gyros or one_clock:
                columns.update(self._read_at(first, whole, one_clock))
            else:
                self._leave_out(placing.intake, f"{whole.name} has a clock of its own, and no gyro to find it by")
        self.placings = [one for one in self.placings if not columns.keys().isdisjoint(one.intake.stream.columns)]
        order = [name for name in dict.fromkeys(self._channels()) if name in columns]
        for start in range(0, len(grid.time), BLOCK):
            part = slice(start, start + BLOCK)
            counts = {name: columns[name][part] for name in order}
            yield Frames(counts, grid.counter[part], grid.time[part], grid.segment[part])

    def _channels(self) -> list[str]:
        return [*(gyro.field for gyro in self._board.gyros), *self._board.channels]

    def _one_clock(self, one: Placing, two: Placing) -> bool:
        """Do the stamps of two streams count on one clock?"""
        if self._log.clocks != "auto":
            return self._log.clocks == "one"
        if one.intake.time is None or two.intake.time is None:
            return False
        if one.intake.stream.files == two.intake.stream.files:
            return True
        return min(one.origin_s, two.origin_s) > SINCE_1970_S

    def _read_at(self, first: Whole, other: Whole, one_clock: bool) -> dict[str, np.ndarray]:
        """Channels of a stream at the times of the first, NaN where it has none."""
        grid, frames = first.frames, other.frames
        if one_clock:
            apart = other.placing.origin_s - first.placing.origin_s
            readings = grid.time - apart
            found: dict[str, Any] = {"offset_s": apart, "by": "stamps"}
        else:
            fit = relative_clock(self._motion(first, other), self._motion(other, first))
            if fit.status != FOUND:
                raise refuse_clock(fit, f"{first.name} and {other.name}")
            readings = fit.on_other(grid.time)
            found = {
                "offset_s": fit.offset_s, "offset_low_s": fit.offset_low, "offset_high_s": fit.offset_high,
                "drift_ppm": fit.drift_ppm, "drift_low_ppm": fit.drift_low, "drift_high_ppm": fit.drift_high,
                "by": "common motion",
            }  # fmt: skip
        paired = (one_clock and self._kind in AT_REST) or not other.placing.has_gyros
        if paired:
            at = nearest(frames.time, readings)
        else:
            at = positions(AlignedStream(frames.time, frames.time, other.rate_hz), readings)
        gain = noise_gain(at[np.isfinite(at)])
        other.placing.alignment = {**found, "to": first.name, "interpolated": not paired,
                                   "noise_gain": float(gain.mean()) if gain.size else 1.0}  # fmt: skip
        return {name: interpolate(values, at, frames.segment) for name, values in frames.counts.items()}

    def _motion(self, whole: Whole, other: Whole) -> AlignedStream:
        """The gyro of a stream about the axis that moves most of those that both have."""
        axes = [gyro.axis for gyro in self._gyros(whole) if gyro.axis in {one.axis for one in self._gyros(other)}]
        if not axes:
            what = "have no axis in common, so their clocks cannot be compared"
            remedy = "give their gyros the axes of the assembly, or set `log.clocks: one`"
            raise DataError(what, f"{whole.name} and {other.name}", remedy)
        axis = max(sorted(set(axes)), key=lambda name: min(self._spread(whole, name), self._spread(other, name)))
        gyro = next(gyro for gyro in self._gyros(whole) if gyro.axis == axis)
        rate = gyro.sign * (whole.frames.counts[gyro.field] - gyro.bias) * gyro.scale
        return AlignedStream(whole.frames.time, rate, whole.rate_hz)

    def _spread(self, whole: Whole, axis: str) -> float:
        gyro = next(gyro for gyro in self._gyros(whole) if gyro.axis == axis)
        return float(np.nanstd(whole.frames.counts[gyro.field]) * gyro.scale)

    def _gyros(self, whole: Whole) -> list[Gyro]:
        return [gyro for gyro in self._board.gyros if gyro.field in whole.frames.counts]


def _whole(placing: Placing, ledger: Ledger) -> Whole:
    """All rows of a stream. ledger : gets its gaps"""
    parts = list(placing.frames(ledger))
    counts = {name: np.concatenate([part.counts[name] for part in parts]) for name in parts[0].counts}
    counter, time, segment = (np.concatenate([part[place] for part in parts]) for place in (1, 2, 3))
    return Whole(placing, Frames(counts, counter, time, segment), placing.rate_hz)


def nearest(time: np.ndarray, readings: np.ndarray) -> np.ndarray:
    """The sample nearest to each reading, as a position; NaN where none is within half a step of its neighbours."""
    after = np.clip(np.searchsorted(time, readings), 1, max(len(time) - 1, 1))
    if len(time) < 2:
        return np.full(len(readings), np.nan)
    near = np.where(readings - time[after - 1] < time[after] - readings, after - 1, after)
    usual = np.median(np.diff(time))
    return np.where(np.abs(time[near] - readings) <= usual / 2, near, np.nan).astype(float)
