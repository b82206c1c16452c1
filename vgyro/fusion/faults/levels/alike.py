"""What all gyros of an array do at once, each by a size of its own, is no fault of one: they warm up and settle."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vgyro.fusion.faults.candidate import SuspectedFault, running_sum, spread
from vgyro.fusion.faults.levels.drift_variance import Slow

SMOOTH = 8
"""A form is smoothed over so much of its length."""
LIKE = 0.2
"""Where the others, in the middle, do so much of what a gyro does, it is the array."""
SETTLES, EARLY = 0.1, 0.05
"""The same of their mean square for a drift that begins with a run, in so much of it: that is how gyros settle when
they are switched on. Of six sizes by chance, the largest is ten times those of the others in one array of 2,000.
What the noise gives is not taken off: evidence too weak to show that the others do less accuses no gyro."""


def of_the_array(one: SuspectedFault, parts: Sequence[Slow]) -> bool:
    """Do the other gyros follow what this one does? Then the array does it, as in a warm-up, and no gyro is at fault.

    one     : the suspected fault;  parts : slow part of the residual of each gyro; in those of the others the suspected
              gyro is left out of the combination that they are compared with
    returns : True where, in the middle, the others do at least LIKE of it, in whatever direction
    What this gyro does in the stretch is the form; each other gyro's residual is regressed on it, so that its size is
    in units of this one's, and what the noise alone would give is taken off.
    """
    own = parts[one.gyro]
    run = own.run == own.run[min(one.first, len(own.run) - 1)]
    form = _form(own, one.first, one.last, run)
    sizes = []
    for gyro, part in enumerate(parts):
        known = part.counts & run
        centred = form[known] - form[known].mean() if known.any() else form[:0]
        power = float(centred @ centred)
        if gyro != one.gyro and power > 0:
            sizes.append(float(centred @ part.mean[known]) / power)
    if not sizes:
        return False
    settles = one.kind == "drift" and one.first - int(np.argmax(run)) < EARLY * run.sum()
    if settles:
        return float(np.mean(np.square(sizes))) > SETTLES**2
    alike: bool = spread(np.array(sizes)) ** 2 - one.evidence**-2.0 > LIKE**2
    return alike


def _form(own: Slow, first: int, last: int, run: np.ndarray) -> np.ndarray:
    """What the level does in blocks [first, last) [B], smoothed, over what it is beside them in the run."""
    blocks = np.arange(len(own.mean))
    inside = run & (blocks >= first) & (blocks < last)
    outside = run & own.counts & ~inside
    level = float(np.median(own.mean[outside])) if outside.any() else 0.0
    half = max(1, (last - first) // SMOOTH) // 2
    sums = running_sum(np.where(inside, own.mean - level, 0.0))
    low, high = np.clip(blocks - half, first, last), np.clip(blocks + half + 1, first, last)
    return np.where(inside, (sums[high] - sums[low]) / np.maximum(high - low, 1), 0.0)
