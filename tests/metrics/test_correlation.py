"""Correlation matrix and its limits."""

import numpy as np
from scipy.signal import lfilter

from vgyro.metrics import correlation_matrix


def test_equals_numpy_on_white_noise_and_fisher():
    rng = np.random.default_rng(1)
    common = rng.standard_normal((20_000, 1))
    rate = rng.standard_normal((20_000, 3)) + 0.5 * common
    found = correlation_matrix(rate.T, 100.0)
    np.testing.assert_allclose(found.value, np.corrcoef(rate.T), atol=1e-12)
    # Fisher's z with n - 3 degrees: noise without memory keeps nearly all its samples.
    half = 1.959964 / np.sqrt(20_000 - 3)
    expected = np.tanh(np.arctanh(found.value[0, 1]) - half)
    assert abs(found.low[0, 1] - expected) < 2e-3
    assert found.low[0, 1] < 0.2 < found.high[0, 1]
    assert np.all(np.diag(found.value) == 1)


def test_correlated_in_time_widens_the_limits():
    # Two independent AR(1), ρ = 0.9: effective samples T(1-ρ²)/(1+ρ²) (Bartlett).
    rng = np.random.default_rng(2)
    rate = lfilter([1], [1, -0.9], rng.standard_normal((20_000, 2)), axis=0)
    found = correlation_matrix(rate.T, 10.0)
    expected = 20_000 * (1 - 0.81) / (1 + 0.81)
    assert 0.7 * expected < found.effective[0, 1] < 1.3 * expected


def test_limits_cover_the_truth():
    inside = 0
    for seed in range(100):
        rate = lfilter([1], [1, -0.8], np.random.default_rng(seed).standard_normal((2000, 2)), axis=0)
        found = correlation_matrix(rate.T, 10.0)
        inside += found.low[0, 1] <= 0 <= found.high[0, 1]
    assert inside >= 88


def test_poses_of_different_bias_are_not_correlation():
    rng = np.random.default_rng(3)
    segment = np.repeat(np.arange(10), 500)
    rate = rng.standard_normal((5000, 2)) + 10 * rng.standard_normal((10, 1))[segment]
    assert abs(correlation_matrix(rate.T, 10.0, segment).value[0, 1]) < 0.06
    assert correlation_matrix(rate.T, 10.0).value[0, 1] > 0.9


def test_constant_gyro_has_no_correlation():
    rate = np.column_stack([np.ones(500), np.random.default_rng(4).standard_normal(500)])
    found = correlation_matrix(rate.T, 10.0)
    assert np.isnan(found.value[0, 1])
    assert np.isnan(found.value[0, 0])
    assert found.value[1, 1] == 1


def test_few_samples_do_not_fail():
    found = correlation_matrix(np.random.default_rng(5).standard_normal((2, 3)), 10.0)
    assert -1 <= found.low[0, 1] <= found.value[0, 1] <= found.high[0, 1] <= 1
