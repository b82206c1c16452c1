"""Samples at the end of a gyro's range: the rate was beyond it, and how far is not known.

The end of the range is not declared; it shows as an extreme value that is repeated as chance would not repeat it.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from vgyro.fusion.samples.missing import fill_missing
from vgyro.fusion.samples.quantised import steps
from vgyro.fusion.types import ArrayRates
from vgyro.runs import true_runs

FEWEST = 3
"""Samples at an end of the range, at least."""
FAR = 4.0
"""An end lies so many deviations of the noise from the middle of the gyro's other values."""
PILE = 10.0
"""At an end there are so many times the samples that are next to it, within a deviation."""
CERTAIN = 16.0
"""Log of how much too unlikely the longest run at an end must be by chance, after the number of samples."""
BEYOND = 2.0
"""Where the noise is below a step, the others must be beyond the end by so many steps."""
LOOK = 1 << 16


def clipped(array: ArrayRates) -> np.ndarray | None:
    """Samples at the end of a gyro's range, bool [T, N]; None: there are none.

    An end is a gyro's greatest or least value where it lies FAR from the middle of its other values, and is repeated
    either in a run that its noise and step would not give by chance, or PILE times as often as what is next to it. A
    gyro whose noise is below its step repeats any value, at rest and while a rate is held: its end is believed where
    the other gyros go BEYOND it. Missing samples are never clipped.
    """
    found = None
    step = steps(array)
    for gyro, column in enumerate(array.rate.T):
        missing = None if array.missing is None else array.missing[:, gyro]
        for low in (False, True):
            at_end = _at_end(column, low, missing)
            if at_end is not None and _is_end(array, gyro, at_end, float(step[gyro])):
                found = np.zeros(array.rate.shape[::-1], dtype=bool) if found is None else found
                found[gyro] |= at_end
    return None if found is None else found.T


def _at_end(column: np.ndarray, low: bool, missing: np.ndarray | None) -> np.ndarray | None:
    """Samples [T] with the least, or greatest, value; None: too few for an end of the range."""
    if missing is None:
        extreme = column.min() if low else column.max()
        at_end = column == extreme
    else:
        if missing.all():
            return None
        extreme = (
            np.min(column, where=~missing, initial=np.inf) if low else np.max(column, where=~missing, initial=-np.inf)
        )
        at_end = (column == extreme) & ~missing
    return at_end if FEWEST <= np.count_nonzero(at_end) < len(column) else None


def _is_end(array: ArrayRates, gyro: int, at_end: np.ndarray, step: float) -> bool:
    column = array.rate[:, gyro]
    end, noise = column[np.argmax(at_end)], _noise(column)
    below = np.abs(column[~at_end].astype(float) - float(end))
    if float(np.median(below)) < FAR * max(noise, step):
        return False
    if step > noise:
        others = np.delete(array.rate[at_end], gyro, axis=1).astype(float)
        beyond = np.median(others, axis=1) - float(end)
        return abs(float(np.median(beyond))) > BEYOND * step
    # Two samples are alike by the density of their difference, of √2 times the deviation, at zero.
    chance = min(max(step, float(np.spacing(np.abs(end)))) / (2.0 * math.sqrt(math.pi) * noise), 1.0)
    longest = int(np.diff(true_runs(at_end), axis=1).max())
    unlikely = (longest - 1) * -math.log(chance) > CERTAIN + math.log(len(column))
    return unlikely or int(at_end.sum()) >= PILE * (int(np.count_nonzero(below <= noise)) + 1)


def _noise(column: np.ndarray) -> float:
    """About the standard deviation of a gyro's noise, deg/s, with little of its motion: from second differences."""
    part = np.asarray(column[:LOOK], dtype=float)
    second = np.abs(part[2:] - 2.0 * part[1:-1] + part[:-2])
    moving = second[second > 0]
    return 1.4826 * float(np.median(moving)) / math.sqrt(6.0) if moving.size else 0.0


def without_clipped(array: ArrayRates) -> tuple[ArrayRates, str]:
    """The array with its clipped samples missing, and what was found; the array itself where there are none.

    They are filled from the gyros that are not clipped. Where all are, their values are left as they are, and are
    missing all the same: the rate is not known there.
    """
    mask = clipped(array)
    if mask is None:
        return array, ""
    missing = mask if array.missing is None else mask | array.missing
    rate = array.rate.copy(order="F")
    for gyro in range(rate.shape[1]):
        rate[missing[:, gyro], gyro] = np.nan
    fill_missing(rate, array.rate_hz)
    lost = missing.all(axis=1) & mask.any(axis=1)
    rate[lost] = array.rate[lost]
    counts = mask.sum(axis=0)
    which = ", ".join(f"{gyro + 1} ({int(count)})" for gyro, count in enumerate(counts.tolist()) if count)
    note = f"at the end of its range, and left out there: gyro {which}"
    if lost.any():
        note += f"; all of them in {int(lost.sum())} samples: the rate is not measured there"
    return replace(array, rate=rate, missing=missing), note
