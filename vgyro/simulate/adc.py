"""Rates and temperatures → the numbers that a board sends: its scale, rounding, the rails of its ADC, dead channels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vgyro.arrays import Floats, Ints
from vgyro.board import Board
from vgyro.simulate.faults import Stretch
from vgyro.simulate.serial.encode import type_limits


class AdcConverter:
    """Counts of a recording, piece after piece.

    count = bias + sign · (1 + scale error) · rate / scale, rounded to the nearest, held at the rails.
    scale_error : [N];  raises : ConfigError for a board without frames
    """

    def __init__(self, board: Board, scale_error: list[float], stretches: Sequence[Stretch]) -> None:
        self._board, self._scale_error = board, scale_error
        self._kinds = {channel: field.type for field in board.layout.fields for channel in field.channels()}
        self._dead = [s for s in stretches if s.fault.kind == "stuck"]
        self._dead += [s for s in stretches if s.fault.kind == "dropout"]
        self._stuck_at: dict[int, float] = {}  # by number in _dead
        self._last: dict[int, float] = {}  # count of each gyro before the piece, dropouts left out

    def counts(self, rates: np.ndarray, temperature: np.ndarray, first: int) -> dict[str, np.ndarray]:
        """Channel → [T]: int64 for integer fields, float64 for fields that the board sends as floats.

        rates : [T, N], deg/s, referred to the input;  temperature : [T], °C;  first : row of the recording
        """
        counts: dict[str, np.ndarray] = {}
        for index, gyro in enumerate(self._board.gyros):
            exact = gyro.bias + gyro.sign * (1.0 + self._scale_error[index]) * rates[:, index] / gyro.scale
            counts[gyro.field] = self._kill(_digitise(exact, self._kinds[gyro.field], self._board), index, first)
        for thermometer in self._board.temperatures:
            exact = (temperature - thermometer.offset) / thermometer.scale
            counts[thermometer.field] = _digitise(exact, self._kinds[thermometer.field], self._board)
        return counts

    def _kill(self, counts: np.ndarray, gyro: int, first: int) -> np.ndarray:
        live = counts[-1]
        for number, stretch in enumerate(self._dead):
            start, stop = max(stretch.first - first, 0), min(stretch.last - first, counts.size)
            if stretch.gyro != gyro or stop <= start:
                continue
            if stretch.fault.kind == "dropout":
                counts[start:stop] = 0
                continue
            before = counts[start - 1] if start else self._last.get(gyro, counts[0])
            counts[start:stop] = self._stuck_at.setdefault(number, before)
            live = counts[-1]
        self._last[gyro] = live
        return counts


def _digitise(exact: Floats, kind: str, board: Board) -> Floats | Ints:
    if kind[0] == "f":
        return exact
    low, high = type_limits(kind)
    if board.adc is not None:
        low, high = max(low, board.adc.low), min(high, board.adc.high)
    return np.clip(np.rint(exact), low, high).astype(np.int64)
