"""Arrays whose truth is known, at rest and in motion, with one fault in one gyro: what the fault search is tested on.

The noise is that of config/twins/demo.yaml (white 6 deg/√h with GARCH and DCC, flicker 40 deg/h, random walk
200 deg/h/√h, warm-up of 8 K), six gyros at 20 Hz. "σ" is the standard deviation of the mean of one second of a healthy
gyro. The faults:
step     5 σ for 10 s or longer
drift    reaches 5 σ within 1 to 10 minutes and is gone at once then; so it ends with a step, the easier part to
         find. lasting_drift has none
noise    2.5 times the usual for 30 s or longer
burst    5 times the usual noise for 2 to 15 s
scale    the residual has an r.m.s. of 5 σ in random motion of 20 deg/s up to 0.5 Hz, for 30 s or longer
stuck, dropout   one count repeated, or the count zero, for 2 s or more
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from vgyro.fusion import ArrayNoise, ArrayRates
from vgyro.simulate.motion import ReferenceRate
from vgyro.simulate.noise import ModulatedWhite, UnitRandomWalk, Volatility, unit_flicker
from vgyro.simulate.twin import RandomRate

RATE_HZ, GYROS, SECONDS = 20.0, 6, 1200
WHITE, FLICKER, WALK = 6.0 / 60.0, 40.0 / 3600.0, 200.0 / 3600.0 / 60.0
COUNT = 0.0153
SCALE_LEFT = 0.002
KINDS = ("step", "drift", "noise", "burst", "scale", "stuck", "dropout")
SIGMAS, NOISE_TIMES, BURST_TIMES = 5.0, 2.5, 5.0
LENGTHS = {"step": (10, 30, 100, 1e9), "drift": (60, 150, 300, 600), "noise": (30, 60, 300, 1e9), "burst": (2, 5, 15),
           "scale": (30, 100, 300, 1e9), "stuck": (2, 10, 60), "dropout": (2, 10, 60)}  # fmt: skip


@dataclass(frozen=True)
class Healthy:
    """time [T] s, errors [T, N] deg/s, motion [T] deg/s, gain [N], sigma [N] of the 1 s mean, deg/s."""

    time: np.ndarray
    errors: np.ndarray
    motion: np.ndarray
    gain: np.ndarray
    sigma: np.ndarray

    def rate(self) -> np.ndarray:
        return self.errors + self.motion[:, None] * self.gain


@dataclass(frozen=True)
class Case:
    """rate [T, N];  the fault of `gyro` from start to stop, s."""

    rate: np.ndarray
    gyro: int
    start: float
    stop: float


@lru_cache(maxsize=48)
def healthy(seed: int, seconds: float = SECONDS, motion: bool = False, rate_hz: float = RATE_HZ) -> Healthy:
    """Six healthy gyros."""
    rng = np.random.default_rng(seed)
    samples = int(seconds * rate_hz)
    time = np.arange(samples) / rate_hz
    sigma = WHITE * rng.uniform(0.93, 1.1, GYROS)
    target = np.where(np.eye(GYROS, dtype=bool), 1.0, 0.05)
    garch = Volatility(sigma**2 * 0.05, np.full(GYROS, 0.05), np.full(GYROS, 0.9), 0.03, 0.94, target)
    errors = ModulatedWhite(rate_hz, garch).next(rng.standard_normal((samples, GYROS))).noise
    warm = 8.0 * (1.0 - np.exp(-time / 400.0))
    for gyro in range(GYROS):
        errors[:, gyro] += FLICKER * rng.uniform(0.9, 1.3) * unit_flicker(samples, rng)
        errors[:, gyro] += WALK * rng.uniform(0.75, 1.3) * UnitRandomWalk(rate_hz, rng).next(samples)
        errors[:, gyro] += (-0.003 if gyro == 4 else 0.002) * warm + rng.normal()
    turning = np.zeros(samples)
    if motion:
        spec = RandomRate(kind="random", sd=20.0, bandwidth_hz=0.5)
        turning = ReferenceRate(spec, samples, rate_hz, rng).at(time, 0)
    return Healthy(time, errors, turning, 1.0 + SCALE_LEFT * rng.uniform(-1.0, 1.0, GYROS), sigma)


def with_fault(kind: str, seed: int, motion: bool) -> Case:
    """A healthy array, and one fault of that kind somewhere in it."""
    array = healthy(1000 + seed, motion=motion)
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    gyro, end = int(rng.integers(GYROS)), float(array.time[-1])
    length = float(rng.choice(LENGTHS[kind]))
    start = float(rng.uniform(0.1, 1.0 - length / end if kind == "drift" else 0.8) * end)
    stop = min(start + length, end)
    inside = (array.time >= start) & (array.time < start + length)
    rate = array.rate()
    rate[inside, gyro] += _added(kind, array, gyro, array.time[inside] - start, length, inside, rng)
    if kind in ("stuck", "dropout"):
        rate = np.rint(rate / COUNT) * COUNT
        before = rate[np.flatnonzero(inside)[0] - 1, gyro]
        rate[inside, gyro] = before if kind == "stuck" else np.rint(-250.0 / COUNT) * COUNT
    return Case(rate, gyro, start, stop)


def lasting_drift(seed: int, motion: bool, length: float, grows: bool) -> Case:
    """A drift that reaches 5 σ in `length` seconds and never comes back: no step gives it away.

    grows : it reaches them at the end of the recording; else it stays there for a minute or longer
    """
    array = healthy(1000 + seed, motion=motion)
    rng = np.random.default_rng([seed, int(length)])
    gyro, end, sign = int(rng.integers(GYROS)), float(array.time[-1]), rng.choice([-1.0, 1.0])
    start = end - length if grows else float(rng.uniform(0.1, 1.0 - (length + 60.0) / end) * end)
    rate = array.rate()
    rate[:, gyro] += sign * SIGMAS * array.sigma[gyro] * np.clip((array.time - start) / length, 0.0, 1.0)
    return Case(rate, gyro, start, end)


def _added(kind: str, array: Healthy, gyro: int, since: np.ndarray, length: float, inside: Any, rng: Any) -> Any:
    sigma, sign = array.sigma[gyro], rng.choice([-1.0, 1.0])
    white = sigma * np.sqrt(RATE_HZ) * rng.standard_normal(since.size)
    if kind == "step":
        return sign * SIGMAS * sigma
    if kind == "drift":
        return sign * SIGMAS * sigma * since / length
    if kind in ("noise", "burst"):
        times = NOISE_TIMES if kind == "noise" else BURST_TIMES
        return np.sqrt(times**2 - 1.0) * white
    if kind == "scale":
        means = array.motion.reshape(-1, int(RATE_HZ)).mean(axis=1)
        return sign * SIGMAS * sigma / means.std() * array.motion[inside]
    return 0.0


def array_of(rate: np.ndarray, rate_hz: float = RATE_HZ, segment: np.ndarray | None = None) -> ArrayRates:
    """The rates [T, N] as the search takes them; it knows nothing of the noise."""
    samples, gyros = rate.shape
    unknown = ArrayNoise(np.full(gyros, np.nan), np.full(gyros, np.nan), np.eye(gyros))
    segment = np.zeros(samples, dtype=np.int32) if segment is None else segment
    return ArrayRates(np.asfortranarray(rate), rate_hz, segment, np.ones(samples, dtype=bool), unknown)
