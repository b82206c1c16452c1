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
    """What the samples of a recording show by themselves, before gyros are compared in blocks.

    events : the faults that were found;  gyros : N
    gone   : [T, N] of bool, samples in which a gyro gives no rate of its own; None: there are none
    odd    : [T, N] of bool, single samples that are absurd; None: there are none
    """

    events: list[FaultEvent]
    gyros: int
    gone: np.ndarray | None
    odd: np.ndarray | None


def look_at_samples(array: ArrayRates, length: int, zero: np.ndarray | None) -> Looked:
    """Look for faults that single samples show: ends of the range, stuck and missing values, copies, absurd values.

    length : samples of a block, as the search in blocks uses them afterwards
    zero   : [N, 2], deg/s, between which the rate of a count of zero lies, as for find_dead; None: not known
    """
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
