"""Variances and correlation that change in motion: against dense sums, known truth, and what must not be lost."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import helmert
from scipy.signal import lfilter
from scipy.stats import multivariate_normal

from vgyro.fusion import ArrayNoise, ArrayRates, FilterParameters
from vgyro.fusion.noise.changing import changing_variances
from vgyro.fusion.noise.changing_in_motion import Score, alike, moving_noise, squares_of_pairs
from vgyro.fusion.noise.cornered_hat import constant_variances
from vgyro.fusion.noise.difference_blocks import block_moments
from vgyro.fusion.noise.parity import parity_variances

MOVING = FilterParameters(in_motion=True)
RATE_HZ, SECONDS, GYROS = 100.0, 1200, 6


def wandering(rng, blocks, many, tau, sd):
    """AR(1) series [blocks, many] of time constant tau, in blocks, and s.d. sd."""
    keep = math.exp(-1.0 / tau)
    white = rng.standard_normal((blocks + 10 * round(tau), many)) * sd * math.sqrt(1 - keep**2)
    return lfilter([1.0], [1.0, -keep], white, axis=0)[-blocks:]


def simulated(seed, variances=0.0, correlations=0.0, truth=0.0):
    """Gyros whose log σ² and C change from second to second, τ = 50 s: the array, and R [T/100, N, N]."""
    rng = np.random.default_rng(seed)
    log = wandering(rng, SECONDS, GYROS, 50.0, variances)
    move = wandering(rng, SECONDS, GYROS * (GYROS - 1) // 2, 50.0, correlations)
    C = np.broadcast_to(np.eye(GYROS), (SECONDS, GYROS, GYROS)).copy()
    first, second = np.triu_indices(GYROS, 1)
    C[:, first, second] = C[:, second, first] = move
    least = np.linalg.eigvalsh(C)[:, 0]
    C[:, first, second] *= np.minimum(1.0, 0.9 / np.maximum(1.0 - least, 0.9))[:, None]
    C[:, second, first] = C[:, first, second]
    sigma = np.exp(log / 2.0)
    R = C * sigma[:, :, None] * sigma[:, None, :]
    size = round(RATE_HZ)
    noise = rng.standard_normal((SECONDS, size, GYROS)) @ np.linalg.cholesky(R).transpose(0, 2, 1)
    rate = np.asfortranarray(noise.reshape(-1, GYROS) + np.asarray(truth)[..., None])
    still = np.zeros(len(rate), dtype=bool)
    noise_record = ArrayNoise(np.ones(GYROS), np.ones(GYROS), np.eye(GYROS))
    return ArrayRates(rate, RATE_HZ, np.zeros(len(rate), dtype=np.int32), still, noise_record), R


def both(array):
    """Variances that change alone, and with the correlation."""
    moments = block_moments(array)
    constant, outlier = constant_variances(moments, np.eye(GYROS))
    alone = changing_variances(moments, constant, outlier, np.eye(GYROS), 0.25)
    return alone, moving_noise(moments, constant, np.eye(GYROS), 0.25, alone)


def loss(R, weights):
    """S.d. of the fused noise over that of equal weights, by the true R [S, N, N]; weights [M, N] of 0.25 s blocks."""
    here = np.repeat(R, len(weights) // len(R), axis=0)
    fused = np.einsum("bi,bij,bj->", weights, here, weights) / len(weights)
    return math.sqrt(fused / (R.sum(axis=(1, 2)).mean() / GYROS**2))


@pytest.mark.parametrize("seed", range(4))
def test_correlation_that_changes_does_no_harm(seed):
    # Expected: not worse than equal weights, which is what constant variances give; changing variances alone, which
    # take it for theirs, lose 2 %.
    array, R = simulated(seed, correlations=0.15)
    alone, found = both(array)
    assert found is not None
    inverse = 1.0 / alone.variance
    assert loss(R, inverse / inverse.sum(axis=1, keepdims=True)) > 1.02
    variances = parity_variances(array, MOVING)
    assert variances.moving is not None
    assert loss(R, variances.weights()) <= 1.0


@pytest.mark.parametrize("seed", range(4))
def test_variances_that_change_alone(seed):
    # Expected: the error of inverse-variance weights by the true variances, within 1 %.
    array, R = simulated(seed, variances=0.5)
    inverse = np.repeat(1.0 / np.einsum("bii->bi", R), 4, axis=0)
    oracle = loss(R, inverse / inverse.sum(axis=1, keepdims=True))
    assert oracle < 0.96
    assert loss(R, parity_variances(array, MOVING).weights()) <= 1.01 * oracle


def test_both_change():
    # Expected: less error than with variances alone, on the mean of six; the true variances lose less than both.
    ratios = []
    for seed in range(6):
        array, R = simulated(seed, variances=0.2, correlations=0.15)
        inverse = 1.0 / both(array)[0].variance
        ratios.append(
            loss(R, parity_variances(array, MOVING).weights()) / loss(R, inverse / inverse.sum(1, keepdims=True))
        )
    assert np.mean(ratios) <= 0.985
    assert max(ratios) <= 1.0


@pytest.mark.parametrize("seed", range(8))
def test_white_noise_keeps_a_constant_correlation(seed):
    assert both(simulated(seed)[0])[1] is None
    assert parity_variances(simulated(seed)[0], MOVING).moving is None


def test_a_motion_changes_nothing():
    # Expected: the same to rounding: it is in no difference.
    truth = 50.0 * np.sin(np.arange(round(SECONDS * RATE_HZ)) / 70.0)
    still, moved = (both(simulated(1, correlations=0.15, truth=one)[0])[1] for one in (0.0, truth))
    np.testing.assert_allclose(moved.variance, still.variance, rtol=1e-6)
    np.testing.assert_allclose(moved.correlation, still.correlation, atol=1e-6)


def test_correlations_are_positive_definite_and_those_of_the_truth():
    # Expected: of what differs between gyros, most: regression of the true pair correlations on the estimate near 1,
    # as for any best linear estimate, and correlated by 0.6 or more.
    array, R = simulated(2, correlations=0.15)
    found = both(array)[1]
    assert np.linalg.eigvalsh(found.correlation)[:, 0].min() > 0.02
    first, second = np.triu_indices(GYROS, 1)
    true, seen = (
        one - one.mean(axis=1, keepdims=True) for one in (R[:, first, second], found.correlation[::4, first, second])
    )
    assert np.sum(true * seen) / np.sum(seen * seen) == pytest.approx(1.0, abs=0.15)
    assert np.corrcoef(true.ravel(), seen.ravel())[0, 1] > 0.6


def test_a_gyro_at_fault_has_no_say():
    # Expected: the weights as if the gyro were not there.
    from vgyro.fusion.events import FaultEvent

    array, _ = simulated(3, correlations=0.15)
    event = FaultEvent(2, "noise", 0, len(array.rate), 9.0, 20.0, "1")
    loud = array.rate.copy()
    loud[:, 2] *= 20.0
    faulty = parity_variances(replace(array, rate=loud, faults=(event,)), MOVING).weights()
    kept = [0, 1, 3, 4, 5]
    noise = ArrayNoise(np.ones(5), np.ones(5), np.eye(5))
    five = parity_variances(replace(array, rate=np.asfortranarray(array.rate[:, kept]), noise=noise), MOVING).weights()
    assert (faulty[:, 2] == 0).all()
    np.testing.assert_allclose(faulty[:, kept], five, atol=0.01)


def test_score_is_the_likelihood_of_the_differences():
    # Expected: the Gaussian density of the Helmert contrasts, by scipy, summed over the samples.
    array, _ = simulated(4, variances=0.5)
    moments = block_moments(
        replace(array, rate=array.rate[:1000], segment=array.segment[:1000], at_rest=array.at_rest[:1000]), 1
    )
    moments = replace(moments, low=np.arange(1000), high=np.arange(1000), mean=np.zeros((1000, GYROS)))
    none = np.zeros((1000, GYROS), dtype=bool)
    moments.excluded[300:, 1] = True
    square = squares_of_pairs(moments, none)
    np.testing.assert_allclose(square[7, 0, 1], 2.0 * (array.rate[7, 0] - array.rate[7, 1]) ** 2, rtol=1e-6)
    score = Score(moments, square / 2.0, none, np.ones(1000))
    rng = np.random.default_rng(1)
    C = np.full((GYROS, GYROS), 0.3) + 0.7 * np.eye(GYROS)
    one, other = rng.uniform(0.5, 2.0, (2, 1000, GYROS))

    def deviance(variance):
        total = 0.0
        for row, kept in enumerate(np.logical_not(moments.excluded)):
            sigma, contrast = np.sqrt(variance[row, kept]), helmert(int(kept.sum()))
            S = contrast @ (np.outer(sigma, sigma) * C[np.ix_(kept, kept)]) @ contrast.T
            total -= 2.0 * multivariate_normal(cov=S).logpdf(contrast @ array.rate[row, kept])
        return total

    expected = [deviance(one), deviance(other)]
    assert score(one, C) - score(other, C) == pytest.approx(expected[0] - expected[1], rel=1e-6)


@pytest.mark.parametrize(("times", "even"), [(1.0, True), (1.06, True), (1.3, False)])
def test_gyros_are_alike_unless_the_differences_show_it(times, even):
    """One of six gyros has `times` the variance: 5·log Σν is asked for, the deviance gives some Σν·(times - 1)²/3."""
    array, _ = simulated(12, variances=0.0)
    rate = np.random.default_rng(3).standard_normal((12_000, GYROS)) * 0.1
    rate[:, 2] *= np.sqrt(times)
    rows = slice(0, 12_000)
    array = replace(array, rate=np.asfortranarray(rate), segment=array.segment[rows], at_rest=array.at_rest[rows])
    moments = block_moments(array)
    constant, outlier = constant_variances(moments, np.eye(GYROS))
    assert alike(moments, constant, outlier, np.eye(GYROS)) == even
    found = parity_variances(array, MOVING, changing=False)
    assert (np.ptp(found.variance) == 0.0) == even
    assert ("equal variances" in found.note) == even
    without = parity_variances(array, replace(MOVING, without=frozenset({"guard"})), changing=False)
    assert np.ptp(without.variance) > 0.0
