"""1σ of a gyro that was read between its samples: the white noise that the interpolation took is given back."""

import numpy as np
import pytest

from vgyro.alignment import interpolate, noise_gain
from vgyro.metrics import allan_deviation, noise_coefficients
from vgyro.metrics.figures import Reading, without_interpolation

SIGMA, RATE_HZ, SAMPLES = 0.05, 100.0, 60_000


@pytest.mark.parametrize("fraction", [0.5, 0.25, 0.015])
def test_sigma_is_that_of_the_sensor(fraction):
    """Truth: the simulated SIGMA; its estimate from 60,000 samples has an error of 0.3 %."""
    white = SIGMA * np.random.default_rng(4).standard_normal(SAMPLES)
    at = np.arange(100, SAMPLES - 100) + fraction
    sigma = float(interpolate(white, at).std())
    found = without_interpolation(Reading(sigma, 0.99 * sigma, 1.01 * sigma), float(noise_gain(at).mean()))
    assert found.value == pytest.approx(SIGMA, rel=0.01)
    assert found.low < found.value < found.high
    assert "before the interpolation" in found.note
    if fraction == 0.5:
        # Without the correction it would be seen.
        assert sigma < 0.98 * SIGMA


def test_n_is_hardly_touched():
    """What is lost lies near Nyquist: N from averages is that of the samples, within 1.5 % at the worst fraction."""
    white = SIGMA * np.random.default_rng(5).standard_normal(SAMPLES)
    between = interpolate(white, np.arange(100, SAMPLES - 100) + 0.5)
    n = noise_coefficients(allan_deviation(between, RATE_HZ)).N.value
    assert n == pytest.approx(SIGMA / np.sqrt(RATE_HZ), rel=0.015)
