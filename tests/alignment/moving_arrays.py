"""Gyros that saw the same motion, each on its own clock; and boards whose gyros are read with a delay."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vgyro.alignment import AlignedStream

NOISE = 0.08


class Motion(NamedTuple):
    """A sum of sinusoids under bursts: rms · envelope(t) · Σ; bursts are (middle s, width s), none: all the time."""

    hz: np.ndarray
    phase: np.ndarray
    rms: float
    bursts: tuple[tuple[float, float], ...]

    def at(self, time: np.ndarray) -> np.ndarray:
        """deg/s at true times, s."""
        total = np.zeros(len(time))
        for hz, phase in zip(self.hz, self.phase, strict=True):
            total += np.sin(2 * np.pi * hz * time + phase)
        envelope = sum(np.exp(-0.5 * ((time - middle) / width) ** 2) for middle, width in self.bursts)
        return self.rms * np.sqrt(2 / len(self.hz)) * total * (envelope if self.bursts else 1.0)


def random_motion(
    rng: np.random.Generator,
    rms: float,
    bursts: tuple[tuple[float, float], ...] = (),
    low: float = 0.2,
    high: float = 4.0,
) -> Motion:
    """Band-limited random motion: forty sinusoids."""
    return Motion(rng.uniform(low, high, 40), rng.uniform(0, 2 * np.pi, 40), rms, bursts)


class Recorded(NamedTuple):
    stream: AlignedStream
    true_time: np.ndarray
    bias: float


def record(
    rng: np.random.Generator,
    motion: Motion | None,
    *,
    start: float = 0.0,
    samples: int = 12000,
    ppm: float = 0.0,
    rate_hz: float = 100.0,
    noise: float = NOISE,
    scale_error: float = 0.03,
    origin: float = 0.0,
) -> Recorded:
    """A gyro that starts at a true time, with a clock that is fast by ppm and reads `origin` at its first sample."""
    own = np.arange(samples) / rate_hz
    true_time = start + own / (1 + 1e-6 * ppm)
    bias = rng.normal(0, 0.5)
    rate = bias + rng.normal(0, noise, samples)
    if motion is not None:
        rate = rate + (1 + rng.uniform(-scale_error, scale_error)) * motion.at(true_time)
    return Recorded(AlignedStream(origin + own, rate, rate_hz), true_time, bias)


def board(
    rng: np.random.Generator,
    motion: Motion | None,
    delays_s: np.ndarray,
    *,
    samples: int = 12000,
    rate_hz: float = 200.0,
    noise: float | np.ndarray = 0.1,
    walk: float = 0.0,
) -> np.ndarray:
    """Rates [T, N] of gyros that read the motion late; scale errors of 3 %, biases, and a random walk, deg/s/√s."""
    time = np.arange(samples) / rate_hz
    gyros = len(delays_s)
    rate = rng.normal(0, 1, (samples, gyros)) * noise + rng.normal(0, 0.5, gyros)
    rate += walk / np.sqrt(rate_hz) * np.cumsum(rng.normal(0, 1, (samples, gyros)), axis=0)
    if motion is not None:
        scale = 1 + rng.uniform(-0.03, 0.03, gyros)
        for k, delay in enumerate(delays_s):
            rate[:, k] += scale[k] * motion.at(time - delay)
    return rate
