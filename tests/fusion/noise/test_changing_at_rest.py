"""Noise of an array at rest as a whole: averages against dense sums, deviance against scipy, fusion against oracles."""

import math

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from vgyro import engine as engines
from vgyro.fusion import ArrayNoise, ArrayRates, FilterParameters, min_variance_weights
from vgyro.fusion.events import FaultEvent
from vgyro.fusion.noise.changing_at_rest import _average, _deviance
from vgyro.fusion.noise.parity import parity_variances

low_pass = engines.get("native").kalman.low_pass
RATE_HZ = 200.0
USUAL = np.full((4, 4), 0.2) + 0.8 * np.eye(4)


def resting(samples, mixing, seed=0, level=0.0, faults=(), correlation=USUAL):
    """White gyros of s.d. 1 deg/s at rest: sample t is `mixing`[t] times white noise."""
    noise = np.random.default_rng(seed).standard_normal((samples, 4))
    rate = np.asfortranarray(np.einsum("tij,tj->ti", mixing, noise) + level)
    of_array = ArrayNoise(np.ones(4), np.ones(4), correlation)
    return ArrayRates(
        rate, RATE_HZ, np.zeros(samples, np.int32), np.ones(samples, bool), of_array, faults=faults
    )  # fmt: skip


def turning(samples, period_s=120.0):
    """Correlation [T, 4, 4] that swings: gyros 1 and 2 share 0.2 ± 0.5, gyros 3 and 4 0.2 ∓ 0.5."""
    swing = 0.5 * np.sin(2.0 * np.pi * np.arange(samples) / RATE_HZ / period_s)
    correlation = np.tile(USUAL, (samples, 1, 1))
    for one, other, sign in ((0, 1, 1.0), (2, 3, -1.0)):
        correlation[:, one, other] += sign * swing
        correlation[:, other, one] += sign * swing
    return correlation


def true_variance(found, covariance):
    """Mean of u'Ru over the blocks, R the true covariance at their middles."""
    weights = found.weights()
    return float(np.einsum("bi,bij,bj->b", weights, covariance, weights).mean())


@pytest.mark.parametrize("alone", [False, True])
def test_average_of_matrices_dense(alone):
    # Expected: Σ ν_c·keep^|b - c|·Z_c with and without c = b, written out, over its own diagonal.
    rng = np.random.default_rng(3)
    factor = rng.standard_normal((40, 3, 6))
    moments, freedom, keep = factor @ factor.transpose(0, 2, 1) / 6, rng.integers(1, 9, 40).astype(float), 0.8
    share = keep ** np.abs(np.subtract.outer(np.arange(40), np.arange(40))) * freedom
    dense = np.einsum("bc,cij->bij", share * (1 - np.eye(40)) if alone else share, moments)
    sd = np.sqrt(np.einsum("bii->bi", dense))
    found = _average(moments, freedom, keep, low_pass, slice(None, None, 3), alone)
    np.testing.assert_allclose(found, (dense / (sd[:, :, None] * sd[:, None, :]))[::3], rtol=1e-9, atol=1e-12)


def test_deviance_is_that_of_the_normal_law():
    # Expected: -2 log density of scipy's normal law, less its constant N·log 2π.
    rng = np.random.default_rng(4)
    samples = rng.standard_normal((7, 4))
    expected = sum(-2.0 * multivariate_normal(cov=USUAL).logpdf(one) - 4 * math.log(2.0 * math.pi) for one in samples)
    found = _deviance(samples[:, :, None] * samples[:, None, :], np.ones(7), np.broadcast_to(USUAL, (7, 4, 4)))
    assert found == pytest.approx(expected, rel=1e-9)


