"""Steps of the gyros' values: no gyro is better than its step allows.

A value that is rounded to steps of q has an error of variance q²/12. Noise of more than a third of a step makes it
white; with less, part of it stays where it is while the rate does, and no averaging takes that away.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Floats, Ints
from vgyro.fusion.types import ArrayRates

LOOK, WINDOWS = 1 << 14, 8
"""Values that a step is read off, and windows that they are spread over."""
OFF_GRID = 0.05
"""A value may be off the grid by this part of a step."""
ROUNDING = 4.0
"""Differences below so many roundings of the largest value are none; steps must be far above."""
TERMS = 64
ORDERS = np.arange(1, TERMS + 1)
"""Terms of the series of the rounding error."""


@dataclass(frozen=True)
class CountGrid:
    """Values that the gyros can have: whole numbers of `step` [N], deg/s, 0: any, above `begin` [N], deg/s."""

    step: np.ndarray
    begin: np.ndarray

    def alike(self, orders: Ints) -> Floats:
        """How alike gyros round, for orders k [K] of the rounding error's series in x: 1, together; 0, each by itself.

        The mean of cos(2πk·(difference of their grids)/step) over the pairs.
        """
        phase = 2.0 * math.pi * self.begin / np.where(self.step > 0, self.step, 1.0)
        gyros = len(phase)
        together = np.abs(np.exp(1j * np.multiply.outer(orders, phase)).sum(axis=1)) ** 2
        alike: Floats = np.maximum((together - gyros) / (gyros * (gyros - 1)), 0.0)
        return alike


def steps(array: ArrayRates) -> np.ndarray:
    """Step of each gyro's values [N], deg/s; 0: none is seen."""
    return grid(array).step


def grid(array: ArrayRates) -> CountGrid:
    """The grids of the gyros' values. Made once for a recording.

    A gyro that gives one constant is taken to have the largest step of the others: its own cannot be seen.
    """

    def find() -> CountGrid:
        own = (
            column if array.missing is None else np.where(array.missing[:, gyro], np.nan, column)
            for gyro, column in enumerate(array.rate.T)
        )
        found = [(step_of(column), column[np.argmax(np.isfinite(column))]) for column in own]
        step, begin = (np.array(one, dtype=float) for one in zip(*found, strict=True))
        constant = np.isnan(step)
        step[constant] = step[~constant].max(initial=0.0)
        return CountGrid(step, np.nan_to_num(begin))

    return array.once("grid", find)


def with_grid(array: ArrayRates, known: CountGrid) -> ArrayRates:
    """The array with a grid that was seen before its values were corrected."""
    array.once("grid", lambda: known)
    return array


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


def lasting_variance(step: float, noise: float, alike: np.ndarray | None = None) -> float:
    """Variance, (deg/s)², of the part of a rounding error that stays while the rate does.

    step  : deg/s;  noise : variance of what is rounded about its mean, (deg/s)²
    alike : [TERMS], of the part that gyros have in common; None: of one gyro
    The mean of rounded values is off by (q/π)·Σ (-1)^k/k·e^(-2π²k²σ²/q²)·sin(2πkx/q) at x; this is its mean square over
    x. Gray & Neuhoff (1998), IEEE Trans. Inf. Theory 44, 2325-2383, sec. II (dither).
    """
    share = np.exp(-4.0 * math.pi**2 * ORDERS**2 * noise / step**2) / ORDERS**2
    return step**2 / 2.0 / math.pi**2 * float(share @ (np.ones(TERMS) if alike is None else alike))


def noise_before(step: float, variance: float) -> float:
    """Variance of the noise before rounding, (deg/s)², from that of the rounded values, the mean over all offsets.

    Rounding adds q²/12, less the part that lasts, which is no variance.
    """
    from scipy.optimize import brentq

    def excess(noise: float) -> float:
        return noise + lasting_variance(step, 0.0) - lasting_variance(step, noise) - variance

    return float(brentq(excess, 0.0, variance)) if excess(variance) > 0.0 and variance > 0.0 else 0.0


def lasting_of_mean(known: CountGrid, variance: np.ndarray, means: np.ndarray, weights: np.ndarray) -> float:
    """Variance, (deg/s)², of the rounding error of Σ u_i·y_i that stays while the rate does.

    means, weights [N] : of the gyros, deg/s;  variance [N] : of their samples, as rounded, (deg/s)²
    Gyros of one grid whose offsets from each other are small beside a step round alike: to the error that they have in
    common these offsets are what noise is to the error of one.
    """
    step = float(np.median(known.step))
    if step == 0.0:
        return 0.0
    inside, apart = float(variance.mean()), float(means.var())
    own = lasting_variance(step, noise_before(step, inside))
    common = min(lasting_variance(step, noise_before(step, inside + apart), known.alike(ORDERS)), own)
    return common + float(weights @ weights) * (own - common)
