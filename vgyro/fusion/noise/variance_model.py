"""How fast a variance changes: time constants, and which of them predicts best."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Floats

TIME_CONSTANTS_S = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 60.0, 120.0, 300.0)
FEWEST_BLOCKS = 2.0
"""A shorter time constant, in blocks, is no average."""
LEAST_MASS = 1e-9

LowPass = Callable[[np.ndarray, float, float, float], np.ndarray]
"""signal, keep, gain, start → keep·y_{k-1} + gain·signal_k"""


@dataclass(frozen=True)
class Memory:
    """What a variance is an average over.

    keep   : share of a block that is left one block further; 1: every block counts the same
    tau_s  : the same as a time constant; infinite: constant
    """

    keep: float
    tau_s: float

    def average(self, square: np.ndarray, freedom: np.ndarray, low_pass: LowPass) -> tuple[np.ndarray, np.ndarray]:
        """Variance [M] of each block with the block itself, and without it, from its square [M] and freedom [M].

        Two-sided EWMA with weights freedom·keep^|distance|. Where nothing is known: the mean over all.
        """
        total = freedom * square
        level = total.sum() / max(freedom.sum(), LEAST_MASS)
        if self.keep == 1.0:
            around, near = np.full(len(total), total.sum()), np.full(len(total), freedom.sum())
        else:
            around, near = both_sides(total, self.keep, low_pass), both_sides(freedom, self.keep, low_pass)
        return _ratio(around, near, level), _ratio(around - total, near - freedom, level)


CONSTANT = Memory(1.0, math.inf)


def both_sides(values: Floats, keep: float, low_pass: LowPass) -> Floats:
    """Σ_c keep^|b - c|·values_c [M] of values [M]."""
    ahead = low_pass(np.ascontiguousarray(values[::-1]), keep, 1.0, 0.0)[::-1]
    return low_pass(values, keep, 1.0, 0.0) + ahead - values


def _ratio(total: np.ndarray, number: np.ndarray, level: float) -> np.ndarray:
    known = number > LEAST_MASS
    return np.where(known, np.maximum(total, LEAST_MASS * level) / np.where(known, number, 1.0), level)


def chosen_memory(square: np.ndarray, freedom: np.ndarray, block_s: float, low_pass: LowPass) -> Memory:
    """The memory that predicts each block best from the others.

    square [M] : of expectation σ²;  freedom [M] : samples of each block; 0: left out;  block_s : s from block to block
    Score: the Gaussian deviance Σ ν·(x/v + log v) with v from the other blocks alone (QLIKE, Patton 2011, J.
    Econometrics 160, 246-256). Beside a constant variance, anything pays 2·log(Σν) for its time constant.
    """
    if not freedom.any() or not square[freedom > 0].any():
        return CONSTANT
    scaled = freedom * effective_share(square, freedom)
    best, least = CONSTANT, math.inf
    for tau in (math.inf, *TIME_CONSTANTS_S):
        if tau < FEWEST_BLOCKS * block_s:
            continue
        memory = Memory(math.exp(-block_s / tau), tau)
        alone = memory.average(square, scaled, low_pass)[1]
        price = 2.0 * math.log(max(scaled.sum(), 2.0)) if tau < math.inf else 0.0
        score = float(np.sum(scaled * (square / alone + np.log(alone)))) + price
        if score < least:
            best, least = memory, score
    return best


def effective_share(square: np.ndarray, freedom: np.ndarray) -> float:
    """Degrees of freedom a sample, from how much neighbouring blocks differ: less than 1 in coloured noise.

    Of two χ² mean squares a and b of ν degrees of freedom ((a - b)/(a + b))² has the mean 1/(ν + 1), whatever σ².
    """
    good = (freedom[1:] > 0) & (freedom[:-1] > 0)
    first, second = square[1:][good], square[:-1][good]
    total = first + second
    alive = total > 0
    if not alive.any():
        return 1.0
    spread = float(np.mean(((first - second)[alive] / total[alive]) ** 2))
    return min(1.0, (1.0 / max(spread, 1e-12) - 1.0) / float(np.median(freedom[freedom > 0])))
