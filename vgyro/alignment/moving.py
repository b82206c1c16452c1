"""Moving stretches of a board, enough of them and no more."""

from __future__ import annotations

import numpy as np

from vgyro.alignment.blocks import BLOCK_S
from vgyro.runs import runs

COARSE_HZ = 20.0  # rate of the means in which motion is looked for
MOVING = 1.0  # common power of a block over the power of what the gyros do not share, least
MOST_VALUES = 2_000_000  # samples, all gyros together
ROWS_AT_ONCE = 1 << 20


def moving_rows(rate: np.ndarray, rate_hz: float, segment: np.ndarray) -> np.ndarray:
    """Rows in which all gyros see one motion: rate [T, N], segment [T] → int, rising.

    Blocks of ten seconds (less at the end of a stretch) in which the power that the gyros share, of means over a
    twentieth of a second, is at least that of what they do not share. Of many, those that move most: two million
    samples in all.
    """
    factor = max(round(rate_hz / COARSE_HZ), 1)
    length = factor * max(round(BLOCK_S * rate_hz / factor), 4)
    blocks: list[tuple[float, int, int]] = []
    for start, stop in runs(segment).tolist():
        for first in range(start, stop, length):
            last = min(first + length, stop)
            common, own = _shared(rate[first:last], factor)
            if common >= MOVING * own and common > 0:
                blocks.append((common, first, last))
    most = max(MOST_VALUES // max(rate.shape[1], 1) // length, 1)
    chosen = sorted((first, last) for _, first, last in sorted(blocks, reverse=True)[:most])
    return np.concatenate([np.arange(*block) for block in chosen]) if chosen else np.zeros(0, dtype=np.int64)


def _shared(block: np.ndarray, factor: int) -> tuple[float, float]:
    """Power that the gyros share and mean power of what they do not, (deg/s)², of one block, a line removed."""
    count = len(block) // factor
    gyros = block.shape[1]
    if count < 8 or gyros < 2:
        return 0.0, 0.0
    means = block[: count * factor].astype(float).reshape(count, factor, gyros).mean(axis=1)
    means = means[np.isfinite(means).all(axis=1)]
    if len(means) < 8:
        return 0.0, 0.0
    lever = np.arange(len(means)) - (len(means) - 1) / 2
    means -= means.mean(axis=0)
    means -= np.outer(lever, lever @ means / (lever @ lever))
    each = float((means**2).mean(axis=0).sum())
    common = (float((means.sum(axis=1) ** 2).mean()) - each) / (gyros * (gyros - 1))
    return common, each / gyros - common
