"""What single samples show by themselves: no rate, that of another gyro, the end of a range, an absurd value."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vgyro.fusion.events import FaultEvent
from vgyro.fusion.faults.samples.absurd import find_absurd
from vgyro.fusion.faults.samples.copies import find_copies
from vgyro.fusion.faults.samples.ends_of_range import find_ends, without_ends
from vgyro.fusion.faults.samples.no_rate import find_dead
from vgyro.fusion.samples.quantised import steps
from vgyro.fusion.types import ArrayRates


@dataclass(frozen=True)
class Looked:
    """events : what was found
    gone, odd : [T, N] samples of a gyro that are no rates, and single ones that are absurd; None: there are none
    """

    events: list[FaultEvent]
    gyros: int
    gone: np.ndarray | None
    odd: np.ndarray | None


def look_at_samples(array: ArrayRates, length: int, zero: np.ndarray | None) -> Looked:
    """length : of a block, samples;  zero : as of find_dead"""
    gone, events = find_ends(array)
    dead = without_ends(find_dead(array, zero), gone)
    copies = _not_dead(find_copies(array), dead)
    # What is stuck may be so at an end of its range.
    events = _not_dead(events, dead)
    gone = _marked(gone, [*dead, *copies], array.rate.shape)
    absurd = find_absurd(array, length, gone, steps(array))
    odd = _marked(None, absurd, array.rate.shape)
    return Looked([*events, *dead, *copies, *absurd], array.rate.shape[1], gone, odd)


def _not_dead(events: list[FaultEvent], dead: list[FaultEvent]) -> list[FaultEvent]:
    """Those that do not lie in a stretch in which the gyro is dead."""

    def inside(one: FaultEvent) -> bool:
        return any(one.gyro == other.gyro and other.start <= one.start and one.stop <= other.stop for other in dead)

    return [one for one in events if not inside(one)]


def _marked(mask: np.ndarray | None, events: list[FaultEvent], shape: tuple[int, ...]) -> np.ndarray | None:
    """The mask with the samples of the events, too; None: there are none."""
    if events and mask is None:
        mask = np.zeros(shape, dtype=bool, order="F")
    for one in events:
        assert mask is not None
        mask[one.start : one.stop, one.gyro] = True
    return mask
