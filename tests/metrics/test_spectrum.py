"""Welch density: white noise, a tone, segments, thinning."""

import math

import numpy as np
import pytest

from vgyro.metrics import allan_deviation, flat_band, noise_coefficients, noise_density, spectral_density, thinned

N = 0.1  # deg/s/√Hz, two-sided


def white(samples: int, rate_hz: float, seed: int = 1) -> np.ndarray:
    return N * np.sqrt(rate_hz) * np.random.default_rng(seed).standard_normal(samples)


def test_one_sided_density_of_white_noise():
    # Closed form: √2·N one-sided.
    spectrum = spectral_density(white(400_000, 100.0), 100.0, 20.0)
    inside = (spectrum.frequency > 1) & (spectrum.frequency < 49)
    assert np.sqrt(np.mean(spectrum.density[inside] ** 2)) == pytest.approx(math.sqrt(2) * N, rel=0.01)


def test_density_and_allan_agree_through_root_two():
    # METRICS: ASD and N agree within 1 %; both from the same hour.
    rate = white(720_000, 200.0)
    density = noise_density(spectral_density(rate, 200.0), flat_band(200.0))
    fitted = noise_coefficients(allan_deviation(rate, 200.0)).N.value
    assert density.value == pytest.approx(fitted, rel=0.01)
    assert density.low < N < density.high


def test_limits_of_the_density_cover_the_truth():
    # 95 % of 100 series of 200 s, less three binomial standard deviations.
    inside = 0
    for seed in range(100):
        density = noise_density(spectral_density(white(10_000, 50.0, seed), 50.0, 20.0), (0.5, 5.0))
        inside += density.low <= N <= density.high
    assert inside >= 88


def test_power_of_a_tone():
    # Parseval: the spectrum's integral about the line is a²/2.
    time = np.arange(100_000) / 100.0
    spectrum = spectral_density(3.0 * np.sin(2 * np.pi * 5.0 * time), 100.0, 50.0)
    near = np.abs(spectrum.frequency - 5) < 0.5
    assert np.sum(spectrum.density[near] ** 2) * spectrum.frequency[1] == pytest.approx(4.5, rel=1e-3)


def test_segments_are_not_joined():
    # A step between two stretches would fill the low frequencies.
    rate = white(20_000, 100.0)
    rate[10_000:] += 1000
    spectrum = spectral_density(rate, 100.0, 10.0, np.repeat([0, 1], 10_000))
    assert spectrum.averages == 2 * 19
    assert spectrum.density[1:].max() < 3 * math.sqrt(2) * N


def test_segments_are_as_long_as_half_of_the_samples_allow():
    # By hand: stretches of 5, 20, 20, 20 and 25 s; half of the 90 s lie in stretches of 20 s or more, which hold four.
    lengths = [500, 2000, 2000, 2000, 2500]
    spectrum = spectral_density(white(9000, 100.0), 100.0, 100.0, np.repeat(np.arange(5), lengths))
    assert spectrum.averages == 4
    assert spectrum.frequency[1] == pytest.approx(1 / 20)


def test_short_series_are_empty():
    assert spectral_density(np.arange(5.0), 1.0).frequency.size == 0
    density = noise_density(spectral_density(np.arange(5.0), 1.0), (0.1, 1.0))
    assert math.isnan(density.value)


def test_thinning_keeps_the_power():
    spectrum = spectral_density(white(400_000, 100.0), 100.0)
    thin = thinned(spectrum, 600)
    assert 100 < thin.frequency.size <= 600
    assert np.all(np.diff(thin.frequency) > 0)
    high = thin.frequency > 10
    assert np.mean(thin.density[high] ** 2) == pytest.approx(2 * N**2, rel=0.02)


def test_flat_band_stays_below_the_roll_off():
    assert flat_band(200.0) == (0.1, 10.0)
    assert flat_band(200.0, 1.0) == (pytest.approx(1 / 12), 0.25)
    low, high = flat_band(1.0)
    assert low < high <= 0.1
