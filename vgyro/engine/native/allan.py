"""Overlapping Allan variance, its degrees of freedom and its limits, and what tells kinds of noise apart; by C kernels.

All averaging factors go through the angle together, block by block. The reference engine does the same by allantools.
"""

from __future__ import annotations

import numpy as np

from vgyro.engine.native import _allan, pool
from vgyro.engine.native.allan_freedom import degrees_of_freedom, limits

__all__ = ["degrees_of_freedom", "lag_products", "limits", "second_differences"]

PIECE = 256  # blocks of _allan.BLOCK differences


def second_differences(
    rate: np.ndarray, rate_hz: float, factors: np.ndarray, edges: np.ndarray | None = None, share: int = 2
) -> tuple[np.ndarray, np.ndarray]:
    """Sum of the squared overlapping second differences of the angle, divided by 2τ², and how many there are.

    rate    : array [T], deg/s
    factors : array [M] int, averaging factors m; τ = m / rate_hz (rate_hz itself cancels)
    edges   : array [S + 1] int, first sample of each gap-free stretch, and T; None: there is no gap
    share   : stretches of less than share·m samples are left out, and those of 2m and less
    returns : sums [M] in (deg/s)², counts [M]; sums / counts is the overlapping Allan variance. Zeros where no stretch
              is long enough.
    Riley, NIST SP 1065, eq. 11. Differences are summed in blocks of 2048, the blocks pairwise.
    """
    del rate_hz
    edges = _edges(rate, edges)
    factors = np.ascontiguousarray(factors, dtype=np.int64)
    sums, counts = np.zeros(len(factors)), np.zeros(len(factors), dtype=np.int64)
    lengths = np.diff(edges)
    most = np.minimum(lengths // share, (lengths - 1) // 2)
    for row, m in enumerate(factors.tolist()):
        counts[row] = np.sum(lengths[most >= m] + 1 - 2 * m)
    possible = counts > 0
    m = factors[possible]
    if m.size:
        angle = _angle(rate, edges, level=False)
        blocks = _blocks(lengths, most)
        parts = np.empty((m.size, len(blocks)))
        pool.run(lambda start, stop: _allan.second(angle, blocks, m, parts, start, stop), len(blocks), PIECE)
        sums[possible] = parts.sum(axis=1) / (2.0 * m**2)
    return sums, counts


def lag_products(
    rate: np.ndarray, factors: np.ndarray, edges: np.ndarray | None = None, fewest: int = 4
) -> tuple[np.ndarray, np.ndarray]:
    """Σ z² and Σ z z' of the means z of adjacent blocks of m samples, z' the following mean.

    rate    : array [T];  factors : array [M] int, m; an incomplete last block is left out
    edges   : as in second_differences;  fewest : means, at least 4; stretches with fewer are left out
    returns : squares [M, 3], products [M, 3]: of the means about their line, of their differences about the mean
              difference, of the second differences about theirs, each stretch by itself. Zeros without a stretch.
    """
    edges = _edges(rate, edges)
    factors = np.ascontiguousarray(factors, dtype=np.int64)
    squares, products = np.zeros((len(factors), 3)), np.zeros((len(factors), 3))
    if factors.size and rate.size:
        # Without its line a drift leaves no large squares to cancel.
        angle = _angle(rate, edges, level=True)
        pool.run(
            lambda start, stop: _allan.lags(angle, edges, factors, fewest, squares, products, start, stop),
            len(factors),
            1,
        )
    return squares, products


def _edges(rate: np.ndarray, edges: np.ndarray | None) -> np.ndarray:
    edges = np.array([0, len(rate)]) if edges is None else edges
    if edges[0] != 0 or edges[-1] != len(rate) or (np.diff(edges) < 0).any():
        raise ValueError(f"edges must ascend from 0 to {len(rate)}")
    return np.ascontiguousarray(edges, dtype=np.int64)


def _angle(rate: np.ndarray, edges: np.ndarray, level: bool) -> np.ndarray:
    """Running sum [T + S] of the rate about the mean of each stretch, in deg/s times the sample period."""
    rate = np.ascontiguousarray(rate, dtype=np.float64)
    angle = np.empty(rate.size + edges.size - 1)
    _allan.angle(rate, edges, level, angle)
    return angle


def _blocks(lengths: np.ndarray, most: np.ndarray) -> np.ndarray:
    """Blocks of second differences [B, 3]: first angle, angles left in its stretch, largest factor."""
    points = lengths + 1
    number = -(-points // _allan.BLOCK)
    within = np.arange(number.sum()) - np.repeat(np.cumsum(number) - number, number)
    offset = within * _allan.BLOCK
    at = np.repeat(np.cumsum(points) - points, number) + offset
    return np.stack([at, np.repeat(points, number) - offset, np.repeat(most, number)], axis=1)
