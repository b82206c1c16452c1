"""Delays between the gyros of one board: found from the motion they have in common, and taken out of the rates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from vgyro.board import Board
from vgyro.dataset import AT_REST, Recording
from vgyro.storage.tables import read_column

if TYPE_CHECKING:
    from vgyro.alignment import Delays


class HasRates(Protocol):
    """What gives the rates of some gyros [T, n], deg/s (vgyro.tasks.rates.convert.Converter)."""

    board: Board
    recording: Recording

    def array(self, frames: Path, names: list[str]) -> np.ndarray: ...


@dataclass(frozen=True)
class Lateness:
    """What was found, and the rates of the gyros that were late, brought back to the time of the others.

    record : axis → what stands in the metadata of rates.parquet;  rates : gyro → [T] deg/s, of the late ones
    """

    record: Mapping[str, Any] = field(default_factory=dict)
    rates: Mapping[str, np.ndarray] = field(default_factory=dict)


def lateness(converter: HasRates, frames: Path, rate_hz: float) -> Lateness:
    """Delays of every array of a recording that moves; those that are significant are taken out.

    A late gyro is read between its samples (vgyro.alignment.interpolate): its white noise above 0.85 of Nyquist goes,
    and the record says what is left of the variance. A recording at rest has none to find.
    """
    if converter.recording.kind in AT_REST:
        return Lateness()
    # Only recordings that move pay for its imports.
    from vgyro.alignment import interpolate, noise_gain, relative_delays

    segment = read_column(frames, "segment")
    record: dict[str, Any] = {}
    rates: dict[str, np.ndarray] = {}
    for axis in converter.board.axes:
        names = [gyro.name for gyro in converter.board.array(axis)]
        if len(names) < 2:
            continue
        array = converter.array(frames, names)
        found = relative_delays(array, rate_hz, segment)
        gyros = {}
        for place, name in enumerate(names):
            late = float(found.delay_s[place]) if found.significant[place] else 0.0
            at = np.arange(len(array)) + late * rate_hz if late else np.empty(0)
            gyros[name] = _entry(found, place, noise_gain(at[:1])[0] if late else 1.0)
            if late:
                rates[name] = interpolate(array[:, place].astype(float), at, segment)
        record[axis] = {"status": found.status, "moving_s": float(found.moving_s), "gyros": gyros}
    return Lateness(record, rates)


def noise_left(board: Board, integrity: Mapping[str, Any], late: Lateness) -> dict[str, dict[str, float]]:
    """Metadata of the gyros that were interpolated, noise_gain: gyro → what is left of the variance of white noise.

    By the joining of clocks (integrity.json) and by a delay that was taken out; empty where no gyro was interpolated.
    """
    by_clock = {
        channel: float(clock["alignment"]["noise_gain"])
        for clock in integrity["clocks"]
        if clock["alignment"]
        for channel in clock["channels"]
    }
    by_delay = {name: one["noise_gain"] for found in late.record.values() for name, one in found["gyros"].items()}
    gains = {gyro.name: by_clock.get(gyro.field, 1.0) * by_delay.get(gyro.name, 1.0) for gyro in board.gyros}
    found = {name: gain for name, gain in gains.items() if gain < 1.0}
    return {"noise_gain": found} if found else {}


def _entry(found: Delays, place: int, gain: float) -> dict[str, Any]:
    """One gyro in the metadata; null where nothing was found."""
    limits = {"delay_s": found.delay_s, "low_s": found.low, "high_s": found.high}
    numbers = {name: float(values[place]) if np.isfinite(values[place]) else None for name, values in limits.items()}
    return {**numbers, "removed": bool(found.significant[place]), "noise_gain": float(gain)}
