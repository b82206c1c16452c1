"""The search: take the strongest suspicion, leave that gyro out there, look again, until none is strong enough."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vgyro.config import FaultOptions
from vgyro.fusion.events import FaultEvent, FaultKind
from vgyro.fusion.faults.block_sums import BlockSums, block_length, block_sums, silent_share
from vgyro.fusion.faults.candidate import SuspectedFault
from vgyro.fusion.faults.levels.temperature import block_temperature
from vgyro.fusion.faults.samples.found import Looked, look_at_samples
from vgyro.fusion.faults.state import BIAS_KINDS, NOISE_KINDS, State
from vgyro.fusion.samples.quantised import steps
from vgyro.fusion.types import ArrayRates

FEWEST_GYROS = 3
FEWEST_BLOCKS = 20
LONGEST_GAP_S = 60.0
NEAR = 8  # blocks: events of a kind that are nearer to each other are one
ONLY_DEAD = "only gyros that give no rate, copies and single samples were looked for"
TOO_FEW = f"fewer than three gyros: a difference does not tell which of two is at fault; {ONLY_DEAD}"
TOO_SHORT = f"less than {FEWEST_BLOCKS} blocks; {ONLY_DEAD}"
IN_HAND = (
    f"in motion {ONLY_DEAD}: between two rests of a free recording the board may be turned over, and its gyros are "
    "neither quite parallel nor blind to gravity"
)
MOST_SILENT = 0.02
TOO_COARSE = f"the counts are too coarse for the noise: blocks hold one value alone; {ONLY_DEAD}"


@dataclass(frozen=True)
class FaultSearch:
    """events : as of find_faults;  note : what could not be looked for in this recording, and why; "": nothing"""

    events: list[FaultEvent]
    note: str = ""


def find_faults(
    array: ArrayRates, options: FaultOptions | None = None, zero: np.ndarray | None = None
) -> list[FaultEvent]:
    """Stretches in which a gyro is at fault, in the order of their starts: the events of search_faults."""
    return search_faults(array, options, zero).events


def search_faults(
    array: ArrayRates, options: FaultOptions | None = None, zero: np.ndarray | None = None, in_hand: bool = False
) -> FaultSearch:
    """Look for stretches in which a gyro is at fault.

    zero : [N, 2] deg/s, between which the rate of a count of zero lies (NaN: not known), to tell dropout from stuck
    in_hand : the board may be turned over between its rests: only these are judged, and each has biases of its own
    First what single samples show by themselves: no rate, the rate of another gyro, the end of a range, absurd values.
    Then parity: each gyro against the inverse-variance combination of the others, so that the motion cancels. The
    strongest suspicion is taken (for a single fault that is the likelihood's choice), its gyro left out of the
    combination there, and the search begun again, so that it accuses no other. Evidence is in standard deviations of
    what this recording does in health, estimated robustly; events weaker than options.threshold are none.
    Ours (row E).
    """
    options = options or FaultOptions()
    length = block_length(array.rate_hz, options.block_s)
    looked = look_at_samples(array, length, zero)
    events, kept = list(looked.events), _kept(looked, FEWEST_BLOCKS * length)
    while True:
        part, gone, odd = _of_gyros(array, looked, kept)
        found, deaf, note = _search(part, gone, odd, options, in_hand)
        events += [replace(one, gyro=kept[one.gyro]) for one in (*found, *deaf)]
        if not deaf:
            return FaultSearch(sorted(events, key=lambda event: (event.start, event.gyro, event.kind)), note)
        silent = {one.gyro for one in deaf}
        kept = [gyro for place, gyro in enumerate(kept) if place not in silent]


def _kept(looked: Looked, fewest: int) -> list[int]:
    """Gyros that give rates for some time at least."""
    gone = looked.gone
    return [gyro for gyro in range(looked.gyros) if gone is None or np.sum(~gone[:, gyro]) >= fewest]


def _of_gyros(
    array: ArrayRates, looked: Looked, kept: Sequence[int]
) -> tuple[ArrayRates, np.ndarray | None, np.ndarray | None]:
    """The array of some of the gyros, and the samples of theirs that are gone or odd."""
    if len(kept) == looked.gyros:
        return array, looked.gone, looked.odd
    gone, odd = (None if one is None else one[:, kept] for one in (looked.gone, looked.odd))
    missing = None if array.missing is None else array.missing[:, kept]
    return replace(array, rate=np.asfortranarray(array.rate[:, kept]), missing=missing), gone, odd


def _search(
    array: ArrayRates, gone: np.ndarray | None, odd: np.ndarray | None, options: FaultOptions, in_hand: bool
) -> tuple[list[FaultEvent], list[FaultEvent], str]:
    """Events of blocks; gyros that are deaf throughout, and then nothing else; what was not looked for."""
    length = block_length(array.rate_hz, options.block_s)
    if array.rate.shape[1] < FEWEST_GYROS:
        return [], [], TOO_FEW
    if len(array.rate) < FEWEST_BLOCKS * length:
        return [], [], TOO_SHORT
    sums = block_sums(array, length, LONGEST_GAP_S, gone, odd)
    if np.median(silent_share(sums)) > MOST_SILENT:
        return [], [], TOO_COARSE
    still, note = None, ""
    if in_hand and array.at_rest.any() and not array.at_rest.all():
        still, note = np.logical_and.reduceat(array.at_rest, sums.edges[:-1]), IN_HAND
    temperature = block_temperature(array.temperature, sums.edges)
    state = State(sums, length * array.period, options, temperature, still, steps(array))
    if state.deaf:
        return [], [_in_samples(one, sums) for one in state.deaf], note
    found = _merged(state.search(), options.burst_s / state.block_s)
    return [_in_samples(one, sums) for one in (*found, *state.silenced)], [], note


def _merged(found: Sequence[SuspectedFault], burst_blocks: float) -> list[SuspectedFault]:
    """Events of a gyro and kind that touch as one; step and drift, noise and burst are of one kind here."""
    merged: list[SuspectedFault] = []
    for kinds in (BIAS_KINDS, NOISE_KINDS, ("scale",)):
        for one in sorted((one for one in found if one.kind in kinds), key=lambda one: (one.gyro, one.first)):
            last = merged[-1] if merged else None
            joins = last is not None and last.gyro == one.gyro and last.kind in kinds and one.first <= last.last + NEAR
            if last is None or not joins:
                merged.append(one)
                continue
            longer = max(last, one, key=lambda part: part.last - part.first)
            size = max(last.size, one.size, key=abs) if kinds is BIAS_KINDS else longer.size
            evidence = max(last.evidence, one.evidence)
            both = replace(longer, first=last.first, last=max(last.last, one.last), evidence=evidence, size=size)
            merged[-1] = both if kinds is not NOISE_KINDS else replace(both, kind=_noise_kind(both, burst_blocks))
    return merged


def _noise_kind(one: SuspectedFault, burst_blocks: float) -> FaultKind:
    return "burst" if one.last - one.first < burst_blocks else "noise"


def _in_samples(one: SuspectedFault, sums: BlockSums) -> FaultEvent:
    start, stop = int(sums.edges[one.first]), int(sums.edges[one.last])
    return FaultEvent(one.gyro, one.kind, start, stop, one.evidence, one.size, one.unit)
