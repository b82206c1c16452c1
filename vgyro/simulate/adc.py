"""Rates and temperatures → the numbers that a board sends: its scale, rounding, the rails of its ADC, dead channels."""

from __future__ import annotations

import numpy as np

from vgyro.board import Board
from vgyro.simulate.encode import type_limits
from vgyro.simulate.faults import Faults


def channel_counts(
    board: Board, rates: np.ndarray, scale_error: list[float], temperature: np.ndarray, faults: Faults
) -> dict[str, np.ndarray]:
    """Channel → [T]: int64 for integer fields, float64 for fields that the board sends as floats.

    rates : [T, N], deg/s, referred to the input;  scale_error : [N];  temperature : [T], °C
    count = bias + sign · (1 + scale error) · rate / scale, rounded to the nearest, held at the rails.
    raises : ConfigError for a board without frames
    """
    kinds = {channel: field.type for field in board.layout.fields for channel in field.channels()}
    counts: dict[str, np.ndarray] = {}
    for index, gyro in enumerate(board.gyros):
        exact = gyro.bias + gyro.sign * (1.0 + scale_error[index]) * rates[:, index] / gyro.scale
        digital = _digitise(exact, kinds[gyro.field], board)
        counts[gyro.field] = _dead(digital, faults, index)
    for thermometer in board.temperatures:
        exact = (temperature - thermometer.offset) / thermometer.scale
        counts[thermometer.field] = _digitise(exact, kinds[thermometer.field], board)
    return counts


def _digitise(exact: np.ndarray, kind: str, board: Board) -> np.ndarray:
    if kind[0] == "f":
        return exact
    low, high = type_limits(kind)
    if board.adc is not None:
        low, high = max(low, board.adc.low), min(high, board.adc.high)
    return np.clip(np.rint(exact), low, high).astype(np.int64)


def _dead(counts: np.ndarray, faults: Faults, gyro: int) -> np.ndarray:
    for first, last in faults.stuck[gyro]:
        counts[first:last] = counts[max(first - 1, 0)]
    for first, last in faults.dropout[gyro]:
        counts[first:last] = 0
    return counts
