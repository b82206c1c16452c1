"""How good a fused rate is, and a search for faults: arithmetic on arrays alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.accuracy.trial import TrueFault
from vgyro.fusion.events import FaultEvent

EDGE_S = 10.0
"""Left out at both ends, s."""
NEAR_S = 5.0
"""An event belongs to a fault that is not farther from it, s."""
FULL = 0.9
"""Share of its samples from which a second counts."""
TWO_SIDED_95 = 1.959963984540054


@dataclass(frozen=True)
class Errors:
    """Errors of one rate, deg/s: s.d. and r.m.s. at the full rate and of means of 1 s."""

    sd: float
    rms: float
    sd_1s: float
    rms_1s: float


@dataclass(frozen=True)
class Honesty:
    """nees : mean of (error/s.d.)²;  coverage : share of errors within 1.96 s.d.; NaN without a stated s.d."""

    nees: float = math.nan
    coverage: float = math.nan


@dataclass(frozen=True)
class FaultScore:
    """Faults of one recording.

    true : how many there are;  found : of them;  named : events on the gyros at fault that belong to a fault
    stray : events on them elsewhere;  invented : healthy gyros that are accused;  events : all
    excused : events on gyros that may be called faulty, and need not be
    """

    true: int
    found: int
    named: int
    stray: int
    invented: int
    excused: int
    events: int

    @property
    def right(self) -> bool:
        """Every fault is found, none twice, and nothing else."""
        nothing_else = self.stray == 0 and self.invented == 0 and self.excused <= 1
        return self.found == self.true and self.named <= self.true and nothing_else


def inner(time: np.ndarray) -> np.ndarray:
    """bool [T]: EDGE_S from both ends.  time [T], s"""
    return (time >= time[0] + EDGE_S) & (time <= time[-1] - EDGE_S)


def second_means(values: np.ndarray, time: np.ndarray, rate_hz: float) -> np.ndarray:
    """Means [S] of the whole seconds of values [T]; one with gaps counts if FULL of it is there."""
    second = np.floor(time - time[0] + 0.5 / rate_hz).astype(int)
    count = np.bincount(second)
    total = np.bincount(second, weights=values)
    full = count >= max(FULL * rate_hz, 1)
    return total[full] / count[full]


def errors_of(rate: np.ndarray, truth: np.ndarray, time: np.ndarray, rate_hz: float) -> Errors:
    """Errors of a fused rate [T], deg/s, within the inner part."""
    where = inner(time)
    error = rate[where].astype(float) - truth[where]
    means = second_means(error, time[where], rate_hz)
    return Errors(float(error.std()), _rms(error), float(means.std()), _rms(means))


def honesty_of(rate: np.ndarray, sd: np.ndarray | None, truth: np.ndarray, time: np.ndarray) -> Honesty:
    """Is the stated s.d. [T], deg/s, that of the errors?"""
    if sd is None:
        return Honesty()
    where = inner(time)
    error, stated = rate[where].astype(float) - truth[where], sd[where].astype(float)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(error == 0.0, 0.0, error / stated)
    return Honesty(float(np.mean(ratio**2)), float(np.mean(np.abs(ratio) <= TWO_SIDED_95)))


def fault_score(
    events: Sequence[FaultEvent], faults: Sequence[TrueFault], rate_hz: float, excused: Sequence[int] = ()
) -> FaultScore:
    """Events against the truth. Where any of some gyros may be named, a second of them is invented."""
    reach = NEAR_S * rate_hz
    guilty = {gyro for fault in faults for gyro in fault.gyros} | set(excused)

    def belongs(event: FaultEvent, fault: TrueFault) -> bool:
        near = event.start <= fault.stop + reach and event.stop >= fault.start - reach
        return event.gyro in fault.gyros and near

    found = sum(any(belongs(event, fault) for event in events) for fault in faults)
    named = sum(any(belongs(event, fault) for fault in faults) for event in events)
    pardoned = sum(event.gyro in excused for event in events)
    stray = sum(event.gyro in guilty for event in events) - named - pardoned
    accused = {event.gyro for event in events}
    both = sum(max(len(accused & set(gyros)) - 1, 0) for gyros in {fault.gyros for fault in faults})
    return FaultScore(len(faults), found, named, stray, len(accused - guilty) + both, pardoned, len(events))


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
