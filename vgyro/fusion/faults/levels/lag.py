"""What a gyro's delay does to its residual is no fault: the part that follows the acceleration is taken off."""

from __future__ import annotations

import numpy as np

from vgyro.arrays import Bools, Floats, Ints
from vgyro.fusion.faults.candidate import weighted_median

FEWEST_BLOCKS = 32
LEAST_GAIN = 0.02
"""Share of the mean size of the changes that the delay must explain."""


def without_lag(mean: Floats, motion: Floats, counts: Bools, run: Ints) -> Floats:
    """Residual means [B], deg/s, less their slope times how fast the motion [B], deg/s, changes about the block.

    counts [B] : healthy blocks in motion, which the slope is taken from;  run [B] : no change reaches over its ends
    The slope is the weighted median of change over change from block to block; a bias cancels.
    """
    if len(mean) < FEWEST_BLOCKS:
        return mean
    rising = np.gradient(motion)
    rising[np.flatnonzero(np.diff(run)) + 1] = rising[np.flatnonzero(np.diff(run))] = 0.0
    usable = counts[1:] & counts[:-1] & (np.diff(run) == 0)
    change, faster = np.diff(mean)[usable], np.diff(rising)[usable]
    if change.size < FEWEST_BLOCKS or not faster.any():
        return mean
    slope = weighted_median(change[faster != 0] / faster[faster != 0], np.abs(faster[faster != 0]))
    if np.abs(change - slope * faster).sum() > (1.0 - LEAST_GAIN) * np.abs(change).sum():
        return mean
    return mean - slope * rising
