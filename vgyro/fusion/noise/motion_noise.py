"""Noise that comes with the motion, of one size in all gyros: q(t) = a²·ẇ² + c²·w².

In a fast turn the gyros of a real array differ by more than their noise at rest: the instants of their samples jitter
by a part of a millisecond (a), scale factors and axes are not quite straight (c). These errors have one size in all
gyros of a kind, whatever their noise at rest is. So where the board moves fast all gyros are equally good, and what the
differences hold there says nothing of a gyro's noise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from vgyro.fusion.noise.difference_blocks import BlockMoments, block_moments
from vgyro.fusion.noise.reference_rate import reference, smoothed, smoothing_window, used
from vgyro.fusion.noise.variance_model import effective_share
from vgyro.fusion.samples.quantised import steps
from vgyro.fusion.types import ArrayRates

ROUNDS = 20
FAR = 25.0
"""A block's square so many times what is expected is a fault, or a burst, and no noise of the motion."""
LOUD = 0.02
"""Blocks in which the motion adds more than this part of the mean variance say nothing of the gyros' own noise."""
FEW = 16
"""So many blocks are no evidence, those that speak for it most: what one event adds is a fault."""
FEWEST_CALM = 64
"""Fewer other blocks are not enough for that."""


@dataclass(frozen=True)
class MotionNoise:
    """Noise that comes with the motion of one recording, of one size in all gyros.

    variance   : [M], (deg/s)² a sample, what it adds to the variance of each gyro in each block
    loud       : [M] of bool, blocks in which it is so large that they say nothing of the gyros' own noise
    jitter_s   : s, the factor a of the rate's derivative;  share : the factor c of the rate
    usual      : (deg/s)², mean variance of the gyros without it
    rate       : [T], deg/s, smoothed mean of the gyros;  derivative : [T], deg/s², of that
    """

    variance: np.ndarray
    loud: np.ndarray
    jitter_s: float
    share: float
    usual: float
    rate: np.ndarray
    derivative: np.ndarray

    @property
    def note(self) -> str:
        """In words, for people."""
        parts = [f"{1000.0 * self.jitter_s:.2g} ms of its derivative"] if self.jitter_s else []
        parts += [f"{100.0 * self.share:.2g} % of the rate"] if self.share else []
        return "noise that comes with the motion, in all gyros alike: " + " and ".join(parts)

    def calm(self, moments: BlockMoments) -> BlockMoments:
        """The moments without the loud blocks, in which no gyro counts."""
        return replace(moments, excluded=moments.excluded | self.loud[:, None])

    def loud_samples(self) -> np.ndarray:
        """bool [T]: samples that say nothing of the gyros' own noise."""
        added = (self.jitter_s * self.derivative) ** 2 + (self.share * self.rate) ** 2
        return np.asarray(added > LOUD * self.usual)


def motion_noise(array: ArrayRates, moments: BlockMoments | None = None) -> MotionNoise | None:
    """a and c of a recording in motion; None: the differences do not show any, or the motion is too small.

    The mean square of the differences of a block, which has the mean of the gyros' variances, is regressed on a
    constant, ẇ² and w²: no term below 0, weights by what is expected (the likelihood of χ²). It must be likelier than a
    constant by 2·log Σν for each term, as a variance that changes pays (vgyro.fusion.noise.variance_model), without the
    FEW blocks that speak for it most. Gyros whose noise is below their step differ by more where the rate crosses
    steps: of those nothing is said. Found once for an array.
    moments : block_moments(array), where they are known
    """
    return array.once("motion noise", lambda: _found(array, block_moments(array) if moments is None else moments))


def _found(array: ArrayRates, blocks: BlockMoments) -> MotionNoise | None:
    gyros = array.rate.shape[1]
    mean, noise = reference(array, used(array))
    window = smoothing_window(array, mean, noise)
    if window is None or gyros < 3:
        return None
    rate, derivative = (smoothed(array, mean, window, order) for order in (0, 1))
    means = [np.add.reduceat(one**2, blocks.start) / blocks.size for one in (derivative, rate)]
    square, count = _mean_square(blocks)
    good = count > 1
    freedom = np.where(good, blocks.size * (count - 1.0), 0.0)
    if good.sum() < FEWEST_CALM:
        return None
    terms = np.column_stack([np.ones(len(square)), *means])
    usual, *found = _fitted(terms, square, freedom)
    still = _fitted(terms[:, :1], square, freedom)[0]
    scaled = freedom * effective_share(square, freedom)
    added = terms[:, 1:] @ np.array(found)
    kept = good & (square < FAR * (usual + added))
    counted = scaled * kept
    each = np.sort(_deviances(square, still, counted) - _deviances(square, usual + added, counted))
    gain = float(each[:-FEW].sum())
    price = 2.0 * math.log(max(float(scaled.sum()), 2.0)) * sum(one > 0 for one in found)
    if not (any(found) and gain > price):
        return None
    if float(np.median(steps(array))) ** 2 > usual:
        return None
    loud = added > LOUD * usual
    if (good & ~loud).sum() < FEWEST_CALM:
        loud = added > np.sort(added[good])[FEWEST_CALM]
    return MotionNoise(added, loud, math.sqrt(found[0]), math.sqrt(found[1]), usual, rate, derivative)


def _mean_square(moments: BlockMoments) -> tuple[np.ndarray, np.ndarray]:
    """Mean over the good gyros [M] of the variances that their differences show, less the slow part; their number."""
    good = ~moments.excluded
    count = good.sum(axis=1)
    share = good / np.maximum(count, 1)[:, None]
    mean = np.sum(share * moments.mean, axis=1, keepdims=True)
    off = np.where(good, moments.mean - mean, 0.0)
    slow = moments.window_sum(off * moments.size[:, None]) / np.maximum(
        moments.window_sum(good * moments.size[:, None]), 1
    )
    own = np.einsum("bii->bi", moments.square)
    cross = np.matmul(moments.square, share[:, :, None])[:, :, 0]
    square = own - 2.0 * cross + np.sum(cross * share, axis=1, keepdims=True)
    square += moments.size[:, None] * (slow**2 - 2.0 * slow * off)
    return np.maximum(np.sum(np.where(good, square, 0.0), axis=1), 0.0) / (
        moments.size * np.maximum(count - 1, 1)
    ), count


def _fitted(terms: np.ndarray, square: np.ndarray, freedom: np.ndarray) -> list[float]:
    """Coefficients [K] ≥ 0 of greatest likelihood of χ² mean squares [M] about terms [M, K] @ coefficients."""
    from scipy.optimize import nnls

    size = np.sqrt(np.mean(terms**2, axis=0))
    size[size == 0] = 1.0
    expected = np.full(len(square), float(np.median(square[freedom > 0])))
    found = np.zeros(terms.shape[1])
    for _ in range(ROUNDS):
        weight = np.sqrt(freedom) * (square < FAR * expected) / expected
        found = nnls(terms / size * weight[:, None], square * weight)[0]
        expected = np.maximum(terms / size @ found, 1e-6 * float(expected.mean()))
    return [float(one) for one in found / size]


def _deviances(square: np.ndarray, expected: np.ndarray | float, freedom: np.ndarray) -> np.ndarray:
    return np.asarray(freedom * (np.log(expected) + square / expected))
