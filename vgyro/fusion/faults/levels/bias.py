"""Steps and drifts: the bias of a gyro leaves the walk that it has in health."""

from __future__ import annotations

import numpy as np

from vgyro.fusion.events import FaultKind
from vgyro.fusion.faults.candidate import SuspectedFault, lengths_up_to, running_sum
from vgyro.fusion.faults.levels.change import LevelChange, fit_change, hinge, lasting_change, run_of
from vgyro.fusion.faults.levels.drift_variance import Slow, contrasts
from vgyro.runs import runs

LEAST_SIZE = 2.5
"""Least fault in standard deviations of a block mean: what is smaller, the bias estimate of the fusion follows."""
LONGEST_STEP_S = 10.0
"""What takes longer to come is a drift."""
MORE_BEFORE = 4
FEWEST_BLOCKS = 20  # of a run in which a lasting change is looked for
SURE = 20.0
"""Log-likelihood ratio for the level being back where it was."""
EARLY, MOST_OF_RUN = 0.05, 0.5
"""A new level that is reached so early in a run is the healthy one, and may be where nothing of the old one is left."""


def suspect_bias(slow: Slow, gyro: int, block_s: float, threshold: float) -> list[SuspectedFault]:
    """The clearest change of the level in units of what it does in health, made into a fault.

    returns : the likelier one first, where either side of the change may be the fault; none: there is no such change
    """
    if not slow.counts.any():
        return []
    least = LEAST_SIZE * float(np.sqrt(slow.usual_white))
    longest_step = max(1, round(LONGEST_STEP_S / block_s))
    evidence, place, length = _contrast(slow, 0.5 * least)
    changes = [lasting_change(slow, *rows) for rows in _long_runs(slow)]
    lasting = max(changes, key=lambda one: one.evidence, default=None)
    faults: list[SuspectedFault] = []
    if evidence >= threshold:
        change = fit_change(slow, place, length)
        back = returns(slow, change)
        if back != (None, None):
            faults = [_passing(slow, gyro, change, back, evidence, longest_step)]
        elif lasting is None or run_of(slow, place) != run_of(slow, lasting.first):
            faults = _lasting(slow, gyro, lasting_change(slow, *run_of(slow, place)), evidence, longest_step)
    if not faults and lasting is not None and abs(lasting.size) >= least:
        evidence = max(evidence, lasting.evidence)
        if evidence >= threshold and returns(slow, lasting) == (None, None):
            faults = _lasting(slow, gyro, lasting, evidence, longest_step)
    return [fault for fault in faults if abs(fault.size) >= least]


def _contrast(slow: Slow, least: float) -> tuple[float, int, int]:
    """Greatest difference of neighbouring means over its standard deviation in health, its place and length."""
    best = (0.0, 0, 1)
    for length, before in _windows(len(slow.mean)):
        places, difference, white = contrasts(slow, length, before)
        inside = slow.counts[places] & slow.counts[places - 1]
        if not inside.any():
            continue
        score = np.where(inside, np.abs(difference), 0.0) / np.sqrt(white + slow.wander(0.5 * (length + before)))
        # Of a drift to the end, halves of it differ by half its size.
        score[np.abs(difference) < least] = 0.0
        place = int(np.argmax(score))
        if score[place] > best[0]:
            best = float(score[place]), int(places[place]), length
    return best


def _long_runs(slow: Slow) -> list[tuple[int, int]]:
    counted = running_sum(slow.counts)
    return [(low, high) for low, high in runs(slow.run).tolist() if counted[high] - counted[low] >= FEWEST_BLOCKS]


def _windows(blocks: int) -> list[tuple[int, int]]:
    """(after, before) blocks that are compared: as many of both, and for what does not last more of them before."""
    even = [(length, length) for length in lengths_up_to(blocks // 2)]
    return even + [(length, MORE_BEFORE * length) for length in lengths_up_to(blocks // (2 + 2 * MORE_BEFORE))]


def returns(slow: Slow, change: LevelChange) -> tuple[int | None, int | None]:
    """Blocks for which the new level lasts, and the old one did, in the run; None: to its end, from its start."""
    low, high = run_of(slow, change.first)
    scatter = slow.usual_white / change.size**2
    later = (slow.mean[change.last : high] - change.level) / change.size
    earlier = (change.level + change.size - slow.mean[low : change.first][::-1]) / change.size
    return _return(later, scatter), _return(earlier, scatter)


def _passing(
    slow: Slow,
    gyro: int,
    change: LevelChange,
    returns: tuple[int | None, int | None],
    evidence: float,
    longest_step: int,
) -> SuspectedFault:
    """The fault of a change that is taken back, on the side where it is so sooner."""
    low, _ = run_of(slow, change.first)
    forward, back = returns
    if back is not None and (forward is None or back < forward):
        begun = _onset(slow, change.first - back, change.first, low)
        level, rise = change.level + change.size, begun.last - begun.first
        return _candidate(slow, gyro, (begun.first, change.last), level, evidence, rise <= longest_step)
    assert forward is not None
    step = change.last - change.first <= longest_step
    return _candidate(slow, gyro, (change.first, change.last + forward), change.level, evidence, step)


def _lasting(slow: Slow, gyro: int, change: LevelChange, evidence: float, longest_step: int) -> list[SuspectedFault]:
    """The faults that a change may be that is not taken back: it begins one, rather than that it ends one.

    It ends one where the new level is there almost from the start on, and may do so where the old one is never seen.
    """
    low, high = run_of(slow, change.first)
    step = change.last - change.first <= longest_step
    begins = _candidate(slow, gyro, (change.first, high), change.level, evidence, step)
    ends = _candidate(slow, gyro, (low, change.last), change.level + change.size, evidence, step)
    reached = (change.last - low) / (high - low)
    if reached < EARLY:
        return [ends]
    return [begins, ends] if reached < MOST_OF_RUN else [begins]


def _candidate(
    slow: Slow, gyro: int, blocks: tuple[int, int], level: float, evidence: float, step: bool
) -> SuspectedFault:
    """A fault from a block to one before another."""
    first, last = blocks[0], max(blocks[1], blocks[0] + 1)
    kind: FaultKind = "step" if step else "drift"
    return SuspectedFault(gyro, kind, first, last, evidence, _size(slow.mean[first:last] - level), "deg/s")


def _onset(slow: Slow, about: int, last: int, low: int) -> LevelChange:
    """How a fault that ends at block `last` began, near block `about`."""
    reach = max(8, last - about)
    first = max(low, about - reach)
    return hinge(slow, first, last) if last - first > 4 else LevelChange(about, about, 0.0, 0.0)


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
