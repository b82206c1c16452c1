"""Did a board that is declared to stand still move? Judged by what most gyros see at once, never by one of them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Bools
from vgyro.config import RestOptions
from vgyro.runs import true_runs

FEWEST_SAMPLES = 16  # in a window: with fewer, a window of noise is several times the quiet level by chance
FEWEST_WINDOWS = 8
FEWEST_VALUES = 8  # in a window, of a gyro that lacks some
SHORTEST = 2  # windows: what is in one alone is a knock, or a damaged row of the log
NEAR = 5  # windows on each side of a motion, from which its change of level is read
AGREE = 0.3  # of a step of the rate: gyros that see less or more of it see something else
QUIET_QUANTILE = 0.1
COMMON = 10.0  # so many times quieter is a difference of two gyros than what both see; noise has no such correlation
STEPS = 0.5  # steps of a quantised channel: a value that flips between two of them has no larger deviation
SMOOTH = 3.0  # a deviation so many times that of adjacent samples is motion, not noise
WINDOWS_AT_ONCE = 1 << 12
MOST_STEPS = 100_000


@dataclass(frozen=True)
class GyroWindows:
    """One gyro in windows of equal length, [W] each, in its own unit; NaN where it has too few values.

    mean, deviation : of the samples;  roughness : deviation of adjacent samples, over √2
    step            : of a quantised channel; of another one a small part of its noise
    """

    mean: np.ndarray
    deviation: np.ndarray
    roughness: np.ndarray
    step: float


def window_length(rate_hz: float, options: RestOptions) -> int:
    """Samples of a window: window_s, or more where that holds too few."""
    return max(round(options.window_s * rate_hz), FEWEST_SAMPLES)


def gyro_windows(values: np.ndarray, length: int) -> GyroWindows:
    """Cut one gyro's channel into windows.

    values : array [T], counts or deg/s, NaN where the channel has none;  length : samples of a window
    returns : T // length windows, one after the other; what is left over at the end is in none
    """
    number = len(values) // length
    parts = [np.empty((3, 0))]
    middle = _middle(values)
    for first in range(0, number, WINDOWS_AT_ONCE):
        rows = slice(first * length, min(first + WINDOWS_AT_ONCE, number) * length)
        parts.append(_moments(values[rows].reshape(-1, length).astype(float) - middle))
    mean, deviation, roughness = np.concatenate(parts, axis=1)
    return GyroWindows(mean, deviation, roughness, _step(values))


def _middle(values: np.ndarray) -> float:
    some = values[:: max(len(values) // MOST_STEPS, 1)].astype(float)
    some = some[np.isfinite(some)]
    return float(np.median(some)) if some.size else 0.0


def _step(values: np.ndarray) -> float:
    places = np.arange(0, max(len(values) - 1, 0), max(len(values) // MOST_STEPS, 1))
    steps = np.abs(values[places + 1].astype(float) - values[places])
    steps = steps[steps > 0]
    return float(np.quantile(steps, 0.1)) if steps.size else 0.0


def _moments(part: np.ndarray) -> np.ndarray:
    """Mean, deviation and roughness of windows [n, length]: [3, n]."""
    there = np.isfinite(part)
    if there.all():
        steps = np.diff(part, axis=1)
        roughness = np.sqrt(np.einsum("ij,ij->i", steps, steps) / (2 * steps.shape[1]))
        return np.stack([part.mean(axis=1), part.std(axis=1), roughness])
    found = np.full((3, len(part)), math.nan)
    for row, (values, known) in enumerate(zip(part, there, strict=True)):
        if known.sum() >= FEWEST_VALUES:
            own = values[known]
            found[:, row] = own.mean(), own.std(), np.sqrt(np.mean(np.diff(own) ** 2) / 2)
    return found


def find_moves(
    gyros: Sequence[GyroWindows],
    axes: Sequence[str],
    scales: Sequence[float],
    options: RestOptions | None = None,
    levels: Mapping[int, float] | None = None,
) -> np.ndarray:
    """True [W] in the windows in which the board moves.

    gyros  : of the whole board;  axes : of each;  scales : deg/s a unit of each, with its sign
    options : window_s, min_duration_s, guard_s, threshold
    levels  : place of a gyro → its level without the motion that it shares with another one, in its own unit (see
              noise_level); None: no gyro seems to move all the time
    A gyro moves in a window where its deviation is more than `threshold` times its quiet level (the lowest tenth of all
    windows, or half a step of its channel). The board moves where most gyros of one axis do, two at least; about an
    axis with one gyro, where another gyro of the board moves with it; on a board of one gyro, where what it sees is
    smooth, as motion is and noise is not. One window alone is no motion. Slow drift, flicker, warming up and more noise
    of one gyro change none of that, as they would the mean over windows.
    A stretch between two motions that begins with a step of the common rate, and so differs from where the board stood
    for most of the time by more than `threshold` times the noise of a sample, is a steady turn. A rest that would be
    shorter than min_duration_s, were guard_s cut from both its ends, counts as motion; nothing is cut here.
    Where less than a tenth is at rest there is no quiet level but that of `levels`. A turn that begins and ends more
    gently than the noise is not seen.
    """
    options = options or RestOptions()
    known = [place for place, one in enumerate(gyros) if np.nansum(one.deviation) > 0]
    windows = len(gyros[0].mean) if gyros else 0
    if not known or windows < FEWEST_WINDOWS:
        return np.zeros(windows, dtype=bool)
    quiet = {place: (levels or {}).get(place, quiet_level(gyros[place])) for place in known}
    moves = {place: _moving(gyros[place], quiet[place], options.threshold) for place in known}
    if len(known) == 1:
        (only,) = known
        moves[only] &= gyros[only].deviation > SMOOTH * gyros[only].roughness
    seen = _most(moves, [axes[place] for place in known])
    if not seen.any():
        return seen
    turning = np.zeros(windows, dtype=bool)
    for axis in dict.fromkeys(axes[place] for place in known):
        members = [place for place in known if axes[place] == axis]
        rates = np.stack([gyros[place].mean * scales[place] for place in members])
        noise = float(np.median([quiet[place] * abs(scales[place]) for place in members]))
        turning |= _turning(rates, seen, options.threshold * noise)
    # A turn may begin within one window; a window alone between rests is none.
    moving = _long_runs(seen | turning, SHORTEST)
    if not moving.any():
        return moving
    shortest = math.ceil((options.min_duration_s + 2 * options.guard_s) / options.window_s)
    return ~_long_runs(~moving, shortest)


def noise_level(gyro: GyroWindows, difference: GyroWindows) -> float | None:
    """Level of a gyro without the motion that it shares with another gyro of its axis; None: it shares none.

    difference : of the two, in the unit of the gyro
    Where the quietest tenth of a gyro is smooth, and the difference more than COMMON times quieter, that was no noise.
    """
    level = quiet_level(difference)
    return level if seems_to_move(gyro) and quiet_level(gyro) > COMMON * level else None


def seems_to_move(gyro: GyroWindows) -> bool:
    """Is even the quietest tenth of the windows smooth, as motion is and noise is not?"""
    there = gyro.deviation > 0
    if not there.any():
        return False
    smooth, rough = (np.quantile(values[there], QUIET_QUANTILE) for values in (gyro.deviation, gyro.roughness))
    return bool(smooth > SMOOTH * rough)


def quiet_level(gyro: GyroWindows) -> float:
    """Deviation of the quietest tenth of the windows, or half a step of the channel."""
    deviation = gyro.deviation[gyro.deviation > 0]
    return max(float(np.quantile(deviation, QUIET_QUANTILE)), STEPS * gyro.step)


def _moving(gyro: GyroWindows, quiet: float, threshold: float) -> Bools:
    """Windows [W] in which one gyro sees more than its noise; where it has no value it sees nothing."""
    moving: Bools = np.nan_to_num(gyro.deviation) > threshold * quiet
    return moving


def _most(moves: dict[int, Bools], axes: list[str]) -> Bools:
    """Windows [W] in which most gyros of an axis move, and two of the board at least, if it has two."""
    columns = np.stack(list(moves.values()))
    two = columns.sum(axis=0) >= min(2, len(columns))
    found = np.zeros(columns.shape[1], dtype=bool)
    for axis in dict.fromkeys(axes):
        members = columns[[one == axis for one in axes]]
        found |= members.sum(axis=0) > len(members) / 2
    moving: Bools = found & two
    return moving


def _turning(rates: np.ndarray, moving: np.ndarray, least: float) -> np.ndarray:
    """Windows [W] of the stretches between motions in which the rate, common to most gyros, is another one.

    rates : [n, W] deg/s, of the gyros of one axis;  least : deg/s
    Levels are added up from the steps across each motion, so that drift within the stretches does not count; a step
    counts where most gyros agree on it.
    """
    stretches = true_runs(~moving).tolist()
    level, levels = 0.0, [0.0]
    for (first, last), (start, stop) in itertools.pairwise(stretches):
        before, after = rates[:, max(first, last - NEAR) : last], rates[:, start : min(stop, start + NEAR)]
        steps = [_median(two) - _median(one) for one, two in zip(before, after, strict=True)]
        known = np.array([step for step in steps if math.isfinite(step)])
        step = float(np.median(known)) if known.size else 0.0
        agree = np.abs(known - step) <= max(least, AGREE * abs(step))
        level += step if 2 * agree.sum() > known.size else 0.0
        levels.append(level)
    near = np.abs(np.subtract.outer(levels, levels)) <= least
    lengths = np.array([stop - start for start, stop in stretches], dtype=float)
    usual = near[int(np.argmax(near @ lengths))] if stretches else []
    found = np.zeros(len(moving), dtype=bool)
    for (start, stop), rests in zip(stretches, usual, strict=True):
        found[start:stop] = not rests
    return found


def _median(values: np.ndarray) -> float:
    values = values[np.isfinite(values)]
    return float(np.median(values)) if values.size else math.nan


def _long_runs(mask: np.ndarray, shortest: int) -> np.ndarray:
    kept = np.zeros(len(mask), dtype=bool)
    for start, stop in true_runs(mask).tolist():
        kept[start:stop] = stop - start >= shortest
    return kept


def widened(mask: np.ndarray, by: int) -> np.ndarray:
    """The mask, with `by` more on both sides of each run of what is marked."""
    wide = mask.copy()
    for start, stop in true_runs(mask).tolist():
        wide[max(start - by, 0) : stop + by] = True
    return wide
