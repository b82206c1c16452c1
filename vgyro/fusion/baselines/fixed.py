"""Methods without a model of time: average, median, fixed inverse-variance weights."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vgyro.fusion.blocks import PIECE, combined
from vgyro.fusion.types import ArrayRates, CannotRun, FilterParameters, Fused


def average(array: ArrayRates, parameters: FilterParameters) -> Fused:  # noqa: ARG001
    """The mean of the gyros."""
    size = array.rate.shape[1]
    return Fused.undelayed(combined(array.rate, np.ones(size)) / size, np.full(size, 1.0 / size))


def median(array: ArrayRates, parameters: FilterParameters) -> Fused:  # noqa: ARG001
    """The median of the gyros, sample by sample: not linear, so it has no weights and no transfer function."""
    fused = np.empty(len(array.rate))
    for start in range(0, len(fused), PIECE):
        ordered = sorted_columns(array.rate[start : start + PIECE])
        low, high = ordered[(len(ordered) - 1) // 2], ordered[len(ordered) // 2]
        fused[start : start + PIECE] = np.add(low, high, dtype=float) / 2
    return Fused.undelayed(fused)


def sorted_columns(rate: np.ndarray) -> list[np.ndarray]:
    """The smallest, second smallest, … of each row of rate [T, N], as N arrays [T].

    By odd-even transposition: N rounds that compare neighbours (Knuth, The Art of Computer Programming 3, 5.3.4). For a
    few columns that is far faster than sorting each row.
    """
    columns = [np.ascontiguousarray(column) for column in rate.T]
    for turn in range(len(columns)):
        for low in range(turn % 2, len(columns) - 1, 2):
            pair = columns[low], columns[low + 1]
            columns[low], columns[low + 1] = np.minimum(*pair), np.maximum(*pair)
    return columns


def inverse_variance_arw(array: ArrayRates, parameters: FilterParameters) -> Fused:  # noqa: ARG001
    """Fixed weights w_i ∝ 1/N_i² from the measured angle random walk: least white noise, correlations left out."""
    return _inverse_variance(array, array.noise.arw, "angle random walk")


def inverse_variance_rrw(array: ArrayRates, parameters: FilterParameters) -> Fused:  # noqa: ARG001
    """Fixed weights w_i ∝ 1/K_i² from the measured rate random walk: least drift, correlations left out."""
    return replace(_inverse_variance(array, array.noise.rrw, "rate random walk"), note=array.noise.rrw_note)


def _inverse_variance(array: ArrayRates, coefficient: np.ndarray, name: str) -> Fused:
    unknown = np.flatnonzero(~(np.isfinite(coefficient) & (coefficient > 0)))
    if len(unknown):
        which = ", ".join(str(index + 1) for index in unknown)
        raise CannotRun(f"no {name} was found for gyro {which} of {len(coefficient)}")
    # The largest is taken out first, so that the squares neither overflow nor vanish.
    inverse = (coefficient.max() / coefficient) ** 2
    weights = inverse / inverse.sum()
    return Fused.undelayed(combined(array.rate, weights), weights)
