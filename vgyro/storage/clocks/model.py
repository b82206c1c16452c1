"""What is told about a clock before, and what is known of it afterwards."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

MAX_GAPS = 1000  # listed in the record; the rest is counted


class ClockOptions(NamedTuple):
    """What is known about the time stamps of a log.

    unit    : of stamps that are plain numbers: "s", "ms", "us", "ns", "min"; "auto": see `guess_unit`
    meaning : "sampled": a stamp says when the sample was taken; "arrival": when it came in; "auto": see `judge`
    wrap    : the stamps begin anew after this many ticks; None: found if one of the known wraps fits
    rate_hz : declared rate; it settles only what the stamps leave open
    name    : of the column, a hint for the unit
    day     : the stamps are times of day, and midnight is a wrap of 86 400 s
    """

    unit: str = "auto"
    meaning: str = "auto"
    wrap: float | None = None
    rate_hz: float | None = None
    name: str = ""
    day: bool = False


class Placed(NamedTuple):
    """The rows of one block on the recording's clock.

    keep    : bool [n]; false for a row that repeats the one before
    time    : float64 [kept], s since the first sample; never falls
    segment : int32 [kept]; a new one begins after every gap and restart
    counter : int64 [kept], number of the sample; lost ones are counted too
    """

    keep: np.ndarray
    time: np.ndarray
    segment: np.ndarray
    counter: np.ndarray


@dataclass(frozen=True)
class ClockGap:
    """An interruption. time: when the first missing sample was due, s. duration (s), lost: None where not known."""

    time: float
    duration: float | None
    lost: int | None
    cause: str


@dataclass(frozen=True)
class ClockRecord:
    """What the time stamps of a recording are, and what they say.

    meaning      : "sampled", "arrival", or "none" (the stamps say nothing; the declared rate holds)
    even         : the samples lie on an even grid; None without a meaning
    time_from    : where sampling times come from: "stamps", "line" through them, "envelope" below them, "rate"
    why          : the test that decided, with its figures
    samples      : rows that are kept
    rate_hz      : measured, or the declared one if meaning is "none"
    rate_sd_hz   : its uncertainty, one sigma; None if meaning is "none"
    drift_ppm    : largest less smallest rate among eight parts of the recording; None: too short or too rough to tell
    jitter_s     : r.m.s. distance of stamps from the even grid, at the start; uneven stamps: s.d. of the steps
    resolution_s : smallest step that the stamps can show
    wrap_s       : where the stamps wrap, s; None: they do not
    wraps        : how often they did; midnights of times of day are counted apart
    restarts     : how often the clock began anew, or was set
    repeated     : rows dropped because stamp and values are those of the row before
    held         : rows per reading; above 1 each reading is kept once
    lost         : samples missing between the first and the last
    least_loss   : shortest run of lost samples that the stamps can show; None: single losses cannot be told at all
    uneven       : s.d. of the steps over their mean; 0 if even
    gaps         : interruptions and restarts, the first 1000
    gaps_not_listed : how many more
    bad_stamps   : rows without a usable stamp; their time is interpolated
    warnings     : sentences
    """

    meaning: Literal["sampled", "arrival", "none"]
    even: bool | None
    time_from: Literal["stamps", "line", "envelope", "rate"]
    why: str
    unit: str
    unit_why: str
    samples: int
    rate_hz: float
    rate_sd_hz: float | None
    drift_ppm: float | None
    jitter_s: float | None
    resolution_s: float | None
    wrap_s: float | None
    wraps: int
    midnights: int
    restarts: int
    repeated: int
    held: float
    lost: int
    least_loss: int | None
    uneven: float
    gaps: list[ClockGap]
    gaps_not_listed: int
    bad_stamps: int
    warnings: list[str]

    def to_json(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return asdict(self)
