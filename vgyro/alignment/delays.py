"""Constant delays between the gyros of one board, from the motion that all see."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import ndtri

from vgyro.alignment.blocks import SampleBlocks, block_numbers, score_covariance
from vgyro.alignment.clock import CUTOFFS_HZ
from vgyro.alignment.moving import moving_rows
from vgyro.alignment.pair import ClockRelation, agreement, rate_and_slope
from vgyro.alignment.streams import AlignedStream, Band, highest_cutoff, low_pass
from vgyro.arrays import Floats

FOUND, NO_MOTION, TOO_FEW = "found", "no motion", "too few gyros"
FALSE_ALARM = 0.01  # chance that a recording of equal gyros shows a delay at all
MOST_DELAY_S = 0.2
TRIED_S = 0.02
NEARLY = 0.99  # of the best agreement: among such peaks of a periodic motion the smallest delay is taken
MOST_STEPS = 12
SMALL_STEP = 0.01
SCALE_STEPS = 20
SAME_SAMPLES = 0.1  # delays that differ by less serve together as the others' time
SAME = 5.0  # standard errors within which gyros have one delay
SHORTEST_S = 2.0
SLOW_HZ = 4.0


class Delays(NamedTuple):
    """How much later each gyro reads the motion than the others do.

    delay_s     : [N], s; positive: late, its rate at t + delay is the motion at t. Against the mean of the group of
                  gyros around the middle one that agree (to a tenth of a sample and the noise); of two gyros, and
                  where less than half agree, against the mean of all
    low, high   : [N], s, 95 % interval of each
    significant : bool [N]; of a recording of equal gyros one or more are marked with a chance of 1 % at most
    status      : "found", "no motion" (rest, or gyros that do not see the same) or "too few gyros"; figures are NaN
                  unless found
    moving_s    : time of motion that was used, s
    """

    delay_s: np.ndarray
    low: np.ndarray
    high: np.ndarray
    significant: np.ndarray
    status: str
    moving_s: float


class _Shifted(NamedTuple):
    """All gyros on one time, each shifted by its delay."""

    blocks: SampleBlocks
    rate: np.ndarray  # [N, K], slow drift removed
    slope: np.ndarray  # [N, K]


class _DelayFit(NamedTuple):
    delay: np.ndarray  # [N], s, weighted mean zero
    influence: np.ndarray  # [N, K]: an error of the delay is the sum of mean slope · this
    slope: np.ndarray  # [K], of the common motion
    blocks: SampleBlocks


def relative_delays(
    rate: np.ndarray, rate_hz: float, segment: np.ndarray | None = None, false_alarm: float = FALSE_ALARM
) -> Delays:
    """Delay of each gyro of one board against the others.

    rate        : array [T, N], deg/s, gyros of one axis and one sign; NaN where a sample is missing
    segment     : int [T], gap-free stretch of each sample; none: one
    false_alarm : of a recording, shared by its gyros (Bonferroni)
    Only in motion, and at most in two million samples of it (see `moving_rows`). Each gyro is laid over the weighted
    mean of all by least squares, with its own scale factor, and a level and slope per ten seconds; in bands of
    1 … 32 Hz, of which the one with the smallest errors is kept. Noise biases neither the delays nor their errors, as
    in `fit_line`. Delays beyond 0.2 s are not looked for. A gyro whose filter differs shows as a delay: it is one.
    """
    gyros = rate.shape[1]
    alive = np.array([_alive(rate[:, k]) for k in range(gyros)])
    if alive.sum() < 2:
        return _none(gyros, TOO_FEW)
    segment = np.zeros(len(rate), dtype=np.int64) if segment is None else np.asarray(segment)
    columns = np.flatnonzero(alive)
    rows = moving_rows(rate if alive.all() else rate[:, columns], rate_hz, segment)
    if len(rows) < SHORTEST_S * rate_hz:
        return _none(gyros, NO_MOTION)
    # Stretches of the recording that do not touch lie apart in time, so that nothing is read across a gap.
    time = (rows + 2.0 * segment[rows]) / rate_hz
    streams = [AlignedStream(time, rate[rows, k].astype(float), rate_hz) for k in columns]
    highest = highest_cutoff(rate_hz)
    start = _first_delays([low_pass(stream, min(SLOW_HZ, highest)) for stream in streams])
    best: tuple[np.ndarray, np.ndarray] | None = None
    for cutoff in sorted({min(hz, highest) for hz in CUTOFFS_HZ}):
        fit = _fit([low_pass(stream, cutoff) for stream in streams], start)
        if fit is None:
            continue
        delay, error = _against_the_group(fit, SAME_SAMPLES / rate_hz)
        if best is None or (error**2).sum() < (best[1] ** 2).sum():
            best = delay, error
    if best is None:
        return _none(gyros, NO_MOTION)
    return _spread_out(*best, columns, gyros, false_alarm, len(rows) / rate_hz)


def _alive(values: np.ndarray) -> bool:
    finite = np.isfinite(values)
    return bool(finite.mean() > 0.5 and np.ptp(values[finite]) > 0) if len(values) else False


def _first_delays(bands: list[Band]) -> np.ndarray:
    """Delays against the first gyro, by correlation, to a fiftieth of a second."""
    first = bands[0]
    delays = np.zeros(len(bands))
    if len(first.time) < 2:
        return delays
    rows = np.arange(len(first.time))
    number = block_numbers(first.time, first.segment)
    count = round(MOST_DELAY_S / TRIED_S)
    tried = TRIED_S * np.arange(-count, count + 1)
    for k, band in enumerate(bands[1:], start=1):
        if len(band.time) < 2:
            continue
        agreed = agreement(first, band, rows, number, [ClockRelation(0.0, lag, 0.0) for lag in tried])
        padded = np.pad(agreed, 1)
        peak = (agreed >= padded[:-2]) & (agreed >= padded[2:]) & (agreed >= NEARLY * agreed.max())
        delays[k] = min(tried[peak], key=abs)
    return delays


def _shift(bands: list[Band], delay: np.ndarray) -> _Shifted | None:
    first = bands[0]
    rate, slope = np.empty((2, len(bands), len(first.time)))
    for k, (band, late) in enumerate(zip(bands, delay, strict=True)):
        places = np.interp(
            first.time + late, band.time, np.arange(len(band.time), dtype=float), left=np.nan, right=np.nan
        )
        rate[k], slope[k] = rate_and_slope(band, places)
    good = np.isfinite(rate).all(axis=0)
    number = block_numbers(first.time, first.segment)
    good &= np.bincount(number, good)[number] * first.step_s >= SHORTEST_S
    if np.count_nonzero(good) * first.step_s < SHORTEST_S:
        return None
    blocks = SampleBlocks(np.flatnonzero(good), number[good], first.step_s)
    return _Shifted(blocks, blocks.detrended(rate[:, good]), blocks.detrended(slope[:, good]))


def _fit(bands: list[Band], delay: np.ndarray) -> _DelayFit | None:
    if min(len(band.time) for band in bands) < 2:
        return None
    weight = np.full(len(bands), 1 / len(bands))
    shifted: _Shifted | None = None
    for _ in range(MOST_STEPS):
        delay = delay - weight @ delay
        shifted = _shift(bands, delay)
        if shifted is None:
            return None
        scale = _scales(shifted.rate)
        mean = (weight / scale) @ shifted.rate
        mean_slope = (weight / scale) @ shifted.slope
        residual = shifted.rate - scale[:, None] * mean
        # Power of the gyro's own slope in the mean's is noise, not motion: it is taken out.
        own = (shifted.slope**2).sum(axis=1) * weight / scale
        information = scale * (shifted.slope @ mean_slope - own) / (1 - weight)
        if (information <= 0).any():
            return None
        influence = -scale[:, None] * residual / information[:, None]
        step = influence @ mean_slope
        error = np.sqrt((residual**2).mean(axis=1) / information)
        delay = delay + step
        weight = 1 / np.maximum((residual / scale[:, None]) ** 2, 0).mean(axis=1).clip(1e-12)
        weight = np.minimum(weight / weight.sum(), 0.5)
        weight = weight / weight.sum()
        if (np.abs(step - step.mean()) < SMALL_STEP * error).all():
            break
    if shifted is None:
        return None
    return _DelayFit(delay, influence, mean_slope, shifted.blocks)


def _scales(rate: Floats) -> Floats:
    """Scale factors of the gyros, their mean one: [N]; from products between gyros, in which noise has no part."""
    products = rate @ rate.T
    if len(rate) == 2:  # one product cannot tell two factors
        scale = np.sqrt(np.diag(products))
        scales: Floats = scale / scale.mean()
        return scales
    scale = np.ones(len(rate))
    np.fill_diagonal(products, 0.0)
    for _ in range(SCALE_STEPS):
        scale = 0.5 * scale + 0.5 * products @ scale / np.maximum(scale @ scale - scale**2, 1e-300)
        scale = np.maximum(scale / scale.mean(), 0.1)
    return scale


def _against_the_group(fit: _DelayFit, tolerance_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Delays against the mean of the gyros that agree, and their standard errors: [N], [N]."""
    gyros = len(fit.delay)
    everyone = np.ones(gyros, dtype=bool)
    delay, error = _contrast(fit, everyone)
    middle = np.argsort(delay)[(gyros - 1) // 2 : gyros // 2 + 1]
    group = np.abs(delay - delay[middle].mean()) <= tolerance_s + SAME * np.hypot(error, error[middle].mean())
    if group.all() or 2 * group.sum() <= gyros:
        return delay, error
    return _contrast(fit, group)


def _contrast(fit: _DelayFit, group: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    contrast = np.eye(len(group)) - group / group.sum()
    error = [np.sqrt(score_covariance(fit.blocks, fit.slope[None], row @ fit.influence)[0, 0]) for row in contrast]
    return contrast @ fit.delay, np.array(error)


def _spread_out(
    delay: np.ndarray, error: np.ndarray, columns: np.ndarray, gyros: int, false_alarm: float, moving_s: float
) -> Delays:
    z = float(ndtri(0.975))
    strict = float(ndtri(1 - false_alarm / (2 * len(delay))))
    result = np.full((3, gyros), np.nan)
    result[:, columns] = delay, delay - z * error, delay + z * error
    significant = np.zeros(gyros, dtype=bool)
    significant[columns] = np.abs(delay) > strict * error
    return Delays(result[0], result[1], result[2], significant, FOUND, moving_s)


def _none(gyros: int, status: str) -> Delays:
    nothing = np.full(gyros, np.nan)
    return Delays(nothing, nothing, nothing, np.zeros(gyros, dtype=bool), status, 0.0)
