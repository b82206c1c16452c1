"""Mistakes of a manifest or board that show in the data: wrong units, signs, times and channels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vgyro.units import deg_from_rad

Span = tuple[float, float]
Plateau = tuple[float, float, float]

RADIAN = deg_from_rad(1.0)
RADIAN_TOLERANCE = 0.1  # a scale that is wrong by 57.3 within so much is one of radians
SURELY_WRONG = 2.0  # a scale so many times too large or too small is no property of a gyro
FAR_FROM_NOMINAL = 0.15
FAR_FROM_OTHERS = 0.10
FEWEST_OTHERS = 3  # gyros of an array whose median says something
BIN_S = 0.1  # resolution of the shift
LONGEST_SHIFT_S = 60.0
SHORTEST_SHIFT_S = 0.3
STEADIER = 3.0  # plateaus are shifted if that makes them so many times steadier …
STEADY = 0.1  # … and leaves less than this of the spread of the whole recording
NEARLY_BEST = 1.2  # shifts whose spread is so near the least are as good; the middle one is taken
UNSTEADY = 5.0  # a plateau that varies so many times more than the median one
FEWEST_PLATEAUS = 3
CUT_SHORT_S = 0.5  # a plateau that goes on so long beyond the end is cut short; less is rounding
RATE_WARNING, RATE_MISTAKE = 0.02, 0.10


@dataclass(frozen=True)
class Suspicion:
    """A sentence on what seems wrong. sure : true: it is a mistake; false: it may be as it should."""

    message: str
    sure: bool


def scale_suspicions(names: Sequence[str], relative: np.ndarray) -> list[Suspicion]:
    """Scales that cannot be, of the gyros of one array on a rate table.

    relative : [N], measured scale over nominal scale, with the board's signs; NaN where it is not known
    """
    known = np.isfinite(relative) & (relative != 0)
    values, gyros = relative[known], [name for name, there in zip(names, known, strict=True) if there]
    if not len(values):
        return []
    median = float(np.median(values))
    for factor, cure in (
        (1 / RADIAN, f"the plateaus' rates look like rad/s: multiply them by {RADIAN:.5f}"),
        (RADIAN, f"the board's scales look like rad/s a count: multiply them by {RADIAN:.5f}"),
    ):
        if abs(abs(median) / factor - 1) <= RADIAN_TOLERANCE:
            return [Suspicion(f"{cure} (measured over nominal scale: {median:.4g})", True)]
    if (values < 0).all() and len(values) > 1:
        return [
            Suspicion("all gyros turn against the table: turn the sign of the plateaus' rates, or of the gyros", True)
        ]
    found = []
    for name, value in zip(gyros, values.tolist(), strict=True):
        if value < 0:
            found.append(Suspicion(f"gyro {name} turns against the table: turn its sign in the board file", True))
            continue
        text = f"the measured scale of gyro {name} is {value:.3g} times the nominal one"
        if not 1 / SURELY_WRONG <= value <= SURELY_WRONG:
            found.append(Suspicion(f"{text}: check `scale` in the board file, and the plateaus' rates", True))
        elif abs(value - 1) > FAR_FROM_NOMINAL:
            found.append(Suspicion(text, False))
        elif len(values) >= FEWEST_OTHERS and abs(value / median - 1) > FAR_FROM_OTHERS:
            found.append(Suspicion(f"{text}, that of its array {median:.3g} times", False))
    return found


def relative_scales(means: np.ndarray, rates: np.ndarray, sign: Sequence[float], scale: Sequence[float]) -> np.ndarray:
    """Measured over nominal scale of each gyro, by a straight line through its plateaus; NaN with fewer than 2 rates.

    means : [P, N] counts, NaN where a plateau cannot be used;  rates : [P] deg/s;  scale : nominal, deg/s a count
    """
    found = np.full(means.shape[1], np.nan)
    for column, (side, nominal) in enumerate(zip(sign, scale, strict=True)):
        usable = np.isfinite(means[:, column])
        if np.unique(rates[usable]).size < 2:
            continue
        slope = float(np.polyfit(rates[usable], means[usable, column], 1)[0])
        if slope:
            found[column] = side / slope / nominal
    return found


def plateau_shift(values: np.ndarray, time: np.ndarray, plateaus: Sequence[Plateau]) -> float | None:
    """Seconds to add to all plateaus so that the gyros are steady on them; None if they are where they should be.

    values : [T, N], counts or rates;  time : [T] s, ascending;  plateaus : (start, stop, rate)
    The spread is that about a line through the rates, so that a shift by a whole plateau does not pass. It must fall to
    a third, and to less than a tenth of the spread of the recording.
    """
    if len(plateaus) < FEWEST_PLATEAUS or not len(time):
        return None
    shifts = np.arange(-round(LONGEST_SHIFT_S / BIN_S), round(LONGEST_SHIFT_S / BIN_S) + 1)
    spread = _spread_of_shifts(values, time, plateaus, shifts)
    best = int(np.argmin(spread))
    here = float(spread[len(shifts) // 2])
    if not math.isfinite(spread[best]) or spread[best] >= STEADY or here <= STEADIER * spread[best]:
        return None
    first = last = best
    limit = NEARLY_BEST * spread[best]
    while first > 0 and spread[first - 1] <= limit:
        first -= 1
    while last < len(shifts) - 1 and spread[last + 1] <= limit:
        last += 1
    shift = float(shifts[first] + shifts[last]) / 2 * BIN_S
    return shift if abs(shift) >= SHORTEST_SHIFT_S else None


def _spread_of_shifts(
    values: np.ndarray, time: np.ndarray, plateaus: Sequence[Plateau], shifts: np.ndarray
) -> np.ndarray:
    """Spread on the plateaus over that of the recording, for each shift in bins; inf where a plateau lies outside."""
    deviation = np.nanstd(values, axis=0)
    usable = deviation > 0
    scaled = np.nan_to_num((values[:, usable] - np.nanmean(values[:, usable], axis=0)) / deviation[usable])
    bins = np.floor(time / BIN_S).astype(np.int64)
    size = int(bins[-1]) + 1

    def summed(weights: np.ndarray | None) -> np.ndarray:
        return np.concatenate([[0.0], np.cumsum(np.bincount(bins, weights, size))])

    count = summed(None)
    starts, stops, rate = (np.array([plateau[k] for plateau in plateaus]) for k in range(3))
    begin = np.ceil(starts / BIN_S).astype(np.int64)[:, None] + shifts
    end = np.floor(stops / BIN_S).astype(np.int64)[:, None] + shifts
    outside = ((begin < 0) | (end > size) | (end <= begin)).any(axis=0)
    begin, end = np.clip(begin, 0, size), np.clip(end, 0, size)
    number = np.maximum(count[end] - count[begin], 0)
    total = np.maximum(number.sum(axis=0), 1)
    away = rate[:, None] - (number * rate[:, None]).sum(axis=0) / total
    squares = np.zeros(len(shifts))
    for column in range(scaled.shape[1]):
        sums, powers = summed(scaled[:, column]), summed(scaled[:, column] ** 2)
        mass = sums[end] - sums[begin]
        power = (powers[end] - powers[begin]).sum(axis=0)
        lever = np.maximum((number * away**2).sum(axis=0), 1e-12)
        squares += power - mass.sum(axis=0) ** 2 / total - (away * mass).sum(axis=0) ** 2 / lever
    spread = np.sqrt(np.maximum(squares, 0) / total / max(1, scaled.shape[1]))
    return np.where(outside, np.inf, spread)


def unsteady_plateaus(values: np.ndarray, time: np.ndarray, plateaus: Sequence[Plateau]) -> list[Suspicion]:
    """Plateaus on which the gyros vary much more than on the others.

    values : [T, N], counts or rates;  time : [T] s, ascending
    """
    spread = np.full(len(plateaus), np.nan)
    deviation = np.nanstd(values, axis=0)
    for row, (start, stop, _) in enumerate(plateaus):
        first, last = np.searchsorted(time, [start, stop])
        if last - first > 1:
            part = values[first:last, deviation > 0] / deviation[deviation > 0]
            spread[row] = float(np.median(np.nanstd(part, axis=0))) if part.size else np.nan
    if np.count_nonzero(np.isfinite(spread)) < FEWEST_PLATEAUS:
        return []
    usual = float(np.nanmedian(spread))
    return [
        Suspicion(
            f"the plateau from {start:g} to {stop:g} s is not steady: the gyros vary {one / usual:.0f} times as much as"
            " on the others; leave the settling out",
            False,
        )
        for (start, stop, _), one in zip(plateaus, spread.tolist(), strict=True)
        if usual > 0 and one > UNSTEADY * usual
    ]


def outside_recording(what: str, spans: Sequence[Span], end_s: float) -> list[tuple[int, Suspicion]]:
    """Plateaus or rests (`what`) beyond the end of the recording: the number of each, and what to say.

    spans : (start, stop), s;  end_s : when the last sample ends
    One that begins after the end is a mistake; one that only goes on beyond it is cut short.
    """
    found = []
    for number, (start, stop) in enumerate(spans):
        where = f"the {what} from {start:g} to {stop:g} s"
        if start >= end_s:
            text = f"{where} lies after the end of the recording, at {end_s:.6g} s: check its times, and `rate_hz`"
            found.append((number, Suspicion(text, True)))
        elif stop > end_s + CUT_SHORT_S:
            text = f"{where} goes on beyond the end of the recording, at {end_s:.6g} s"
            found.append((number, Suspicion(text, False)))
    return found


def same_columns(values: np.ndarray, names: Sequence[str]) -> list[Suspicion]:
    """Gyros that give the same numbers all the time: one channel under two names.

    values : [T, N]; a column that never changes is left out
    """
    found = []
    moving = [column for column in range(values.shape[1]) if len(values) and np.ptp(values[:, column]) > 0]
    for place, first in enumerate(moving):
        for second in moving[place + 1 :]:
            if np.array_equal(values[:, first], values[:, second]):
                text = f"gyros {names[first]} and {names[second]} give the same numbers in all {len(values)} samples"
                found.append(Suspicion(f"{text}: one channel under two names", True))
    return found


def shared_channels(names: Sequence[str], fields: Sequence[str]) -> list[Suspicion]:
    """Gyros of a board that read the same channel. fields : the channel of each"""
    return [
        Suspicion(f"gyros {names[other]} and {name} read one channel, {field}: mend `field` in the board file", True)
        for place, (name, field) in enumerate(zip(names, fields, strict=True))
        for other in range(place)
        if fields[other] == field
    ]


def rate_suspicion(declared_hz: float, measured_hz: float) -> Suspicion | None:
    """A declared sample rate that the time stamps contradict: a warning from 2 % on, a mistake from 10 % on."""
    error = measured_hz / declared_hz - 1
    if abs(error) <= RATE_WARNING:
        return None
    text = f"rate_hz is {declared_hz:g}, but the time stamps say {measured_hz:.6g} Hz"
    return Suspicion(f"{text}: set rate_hz: {measured_hz:.4g}", abs(error) > RATE_MISTAKE)
