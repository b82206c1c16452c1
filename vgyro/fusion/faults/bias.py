"""Steps and drifts: the bias of a gyro leaves the walk that it has in health."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vgyro.fusion.events import FaultKind
from vgyro.fusion.faults.candidate import Candidate, lengths_up_to
from vgyro.fusion.faults.wander import Slow, contrasts

LEAST_SIZE = 2.5
"""Least fault in standard deviations of a block mean: what is smaller, the bias estimate of the fusion follows."""
LONGEST_STEP_S = 10.0
"""What takes longer to come is a drift."""
MORE_BEFORE = 4
SIDE = 1.5  # of the window, on each side, is fitted
BINS = 192
KNOTS = 48
SURE = 20.0
"""Log-likelihood ratio for the level being back where it was."""
EARLY = 0.05
"""A change so near to the start of the recording ends a fault rather than begins one."""


@dataclass(frozen=True)
class Change:
    """The level is `level` until block `first`, goes straight to level + size, and is there from block `last` on."""

    first: int
    last: int
    level: float
    size: float


def suspect_bias(slow: Slow, gyro: int, block_s: float, threshold: float) -> Candidate | None:
    """The greatest change of the level in units of what it does in health, made into a fault; None: there is none."""
    best: tuple[float, int, int] | None = None
    covered = np.flatnonzero(slow.counts)
    if covered.size == 0:
        return None
    least = LEAST_SIZE * float(np.sqrt(slow.usual_white))
    for length, before in _windows(len(slow.mean)):
        places, difference, white = contrasts(slow, length, before)
        inside = slow.counts[places] & slow.counts[places - 1]
        if not inside.any():
            continue
        score = np.where(inside, np.abs(difference), 0.0) / np.sqrt(white + slow.wander(0.5 * (length + before)))
        # Of a drift to the end, halves of it differ by half its size.
        score[np.abs(difference) < 0.5 * least] = 0.0
        place = int(np.argmax(score))
        if score[place] >= threshold and (best is None or score[place] > best[0]):
            best = float(score[place]), int(places[place]), length
    if best is None:
        return None
    evidence, place, length = best
    change = fit_change(slow, place, length)
    fault = _fault(slow, gyro, change, evidence, max(1, round(LONGEST_STEP_S / block_s)))
    return fault if abs(fault.size) >= least else None


def _windows(blocks: int) -> list[tuple[int, int]]:
    """(after, before) blocks that are compared: as many of both, and for what does not last more of them before."""
    even = [(length, length) for length in lengths_up_to(blocks // 2)]
    return even + [(length, MORE_BEFORE * length) for length in lengths_up_to(blocks // (2 + 2 * MORE_BEFORE))]


def fit_change(slow: Slow, place: int, length: int) -> Change:
    """Least-squares change of level near a block; the stretch that is fitted grows until the change lies inside it."""
    run = np.flatnonzero(slow.run == slow.run[place])
    low, high = int(run[0]), int(run[-1]) + 1
    reach = max(4, int(SIDE * length))
    first, last = max(low, place - reach), min(high, place + reach)
    for _ in range(12):
        change = _hinge(slow, first, last)
        margin = max(1, (last - first) // 8)
        wider = (first - (last - first) // 2 if change.first < first + margin else first,
                 last + (last - first) // 2 if change.last > last - margin else last)  # fmt: skip
        wider = max(low, wider[0]), min(high, wider[1])
        if wider == (first, last):
            break
        first, last = wider
    return change


def _hinge(slow: Slow, first: int, last: int) -> Change:
    """The best of all changes that begin and end between two blocks: on a grid, then once more near its best."""
    step = max(1, (last - first) // BINS)
    begins = np.arange(first, last, step)
    size = np.diff(np.append(begins, last))
    weight = size / np.maximum(np.add.reduceat(slow.white[first:last], begins - first) / size, 1e-300)
    mean = np.add.reduceat(slow.mean[first:last], begins - first) / size
    middle = begins + 0.5 * size
    knots = np.unique(np.linspace(first + 1, last - 1, min(KNOTS, last - first - 1)).astype(int))
    spacing = max(1, int(np.ceil((last - first) / KNOTS)))
    change = _best_knots(middle, mean, weight, knots, knots)
    while spacing > 1:
        near = [np.unique(np.clip(one + np.linspace(-spacing, spacing, 17).astype(int), first, last))
                for one in (change.first, change.last)]  # fmt: skip
        if step > 1 and spacing <= step:
            # Within a bin the single blocks decide.
            return _sharpened(slow, change, step, first, last)
        change = _best_knots(middle, mean, weight, *near)
        spacing = max(1, spacing // 4)
    return change


def _sharpened(slow: Slow, change: Change, step: int, first: int, last: int) -> Change:
    low, high = max(first, change.first - 16 * step), min(last, change.last + 16 * step)
    if high - low > 8 * BINS:
        return change
    rows = slice(low, high)
    near = [np.unique(np.clip(one + np.arange(-2 * step, 2 * step + 1, max(1, step // 4)), low, high))
            for one in (change.first, change.last)]  # fmt: skip
    middle = np.arange(low, high) + 0.5
    return _best_knots(middle, slow.mean[rows], 1.0 / slow.white[rows], *near)


def _best_knots(
    middle: np.ndarray, mean: np.ndarray, weight: np.ndarray, begins: np.ndarray, ends: np.ndarray
) -> Change:
    """The pair of knots with the least squares, level and size free."""
    begin, end = (grid.ravel() for grid in np.meshgrid(begins, ends, indexing="ij"))
    begin, end = begin[end >= begin], end[end >= begin]
    ramp = np.clip((middle - begin[:, None]) / np.maximum(end - begin, 1e-9)[:, None], 0.0, 1.0)
    total = weight.sum()
    centred = ramp - (ramp @ weight / total)[:, None]
    own = (weight * mean).sum() / total
    along = centred @ (weight * (mean - own))
    power = np.maximum((centred**2) @ weight, 1e-300)
    gain = along**2 / power
    place = int(np.argmax(gain))
    size = float(along[place] / power[place])
    level = float(own - size * (ramp[place] @ weight) / total)
    return Change(int(begin[place]), int(end[place]), level, size)


def _fault(slow: Slow, gyro: int, change: Change, evidence: float, longest_step: int) -> Candidate:
    """Which side of a change is the fault, and where it ends: where the level is back, or with the run."""
    run = np.flatnonzero(slow.run == slow.run[min(change.first, len(slow.run) - 1)])
    low, high = int(run[0]), int(run[-1]) + 1
    scatter = slow.usual_white / change.size**2
    later = (slow.mean[change.last : high] - change.level) / change.size
    earlier = (change.level + change.size - slow.mean[low : change.first][::-1]) / change.size
    forward, back = _return(later, scatter), _return(earlier, scatter)
    starts_early = change.first - low < EARLY * (high - low)
    backward = (
        back is not None and (forward is None or back < forward)
        if back is not None or forward is not None
        else starts_early
    )
    if not backward:
        first = change.first
        last = high if forward is None else change.last + forward
        rise = change.last - change.first
        level = change.level
    else:
        last = change.last
        level = change.level + change.size
        first, rise = low, longest_step + 1 if back is None else 0
        if back is not None:
            begun = _onset(slow, change.first - back, change.first, low)
            first, rise = begun.first, begun.last - begun.first
        if back is None and change.last - change.first <= longest_step:
            rise = 0
    last = max(last, first + 1)
    kind: FaultKind = "step" if rise <= longest_step else "drift"
    return Candidate(gyro, kind, first, last, evidence, _size(slow.mean[first:last] - level), "deg/s")


def _onset(slow: Slow, about: int, last: int, low: int) -> Change:
    """How a fault that ends at block `last` began, near block `about`."""
    reach = max(8, last - about)
    first = max(low, about - reach)
    return _hinge(slow, first, last) if last - first > 4 else Change(about, about, 0.0, 0.0)


def _return(share: np.ndarray, scatter: float) -> int | None:
    """First block of the return from 1 to 0 of a series, in order of time; None: it stays."""
    if share.size == 0:
        return None
    gain = np.cumsum(share - 0.5) / scatter
    highest = np.maximum.accumulate(np.maximum(gain, 0.0))
    back = np.flatnonzero(highest - gain > SURE)
    if back.size == 0:
        return None
    upto = gain[: back[0] + 1]
    return int(np.argmax(upto)) + 1 if upto.max() > 0 else 0


def _size(away: np.ndarray) -> float:
    """Greatest deviation, noise averaged out."""
    width = max(1, min(32, len(away) // 4))
    means = np.convolve(away, np.full(width, 1.0 / width), mode="valid")
    return float(means[np.argmax(np.abs(means))])
