"""Allan variances, their degrees of freedom and limits, and what tells kinds of noise apart; by C kernels.

All averaging factors go through the angle together, block by block. The reference engine does the same by allantools.
"""

from __future__ import annotations

import numpy as np

from vgyro.arrays import Floats, Ints
from vgyro.engine.models import LossyDifferences
from vgyro.engine.native import _allan, pool
from vgyro.engine.native.allan_freedom import degrees_of_freedom, limits

__all__ = ["degrees_of_freedom", "differences", "differences_over_losses", "lag_products", "limits", "slot_sums"]

PIECE = 256  # blocks of _allan.BLOCK differences
ORDER = {"overlapping": 2, "hadamard": 3}
WEIGHTS = {"overlapping": 2.0, "modified": 2.0, "hadamard": 6.0}  # sum of the squared weights of the means
PRESENT_TENTHS = 9
DENSE = 64  # differences that begin within one averaging time, where some are left out


def differences(
    rate: np.ndarray,
    factors: np.ndarray,
    edges: np.ndarray | None = None,
    share: int = 2,
    kind: str = "overlapping",
) -> tuple[np.ndarray, np.ndarray]:
    """As vgyro.engine.protocols.noise.AllanEngine.differences; summed in blocks of 2048, the blocks pairwise."""
    edges = _edges(rate, edges)
    factors = np.ascontiguousarray(factors, dtype=np.int64)
    sums, counts = np.zeros(len(factors)), np.zeros(len(factors), dtype=np.int64)
    lengths = np.diff(edges)
    # Those of the modified variance reach over 3m - 1 samples, the others over order·m.
    reach, spare = (3, 1) if kind == "modified" else (ORDER[kind], 0)
    most = np.minimum(lengths // share, (lengths - 1 + spare) // reach)
    for row, m in enumerate(factors.tolist()):
        counts[row] = np.sum(lengths[most >= m] + 1 + spare - reach * m)
    possible = counts > 0
    m = factors[possible]
    if m.size:
        angle = _angle(rate, edges, level=False)
        sums[possible] = _summed(angle, edges, m, most, share, kind) / (WEIGHTS[kind] * m.astype(float) ** 2)
    return sums, counts


def _summed(angle: Floats, edges: Ints, factors: Ints, most: Ints, share: int, kind: str) -> Floats:
    if kind == "modified":
        sums, share = np.empty(len(factors)), max(share, 3)
        pool.run(lambda start, stop: _allan.averaged(angle, edges, factors, share, sums, start, stop), len(factors), 1)
        means: Floats = sums / factors.astype(float) ** 2
        return means
    blocks = _blocks(np.diff(edges), most)
    parts = np.empty((len(factors), len(blocks)))
    pool.run(
        lambda start, stop: _allan.differences(angle, blocks, factors, ORDER[kind], parts, start, stop),
        len(blocks),
        PIECE,
    )
    total: Floats = parts.sum(axis=1)
    return total


def slot_sums(rate: np.ndarray, slot: np.ndarray, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """As vgyro.engine.protocols.noise.AllanEngine.slot_sums."""
    edges = np.ascontiguousarray(edges, dtype=np.int64)
    borders = int(edges[-1]) + len(edges) - 1
    total, have = np.zeros(borders), np.zeros(borders, dtype=np.int32)
    if len(rate):
        rate = np.ascontiguousarray(rate, dtype=np.float64)
        _allan.slots(rate, np.ascontiguousarray(slot, dtype=np.int64), edges, total, have)
    return total, have


def differences_over_losses(
    total: np.ndarray,
    have: np.ndarray,
    edges: np.ndarray,
    factors: np.ndarray,
    share: int = 3,
    kind: str = "overlapping",
) -> LossyDifferences:
    """As vgyro.engine.protocols.noise.AllanEngine.differences_over_losses; those begin `strides` slots apart."""
    factors = np.ascontiguousarray(factors, dtype=np.int64)
    edges = np.ascontiguousarray(edges, dtype=np.int64)
    steps = strides(factors)
    found, counts = np.zeros((len(factors), 2)), np.zeros(len(factors), dtype=np.int64)
    if factors.size and total.size:
        order = ORDER.get(kind, 0)
        pool.run(
            lambda start, stop: _allan.lossy(
                total, have, edges, factors, steps, order, share, PRESENT_TENTHS, found, counts, start, stop
            ),
            len(factors),
            1,
        )
    found /= WEIGHTS[kind]
    if kind == "modified":
        # White noise of m slots: the modified variance is this part of the other one.
        found[:, 1] *= (factors**2 + 1) / (2 * factors**2)
    possible = possible_differences(factors, np.diff(edges), share, kind)
    return LossyDifferences(found[:, 0], found[:, 1], counts, possible)


def strides(factors: Ints) -> Ints:
    """Slots between the differences over losses at each averaging factor."""
    return np.maximum(factors // DENSE, 1)


def possible_differences(factors: Ints, slots: Ints, share: int, kind: str) -> Ints:
    """Differences over losses at each factor [M], were nothing lost of stretches of `slots` [S]."""
    steps = strides(factors)
    reach = 2 * factors + (factors // steps - 1) * steps if kind == "modified" else ORDER[kind] * factors
    found = (slots - reach[:, None]) // steps[:, None] + 1
    possible: Ints = np.where((slots >= share * factors[:, None]) & (slots >= reach[:, None]), found, 0).sum(axis=1)
    return possible


def lag_products(
    rate: np.ndarray, factors: np.ndarray, edges: np.ndarray | None = None, fewest: int = 4
) -> tuple[np.ndarray, np.ndarray]:
    """As vgyro.engine.protocols.noise.AllanEngine.lag_products."""
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
