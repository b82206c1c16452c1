"""The integrity record: how complete a recording is, what is damaged or missing, where and why."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Literal, Self

import numpy as np

from vgyro import engine as engines
from vgyro.errors import DataError

MAX_ENTRIES = 1000  # of damage and of gaps in the record; the rest is counted


@dataclass(frozen=True)
class FileRecord:
    """One file of the recording. content_bytes: after unpacking; offsets of damage count these."""

    name: str
    bytes: int
    sha256: str
    compression: str = "none"
    content_bytes: int = 0


@dataclass(frozen=True)
class Damage:
    """Bytes [start, stop) of a file that belong to no good frame. frames_lost: by counter or time stamp; at the ends
    of the recording, and without both, as many as the bytes could have been."""

    file: str
    start: int
    stop: int
    frames_lost: int
    cause: str


@dataclass(frozen=True)
class Gap:
    """A gap in time, s. time: when the first missing frame was due; None: not known. ambiguous: whole wraps of the
    counter (or time stamp) more would fit as well."""

    time: float
    duration: float | None
    frames_lost: int | None
    cause: str
    ambiguous: bool = False


@dataclass(frozen=True)
class ChannelRecord:
    """Samples at a rail, the longest run of equal samples (begin and duration, s), and rows without a value."""

    clipped: int
    clipped_share: float
    stuck_start: float
    stuck_duration: float
    missing: int = 0


@dataclass(frozen=True)
class FrameCount:
    """good + lost = frames sent between the first and the last good one, restarts apart.

    bad       : damaged frames that were seen, or as many as the damaged bytes could have been
    lost      : missing between the first and the last good frame, damaged ones included
    repeated  : sent again with the same counter and bytes; dropped
    good_share : good / (good + the larger of bad and lost)
    """

    good: int
    bad: int
    lost: int
    repeated: int
    good_share: float


@dataclass(frozen=True)
class Integrity:
    """What decoding found. status: good, suspect or refused; reasons say why, in plain sentences.

    rate_hz : the rate to analyse with: of a log with time stamps the measured one; else the declared one, or the
              measured one where the two contradict each other
    clocks  : of a log, what the stamps of each stream are (vgyro.storage.clocks); of a dump none
    """

    board: str
    status: Literal["good", "suspect", "refused"]
    reasons: list[str]
    warnings: list[str]
    values: Literal["counts", "rates"]
    files: list[FileRecord]
    frames: FrameCount
    duration_s: float
    rate_hz: float
    declared_rate_hz: float | None
    measured_rate_hz: float | None
    rate_note: str
    segments: int
    clocks: list[dict[str, Any]]
    restarts: int
    gaps: list[Gap]
    gaps_not_listed: dict[str, int]
    damage: list[Damage]
    damage_not_listed: dict[str, int]
    channels: dict[str, ChannelRecord]

    def to_json(self) -> dict[str, Any]:
        """The record of integrity.json."""
        return asdict(self)


class Refused(DataError):
    """A recording that cannot be used; `integrity` is its record, as far as it got."""

    def __init__(self, integrity: Integrity, what: str, where: str | None = None, remedy: str | None = None) -> None:
        self.integrity = integrity
        super().__init__(what, where, remedy)

    def __reduce__(self) -> tuple[type[Self], tuple[object, ...]]:
        return type(self), (self.integrity, self.what, self.where, self.remedy)


@dataclass
class Ledger:
    """Damage and gaps as they are found; the sums count what the lists no longer hold."""

    damage: list[Damage] = field(default_factory=list)
    gaps: list[Gap] = field(default_factory=list)
    more_damage: dict[str, int] = field(default_factory=lambda: {"entries": 0, "bytes": 0, "frames_lost": 0})
    more_gaps: dict[str, int] = field(default_factory=lambda: {"entries": 0, "frames_lost": 0})
    bad: int = 0
    lost: int = 0
    restarts: int = 0
    ambiguous: int = 0

    def add_damage(self, file: str, start: int, stop: int, frames_lost: int, cause: str) -> None:
        """Note damaged bytes; see Damage."""
        if len(self.damage) < MAX_ENTRIES:
            self.damage.append(Damage(file, start, stop, frames_lost, cause))
            return
        self.more_damage["entries"] += 1
        self.more_damage["bytes"] += stop - start
        self.more_damage["frames_lost"] += frames_lost

    def add_gap(
        self, time: float, duration: float | None, frames_lost: int | None, cause: str, ambiguous: bool = False
    ) -> None:
        """Note a gap in time; see Gap."""
        self.lost += frames_lost or 0
        self.restarts += frames_lost is None
        self.ambiguous += ambiguous
        if len(self.gaps) < MAX_ENTRIES:
            self.gaps.append(Gap(time, duration, frames_lost, cause, ambiguous))
            return
        self.more_gaps["entries"] += 1
        self.more_gaps["frames_lost"] += frames_lost or 0


@dataclass
class ChannelWatch:
    """Clipped samples and the longest run of one value, of one channel, chunk by chunk."""

    low: float
    high: float
    engine: str = "native"
    samples: int = 0
    clipped: int = 0
    stuck_start: float = 0.0
    stuck_duration: float = 0.0
    missing: int = 0
    _value: Any = None
    _since: float = 0.0

    def __post_init__(self) -> None:
        self._longest_run = engines.get(self.engine).frames.longest_run

    def feed(self, values: np.ndarray, time: np.ndarray) -> None:
        """Take the next samples; NaN is none."""
        if values.dtype.kind == "f" and (gone := np.isnan(values)).any():
            self.missing += int(gone.sum())
            values, time = values[~gone], time[~gone]
        if not len(values):
            return
        self.samples += len(values)
        if np.fmin.reduce(values) <= self.low or np.fmax.reduce(values) >= self.high:
            self.clipped += int(np.count_nonzero((values <= self.low) | (values >= self.high)))
        goes_on = self._value is not None and values[0] == self._value
        since = self._since if goes_on else float(time[0])
        run, self._since = self._longest_run(values, time, since, self.stuck_duration)
        if run is not None:
            self.stuck_start, self.stuck_duration = run
        self._value = values[-1]

    def record(self) -> ChannelRecord:
        """The channel's entry."""
        return ChannelRecord(
            self.clipped,
            self.clipped / self.samples if self.samples else 0.0,
            self.stuck_start,
            self.stuck_duration,
            self.missing,
        )


def good_share(good: int, bad: int, lost: int) -> float:
    """Share of good frames among those that were sent; 0 if there is none."""
    return good / (good + max(bad, lost)) if good else 0.0


def percent(share: float) -> str:
    """A share for people: 12.3 %."""
    return f"{100 * share:.3g} %"


def listed(names: Sequence[str], most: int = 6) -> str:
    """Names in a sentence: a, b and 3 more."""
    shown = ", ".join(names[:most])
    return f"{shown} and {len(names) - most} more" if len(names) > most else shown
