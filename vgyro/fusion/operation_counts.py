"""Floating-point operations a sample of N gyros, for the methods table; estimation, once a recording, is left out."""

from __future__ import annotations

SMOOTHED_STATES = 3
"""States of the motion model that the smoothers are counted with."""


def weighted(gyros: int) -> float:
    """Σw·y."""
    return 2.0 * gyros


def sorted_median(gyros: int) -> float:
    """Odd-even transposition, and the mean of the middle two."""
    return float(gyros * (gyros - 1) + 2)


def moments(gyros: int) -> float:
    """Block means, and Σw·y."""
    return 3.0 * gyros


def low_passed(gyros: int) -> float:
    """Σu·y, and a first-order recursion."""
    return 2.0 * gyros + 3


def settling(gyros: int) -> float:
    """Σu·y, and a first-order recursion whose gain settles."""
    return 2.0 * gyros + 11


def residuals(gyros: int) -> float:
    """Products of all pairs in blocks, their slow part, and Σw·y."""
    return gyros * (gyros + 9.0)


def changing_residuals(gyros: int) -> float:
    """The same, and the search for the memory of each variance: some 30 operations a gyro at 200 Hz."""
    return residuals(gyros) + 30.0 * gyros


def without_slow(gyros: int) -> float:
    """Block means, and Σu·(y - b) with b between the block centres."""
    return 6.0 * gyros


def smoother() -> float:
    """Filter, filter again and smoother of SMOOTHED_STATES states: covariances F·P·F', gain, and their products."""
    n = SMOOTHED_STATES
    return 2.0 * (4 * n**3 + 6 * n**2) + 6 * n**3


def smoothed_average(gyros: int) -> float:
    """As `average_smoothed`, with the residuals that give its variance."""
    return residuals(gyros) + weighted(gyros) + smoother()


def smoothed_residuals(gyros: int) -> float:
    """As `residual_smoothed`."""
    return changing_residuals(gyros) + smoother()


def smoothed_median(gyros: int) -> float:
    """As `median_smoothed`."""
    return sorted_median(gyros) + smoothed_average(gyros)


def everything(gyros: int) -> float:
    """As `recommended_unsmoothed`."""
    return changing_residuals(gyros) + without_slow(gyros)


def everything_smoothed(gyros: int) -> float:
    """As `recommended`."""
    return everything(gyros) + smoother()
