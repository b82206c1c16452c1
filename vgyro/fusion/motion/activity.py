"""Where the rate is livelier or calmer than its model says: by the smoother's own estimated error, block by block.

Real motion comes and goes: between two moves a board is nearly still, and one model with constant parameters smooths
too little there and too much in between. So the process noise may take other levels for a while. Each level smooths the
whole recording; the path through the levels is the one of least estimated error (Stein 1981, as in motion_evidence),
where every change of level costs what two parameters cost (BIC; Schwarz 1978). The path: Viterbi (1967).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from vgyro.fusion.motion.models import NARROW, UNLIMITED, Activity, Motion
from vgyro.fusion.motion.noisy_rate import NoisyRate, Standstill
from vgyro.fusion.motion.search import FAMILIES
from vgyro.fusion.motion.smoother import Smoothed, smooth, stretches

BLOCK_S, LEAST_BLOCK = 0.25, 8
"""Length of the blocks, s, and samples of one at least."""
STEP = 2.0
"""From one level to the next the smoother's bandwidth changes by this factor."""
FIRST, MOST = 1, 6
"""Levels on either side that are looked at first, and at most."""
FAR = 6.0
"""A square counts no more, over the variance: one sample far off is no motion."""


def find_activity(noisy: NoisyRate, motion: Motion, standstill: Standstill | None = None) -> Activity | None:
    """Levels of the process noise, by samples; None: the model holds throughout, or has no noise to change.

    All as in vgyro.fusion.motion.smoother.smooth. Samples of a standstill do not count. A sinusoid stays as it is.
    """
    sinusoid = motion.parameters.get("damping", 0.0) <= NARROW
    if motion.model == UNLIMITED or (motion.parameters.get("q") == 0.0 and sinusoid):
        return None
    samples = len(noisy.z)
    begins = _blocks(noisy.segment, max(LEAST_BLOCK, round(BLOCK_S * noisy.rate_hz)))
    apart = np.isin(begins, [part.start for part in stretches(noisy.segment)])
    counts = np.isfinite(np.broadcast_to(noisy.r, noisy.z.shape))
    if standstill is not None:
        counts = counts & ~standstill.at_rest

    def errors(activity: Activity) -> np.ndarray:
        found = smooth(noisy, replace(motion, calibration=1.0), "native", standstill, activity)
        return _errors(noisy, found, counts, begins)

    cost = 2.0 * math.log(max(int(counts.sum()), 2))
    order = next(family.order for family in FAMILIES.values() if family.model == motion.model)
    known = {level: errors(Activity.even(samples, STEP**level, order)) for level in range(-FIRST, FIRST + 1)}
    path = _path(known, cost, apart)
    while more := _beyond(known, path):
        known |= {level: errors(Activity.even(samples, STEP**level, order)) for level in more}
        path = _path(known, cost, apart)
    levels, place = np.unique(path, return_inverse=True)
    if not levels.any():
        return None
    lengths = np.diff(begins, append=samples)
    activity = Activity(np.repeat(place.astype(np.uint8), lengths), STEP ** levels.astype(float), order)
    changes = int(np.count_nonzero(np.diff(path, prepend=0)))
    return activity if errors(activity).sum() + changes * cost < known[0].sum() else None


def _blocks(segment: np.ndarray, size: int) -> np.ndarray:
    """First samples of the blocks: of `size` samples, the last one of a stretch longer. None reaches over a gap."""
    found = []
    for part in stretches(segment):
        many = max((part.stop - part.start) // size, 1)
        found.append(part.start + size * np.arange(many))
    return np.concatenate(found)


def _errors(noisy: NoisyRate, found: Smoothed, counts: np.ndarray, begins: np.ndarray) -> np.ndarray:
    """Estimated squared error of the smoother in each block, in units of the noise, but for a constant."""
    with np.errstate(invalid="ignore"):
        squares = np.minimum((noisy.z - found.rate) ** 2 / noisy.r, FAR) + 2.0 * found.variance / noisy.r
    squares[~counts] = 0.0
    return np.add.reduceat(squares, begins) * (1.0 - noisy.phi) / (1.0 + noisy.phi)


def _beyond(known: dict[int, np.ndarray], path: np.ndarray) -> list[int]:
    """Levels that should be looked at, too, as the path takes the outermost ones."""
    low, high = min(known), max(known)
    down = [low - 1] if path.min() == low and low > -MOST else []
    return down + ([high + 1] if path.max() == high and high < MOST else [])


def _path(known: dict[int, np.ndarray], cost: float, apart: np.ndarray) -> np.ndarray:
    """Level of each block [B] such that errors and changes of level cost least.

    known : level → errors [B];  apart : [B] of bool, the first block of a stretch, where level 0 is free
    """
    levels = np.array(sorted(known))
    errors = np.stack([known[level] for level in levels.tolist()], axis=1)
    fresh = np.where(levels == 0, 0.0, cost)
    best, changed = np.empty(len(errors), dtype=np.int64), np.empty(errors.shape, dtype=bool)
    total = np.zeros(len(levels))
    for block, (own, first) in enumerate(zip(errors, apart, strict=True)):
        best[block] = np.argmin(total)
        least = total[best[block]]
        if first:
            changed[block], total = True, least + fresh + own
        else:
            changed[block] = least + cost < total
            total = np.minimum(total, least + cost) + own
    path, place = np.empty(len(errors), dtype=np.int64), int(np.argmin(total))
    for block in range(len(errors) - 1, -1, -1):
        path[block] = levels[place]
        if changed[block, place]:
            place = int(best[block])
    return path
