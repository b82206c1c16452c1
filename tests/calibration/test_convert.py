"""Counts to rates, sinusoidal references, clipping."""

import numpy as np
import pytest

from vgyro.calibration import clipped_samples, fit_phase, sinusoid, to_rates


def test_rate_of_a_count():
    counts = np.array([-100, 0, 57], dtype=np.int16)
    np.testing.assert_allclose(to_rates(counts, 1, 0.5, 57.0), [-78.5, -28.5, 0.0])
    np.testing.assert_allclose(to_rates(counts, -1, 0.5, 57.0), [78.5, 28.5, 0.0])


def test_phase_of_a_noisy_sinusoid():
    time = np.arange(30_000) / 500.0
    truth = sinusoid(time, 62.8, 0.25, 1.1)
    rate = 3.0 + 0.97 * truth + 1.5 * np.random.default_rng(1).standard_normal(time.size)
    phase = fit_phase(rate, time, 0.25)
    assert phase == pytest.approx(1.1, abs=0.002)
    assert np.abs(sinusoid(time, 62.8, 0.25, phase) - truth).max() < 0.15


def test_clipped_at_either_rail():
    counts = np.array([-32768, -32767, 0, 32766, 32767], dtype=np.int16)
    assert clipped_samples(counts, (-32768, 32767)).tolist() == [True, False, False, False, True]
    assert not clipped_samples(counts, None).any()
