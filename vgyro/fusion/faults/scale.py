"""Changes of a scale factor, seen where the board moves: the residual is in proportion to the motion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vgyro.fusion.faults.block_sums import BlockSums
from vgyro.fusion.faults.candidate import SuspectedFault, lengths_up_to, running_sum, spread, weighted_median
from vgyro.fusion.faults.residuals import Residuals, Spoilt, residuals_of

LEAST_CHANGE = 0.005
"""Smaller changes of the sensitivity are what calibration and mounting leave over, as axes are not quite parallel."""
FEWEST_BLOCKS = 8
FEWEST_WINDOWS = 16
ROUNDS = 4
GAIN_ROUNDS, SETTLED = 6, 1e-5
LEAST_GAIN = 0.01
EDGE, AROUND = 2, 4  # blocks
EARLY = 0.05
"""A change in so early a part of the motion ends a fault rather than begins one."""


def _parts(sums: BlockSums, found: Residuals, gyro: int) -> tuple[np.ndarray, np.ndarray]:
    """Numerator and denominator [B] of the slope of the residual against the motion, block by block, samples' worth.

    Inside the block, and from one block to the next of the same run, where a bias cancels.
    """
    top = sums.count * found.product[:, gyro]
    bottom = sums.count * found.energy[:, gyro]
    same = np.diff(sums.run) == 0
    pair = 0.5 * np.minimum(sums.count[1:], sums.count[:-1]) * same
    top[1:] += pair * np.diff(found.mean[:, gyro]) * np.diff(found.motion[:, gyro])
    bottom[1:] += pair * np.diff(found.motion[:, gyro]) ** 2
    still = ~found.moving
    top[still] = bottom[still] = 0.0
    return top, bottom


def usual_slope(sums: BlockSums, found: Residuals, gyro: int, counts: np.ndarray) -> float:
    """Slope of the residual against the motion that is usual in this recording: a constant error of the scale.

    counts : [B], false where something is known to be wrong
    """
    top, bottom = _parts(sums, found, gyro)
    moving = (bottom > 0) & counts
    if moving.sum() < FEWEST_BLOCKS:
        return 0.0
    return weighted_median(top[moving] / bottom[moving], bottom[moving])


def relative_gain(
    sums: BlockSums, sigma2: np.ndarray, spoilt: Sequence[Spoilt], run: np.ndarray, counts: Sequence[np.ndarray]
) -> np.ndarray:
    """Sensitivities of the gyros [N] that are usual in this recording, over that of the middle one.

    counts : of each gyro [B], false where something is known to be wrong;  the rest as of residuals_of
    The slope against the others says how a gyro answers over how they do: log γ_i - Σ u_ij·log γ_j = log(1 + slope_i),
    solved for γ, and again with the rates divided by it.
    """
    gyros = sums.gyros
    share = np.where(np.eye(gyros, dtype=bool), 0.0, 1.0 / sigma2)
    solve = np.linalg.pinv(np.eye(gyros) - share / share.sum(axis=1, keepdims=True))
    gain = np.ones(gyros)
    for _ in range(GAIN_ROUNDS):
        found = residuals_of(sums, sigma2, np.tile(gain, (len(sums), 1)), spoilt, run)
        slope = np.array([usual_slope(sums, found, gyro, counts[gyro]) for gyro in range(gyros)])
        change = solve @ np.log(np.maximum(1.0 + slope, LEAST_GAIN))
        gain = gain * np.exp(change)
        gain = np.maximum(gain / np.median(gain), LEAST_GAIN)
        if np.ptp(change[gain > LEAST_GAIN]) < SETTLED:
            break
    return gain


def slope_in(sums: BlockSums, found: Residuals, gyro: int, first: int, last: int) -> float:
    """Slope of the residual against the motion in blocks [first, last); 0 without motion."""
    top, bottom = _parts(sums, found, gyro)
    return float(top[first:last].sum() / bottom[first:last].sum()) if bottom[first:last].any() else 0.0


def suspect_scale(
    sums: BlockSums, found: Residuals, gyro: int, counts: np.ndarray, local: np.ndarray, threshold: float
) -> SuspectedFault | None:
    """The window in which the slope differs most from the usual; None: in none.

    counts : [B], false where something else is known to be wrong
    local  : [B] variance of a sample of the residual, of white noise that is as strong at the motion's frequencies
    The evidence is the slope over its standard error, from the noise or from how much it varies in health.
    """
    top, bottom = _parts(sums, found, gyro)
    top, bottom = np.where(counts, top, 0.0), np.where(counts, bottom, 0.0)
    moving = np.flatnonzero(bottom > 0)
    if len(moving) < 2 * FEWEST_BLOCKS:
        return None
    # Blocks at rest know nothing of the scale: windows are of moving blocks alone.
    x, w = top[moving] / np.sqrt(local[moving]), bottom[moving] / local[moving]
    sx, sw = running_sum(x / np.sqrt(local[moving])), running_sum(w)
    best: tuple[float, int, int] | None = None
    for length in lengths_up_to(len(moving) // 2)[2:]:
        weight = sw[length:] - sw[:-length]
        score = (sx[length:] - sx[:-length]) / np.sqrt(weight)
        excess = spread(score) if len(score) > FEWEST_WINDOWS * length else 1.0
        score /= max(excess, 1.0)
        enough = np.abs(sx[length:] - sx[:-length]) / weight >= LEAST_CHANGE
        place = int(np.argmax(np.abs(score) * enough))
        evidence = float(abs(score[place]) * enough[place])
        if evidence >= threshold and (best is None or evidence > best[0]):
            best = evidence, place, place + length
    if best is None:
        return None
    first, last = _ends(sx, sw, best[1], best[2])
    size = float((sx[last] - sx[first]) / (sw[last] - sw[first]))
    if first <= EDGE and EARLY * len(moving) < last < len(moving) - EDGE:
        # The usual slope is that of the longer part; the earlier part is the one without the fault.
        first, last, size = last, len(moving), -size / (1.0 + size)
    begin, end = int(moving[first]), int(moving[last - 1]) + 1
    # Where nothing moves, or the rate is at a peak, it may have begun before, and have ended later.
    before = 0 if first == 0 else int(moving[first - 1]) + 1
    after = int(np.flatnonzero(counts)[-1]) + 1 if last >= len(moving) - EDGE else int(moving[last])
    begin = max(before, begin - AROUND)
    end = after if last >= len(moving) - EDGE else min(after, end + AROUND)
    return SuspectedFault(gyro, "scale", begin, end, best[0], size, "1")


def _ends(sx: np.ndarray, sw: np.ndarray, first: int, last: int) -> tuple[int, int]:
    """Maximum-likelihood ends of the stretch: the greatest (Σx)²/Σw."""
    total = len(sx) - 1
    for _ in range(ROUNDS):
        before, reach = (first, last), max(last - first, FEWEST_BLOCKS)
        begins = np.arange(max(0, first - reach), last)
        first = int(begins[np.argmax((sx[last] - sx[begins]) ** 2 / (sw[last] - sw[begins]))])
        ends = np.arange(first + 1, min(total, last + reach) + 1)
        last = int(ends[np.argmax((sx[ends] - sx[first]) ** 2 / (sw[ends] - sw[first]))])
        if (first, last) == before:
            break
    return first, last
