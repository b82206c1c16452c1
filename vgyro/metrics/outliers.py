"""Single samples far outside the noise around them."""

from __future__ import annotations

import numpy as np

from vgyro.arrays import Bools, Floats, Ints
from vgyro.runs import run_starts

NORMAL_MAD = 0.6744897501960817  # median of |z| of a normal z
NORMAL = (0.68, 0.9944578832097531), (0.8, 1.2815515655446004)  # quantiles of |z|
BLOCK = 512  # samples that share a scale
CHUNK = 256  # blocks at a time
SCREEN = 0.6  # of the threshold: what is looked at closely
AROUND = 0.85  # of the threshold, against the scale of the samples on both sides
NEAR = 0.7  # of the threshold, against the scale of one side
SIDE, LEVEL = 24, 8  # samples on each side that give the near scale, and the level
REACH = 2  # samples beside a suspect that are looked at, too
AT_ONCE = 1 << 15
QUANTISED = 0.29  # noise of quantisation, of a step
BEND = np.sqrt(1.5)  # of x[k] - (x[k-1] + x[k+1])/2, white noise of unit variance


def find_outliers(
    rate: np.ndarray, rate_hz: float, segment: np.ndarray | None = None, threshold: float = 8.0
) -> np.ndarray:
    """Which samples are single ones, or a few in a row, far off all around them.

    rate      : array [T], deg/s;  rate_hz : Hz, of the samples
    segment   : array [T] int, number of the gap-free stretch. A stretch of which more than half is far off has a level
                of its own
    threshold : distance from the level, in standard deviations of the noise
    returns   : bool [T]
    An outlier is further than `threshold` scales of its second (at least 512 samples) from the level before it and
    from the level after it, medians of 8 samples about the slope of 24: so a step, a slow motion and a drift are none.
    That scale is the median of the second differences, or the noise of quantisation where that is more. An outlier is
    also further than 0.85·threshold times the noise of the 48 samples around it about those slopes (68 % quantile),
    which is more where the noise is not white, and than 0.7·threshold times that of the 24 samples on either side
    (80 % quantile): so samples of a noisy stretch of more than about ten samples are none.
    """
    rate = np.asarray(rate)
    flags = np.zeros(len(rate), dtype=bool)
    if len(rate) < 2 * LEVEL:
        return flags
    length = max(BLOCK, round(rate_hz))
    floor = QUANTISED * _resolution(rate)
    suspects, scale = _suspects(rate, length, SCREEN * threshold, floor)
    for first in range(0, len(suspects), AT_ONCE):
        part = slice(first, first + AT_ONCE)
        off = _far_off(rate, suspects[part], scale[part], threshold, floor)
        flags[suspects[part][off]] = True
    if segment is not None and flags.any():
        flags &= ~_of_another_level(flags, np.asarray(segment))
    return flags


def _resolution(rate: np.ndarray) -> float:
    """Step of quantised rates; of others, a small part of the noise."""
    for every in (max(len(rate) // 100_000, 1), 1):
        steps = np.abs(rate[1::every].astype(float) - rate[:-1:every])
        steps = steps[steps > 0]
        if steps.size:
            return float(np.quantile(steps, 0.1))
    return 0.0


def _suspects(rate: np.ndarray, length: int, screen: float, floor: float) -> tuple[np.ndarray, np.ndarray]:
    """Samples that bend away from their neighbours, with those beside them, and the scale of the noise there."""
    found, scales = [], []
    piece = length * CHUNK
    for first in range(0, len(rate), piece):
        # With a sample on each side; at the ends of the series the second difference is that of the neighbour.
        values = rate[max(first - 1, 0) : first + piece + 1].astype(float)
        bend = np.abs(values[1:-1] - (values[:-2] + values[2:]) / 2)
        if first == 0:
            bend = np.concatenate([bend[:1], bend])
        if first + piece >= len(rate):
            bend = np.concatenate([bend, bend[-1:]])
        scale = np.maximum(_block_medians(bend, length) / (NORMAL_MAD * BEND), floor)
        whole = len(bend) // length * length
        high = np.concatenate(
            [
                (bend[:whole].reshape(-1, length) > screen * scale[: whole // length, None]).ravel(),
                bend[whole:] > screen * scale[-1],
            ]
        )
        where = np.flatnonzero(high)
        found.append(where + first)
        scales.append(scale[np.minimum(where // length, len(scale) - 1)])
    places, scale = np.concatenate(found), np.concatenate(scales)
    beside = (places[:, None] + np.arange(-REACH, REACH + 1)).ravel()
    inside = (beside >= 0) & (beside < len(rate))
    places, first_of = np.unique(beside[inside], return_index=True)
    return places, np.repeat(scale, 2 * REACH + 1)[inside][first_of]


def _block_medians(bend: Floats, length: int) -> Floats:
    """Median of each block; samples of an incomplete last one belong to the block before."""
    blocks = len(bend) // length
    if blocks == 0:
        return np.array([np.median(bend)])
    return np.median(bend[: blocks * length].reshape(blocks, length), axis=1)


def _far_off(rate: Floats, places: Ints, scale: Floats, threshold: float, floor: float) -> Bools:
    """Which of `places` [K] lie far off the levels before and after, by the scale there and by that of their sides."""
    last = len(rate) - 1
    distance, spread = [], []
    steps = np.arange(1, SIDE + 1)
    for side in (-1, 1):
        at = places[:, None] + side * steps
        # At the ends of the series the other side stands in.
        at = np.where((at < 0) | (at > last), 2 * places[:, None] - at, at)
        values = rate[np.clip(at, 0, last)].astype(float)
        # A line through the medians of both halves of the side follows slow motion.
        ends = np.median(values.reshape(-1, 2, SIDE // 2), axis=2)
        slope = (ends[:, 1] - ends[:, 0]) / (SIDE // 2)
        level = np.median(values[:, :LEVEL] - slope[:, None] * steps[:LEVEL], axis=1)
        distance.append(np.abs(rate[places] - level))
        values -= slope[:, None] * steps
        spread.append(np.abs(values - np.median(values, axis=1)[:, None]))
    nearest = np.minimum(*distance)
    around = _quantile(np.hstack(spread), NORMAL[0])
    near = np.maximum(*(_quantile(one, NORMAL[1]) for one in spread))
    limit = np.maximum(scale, np.maximum(AROUND * around, NEAR * np.maximum(near, floor)))
    far: Bools = nearest > threshold * limit
    return far


def _quantile(spread: np.ndarray, normal: tuple[float, float]) -> np.ndarray:
    """Standard deviation by a quantile of each row."""
    share, of_normal = normal
    place = int(share * spread.shape[1])
    return np.partition(spread, place, axis=1)[:, place] / of_normal


def _of_another_level(flags: np.ndarray, segment: np.ndarray) -> np.ndarray:
    """Samples of stretches more than half of which are flagged."""
    first = run_starts(segment)
    lengths = np.diff(np.append(first, len(flags)))
    return np.repeat(2 * np.add.reduceat(flags, first, dtype=np.int64) > lengths, lengths)
