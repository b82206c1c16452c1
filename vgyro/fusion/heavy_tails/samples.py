"""Heavy tails: samples far off count for less, by the likelihood of what the recording itself shows.

A gyro whose samples are clearly not normal about their neighbours (vgyro.fusion.heavy_tails.robust_rate) gets a density
f of its own (vgyro.fusion.heavy_tails.scale_mixture). Each of its samples is then replaced by the pseudo-observation
ỹ = a + s·ψ((y - a)/s)/I with a = ŵ + m, ψ = -f'/f and Fisher's information I = E[ψ']. Its variance is s²/I, that of the
best estimator, and a small error of a does not get into it: dỹ/da = 1 - E[ψ']/I = 0. So linear methods may take it as a
sample. Of normal noise ψ(x) = x, and ỹ = y. Huber & Ronchetti (2009), Robust Statistics, 2nd ed., sec. 6.7.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vgyro.arrays import Bools, Floats
from vgyro.fusion.blocks import PIECE
from vgyro.fusion.events import excluded
from vgyro.fusion.heavy_tails.robust_rate import (
    FAR,
    LEAST_SIZE,
    REACHES,
    Local,
    RateSamples,
    RateSetting,
    box,
    first_setting,
    improved,
    mean_log_variance,
    start,
)
from vgyro.fusion.heavy_tails.scale_mixture import ScaleMixture, fitted, histogram, middles
from vgyro.fusion.noise.difference_blocks import STUCK_SAMPLES, STUCK_SHARE
from vgyro.fusion.types import ArrayRates
from vgyro.runs import run_starts

LOOK, WINDOWS = 1 << 16, 16
"""Samples that are looked at, at most, and windows that they are spread over."""
NEAR_STEP, STEPS = 1 << 11, 2
"""Samples about each of the largest steps of a gyro that are looked at as well, and how many of these."""
WARY_ROUNDS, FIT_ROUNDS, ROUNDS = 4, 3, 6
LEAST_GAIN = 1.04
"""A gyro whose variance would fall by less than this factor is left as it is."""
NO_CHANGE = 1e-3
"""Samples that would move by less than this part of their deviation stay as they are, to the bit."""
FEWEST = 256
NORMAL = ScaleMixture.normal()
WARY = ScaleMixture.of(np.exp2(0.5 * np.arange(-2, 40)), np.exp2(-0.75 * np.abs(np.arange(-2, 40))))
"""What is thought of a gyro before anything is known of it: tails about as heavy as those of Student's t of 2 d.o.f."""


def without_tails(array: ArrayRates, steps: np.ndarray) -> tuple[ArrayRates, str]:
    """The array with pseudo-observations for the samples of gyros with heavy tails, and what was found.

    steps [N] : of each gyro's values, deg/s; 0: none. A gyro whose noise is below its step is left as it is: its jumps
                from one value to the next are no outliers
    Samples that are missing, at fault or stuck are neither touched nor asked. A gyro is changed where the likelihood of
    its density is above that of a normal one by more than its price, log(samples) for each parameter (BIC; Schwarz
    1978), and where this lowers its deviation by 2 %. Where no gyro is, the array itself is returned.
    """
    if array.rate.shape[1] < 2 or len(array.rate) < FEWEST:
        return array, ""
    found = _found([_look(array, rows) for rows in _windows(array)], array.rate_hz, steps)
    if found is None:
        return array, ""
    setting, gains = found
    rate = array.rate.copy(order="F")
    if not sum([_replace(array, rate, rows, setting) for rows in _pieces(len(rate))]):
        return array, ""
    which = ", ".join(f"{gyro + 1} (× {gain**-0.5:.2g})" for gyro, gain in enumerate(gains.tolist()) if gain > 0)
    return replace(array, rate=rate), f"heavy tails, and what is left of the deviation without them: gyro {which}"


