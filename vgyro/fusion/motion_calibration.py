"""Is the variance of the smoothed rate right? The spectrum of what the smoother left says so, for any rate."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vgyro import engine as engines
from vgyro.engine.linear import StateSpace
from vgyro.fusion.motion_evidence import Evidence, Series, wide_start
from vgyro.fusion.motion_models import Motion, SteadyGain

PASSED = 0.05
"""Beyond the highest frequency at which the smoother passes this much, its model of the rate is taken as right."""
BELIEF = 0.25
"""Standard deviation of the calibration before the residual is looked at: how wrong a model of most likelihood is."""
LEAST, MOST = 0.25, 4.0
LEVELS = 16
"""Levels that stand for a variance which changes with time."""
HANN = 35.0 / 18.0
"""Variance of a sum over the lines of a periodogram with Hann's window, over that of independent lines."""


@dataclass(frozen=True)
class Excess:
    """Of the residual's spectrum over what the model says it is, integrated; its variance; weight of the stretch."""

    value: float
    variance: float
    weight: float


def calibration(motion: Motion, evidence: Evidence) -> float | None:
    """Mean square error of the smoothed rate over the variance that its model claims.

    The smoother G leaves e = (1 - G)·z. Its error is G·v - (1 - G)·w, of the density G²·S_v + (1 - G)²·S_w, whatever
    the density S_w of the rate is; that of e is (1 - G)²·(S_w + S_v). So the error has the variance
    ∫ S_e - (1 - 2G)·S_v (Stein's unbiased risk), where the model claims ∫ G·S_v: the ratio is
    1 + ∫ (S_e - (1 - G)·S_v) / ∫ G·S_v. The first integral is taken over the frequencies that the smoother passes, from
    periodograms of the residual in units of its noise. The ratio is drawn toward 1 by what is known before (1 ± BELIEF)
    and by its own standard error. None: the smoother breaks down, a variance is not above zero.
    """
    frequency = SteadyGain(motion, 1.0).frequencies()
    wholes = [one for one in evidence.series if one.size == 1] or evidence.series
    levels = _levels(wholes)
    gains = np.mean([SteadyGain(motion, level, evidence.phi).at(frequency) for level in levels], axis=0)
    passed = np.flatnonzero(gains >= PASSED)
    highest = float(frequency[passed[-1]]) if passed.size else 0.0
    claimed = 2.0 * float(np.trapezoid(gains * _colour(frequency, evidence.phi, motion.rate_hz), frequency))
    used = _long_enough(evidence, wholes, highest)
    parts = [_excess(motion, one, evidence, highest) for one in used]
    if not all(math.isfinite(part.value) for part in parts):
        return None
    if passed.size == 0:
        return 1.0
    weight = sum(part.weight for part in parts)
    excess = sum(part.value * part.weight for part in parts) / weight / claimed
    variance = sum(part.variance * part.weight**2 for part in parts) / weight**2 / claimed**2
    return min(max(1.0 + excess * BELIEF**2 / (BELIEF**2 + variance), LEAST), MOST)


def _levels(series: list[Series]) -> np.ndarray:
    """Variances at evenly spread quantiles."""
    values = np.concatenate([one.r[np.isfinite(one.r)] for one in series])
    if values.min() == values.max():
        return values[:1]
    return np.quantile(values, (np.arange(LEVELS) + 0.5) / LEVELS)


def _colour(frequency: np.ndarray, phi: float, rate_hz: float) -> np.ndarray:
    """Density of AR(1) noise of variance 1, two-sided, 1/Hz."""
    turn = np.exp(2j * math.pi * frequency / rate_hz)
    return (1.0 - phi**2) / np.abs(1.0 - phi / turn) ** 2 / rate_hz


def _long_enough(evidence: Evidence, wholes: list[Series], highest: float) -> list[Series]:
    """The windows at full rate; the block means of the whole recording where they reach far enough and are longer."""
    blocks = [one for one in evidence.series if one.size > 1 and highest <= 0.1 * evidence.rate_hz / one.size]
    longest = sum(len(one.z) * one.size for one in blocks)
    return blocks if longest > sum(len(one.z) for one in wholes) else wholes


def _excess(motion: Motion, one: Series, evidence: Evidence, highest: float) -> Excess:
    """From the residual of one stretch, smoothed by itself, divided by the noise's standard deviation."""
    model = motion.dynamics() if one.size == 1 else motion.dynamics().of_blocks(one.size)
    start = wide_start(one.z, one.r, model, one.size)
    assert start is not None
    space = StateSpace(model.transition, model.process, model.reads, model.reads, *start, pole=one.phi)
    smoothed, variance = engines.get(evidence.engine).statespace.smooth(one.z, one.r, space)
    if not np.all(variance > 0.0):
        return Excess(math.nan, math.nan, math.nan)
    told = np.isfinite(one.r)
    residual = np.where(told, (np.where(told, one.z, 0.0) - smoothed) / np.sqrt(np.where(told, one.r, 1.0)), 0.0)
    rate_hz = evidence.rate_hz / one.size
    window = np.hanning(len(residual))
    power = np.abs(np.fft.rfft(residual * window)) ** 2 / (float(np.sum(window[told] ** 2)) * rate_hz)
    frequency = np.fft.rfftfreq(len(residual), 1.0 / rate_hz)
    inside = (frequency > 0) & (frequency <= highest)
    step = 2.0 * float(frequency[1])
    gains = np.mean(
        [SteadyGain(motion, level / one.shrink, evidence.phi).at(frequency[inside]) for level in _levels([one])], axis=0
    )
    expected = (1.0 - gains) * _colour(frequency[inside], one.phi, rate_hz)
    # In units of the variance of a sample, not of a block.
    value = one.shrink * step * float(np.sum(power[inside] - expected))
    return Excess(value, HANN * (one.shrink * step) ** 2 * float(np.sum(expected**2)), float(told.sum()))
