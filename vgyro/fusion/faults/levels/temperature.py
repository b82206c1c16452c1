"""What the temperature does to a residual is no fault: it is taken off where a temperature is logged."""

from __future__ import annotations

import numpy as np

from vgyro.arrays import Bools, Floats, Ints
from vgyro.fusion.faults.candidate import running_sum, weighted_median

SMOOTH = 15  # blocks on each side
FEWEST_BLOCKS = 64
PARTS = 64
SHORTEST = 8  # blocks
LEAST_GAIN = 0.02
"""Share of the mean size of the changes that the temperature must explain."""


def block_temperature(temperature: Floats | None, edges: Ints) -> Floats | None:
    """Temperature of the blocks [B], °C, smoothed against the noise of the thermometer; None where none is known.

    temperature : [T] of the samples;  edges : [B + 1] samples
    """
    if temperature is None or len(edges) - 1 < FEWEST_BLOCKS:
        return None
    means = np.add.reduceat(temperature, edges[:-1], dtype=float) / np.diff(edges)
    if not np.isfinite(means).all():
        return None
    sums, places = running_sum(means), np.arange(len(means))
    half = np.minimum(np.minimum(places, len(means) - 1 - places), SMOOTH)
    smoothed: Floats = (sums[places + half + 1] - sums[places - half]) / (2 * half + 1)
    return smoothed


def without_temperature(mean: Floats, temperature: Floats | None, healthy: Bools, run: Ints) -> Floats:
    """Residual means [B], deg/s, less their slope times the temperature [B], °C.

    The slope is the weighted median of change over change from one stretch of blocks to the next, so that a fault of
    less than half of the change in temperature does not enter; none is taken off where it would explain too little.
    """
    if temperature is None:
        return mean
    length = max(SHORTEST, len(mean) // PARTS)
    low, middle, high = (np.arange(len(mean) - 2 * length + 1) + part * length for part in range(3))
    bad = running_sum(~healthy)
    usable = (bad[high] == bad[low]) & (run[low] == run[high - 1])
    changes = []
    for values in (mean, temperature):
        sums = running_sum(values)
        changes.append(((sums[high] - 2.0 * sums[middle] + sums[low]) / length)[usable])
    change, warming = changes
    if change.size < FEWEST_BLOCKS or not warming.any():
        return mean
    warms = warming != 0
    slope = weighted_median(change[warms] / warming[warms], np.abs(warming[warms]))
    if np.abs(change - slope * warming).sum() > (1.0 - LEAST_GAIN) * np.abs(change).sum():
        return mean
    without: Floats = mean - slope * (temperature - temperature[0])
    return without
