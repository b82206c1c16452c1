"""Arrays of simulated gyros for the fusion tests; slow_gyros.py, beside this file, is no package."""

import sys
from pathlib import Path

import numpy as np
import pytest

from vgyro.fusion import ArrayNoise, ArrayRates
from vgyro.fusion.types import AllanScales

sys.path.insert(0, str(Path(__file__).parent))

ARW = 6.17 / 60.0
RRW = 0.001


def pattern(arw, tau):
    """Allan variance [J, N, N] of white noise and random walks in all gyros, one with the other."""
    return (np.outer(arw, arw)[None] / tau[:, None, None]) + RRW**2 * tau[:, None, None] / 3


@pytest.fixture
def make_array():
    """White gyros: make_array(samples, arw [N], rate_hz, truth, correlation, segment)."""

    def make(
        samples, arw, rate_hz=200.0, truth=0.0, correlation=None, segment=None, at_rest=True, seed=1, weights=None
    ):
        arw = np.asarray(arw, dtype=float)
        correlation = np.eye(len(arw)) if correlation is None else np.asarray(correlation, dtype=float)
        rng = np.random.default_rng(seed)
        white = rng.standard_normal((samples, len(arw))) @ np.linalg.cholesky(correlation).T
        rate = np.asarray(truth)[..., None] + white * arw * np.sqrt(rate_hz)
        segment = np.zeros(samples, dtype=np.int32) if segment is None else segment
        tau = 2.0 ** np.arange(20) / rate_hz
        scales = AllanScales(tau, correlation * pattern(arw, tau), 2.0**20 / 2.0 ** np.arange(20))
        noise = ArrayNoise(arw, np.full(len(arw), RRW), correlation, scales=scales)
        return ArrayRates(rate, rate_hz, segment, np.full(samples, at_rest), noise, weights or {})

    return make
