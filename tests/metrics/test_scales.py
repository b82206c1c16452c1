"""Allan covariances at doubling times: against a Haar MODWT written out, cross_allan, with losses and lacking gyros."""

import numpy as np
import pytest

from vgyro.errors import TooShort
from vgyro.metrics import Sampling, allan_scales, cross_allan
from vgyro.metrics.allan import scales as module


def noise(samples, gyros=3, seed=1):
    """White noise and random walks, both correlated; large constant biases."""
    rng = np.random.default_rng(seed)
    mix = rng.normal(size=(gyros, gyros))
    white, walk = rng.standard_normal((2, samples, gyros))
    return 100.0 + white @ mix + 0.05 * np.cumsum(walk @ mix.T, axis=0)


def whole(samples, rate_hz=10.0):
    return Sampling.of(rate_hz, np.zeros(samples, dtype=np.int32))


def modwt_covariance(rate, level):
    """Haar MODWT of `level`, its filter written out, without the coefficients at the boundary."""
    half = 2 ** (level - 1)
    haar = np.repeat([1.0, -1.0], half) / 2**level
    coefficients = np.column_stack([np.convolve(column, haar, mode="valid") for column in rate.T])
    return coefficients.T @ coefficients / len(coefficients)


def test_half_of_it_is_the_wavelet_covariance():
    rate = noise(1500)
    found = allan_scales(list(rate.T), whole(1500))
    np.testing.assert_allclose(found.tau, 0.1 * 2.0 ** np.arange(9))
    for level, covariance in enumerate(found.covariance, 1):
        np.testing.assert_allclose(covariance / 2, modwt_covariance(rate, level), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.pairs, 1500 / 2.0 ** np.arange(9) - 1)


def test_it_is_the_allan_covariance_of_the_figures():
    # Expected: cross_allan; it takes every (m // 64)-th difference, so only up to m = 64 is it the same number.
    rate = noise(3000)
    found = allan_scales(list(rate.T), whole(3000))
    expected = cross_allan(rate, 10.0, taus=found.tau[:7])
    np.testing.assert_allclose(found.covariance[:7], expected.covariance, rtol=1e-9, atol=1e-12)


def test_stretches_are_not_bridged():
    # Expected: the mean over both stretches, each weighed by its number of differences.
    rate = noise(900)
    rate[500:] += 1000.0
    segment = np.repeat([0, 1], [500, 400]).astype(np.int32)
    found = allan_scales(list(rate.T), Sampling.of(10.0, segment))
    for level in (1, 4, 7):
        parts = [(part, len(part) - 2**level + 1) for part in (rate[:500], rate[500:])]
        expected = sum(modwt_covariance(part, level) * number for part, number in parts)
        expected = expected / sum(number for _, number in parts)
        np.testing.assert_allclose(found.covariance[level - 1] / 2, expected, rtol=1e-9, atol=1e-10)


def test_many_samples_are_thinned(monkeypatch):
    rate = noise(20_000)
    every = allan_scales(list(rate.T), whole(20_000))
    monkeypatch.setattr(module, "MOST_DIFFERENCES", 2000)
    some = allan_scales(list(rate.T), whole(20_000))
    # Within five standard errors of 2000 independent differences, and of those that a long τ has.
    error = 5 * np.sqrt(2 / np.minimum(2000, every.pairs))[:, None]
    diagonal = [np.diagonal(one.covariance, axis1=1, axis2=2) for one in (some, every)]
    assert (np.abs(diagonal[0] / diagonal[1] - 1) < error).all()


def test_a_gyro_that_lacks_values():
    rate = noise(4000)
    full = allan_scales(list(rate.T), whole(4000))
    some, most = rate.copy(), rate.copy()
    some[1000:1060, 1] = np.nan
    most[::2, 2] = np.nan
    few = allan_scales(list(some.T), whole(4000), lacking=[1])
    assert np.isfinite(few.covariance).all()
    np.testing.assert_allclose(few.covariance[:5], full.covariance[:5], rtol=0.1)
    without = allan_scales(list(most.T), whole(4000), lacking=[2])
    np.testing.assert_allclose(without.covariance[:, :2, :2], full.covariance[:, :2, :2])
    assert np.isnan(without.covariance[:, 2]).all()
    assert np.isnan(without.covariance[:, :, 2]).all()


def test_too_short():
    with pytest.raises(TooShort, match="3 samples"):
        allan_scales(list(noise(3).T), whole(3))
    with pytest.raises(TooShort):
        allan_scales([np.full(100, np.nan)] * 2, whole(100), lacking=[0, 1])
