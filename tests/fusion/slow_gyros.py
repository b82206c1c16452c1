"""Gyros with biases that walk, for the tests of slow errors against their truth."""

import numpy as np

from vgyro.fusion import ArrayNoise, ArrayRates, FilterParameters

MOVING = FilterParameters(in_motion=True)
SEEDS = range(8)
ARW = np.array([0.01, 0.02, 0.03, 0.01, 0.02, 0.03])
RRW = np.array([3.0, 1.0, 2.0, 0.5, 1.0, 0.2]) * 1e-3
EQUAL = np.full(6, 1 / 6)


def simulated(seconds, seed, arw=ARW, rrw=RRW, spread=0.1, at_rest=None, temperature=None, slopes=0.0):
    """Recording in motion at 1 Hz, and the true biases [T, N]."""
    rng, gyros = np.random.default_rng(seed), len(arw)
    bias = spread * rng.standard_normal(gyros) + np.cumsum(rng.standard_normal((seconds, gyros)) * rrw, axis=0)
    if temperature is not None:
        bias = bias + slopes * (temperature - temperature.mean())[:, None]
    at_rest = np.zeros(seconds, dtype=bool) if at_rest is None else at_rest
    motion = np.where(at_rest, 0.0, 20.0 * np.sin(np.arange(seconds) / 3.0))
    rate = bias + motion[:, None] + rng.standard_normal((seconds, gyros)) * arw
    noise = ArrayNoise(arw, rrw, np.eye(gyros))
    segment = np.zeros(seconds, dtype=int)
    return ArrayRates(rate, 1.0, segment, at_rest, noise, temperature=temperature), bias
