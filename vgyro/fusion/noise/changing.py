"""Variances that change with time, by residuals against the estimate whose weights they make."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vgyro import engine as engines
from vgyro.arrays import Bools, Floats
from vgyro.fusion.noise.cornered_hat import LEAST_SHARE, BestWeights, best_weights, outliers
from vgyro.fusion.noise.difference_blocks import BlockMoments
from vgyro.fusion.noise.variance_model import Memory, chosen_memory

PASSES = 5
CHOICES = (0, 2)
"""Passes in which the memories are chosen; the others keep those of the pass before."""
SETTLING = 10


@dataclass(frozen=True)
class Changing:
    """Noise variances of N gyros that change from block to block.

    variance : [M, N], (deg/s)² a sample, in each of M blocks
    alone    : [M, N], (deg/s)² a sample, the same from the other blocks alone, without the block itself
    memories : [N], over which time each gyro's variance is an average
    square   : [M, N], (deg/s)², mean square that was seen in each block, of which `variance` is the expectation
    freedom  : [M, N], samples that count in `square`; 0: the block is left out for this gyro
    outlier  : [M, N] of bool, single blocks far above those about them
    """

    variance: np.ndarray
    alone: np.ndarray
    memories: list[Memory]
    square: np.ndarray
    freedom: np.ndarray
    outlier: np.ndarray


def changing_variances(
    moments: BlockMoments, constant: np.ndarray, outlier: np.ndarray, correlation: np.ndarray, block_s: float,
    engine: str = "native",
) -> Changing:  # fmt: skip
    """Follow the variances through the blocks, from the constant ones [N] and their outlying blocks [M, N] on.

    Each pass takes the residual against the estimate with the weights of the pass before. These come from variances
    that do not know the block's own square, so that no gyro is favoured for a square that was small by chance.
    """
    alone = np.broadcast_to(constant, moments.excluded.shape)
    known = ~moments.excluded & ((~moments.excluded).sum(axis=1) > 1)[:, None]
    low_pass = engines.get(engine).kalman.low_pass
    memories: list[Memory] = []
    for number in range(PASSES):
        square = _squares(moments, alone, known & ~outlier, correlation)
        square = _settled(moments, square, alone, outlier | outliers(np.where(known, square, 0.0)), correlation)
        outlier = outliers(np.where(known, square, 0.0))
        freedom = np.where(known & ~outlier, moments.size[:, None].astype(float), 0.0)
        columns = list(zip(square.T, freedom.T, strict=True))
        if number in CHOICES:
            memories = [chosen_memory(*one, block_s, low_pass) for one in columns]
        found = [memory.average(*one, low_pass) for memory, one in zip(memories, columns, strict=True)]
        variance, alone = (np.column_stack([one[place] for one in found]) for place in (0, 1))
        # An outlier has the variance that it shows, and lends it to no other block.
        least = np.maximum(LEAST_SHARE * float(np.median(constant)), np.where(outlier, square, 0.0))
        variance, alone = (np.where(known.any(axis=0), one, constant) for one in (variance, alone))
        variance, alone = np.maximum(variance, least), np.maximum(alone, least)
    return Changing(variance, alone, memories, square, freedom, outlier)


def _settled(
    moments: BlockMoments, square: np.ndarray, variance: np.ndarray, outlier: np.ndarray, correlation: np.ndarray
) -> np.ndarray:
    """`square` [M, N] with the blocks of outliers put right: there each gyro's variance is the block's own.

    An outlier moves the estimate that it is measured against, so that all the other gyros look far off as well. With
    its own square as its variance, but not less than the `variance` of before, it loses its weight within a few rounds.
    """
    rows = np.flatnonzero(outlier.any(axis=1))
    if len(rows) == 0:
        return square
    part = moments.part(rows)
    found, least = square[rows], variance[rows]
    for _ in range(SETTLING):
        best = best_weights(np.maximum(found, least), part.excluded, correlation)
        found = part.residual(best.weights)[0] + best.variance[:, None]
    square = square.copy()
    square[rows] = found
    return square


def _squares(moments: BlockMoments, variance: Floats, used: Bools, correlation: Floats) -> Floats:
    """Mean squares [M, N] of the gyros' noise, (deg/s)², without bias where `variance` [M, N] is theirs.

    Residual against the best estimate, less its slow part; what these two took of it is added (see parity_hat).
    """
    best = best_weights(variance, moments.excluded, correlation)
    square, mean = moments.residual(best.weights)
    slow, lost = _slow_part(moments, best, variance, used, mean)
    squares: Floats = np.maximum(square - 2.0 * mean * slow + slow**2, 0.0) + best.variance[:, None] + lost
    return squares


def _slow_part(
    moments: BlockMoments, best: BestWeights, variance: np.ndarray, used: np.ndarray, mean: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Mean of the residuals' means [M, N] over the blocks about each, by their variances; and the variance it takes."""
    rest = np.maximum(variance - best.variance[:, None], 1e-6 * variance)
    sure = np.where(used, moments.size[:, None] / rest, 0.0)
    mass = moments.window_sum(sure)
    some = mass > 1e-9 * sure.max(axis=0)
    mass = np.where(some, mass, 1.0)
    slow = np.where(some, moments.window_sum(sure * mean) / mass, 0.0)
    return slow, np.where(some, np.minimum(1.0 / mass, rest), 0.0)
