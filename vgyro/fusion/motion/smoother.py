"""The smoother: the rate given all samples of a gap-free stretch, by a model of how it moves.

The measurement is one series z = w + v whose noise v has its own variance at each sample. What the sensor's pole does
to the noise is in the model (AR(1)): the rate is smoothed as the sensor passes it, and no colour is taken for motion.
Rauch, Tung & Striebel (1965), AIAA J. 3(8), 1445-1450.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from vgyro import engine as engines
from vgyro.engine.linear import StateSpace
from vgyro.errors import DataError
from vgyro.fusion.motion.choice import choose_motion
from vgyro.fusion.motion.models import UNLIMITED, Activity, Motion, SteadyGain, fixed_bandwidth
from vgyro.fusion.motion.noisy_rate import NoisyRate, Standstill
from vgyro.fusion.motion.regimes import AfterRest, Regimes, jumps_at_ends, lines_that_end
from vgyro.fusion.motion.start import wide_start
from vgyro.runs import runs

__all__ = ["Smoothed", "choose_motion", "fixed_bandwidth", "smooth"]

FREE = 1e8
"""Process variance over that of the noise at which neighbours say nothing (1e-8 of the weight)."""
NOTHING = 1e3
"""A sample of so many times the usual variance says next to nothing."""
JUMP_S = 0.1
"""Means over so long on both sides of an end of standstill show whether the rate jumps there."""


@dataclass(frozen=True)
class Smoothed:
    """A smoothed rate.

    rate, variance     : [T], deg/s and (deg/s)², mean and variance given all samples of the gap-free stretch
    bandwidth_hz       : -3 dB, of the steady smoother at the mean of r; NaN: not limited; 0: the rate does not move
    noise_bandwidth_hz : noise-equivalent, one-sided, of the same; NaN: not limited
    passes             : 2 where it is a first-order low-pass run forward and back, of this bandwidth; 0: it is not
    parameters         : model and parameters, for people
    """

    rate: np.ndarray
    variance: np.ndarray
    motion: Motion
    bandwidth_hz: float
    noise_bandwidth_hz: float
    passes: int
    parameters: str


def smooth(
    noisy: NoisyRate,
    motion: Motion,
    engine: str = "native",
    standstill: Standstill | None = None,
    activity: Activity | None = None,
) -> Smoothed:
    """The rate given all samples of each gap-free stretch.

    motion   : how the rate moves
    standstill : samples over which the rate is a random walk instead; what the motion has beside a rate (derivative,
               oscillation) is at zero after them. Where it jumps at their ends, it is free to
    activity : how lively the rate is at each sample; None: as its model says. Its levels have no calibration
    raises   : EngineError for samples that cannot be used, DataError for parameters that do not fit
    A stretch without any sample that says something is NaN, with infinite variance.
    """
    z, r = np.asarray(noisy.z, dtype=float), np.asarray(noisy.r, dtype=float)
    segment, rate_hz, phi = noisy.segment, noisy.rate_hz, noisy.phi
    _check(z, r, segment, rate_hz, motion, phi)
    mean = mean_variance(r)
    steady = SteadyGain(motion, mean, phi)
    if standstill is not None and not np.any(standstill.at_rest):
        standstill = None
    if motion.model == UNLIMITED and standstill is None:
        variance = np.broadcast_to(r, z.shape).copy()
        return Smoothed(z.copy(), variance, motion, math.nan, math.nan, 0, motion.text)
    rate, variance = np.empty(len(z)), np.empty(len(z))
    dynamics = _free(motion, mean).dynamics()
    regimes = Regimes.of(motion, dynamics, len(z), activity)
    if standstill is not None:
        jumps = jumps_at_ends(z, r, segment, phi, standstill.at_rest, max(1, round(JUMP_S * rate_hz)))
        density = mean / rate_hz * (1.0 + phi) / (1.0 - phi)
        rest = Standstill(standstill.at_rest, _free(standstill.motion, mean))
        ending = lines_that_end(noisy, motion.lines, standstill.at_rest)
        regimes = regimes.with_rest(motion, dynamics, rest, density, AfterRest(jumps, FREE * mean, ending))
    run = engines.get(engine).statespace.smooth
    for part in stretches(segment):
        own = r if r.ndim == 0 else r[part]
        start = wide_start(z[part], own, dynamics)
        if start is None:
            rate[part], variance[part] = math.nan, math.inf
            continue
        model = StateSpace(regimes.transition, regimes.process, dynamics.reads, dynamics.reads, *start, pole=phi)
        rate[part], variance[part] = run(z[part], own, model, regimes.of_step[part])
        variance[part] *= regimes.calibration[regimes.of_sample[part]]
    if not np.all(variance > 0.0):
        broken = int(np.argmin(variance > 0.0))
        raise DataError(f"the smoother breaks down: {motion.text}", f"sample {broken}", "choose another motion model")
    plain = activity is None and not phi and standstill is None
    low_pass = motion.model == "random_walk" and not motion.lines and plain and (r.ndim == 0 or bool(np.all(r == r[0])))
    text = motion.text + (f"; {activity.text}" if activity is not None else "")
    text += f"; at rest {standstill.motion.text}" if standstill is not None else ""
    if phi:
        text += f"; noise AR(1), {phi:.3g} a sample"
    limits = (math.nan, math.nan) if motion.model == UNLIMITED else (steady.bandwidth_hz(), steady.noise_bandwidth_hz())
    return Smoothed(rate, variance, motion, *limits, 2 if low_pass else 0, text)


def mean_variance(r: np.ndarray) -> float:
    """Mean of r, one or [T], where it is not infinite, nor so large that it says next to nothing."""
    known = r[np.isfinite(r)]
    return float(np.mean(known[known <= NOTHING * np.median(known)]))


def stretches(segment: np.ndarray) -> Iterator[slice]:
    """The gap-free stretches, in order."""
    return (slice(start, stop) for start, stop in runs(segment).tolist())


def _check(z: np.ndarray, r: np.ndarray, segment: np.ndarray, rate_hz: float, motion: Motion, phi: float) -> None:
    if z.ndim != 1 or len(z) == 0 or len(segment) != len(z) or r.shape not in ((), z.shape):
        raise DataError(f"z {z.shape}, r {r.shape} and segment {np.shape(segment)} do not fit", remedy="give [T] each")
    if not 0.0 <= phi < 1.0:
        raise DataError(f"the noise cannot have the AR(1) coefficient {phi:g}", remedy="give 0 ≤ phi < 1")
    if motion.rate_hz != rate_hz:
        raise DataError(f"the motion model is of {motion.rate_hz:g} Hz, the samples of {rate_hz:g} Hz")
    if not np.isfinite(r).any():
        raise DataError("no sample says anything: every variance is infinite")


def _free(motion: Motion, r_mean: float) -> Motion:
    """Where nothing is to be smoothed, a random walk that is faster than any noise."""
    if motion.model != UNLIMITED:
        return motion
    return Motion("random_walk", {"q": FREE * r_mean * motion.rate_hz}, motion.rate_hz)
