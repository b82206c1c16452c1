"""What is known of the constants beforehand: the centre of the biases, seen or not, against dense algebra and truth."""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from vgyro.fusion import ArrayNoise, ArrayRates, FilterParameters
from vgyro.fusion.bias.blocks import SlowBlocks
from vgyro.fusion.bias.estimate import slow_errors, slow_variance
from vgyro.fusion.bias.model import BiasEvidence, BlockNoise, Walk
from vgyro.fusion.bias.prior import Prior, _Look, _posteriors
from vgyro.fusion.bias.smoother import Filtered

MOVING = FilterParameters(in_motion=True)
GYROS, SECONDS, TAU = 6, 600, 30.0
ARW, RRW = np.full(GYROS, 0.02), np.full(GYROS, 0.003)
EQUAL = np.full(GYROS, 1 / GYROS)
REST = np.zeros(SECONDS, dtype=bool)
REST[:60], REST[270:330], REST[-60:] = True, True, True


def recording(seed, centre, spread, at_rest=REST, slope=0.0):
    """A recording at 1 Hz whose biases are near one centre and walk, fading in TAU; true biases [T, N]."""
    rng = np.random.default_rng(seed)
    fade = np.exp(-1.0 / TAU)
    sd = RRW[0] * np.sqrt(TAU / 2)
    walk = np.empty((SECONDS, GYROS))
    walk[0] = sd * rng.standard_normal(GYROS)
    for second in range(1, SECONDS):
        walk[second] = fade * walk[second - 1] + sd * np.sqrt(1 - fade**2) * rng.standard_normal(GYROS)
    degrees = 20.0 + 10.0 * (1.0 - np.exp(-np.arange(SECONDS) / 200.0))
    slopes = slope * (1.0 + 0.05 * rng.standard_normal(GYROS))
    bias = centre + spread * rng.standard_normal(GYROS) + walk + slopes * (degrees - degrees.mean())[:, None]
    motion = np.where(at_rest, 0.0, 20.0 * np.sin(np.arange(SECONDS) / 3.0))
    rate = bias + motion[:, None] + ARW * rng.standard_normal((SECONDS, GYROS))
    noise = ArrayNoise(ARW, RRW, np.eye(GYROS))
    temperature = degrees if slope else None
    return ArrayRates(rate, 1.0, np.zeros(SECONDS, dtype=int), at_rest, noise, temperature=temperature), bias


def errors(seeds, **more):
    """Mean error of the common bias [S], deg/s, and error²/variance of it in the motion [S]."""
    means, ratios = [], []
    for seed in seeds:
        array, bias = recording(seed, **more)
        slow = slow_errors(array, MOVING, ARW**2, walk=Walk(RRW, TAU))
        error = (slow.bias - bias) @ EQUAL
        means.append(error.mean())
        ratios.append(np.mean((error**2 / slow_variance(EQUAL, slow))[~array.at_rest]))
    return np.array(means), np.array(ratios)


def test_sums_of_variables_against_the_dense_posterior():
    # Expected: the normal posterior with the prior covariance of the sums, SVS', by dense algebra.
    array, _ = recording(1, 0.3, 0.01)
    blocks = SlowBlocks.of(array)
    evidence = BiasEvidence.of(array, blocks, BlockNoise(np.tile(ARW**2, (len(blocks), 1)), np.eye(GYROS)), REST)
    filtered = evidence.filtered(evidence.information(), Walk(RRW, TAU))
    sums = np.column_stack([np.eye(GYROS), np.ones(GYROS)])
    variance = np.array([0.1, 0.2, 0.3, 0.1, 0.2, 0.3, 4.0])
    found = Prior(np.ones(1), variance[None], sums).posterior(filtered)
    before = np.linalg.inv(sums @ np.diag(variance) @ sums.T)
    covariance = np.linalg.inv(before + filtered.squares[1:, 1:])
    np.testing.assert_allclose(found.covariance, covariance, rtol=1e-9)
    np.testing.assert_allclose(found.mean, covariance @ filtered.squares[1:, 0], rtol=1e-9)


@pytest.mark.parametrize("centre", [0.0, 0.3, -20.0])
def test_standstill_shows_the_centre_however_far_and_close_together(centre):
    # Truth: six biases within 0.001 deg/s of a centre that may be far from zero. Expected: errors about zero (t below
    # 3.5), and as large as stated (NEES of 1 within 3.5 standard errors) over 80 recordings.
    means, ratios = errors(range(80), centre=centre, spread=0.001)
    assert abs(means.mean()) < 3.5 * means.std(ddof=1) / np.sqrt(len(means))
    assert abs(ratios.mean() - 1.0) < 3.5 * ratios.std(ddof=1) / np.sqrt(len(ratios))


