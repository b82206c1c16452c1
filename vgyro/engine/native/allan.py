"""Overlapping Allan variance, its degrees of freedom and its limits, and what tells kinds of noise apart; by C kernels.

All averaging factors go through the angle together, block by block. The reference engine does the same by allantools.
"""

from __future__ import annotations

import numpy as np

from vgyro.engine.native import _allan, pool
from vgyro.engine.native.allan_freedom import degrees_of_freedom, limits

__all__ = ["degrees_of_freedom", "lag_products", "limits", "second_differences"]

PIECE = 256  # blocks of _allan.BLOCK differences
FEWEST_MEANS = 4


def second_differences(rate: np.ndarray, rate_hz: float, factors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sum of the squared overlapping second differences of the angle, divided by 2τ², and how many there are.

    rate    : array [T], deg/s, one gap-free stretch; float32 is taken as it is
    factors : array [M] int, averaging factors m; τ = m / rate_hz (rate_hz itself cancels)
    returns : sums [M] in (deg/s)², counts [M]; sums / counts is the overlapping Allan variance. Zeros where 2m >= T.
    Riley, NIST SP 1065, eq. 11. Differences are summed in blocks of 2048, the blocks pairwise.
    """
    del rate_hz
    factors = np.ascontiguousarray(factors, dtype=np.int64)
    sums, counts = np.zeros(len(factors)), np.zeros(len(factors), dtype=np.int64)
    possible = 2 * factors < len(rate)
    m = factors[possible]
    if m.size:
        angle = _angle(rate)
        blocks = np.empty((m.size, -(-angle.size // _allan.BLOCK)))
        pool.run(lambda start, stop: _allan.second(angle, m, blocks, start, stop), blocks.shape[1], PIECE)
        sums[possible] = blocks.sum(axis=1) / (2.0 * m**2)
        counts[possible] = angle.size - 2 * m
    return sums, counts


def lag_products(rate: np.ndarray, factors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Σ z² and Σ z z' of the means z of adjacent blocks of m samples, z' the following mean.

    rate    : array [T], one gap-free stretch;  factors : array [M] int, m; an incomplete last block is left out
    returns : squares [M, 3], products [M, 3]: of the means about their line, of their differences about the mean
              difference, of the second differences about theirs. Zeros where there are fewer than four means.
    """
    factors = np.ascontiguousarray(factors, dtype=np.int64)
    squares, products = np.zeros((len(factors), 3)), np.zeros((len(factors), 3))
    possible = FEWEST_MEANS * factors <= len(rate)
    m = factors[possible]
    if m.size:
        angle = _angle(rate, level=True)
        sums = np.empty((m.size, _allan.SUMS))
        pool.run(lambda start, stop: _allan.lags(angle, m, sums, start, stop), m.size, 1)
        squares[possible], products[possible] = _centred(angle, m, sums)
    return squares, products


def _angle(rate: np.ndarray, level: bool = False) -> np.ndarray:
    """Running sum of a rate [T] about its mean, [T + 1], in units of deg/s times the sample period.

    level : take off a line through the means of both halves as well, so that a drift leaves no large squares to cancel
    """
    rate = np.ascontiguousarray(rate, dtype=None if rate.dtype == np.float32 else np.float64)
    start, slope, half = float(rate.mean(dtype=np.float64)), 0.0, rate.size // 2
    if level:
        rise = rate[rate.size - half :].mean(dtype=np.float64) - rate[:half].mean(dtype=np.float64)
        slope = float(rise) / (rate.size - half)
        start -= slope * (rate.size - 1) / 2
    angle = np.empty(rate.size + 1)
    _allan.angle(rate, start, slope, angle)
    return angle


def _centred(angle: np.ndarray, m: np.ndarray, sums: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """lag_products from the sums of vg_allan_lags: the means and the line are taken off in closed form.

    With u = y - ȳ, p_k = k - (n-1)/2 and the slope b = Σpu / Σp²:  Σ(u - bp)² = Σu² - bΣpu,
    Σ(u - bp)(u' - bp') = Σuu' - b(2Σpu + (n+1)/2·(u_first - u_last)) + b²(Σp² - (n²-1)/4).
    """
    n = (angle.size - 1) // m
    head = np.diff(angle[np.arange(4) * m[:, None]])
    tail = np.diff(angle[(n[:, None] + np.arange(-3, 1)) * m[:, None]])
    # Columns: y, its differences, its second differences.
    first = np.stack([np.diff(head, order)[:, 0] for order in range(3)], axis=1)
    last = np.stack([np.diff(tail, order)[:, -1] for order in range(3)], axis=1)
    end = angle[n * m]
    total = np.column_stack([end, last[:, 0] - first[:, 0], last[:, 1] - first[:, 1]])
    number = n[:, None] - np.arange(3)
    mean = total / number
    squares = sums[:, 1::2] - mean * total
    products = sums[:, 2::2] - mean * (2 * total - first - last) + (number - 1) * mean**2
    n = n.astype(float)
    along, spread = (n + 1) / 2 * end - sums[:, 0], n * (n**2 - 1) / 12
    slope = along / spread
    squares[:, 0] -= slope * along
    products[:, 0] -= slope * (2 * along + (n + 1) / 2 * (first[:, 0] - last[:, 0]))
    products[:, 0] += slope**2 * (spread - (n**2 - 1) / 4)
    return np.maximum(squares, 0) / m[:, None] ** 2, products / m[:, None] ** 2
