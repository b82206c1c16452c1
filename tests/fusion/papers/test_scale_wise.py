"""Scale-wise weights: against the equations written out and a minimiser, copies, weights on scales, intervals."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from vgyro.fusion import ArrayNoise, ArrayRates, FilterParameters
from vgyro.fusion.papers.scale_wise import alike, large, scale_wise_all, scale_wise_large, wavelet_variance
from vgyro.fusion.rest_scales import own_scales

PARAMETERS = FilterParameters()
MIX = np.array([[1.0, 0.3, 0.0, 0.0], [0.0, 1.2, 0.4, 0.0], [0.2, 0.0, 0.8, 0.0], [0.5, 0.0, 0.0, 2.0]])
CHOICES = {scale_wise_all: alike, scale_wise_large: large}


def record(samples, seed=1, white=1.0, walk=0.02):
    rng = np.random.default_rng(seed)
    noise, steps = rng.standard_normal((2, samples, 4))
    rate = white * noise @ MIX + walk * np.cumsum(steps @ MIX.T, axis=0)
    unknown = ArrayNoise(np.full(4, np.nan), np.full(4, np.nan), np.eye(4))
    return ArrayRates(rate, 1.0, np.zeros(samples, dtype=np.int32), np.ones(samples, dtype=bool), unknown)


def modwt(signal, level):
    """Coefficients of the Haar MODWT without those at the boundary, its filter written out."""
    half = 2 ** (level - 1)
    return np.convolve(signal, np.repeat([1.0, -1.0], half) / 2**level, mode="valid")


@pytest.mark.parametrize("method", CHOICES)
def test_the_virtual_signal_has_the_least_weighted_wavelet_variance(method):
    # Expected: a general minimiser, on the wavelet variance of the combined signal itself.
    array = record(1024)
    weights = method(array, PARAMETERS).weights
    shares = CHOICES[method](own_scales(array).covariance / 2)
    coefficients = [np.column_stack([modwt(one, level) for one in array.rate.T]) for level in range(1, len(shares) + 1)]

    def cost(three):
        c = np.append(three, 1 - three.sum())
        return sum(share * np.mean((w @ c) ** 2) for share, w in zip(shares, coefficients, strict=True))

    found = minimize(cost, np.full(3, 0.25), tol=1e-14).x
    np.testing.assert_allclose(weights[:3], found, atol=1e-5)
    assert weights.sum() == pytest.approx(1.0, abs=1e-12)


def test_weights_on_scales():
    wavelet = own_scales(record(2048)).covariance / 2
    assert alike(wavelet).sum() == pytest.approx(1.0)
    # Each scale has the same part in the sum for the mean gyro.
    parts = alike(wavelet) * np.trace(wavelet, axis1=1, axis2=2)
    np.testing.assert_allclose(parts, parts[0])
    scales = len(wavelet)
    shares = large(np.ones((20, 4, 4)))
    assert shares[14] / shares[19] == pytest.approx(0.5 * (1 + np.exp(-5)))
    assert (np.diff(large(wavelet)) > 0).all()
    # 10 scales alike: half of the sum is of the fifth, 16 samples, or more.
    assert "averaging times of 16 s or more" in scale_wise_all(record(2048), PARAMETERS).note
    assert large(wavelet)[: scales // 2].sum() < 0.1


def test_white_noise_alone_has_the_weights_of_least_variance():
    # Expected: Σ⁻¹1/(1'Σ⁻¹1) of the samples' true covariance, at any choice of scales, within sampling errors.
    covariance = MIX.T @ MIX
    expected = np.linalg.solve(covariance, np.ones(4))
    expected /= expected.sum()
    array = record(100_000, walk=0.0)
    np.testing.assert_allclose(scale_wise_all(array, PARAMETERS).weights, expected, atol=0.3)
    variance = [w @ covariance @ w for w in (scale_wise_all(array, PARAMETERS).weights, expected)]
    assert variance[0] < 1.3 * variance[1]


def test_copies_share_their_weight():
    array = record(4096)
    twice = replace(array, rate=np.column_stack([array.rate, array.rate[:, 1]]))
    alone, both = (scale_wise_large(one, PARAMETERS) for one in (array, twice))
    np.testing.assert_allclose(twice.rate @ both.weights, array.rate @ alone.weights, atol=1e-6)
    assert both.weights[1] == pytest.approx(both.weights[4], abs=1e-8)
    assert "gyros 2 and 5 are copies of each other" in both.note


def test_each_choice_is_better_where_it_looks():
    array = record(20_000, white=1.0, walk=0.01)
    wavelet = own_scales(array).covariance / 2
    variance = {
        method: np.einsum("i,jik,k->j", *(lambda c: (c, wavelet, c))(method(array, PARAMETERS).weights))
        for method in CHOICES
    }
    assert variance[scale_wise_large][-1] < variance[scale_wise_all][-1]
    assert variance[scale_wise_large][0] > variance[scale_wise_all][0]


def test_wavelet_variance_of_a_combination():
    array = record(3000)
    c = np.array([0.5, 0.3, 0.4, -0.2])
    found = wavelet_variance(array, c)
    np.testing.assert_allclose(found.tau, 2.0 ** np.arange(10))
    wavelet = own_scales(array).covariance / 2
    # All differences up to 16 samples; every (m // 16)-th beyond.
    expected = np.einsum("i,jik,k->j", c, wavelet, c)
    np.testing.assert_allclose(found.value[:5], expected[:5], rtol=1e-9)
    np.testing.assert_allclose(found.value, expected, rtol=0.2)
    assert ((found.low < found.value) & (found.value < found.high)).all()


@pytest.mark.parametrize(("white", "walk"), [(1.0, 0.0), (0.0, 1.0), (1.0, 0.02)])
def test_intervals_cover_the_truth(white, walk):
    # Expected: wavelet variance of white noise v/2m, of a random walk v(4m² + 2)/24m (m the averaging factor); 95 % of
    # 300 records, less 3.5 % for three binomial deviations, and 5 % more at the two longest scales, of few pairs.
    c = np.array([0.5, 0.3, 0.4, -0.2])
    inside = 0
    for seed in range(300):
        found = wavelet_variance(record(2000, seed, white, walk), c)
        m = found.tau
        truth = white**2 * c @ MIX.T @ MIX @ c / (2 * m) + walk**2 * c @ MIX @ MIX.T @ c * (4 * m**2 + 2) / (24 * m)
        inside = inside + ((found.low <= truth) & (truth <= found.high))
    assert (inside[:-2] / 300 > 0.915).all()
    assert (inside[-2:] / 300 > 0.865).all()
    assert (inside / 300 < 0.99).all()
