"""What the first rows of a recording tell: unit, wraps, repeats, and what the stamps are."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vgyro.storage.clocks.evenness import SHORTEST_PERIOD, Judgement, judge
from vgyro.storage.clocks.model import ClockOptions
from vgyro.storage.clocks.repeats import Keeper, KeepRule, keep_rule
from vgyro.storage.clocks.unfold import DAY_S, Unfolder, UnfoldRule, fits, known_wraps, spikes, usable
from vgyro.storage.clocks.unit import SECONDS, resolve_unit
from vgyro.storage.clocks.windows import resolution_ticks, robust_sd, rough_period, without_long_steps

SHARED = 2.5  # rows per stamp, from which on …
MIN_ADVANCES = 10  # … stamps that advance less often, or …
COARSEST_S = 4.0  # … by this much at a time say nothing
BACK_PERIODS, BACK_SPREADS = 3.0, 15.0  # how far jitter may take a stamp back
USUAL = 1.5  # times the 99.5th percentile of steps
MAX_BIN = 1024


class Rules(NamedTuple):
    """How to read the stamps. judgement: None if they say nothing, for the reason in `nothing`. bin_rows: of `Bins`."""

    unit: str
    unit_why: str
    scale: float
    unfold: UnfoldRule | None
    keep: KeepRule
    judgement: Judgement | None
    nothing: str
    resolution: float
    bin_rows: int


def look(stamps: np.ndarray, same: np.ndarray, options: ClockOptions, whole: bool) -> Rules:
    """Judge the head of a recording.

    stamps : [n] int64 or float64; same: bool [n]
    whole  : the head is the whole recording
    raises : DataError for a unit that does not exist
    """
    good = usable(stamps, 1.0)
    unit, why = resolve_unit(options.unit, stamps[good], options.name, options.rate_hz)
    scale = SECONDS[unit]
    good = usable(stamps, scale)
    values = stamps[good]
    resolution = resolution_ticks(values) if len(values) else 1.0
    nothing = _nothing(values, resolution * scale)
    silent = Rules(unit, why, scale, None, KeepRule(False), None, nothing, resolution * scale, MAX_BIN)
    if nothing:
        return silent
    rule = _unfold_rule(values, unit, scale, options)
    if rule is None:
        return silent._replace(nothing="the stamps do not advance")
    bad = ~good | spikes(stamps, good, rule)
    rows = keep_rule(stamps, same)
    seconds = Unfolder(rule).feed(stamps, bad).seconds[Keeper(rows).feed(stamps, same)]
    seconds = seconds[np.isfinite(seconds)]
    finest = 1.0 if np.issubdtype(values.dtype, np.integer) else float(np.spacing(np.abs(values).max()))
    judgement = judge(seconds, resolution * scale, finest * scale, options.meaning)
    if judgement is None:
        return silent._replace(nothing="the stamps do not advance")
    size = int(np.clip(len(seconds) // 128, 1, MAX_BIN)) if whole else MAX_BIN
    return Rules(unit, why, scale, rule, rows, judgement, "", judgement.resolution, size)


def _nothing(values: np.ndarray, resolution_s: float) -> str:
    """Why the stamps say nothing; empty if they do say something.

    They say nothing if they never advance, or if more than 2.5 rows share a stamp and they advance by 4 s or more at a
    time, or fewer than ten times.
    """
    if len(values) < 2:
        return f"{len(values)} rows have a usable stamp"
    steps = np.diff(values)
    advances = int(np.count_nonzero(steps > 0))
    if not advances:
        return "the stamps never advance"
    shared = len(values) / (advances + 1)
    if shared <= SHARED:
        return ""
    if resolution_s >= COARSEST_S:
        return (
            f"the stamps advance by {resolution_s:.6g} s at a time, and {shared:.0f} rows share one: "
            "stored in single precision?"
        )
    return f"the stamps advance {advances} times in {len(values)} rows" if advances < MIN_ADVANCES else ""


def _unfold_rule(values: np.ndarray, unit: str, scale: float, options: ClockOptions) -> UnfoldRule | None:
    """Usual steps, in ticks; None if there is no period."""
    steps = np.diff(values).astype(np.float64)
    upward = steps[steps > 0]
    known = DAY_S / scale if options.day else options.wrap
    wraps = () if known else known_wraps(unit, scale)
    usual = USUAL * float(np.quantile(upward, 0.995))
    before = values[:-1].astype(np.float64)
    best = max((known,) if known else wraps, key=lambda wrap: int(fits(steps, before, wrap, usual).sum()))
    steps = np.where(fits(steps, before, best, usual), steps + best, steps)
    steps = np.where(steps < -usual, np.median(upward), steps)
    times = np.concatenate([[0.0], np.cumsum(without_long_steps(steps))])
    period, _ = rough_period(times)
    if not period * scale >= SHORTEST_PERIOD:
        return None
    usual = max(usual, 2 * period)
    back = max(BACK_PERIODS * period, BACK_SPREADS * robust_sd(steps))
    return UnfoldRule(scale, period, usual, back, wraps, known)