def _windows(array: ArrayRates) -> list[slice]:
    """What is looked at."""
    samples = len(array.rate)
    if samples <= LOOK:
        return _pieces(samples)
    length = LOOK // WINDOWS
    first = np.linspace(0, samples - length, WINDOWS).astype(int)
    chosen = [slice(one, one + length) for one in first.tolist()]
    for place in _largest_steps(array):
        if not any(one.start <= place < one.stop for one in chosen):
            begin = min(max(place - NEAR_STEP // 2, 0), samples - NEAR_STEP)
            chosen.append(slice(begin, begin + NEAR_STEP))
    return chosen


def _largest_steps(array: ArrayRates) -> list[int]:
    """Samples at which a gyro is farthest from the two beside it, beyond what all are."""
    best: list[list[tuple[float, int]]] = [[] for _ in array.rate.T]
    for rows in _pieces(len(array.rate)):
        values = array.rate[rows].T - array.rate[rows].mean(axis=1)
        if values.shape[1] < 3:
            continue
        step = np.abs(values[:, 1:-1] - 0.5 * (values[:, 2:] + values[:, :-2]))
        for gyro, place in enumerate(step.argmax(axis=1).tolist()):
            best[gyro].append((float(step[gyro, place]), rows.start + place + 1))
    return sorted({place for one in best for _, place in sorted(one, reverse=True)[:STEPS]})


def _pieces(samples: int) -> list[slice]:
    return [slice(first, min(first + PIECE, samples)) for first in range(0, samples, PIECE)]


def _look(array: ArrayRates, rows: slice) -> RateSamples:
    values = np.array(array.rate[rows].T, dtype=float, order="C")
    used = np.ones(values.shape, dtype=bool)
    if array.missing is not None:
        used &= ~array.missing[rows].T
    if array.faults:
        for gyro, spans in enumerate(excluded(array.faults, len(array.rate), len(values))):
            for first, last in spans.tolist():
                used[gyro, max(first - rows.start, 0) : max(last - rows.start, 0)] = False
    used &= ~_stuck(values)
    used &= used.sum(axis=0) > 1
    return RateSamples(values, used, run_starts(array.segment[rows])[1:])


def _stuck(values: Floats) -> Bools:
    """[N, n]: samples in a window in which the gyro has hardly a step, while the others have."""
    steps = np.diff(values, axis=1, prepend=values[:, :1]) ** 2
    # One step far off is none of the others' motion.
    usual = np.median(steps, axis=1, keepdims=True)
    over = np.stack([box(one, STUCK_SAMPLES) for one in np.where(usual > 0, np.minimum(steps, FAR * usual), steps)])
    small: Bools = over <= STUCK_SHARE * np.median(over, axis=0)
    if not small.any():
        return small
    return np.stack([box(one.astype(float), STUCK_SAMPLES) > 0.5 for one in small])


def _found(looks: Sequence[RateSamples], rate_hz: float, steps: np.ndarray) -> tuple[RateSetting, np.ndarray] | None:
    """How the recording is to be mended, and the factor [N] by which each variance falls, 0: not mended; None: not."""
    setting = first_setting(looks, rate_hz, WARY, 0.5 * steps)
    asked = setting.usual > steps
    asked &= np.sum([one.used.sum(axis=1) for one in looks], axis=0) >= FEWEST
    if not asked.any():
        return None
    setting = replace(setting, densities=[WARY if one else NORMAL for one in asked])
    known = [start(one, setting) for one in looks]
    gains = np.zeros(len(asked))
    for number in range(WARY_ROUNDS + FIT_ROUNDS):
        known = [improved(one, setting, local) for one, local in zip(looks, known, strict=True)]
        if number == 1:
            setting = replace(setting, reach=_reach(looks, known, setting))
        if number < WARY_ROUNDS:
            continue
        densities = [fitted(_counts(looks, known, gyro)) if one else NORMAL for gyro, one in enumerate(asked)]
        setting = replace(setting, densities=densities)
        gains = np.array([_gain(looks, known, setting, gyro) if one else 0.0 for gyro, one in enumerate(asked)])
        if not gains.any():
            return None
    densities = [one if gain else NORMAL for one, gain in zip(setting.densities, gains, strict=True)]
    return replace(setting, densities=densities), gains


def _reach(looks: Sequence[RateSamples], known: Sequence[Local], setting: RateSetting) -> int:
    """The neighbours that predict best, by the mean log variance."""
    pairs = list(zip(looks, known, strict=True))
    scores = np.array([[mean_log_variance(*pair, setting, reach) for reach in REACHES] for pair in pairs])
    told = np.isfinite(scores).all(axis=1)
    if not told.any():
        return 0
    samples = np.array([one.values.shape[1] for one in looks], dtype=float)
    return REACHES[int(np.argmin(samples[told] @ scores[told]))]


def _counts(looks: Sequence[RateSamples], known: Sequence[Local], gyro: int) -> np.ndarray:
    """Histogram of the squares x² of the samples that are used."""
    total = np.zeros(len(middles()))
    for one, local in zip(looks, known, strict=True):
        used = one.used[gyro]
        total += histogram((local.residual[gyro][used] ** 2 + local.variance[used]) / local.size[gyro][used] ** 2)
    return total


def _gain(looks: Sequence[RateSamples], known: Sequence[Local], setting: RateSetting, gyro: int) -> float:
    """Factor by which the gyro's variance falls; 0: its density does not pay for itself, or gains too little.

    Both densities have a size that follows the samples over the same window.
    """
    density, counts = setting.densities[gyro], _counts(looks, known, gyro)
    samples = float(counts.sum())
    mixed, normal, spread = float(counts @ density.log_density(middles())), 0.0, 0.0
    for one, local in zip(looks, known, strict=True):
        used = one.used[gyro]
        square = _normal_squares(one, local, setting, gyro)
        mean = box(square, setting.size) / np.maximum(box(used.astype(float), setting.size), 1.0)
        mean = np.maximum(mean, (LEAST_SIZE * setting.usual[gyro]) ** 2)
        mixed -= float(np.log(local.size[gyro][used]).sum())
        normal -= 0.5 * float(np.sum((np.log(mean) + square / mean)[used]))
        spread += float(np.sum((square / local.size[gyro] ** 2)[used]))
    gain = density.information * spread / samples
    price = max(density.parameters(samples), 1) * math.log(samples)
    return gain if 2.0 * (mixed - normal) > price and gain > LEAST_GAIN else 0.0


def _normal_squares(look: RateSamples, local: Local, setting: RateSetting, gyro: int) -> np.ndarray:
    """Squares [n] about the local mean, of the samples that are used; 0 elsewhere."""
    used = look.used[gyro]
    off = np.where(used, look.values[gyro] - local.rate, 0.0)
    centre = box(off, setting.centre) / np.maximum(box(used.astype(float), setting.centre), 1.0)
    return np.where(used, (off - centre) ** 2 + local.variance, 0.0)


def _replace(array: ArrayRates, rate: np.ndarray, rows: slice, setting: RateSetting) -> int:
    """Put pseudo-observations into `rate` [T, N], for some of the samples; how many are others."""
    halo = setting.size + setting.centre
    wide = slice(max(rows.start - halo, 0), min(rows.stop + halo, len(rate)))
    inside = slice(rows.start - wide.start, rows.stop - wide.start)
    look = _look(array, wide)
    local = start(look, setting)
    for _ in range(ROUNDS):
        local = improved(look, setting, local)
    moved = 0
    for gyro, density in enumerate(setting.densities):
        if len(density.sizes) == 1:
            continue
        off = local.residual[gyro, inside]
        share = density.weight((off / local.size[gyro, inside]) ** 2) / density.information - 1.0
        change = look.used[gyro, inside] & (np.abs(share) > NO_CHANGE)
        rate[rows, gyro][change] += (off * share)[change].astype(rate.dtype)
        moved += int(change.sum())
    return moved