def test_standstill_shows_what_all_gyros_follow_the_temperature():
    # Truth: six slopes within 5 % of 0.01 deg/s/K. Expected: as above.
    means, ratios = errors(range(80), centre=0.1, spread=0.01, slope=0.01)
    assert abs(means.mean()) < 3.5 * means.std(ddof=1) / np.sqrt(len(means))
    assert abs(ratios.mean() - 1.0) < 3.5 * ratios.std(ddof=1) / np.sqrt(len(ratios))


def test_without_standstill_the_centre_is_zero():
    # Expected: what all gyros share goes to the motion: the biases found do not depend on the centre.
    moving = np.zeros(SECONDS, dtype=bool)
    found = []
    for centre in (0.0, 0.3):
        array, _ = recording(3, centre, 0.01, moving)
        found.append(slow_errors(array, MOVING, ARW**2, walk=Walk(RRW, TAU)).bias)
    np.testing.assert_allclose(found[1], found[0], atol=1e-9)


def measured(bias, sd):
    """Constants that are measured one by one, with the s.d. `sd` [N]: the squares of their rows are all that counts."""
    rows = np.column_stack([np.asarray(bias) / sd, np.diag(1.0 / np.asarray(sd))])
    nothing = np.zeros(0)
    return Filtered(nothing, nothing, nothing, nothing, nothing, rows.T @ rows, 0.0)


def look_at(bias, sd):
    return _Look.of(measured(bias, sd), slice(0, len(bias)))


def test_a_gyro_far_off_costs_the_odds_of_three_in_a_thousand():
    # Expected: by definition: sets of at most three, and less than half, of the gyros farthest from the median, each
    # gyro for the odds 0.003/0.997; its variance is that of its own square, of the others s².
    look = look_at([0.01, -0.02, 0.015, -0.01, 0.0, 5.0], np.full(6, 1e-3))
    sizes, (variances, logarithms) = look.sizes(), look.with_far_off()
    assert look.farthest[0] == 5
    assert len(variances) == len(sizes) * (1 + 6 + 15)
    price = math.log(0.003 / 0.997)
    expected = np.repeat([0.0] + [price] * 6 + [2 * price] * 15, len(sizes))
    np.testing.assert_allclose(logarithms, expected, rtol=1e-12)
    far = variances[len(sizes)]
    assert far[5] == pytest.approx(5.0**2, rel=0.01)
    np.testing.assert_array_equal(far[:5], sizes[0])
    np.testing.assert_array_equal(variances[0], np.full(6, sizes[0]))
    assert len(look_at(np.linspace(-1, 1, 9), np.full(9, 1e-3)).with_far_off()[0]) % (1 + 6 + 15 + 20) == 0


def test_sizes_of_the_spread():
    # Expected: by definition: from half the s.d. of one measurement to five times the largest constant, in steps of a
    # factor e^½ at most.
    look = look_at([0.3, -0.4, 0.1, 0.0, 2.0], [0.01, 0.02, 0.03, 0.04, 0.05])
    sizes = np.sqrt(look.sizes())
    assert sizes[0] == pytest.approx(0.5 * 0.03)
    assert sizes[-1] == pytest.approx(5.0 * np.sqrt(look.square.max()))
    steps = [math.log(after / before) for before, after in pairwise(sizes)]
    assert max(steps) <= 0.5
    assert max(steps) > 0.5 * (len(steps) - 1) / len(steps)


def test_likelihood_of_priors_is_that_of_the_normal_law():
    # Expected: scipy's normal law of the measurements, of covariance prior + noise, up to what all priors share.
    bias, sd = np.array([0.3, -0.4, 0.1]), np.array([0.1, 0.2, 0.3])
    filtered = measured(bias, sd)
    priors = np.array([[1.0, 2.0, 3.0], [0.01, 0.1, 0.0], [4.0, 0.5, 0.2]])
    means, covariances, found = _posteriors(filtered, priors)
    expected = [multivariate_normal(cov=np.diag(one + sd**2)).logpdf(bias) for one in priors]
    np.testing.assert_allclose(found - found[0], np.array(expected) - expected[0], rtol=1e-9)
    share = priors / (priors + sd**2)
    np.testing.assert_allclose(means, share * bias, rtol=1e-9)
    np.testing.assert_allclose(covariances, [np.diag(one) for one in share * sd**2], atol=1e-12)
