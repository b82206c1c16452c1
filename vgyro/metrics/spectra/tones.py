"""Narrow lines of a Welch spectrum: sinusoids and hum that stand out of the noise."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vgyro.metrics.spectra.welch import HANN_BINS, HANN_OVERLAP, Spectrum

SIDE = 40  # bins on each side that tell the floor
GUARD = 3  # bins next to a bin that do not: half a Hann line between two bins, and one more
LOBE = 2  # bins beyond the outermost significant one that still belong to a line
FIRST = 2  # lower bins hold the mean that was removed
FEWEST = 3  # bins that tell a floor
LEAST_RATIO = 1.5  # of a line over its floor: a smooth spectrum may curve, however well it is known
WIDE = 8  # bins that are averaged to find lines too wide for the floor beside them
SPREAD = 256  # neighbouring bins whose scatter tells how many averages the spectrum is really worth
HANN_POWER = 35 / 18  # Σρ² of neighbouring Hann bins: variance of a summed power, in bins
HANN_SIGN = 1.62 * math.pi / 2  # of a median of Hann bins, from (2/π)·asin(ρ²), times that of a median over a mean
OUTSIDE = 1e-4  # relative error of an amplitude for the power in sidelobes that are not summed
NARROW = 3.0  # bins: (ΣP)²/ΣP² of a sinusoid is 2.0 to 2.2
FREQUENCY_ERROR = 0.6  # variance of the frequency, bins², times averages · line power / floor power of a bin; of
# segments that do not overlap, by simulation. Half overlapping ones do better, 0.15 if they are many.


@dataclass(frozen=True)
class Tone:
    """A line: frequency [Hz]; amplitude of the sinusoid [deg/s], with its limits; probability of it in noise alone.

    resolution      : Hz; lines closer than that cannot be told apart
    frequency_error : Hz, half the width of the frequency's interval
    """

    frequency: float
    amplitude: float
    low: float
    high: float
    probability: float
    resolution: float
    frequency_error: float


@dataclass(frozen=True)
class _Floor:
    """Of each bin: level of the noise there; the greater of both sides' levels; degrees of freedom of bin and sides."""

    level: np.ndarray
    greater: np.ndarray
    freedom: np.ndarray
    freedom_level: np.ndarray


def find_tones(spectrum: Spectrum, confidence: float = 0.95, false_alarm: float = 0.001) -> list[Tone]:
    """The lines of a spectrum that noise alone would not show, by rising frequency.

    spectrum    : of spectral_density, deg/s; every bin of it (not thinned)
    confidence  : of the limits of amplitude and frequency
    false_alarm : probability that noise alone gives one or more lines, over the whole spectrum
    returns     : list of Tone; its probability counts all bins that were tested (Bonferroni)

    A line may be an alias: what lies above half the sample rate folds back, and nothing in the spectrum tells.

    Test. The floor of a bin is the greater of the medians of the 40 bins below and above it, 3 bins next to it left
    out: where the floor slopes (drift, roll-off), the higher side counts ("greatest of" CFAR; Hansen & Sawyers 1980).
    Power over floor is F-distributed, with the degrees of freedom of the averages and of the median; they are fewer
    where the bins scatter more than they should, as after a knock. A line is also at least half as high again as its
    floor. The same is done with means of 8 bins, for lines up to some hundred bins wide. The sidelobes of a stronger
    line count as floor. Significant bins up to 3 apart are one line.

    Amplitude √(2·power): all power of the line above the floor, so it does not matter where between two bins it lies;
    of a line of finite width it is the sinusoid of equal power. Limits: noise about a sinusoid of constant amplitude;
    of a wide line, a Gaussian process. Frequency: from the two highest bins (Grandke 1983), of a wide line its centre.
    """
    if spectrum.frequency.size < 2 * FIRST + GUARD + FEWEST + 1:
        return []
    averages = max(spectrum.averages * HANN_OVERLAP, 1.0)
    step = float(spectrum.frequency[1])
    power = spectrum.density**2
    tests = power.size - FIRST - 1 + power.size // WIDE
    quantile = _normal_quantile(confidence)
    floor = _floor(power, 2 * averages, FIRST)
    leak = _leakage(power, np.flatnonzero(_chance(power, floor.greater, floor) * tests < false_alarm))
    found = _groups(power, floor, leak, false_alarm / tests, GUARD)
    lines = [_measure(power, floor, step, quantile, group, chance * tests) for group, chance in found]
    quiet = _without(power, floor, leak, lines, step)
    whole = quiet.size // WIDE * WIDE
    coarse, coarse_leak = (each[:whole].reshape(-1, WIDE).mean(axis=1) for each in (quiet, 2 * leak))
    coarse_floor = _floor(coarse, 2 * averages * WIDE / HANN_POWER, 1)
    wide = []
    for group, chance in _groups(coarse, coarse_floor, coarse_leak, false_alarm / tests, 1):
        bins = np.arange(group[0] * WIDE, (group[-1] + 1) * WIDE)
        level = np.repeat(coarse_floor.level[group[0] : group[-1] + 1], WIDE)
        wide.append(_wide(_Bins(bins, quiet[bins], level), averages, step, quantile, chance * tests))
    kept = [line for line in lines if not any(_part_of(line, hump) for hump in wide)]
    return sorted([*kept, *wide], key=lambda tone: tone.frequency)