def test_constant_noise_keeps_its_constant_correlation():
    # Expected: the variance of the mean of four, (1 + 3·0.2)/4 = 0.4; 0.1 % more is what the weights' chance may cost.
    mixing = np.broadcast_to(np.linalg.cholesky(USUAL), (60_000, 4, 4))
    found = parity_variances(resting(60_000, mixing), FilterParameters())
    assert found.moving is None
    assert np.isinf(found.tau_s).all()
    assert 0.4 * (1 - 1e-9) <= true_variance(found, np.broadcast_to(USUAL, (len(found.start), 4, 4))) < 0.4 * 1.001
    # 1σ of a variance from 60 000 samples is 0.6 %. Median: a few blocks may differ by chance.
    np.testing.assert_allclose(np.median(found.variance, axis=0), 1.0, atol=0.03)


def test_a_correlation_that_is_not_known_is_measured():
    # Gyros 1 and 2 share 0.8. Expected: the true correlation (1σ of one of 120 000 samples: 0.003), and the best
    # variance, 1/(1'C⁻¹1).
    samples = 120_000
    truth = np.eye(4)
    truth[0, 1] = truth[1, 0] = 0.8
    unknown = np.full((4, 4), np.nan)
    array = resting(samples, np.broadcast_to(np.linalg.cholesky(truth), (samples, 4, 4)), 5, correlation=unknown)
    found = parity_variances(array, FilterParameters())
    np.testing.assert_allclose(found.correlation, truth, atol=0.015)
    best = 1.0 / np.linalg.inv(truth).sum()
    assert true_variance(found, np.broadcast_to(truth, (len(found.start), 4, 4))) < 1.001 * best


def test_a_correlation_that_swings_is_followed():
    # Oracles: minimum-variance weights of the true covariance of every block; of the constant one (the mean). Equal
    # weights are those of the constant one here.
    samples = 240_000
    correlation = turning(samples)
    array = resting(samples, np.linalg.cholesky(correlation), seed=1)
    found = parity_variances(array, FilterParameters())
    truth = correlation[(found.start + found.stop) // 2]
    weights = min_variance_weights(truth)
    best = float(np.einsum("bi,bij,bj->b", weights, truth, weights).mean())
    constant = float(np.einsum("i,bij,j->b", np.full(4, 0.25), truth, np.full(4, 0.25)).mean())
    assert found.moving is not None
    assert constant > 1.05 * best
    assert true_variance(found, truth) < 1.01 * best
    # What the combination is said to have: 2 % from the weights' own chance.
    assert found.combined_variance().mean() == pytest.approx(best, rel=0.02)


def test_a_constant_rate_changes_nothing():
    mixing = np.linalg.cholesky(turning(40_000))
    still, moved = (parity_variances(resting(40_000, mixing, level=rate), FilterParameters()) for rate in (0.0, 10.0))
    np.testing.assert_allclose(moved.weights(), still.weights(), rtol=1e-9, atol=1e-9)


def test_a_gyro_at_fault_has_no_weight_and_spoils_no_correlation():
    samples = 120_000
    correlation = turning(samples)
    fault = FaultEvent(2, "noise", 40_000, 80_000, 9.0, 8.0, "1")
    array = resting(samples, np.linalg.cholesky(correlation), seed=2, faults=(fault,))
    array.rate[40_000:80_000, 2] *= 8.0
    found = parity_variances(array, FilterParameters())
    during = (found.start < 80_000) & (found.stop > 40_000)
    assert (found.weights()[during, 2] == 0).all()
    kept = [0, 1, 3]
    truth = correlation[(found.start + found.stop) // 2][during][:, kept][:, :, kept]
    weights = found.weights()[during][:, kept]
    best = min_variance_weights(truth)
    ours, oracle = (np.einsum("bi,bij,bj->b", one, truth, one).mean() for one in (weights, best))
    assert ours < 1.01 * oracle


def test_two_outputs_of_one_gyro():
    # Closed form: two of the same and two others, alike: 1/3 for the pair, 1/3 for each of the others.
    truth = np.eye(4)
    mixing = np.broadcast_to(np.eye(4), (40_000, 4, 4))
    array = resting(40_000, mixing, 6, correlation=truth)
    array.rate[:, 1] = array.rate[:, 0]
    weights = parity_variances(array, FilterParameters()).weights()
    np.testing.assert_allclose(weights[:, :2].sum(axis=1), 1 / 3, atol=0.02)
