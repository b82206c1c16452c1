"""Steps of the gyros' values: no gyro is better than its step allows.

A value that is rounded to steps of q has an error of variance q²/12. Noise of more than a third of a step makes it
white; with less, part of it stays where it is while the rate does, and no averaging takes that away.
"""

from __future__ import annotations

import math

import numpy as np

from vgyro.fusion.array import ArrayRates

LOOK, WINDOWS = 1 << 14, 8
"""Values that a step is read off, and windows that they are spread over."""
OFF_GRID = 0.05
"""A value may be off the grid by this part of a step."""
ROUNDING = 4.0
"""Differences below so many roundings of the largest value are none; steps must be far above."""
TERMS = 8


def steps(array: ArrayRates) -> np.ndarray:
    """Step of each gyro's values [N], deg/s; 0: none is seen. Made once for a recording.

    A gyro that gives one constant is taken to have the largest step of the others: its own cannot be seen.
    """

    def find() -> np.ndarray:
        missing = array.missing
        own = (
            column if missing is None else np.where(missing[:, gyro], np.nan, column)
            for gyro, column in enumerate(array.rate.T)
        )
        found = np.array([step_of(column) for column in own])
        constant = np.isnan(found)
        found[constant] = found[~constant].max(initial=0.0)
        return found

    return array.once("steps", find)


def step_of(values: np.ndarray) -> float:
    """Smallest common step of values [T], deg/s; 0: they have none; NaN: they are one constant, or there is none.

    The smallest difference between values that occur, if all others are whole numbers of it.
    """
    seen = np.unique(_some(values))
    seen = seen[np.isfinite(seen)]
    if len(seen) < 2:
        return math.nan
    rounding = ROUNDING * np.finfo(values.dtype).eps * float(np.abs(seen).max()) if values.dtype.kind == "f" else 0.0
    apart = np.diff(seen.astype(float))
    apart = apart[apart > rounding]
    if apart.size == 0:
        return math.nan
    step = float(apart[apart < 1.5 * apart.min()].mean())
    if 2.0 * rounding > OFF_GRID * step:
        return 0.0
    many = apart / step
    return step if (np.abs(many - np.rint(many)) < 2.0 * OFF_GRID).all() else 0.0


def _some(values: np.ndarray) -> np.ndarray:
    if len(values) <= LOOK:
        return values
    length = LOOK // WINDOWS
    first = np.linspace(0, len(values) - length, WINDOWS).astype(int)
    return np.concatenate([values[one : one + length] for one in first.tolist()])


def least_variance(step: np.ndarray) -> np.ndarray:
    """q²/12 [N], (deg/s)²: the variance of a sample is not smaller."""
    return step**2 / 12.0


def lasting_variance(step: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """Variance [N], (deg/s)², of the part of the rounding error that stays while the rate does.

    step [N] deg/s;  variance [N] : of the noise before rounding, (deg/s)²
    The mean of rounded values is off by (q/π)·Σ (-1)^k/k·e^(-2π²k²σ²/q²)·sin(2πkx/q) at x; this is its mean square over
    x. Gray & Neuhoff (1998), IEEE Trans. Inf. Theory 44, 2325-2383, sec. II (dither).
    """
    k = np.arange(1, TERMS + 1)
    ratio = np.where(step > 0, variance / np.where(step > 0, step, 1.0) ** 2, np.inf)
    series = np.exp(-4.0 * math.pi**2 * np.multiply.outer(ratio, k**2)) / k**2
    # Of no noise the series is π²/6.
    series[..., -1] += np.where(ratio == 0, math.pi**2 / 6.0 - (1.0 / k**2).sum(), 0.0)
    return step**2 / (2.0 * math.pi**2) * series.sum(axis=-1)
