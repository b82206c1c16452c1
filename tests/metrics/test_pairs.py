"""Noise of gyros that never rest, from their differences, where frames are lost."""

import numpy as np

from vgyro.metrics import noise_from_differences
from vgyro.metrics.sampling import Sampling
from vgyro.simulate.noise import UnitRandomWalk

RATE_HZ, SAMPLES = 20.0, 36_000
N = np.array([0.1, 0.2, 0.12])  # deg/s/√Hz
K = np.array([0.003, 0.003, 0.012])  # deg/s/√s


def test_short_losses_do_not_hide_the_drift():
    # Known truth under a common motion: one frame in a hundred is lost, so no gap-free run lasts to the random walk,
    # which governs gyro 3 from τ = √3·N/K = 17 s on. Its half hour holds 100 times that: K to about 1/√100, here 3 s.e.
    generator = np.random.default_rng(11)
    noise = N[:, None] * np.sqrt(RATE_HZ) * generator.standard_normal((3, SAMPLES))
    walk = [k * UnitRandomWalk(RATE_HZ, generator).next(SAMPLES) for k in K]
    rate = 40 * np.sin(np.arange(SAMPLES) / 50) + noise + walk
    there = np.flatnonzero(generator.random(SAMPLES) > 0.01)
    sampling = Sampling.of(RATE_HZ, np.zeros(len(there), dtype=int), there)
    found_n, found_k = noise_from_differences(rate[:, there], RATE_HZ, sampling=sampling)
    np.testing.assert_allclose(found_n, N, rtol=0.05)
    np.testing.assert_allclose(found_k[2], K[2], rtol=0.3)
    assert np.argmax(found_k) == 2
    cut_n, cut_k = noise_from_differences(rate[:, there], RATE_HZ, sampling.segment)
    np.testing.assert_allclose(cut_n, N, rtol=0.05)
    assert abs(cut_k[2] / K[2] - 1) > 0.3