def share_tones(tones: Mapping[str, Sequence[Tone]]) -> dict[str, list[str | float]]:
    """Columns of tones.parquet: the lines of every gyro, and which gyros have the same line.

    tones   : gyro → its lines
    returns : column → values, one row a gyro and line; `shared` names all gyros with a line no further off than the
              resolution, this gyro among them, in the order of `tones`
    """
    columns: dict[str, list[str | float]] = {
        name: [] for name in ("gyro", "frequency", "amplitude", "low", "high", "probability", "shared")
    }
    for gyro, lines in tones.items():
        for line in lines:
            for name in ("frequency", "amplitude", "low", "high", "probability"):
                columns[name].append(getattr(line, name))
            columns["gyro"].append(gyro)
            same = [other for other, theirs in tones.items() if any(_same(line, one) for one in theirs)]
            columns["shared"].append(", ".join(same))
    return columns


def _same(line: Tone, other: Tone) -> bool:
    return abs(line.frequency - other.frequency) <= max(line.resolution, other.resolution)


def _part_of(line: Tone, hump: Tone) -> bool:
    """True for a peak on a wide line that holds less power than it."""
    return abs(line.frequency - hump.frequency) <= hump.resolution and line.amplitude < hump.amplitude


def _floor(power: np.ndarray, freedom: float, first: int) -> _Floor:
    """Floor of each bin from the bins on both sides; above half the sample rate, the spectrum's mirror image."""
    known = power.astype(float)
    known[:first] = np.nan
    padded = np.concatenate([np.full(SIDE + GUARD, np.nan), known, known[-2 : -SIDE - GUARD - 2 : -1]])
    padded = np.pad(padded, (0, max(0, power.size + 2 * (SIDE + GUARD) - padded.size)), constant_values=np.nan)
    views = np.lib.stride_tricks.sliding_window_view(padded, SIDE)
    sides = [views[: power.size], views[SIDE + 2 * GUARD + 1 :][: power.size]]
    counts = [np.isfinite(side).sum(axis=1) for side in sides]
    medians = []
    for side, count in zip(sides, counts, strict=True):
        ordered = np.sort(side, axis=1)  # NaN last
        row, upper = np.arange(power.size), np.maximum(count, 1)
        middle = (ordered[row, (upper - 1) // 2] + ordered[row, upper // 2]) / 2
        medians.append(np.where(count >= FEWEST, middle, np.nan) / (1 - 2 / (9 * freedom)) ** 3)
    below, above = medians
    level = np.sqrt(below * above)
    real = _real_freedom(power, level, freedom)
    fewer = np.minimum(*counts)
    return _Floor(level, np.maximum(below, above), real, real * fewer / HANN_SIGN)


def _real_freedom(power: np.ndarray, level: np.ndarray, freedom: float) -> np.ndarray:
    """Degrees of freedom of each bin: those of the averages, fewer where neighbouring bins scatter more than that."""
    from scipy.special import chdtri

    grid = np.geomspace(min(freedom, 2.0), freedom, 60)
    spread = np.log(chdtri(grid, 0.25) / chdtri(grid, 0.75))
    usable = np.isfinite(level) & (level > 0) & (power > 0)
    ratio = np.full(power.size, np.nan)
    ratio[usable] = np.log(power[usable] / level[usable])
    blocks = max(1, round(power.size / SPREAD))
    found = []
    for block in np.array_split(ratio, blocks):
        good = block[np.isfinite(block)]
        quartiles = np.quantile(good, [0.25, 0.75]) if good.size >= SIDE else np.zeros(2)
        found.append(np.interp(quartiles[1] - quartiles[0], spread[::-1], grid[::-1]))
    return np.repeat(found, [block.size for block in np.array_split(ratio, blocks)])


def _groups(
    power: np.ndarray, floor: _Floor, leak: np.ndarray, least: float, gap: int
) -> list[tuple[np.ndarray, float]]:
    """The bins less probable than `least`, line by line (bins up to `gap` apart are one), with the lowest of each."""
    chance = _chance(power, floor.greater + leak, floor)
    found = np.flatnonzero(chance < least)
    cuts = np.flatnonzero(np.diff(found) > gap) + 1
    return [(group, float(min(chance[group]))) for group in np.split(found, cuts) if group.size]


def _chance(power: np.ndarray, level: np.ndarray, floor: _Floor) -> np.ndarray:
    """Probability of so high a bin; 1 where there is no floor, in the last bin, and below the least ratio."""
    from scipy.special import fdtrc

    usable = np.isfinite(level) & (level > 0)
    usable[-1] = False
    ratio = np.divide(power, level, out=np.zeros(power.size), where=usable)
    usable &= ratio >= LEAST_RATIO
    chance = np.ones(power.size)
    chance[usable] = fdtrc(floor.freedom[usable], floor.freedom_level[usable], ratio[usable])
    return chance


def _leakage(power: np.ndarray, peaks: np.ndarray) -> np.ndarray:
    """Highest sidelobe that the bins `peaks` can have in every bin: a Hann line half a bin nearer than its peak."""
    distance = np.arange(LOBE, power.size) - 0.5
    envelope = 1 / (np.pi * distance * (distance**2 - 1)) ** 2 / 0.72
    leak = np.zeros(power.size)
    for peak in peaks:
        above = leak[peak + LOBE :]
        np.maximum(above, power[peak] * envelope[: above.size], out=above)
        below = leak[: max(peak - LOBE + 1, 0)][::-1]
        np.maximum(below, power[peak] * envelope[: below.size], out=below)
    return leak


def _measure(power: np.ndarray, floor: _Floor, step: float, quantile: float, group: np.ndarray, chance: float) -> Tone:
    """Amplitude and frequency of the line whose significant bins are `group`."""
    bins = np.arange(max(group[0] - LOBE, FIRST), min(group[-1] + LOBE + 1, power.size))
    peak = int(group[np.argmax(power[group])])
    noise, averages = float(floor.level[peak]), float(floor.freedom[peak]) / 2
    excess = power[bins] - noise
    width = excess.clip(0).sum() ** 2 / np.square(excess.clip(0)).sum()
    if width > NARROW:
        return _wide(_Bins(bins, power[bins], np.full(bins.size, noise)), averages, step, quantile, chance)
    line = float(excess.sum())
    alone = bins.size + 8 / 9 * (bins.size - 1) + (bins.size - 2) / 18
    error_floor = bins.size**2 * 2 / (2 * floor.freedom_level[peak])
    variance = 2 * line * noise * HANN_POWER / averages + noise**2 * (alone / averages + error_floor)
    # Half the relative error of a power is that of an amplitude.
    amplitude = math.sqrt(2 * line * step)
    error = (quantile * math.sqrt(variance) / line / 2 + OUTSIDE) * amplitude
    side = peak + (1 if power[peak + 1] > power[peak - 1] else -1)
    ratio = math.sqrt(max(power[side] - noise, 0.0) / (power[peak] - noise))
    place = peak + (side - peak) * min(max((2 * ratio - 1) / (1 + ratio), 0.0), 0.5)
    jitter = quantile * math.sqrt(FREQUENCY_ERROR * noise / (line * averages))
    return Tone(
        place * step, amplitude, max(amplitude - error, 0.0), amplitude + error, chance, HANN_BINS * step, jitter * step
    )


class _Bins(NamedTuple):
    """Bins [B] of a spectrum, with their power and their floor."""

    number: np.ndarray
    power: np.ndarray
    level: np.ndarray


def _wide(line: _Bins, averages: float, step: float, quantile: float, chance: float) -> Tone:
    """A line of finite width; the power in it varies as that of noise does."""
    bins, power, level = line
    excess = np.maximum(power - level, 0.0)
    total, square = float(np.sum(power - level)), float(np.square(power).sum())
    centre = float(excess @ bins / excess.sum())
    around = math.sqrt(float(excess @ np.square(bins - centre) / excess.sum()))
    amplitude = math.sqrt(2 * max(total, 0.0) * step)
    error = quantile * math.sqrt(square * HANN_POWER / averages) / max(total, 1e-300) / 2 * amplitude
    jitter = quantile * around * math.sqrt(HANN_POWER * square / averages) / max(total, 1e-300)
    resolution = max(HANN_BINS, 2 * around) * step
    return Tone(
        centre * step, amplitude, max(amplitude - error, 0.0), amplitude + error, chance, resolution, jitter * step
    )


def _without(power: np.ndarray, floor: _Floor, leak: np.ndarray, lines: Sequence[Tone], step: float) -> np.ndarray:
    """The spectrum with the floor in place of its lines and of sidelobes that come near it."""
    known = np.where(np.isfinite(floor.level), floor.level, np.inf)
    hidden = 4 * leak > known
    for line in lines:
        reach = math.ceil(line.resolution / step) + LOBE
        peak = round(line.frequency / step)
        hidden[max(peak - reach, 0) : peak + reach + 1] = True
    return np.where(hidden, np.minimum(power, known), power)


def _normal_quantile(confidence: float) -> float:
    from scipy.special import ndtri

    return float(ndtri(0.5 + confidence / 2))
