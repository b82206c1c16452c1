"""Constant variances from the differences between gyros: against closed forms, dense likelihoods and known truth."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import helmert
from scipy.optimize import minimize

from vgyro.fusion import ArrayNoise, ArrayRates, CannotRun, FilterParameters
from vgyro.fusion.events import FaultEvent
from vgyro.fusion.noise.cornered_hat import best_weights, constant_variances, outliers
from vgyro.fusion.noise.difference_blocks import SLOW_BLOCKS, BlockMoments, block_moments
from vgyro.fusion.noise.parity import cornered_hat, pair_variances, parity_variances

MOVING = FilterParameters(in_motion=True)
RATES = [(12000, 200.0), (3600, 1.0)]
"""Samples and rate: blocks of 50 samples, and single samples."""


def simulated(samples, rate_hz, sigma, truth=0.0, seed=0, correlation=None, walk=0.0):
    """Gyros of noise `sigma` [N] or [T, N] deg/s a sample, and of random walk `walk` deg/s/√s."""
    sigma = np.asarray(sigma, dtype=float)
    gyros = sigma.shape[-1]
    rng = np.random.default_rng(seed)
    correlation = np.eye(gyros) if correlation is None else correlation
    noise = rng.standard_normal((samples, gyros)) @ np.linalg.cholesky(correlation).T * sigma
    bias = np.cumsum(rng.standard_normal((samples, gyros)) * walk / np.sqrt(rate_hz), axis=0)
    rate = np.asfortranarray(np.asarray(truth)[..., None] + noise + bias)
    of_array = ArrayNoise(np.ones(gyros), np.ones(gyros), correlation)
    return ArrayRates(rate, rate_hz, np.zeros(samples, dtype=np.int32), np.zeros(samples, dtype=bool), of_array)


def motion(samples, rate_hz, amplitude=20.0, frequency=0.5):
    """A sinusoidal rate, deg/s."""
    return amplitude * np.sin(2 * np.pi * frequency * np.arange(samples) / rate_hz)


def standard_errors(variance, samples):
    """Cramér-Rao bounds [N] of the variances of uncorrelated gyros seen through their differences.

    Information ½n·(P∘P), P = R⁻¹ - R⁻¹11'R⁻¹/(1'R⁻¹1), R = diag(variance).
    """
    inverse = 1.0 / np.asarray(variance)
    P = np.diag(inverse) - np.outer(inverse, inverse) / inverse.sum()
    return np.sqrt(np.diag(np.linalg.inv(samples / 2.0 * P**2)))


def test_three_cornered_hat_closed_form():
    # Expected: σ_1² = (p_12 + p_13 - p_23)/2 and so on.
    pairs = np.array([[0.0, 5.0, 10.0], [5.0, 0.0, 13.0], [10.0, 13.0, 0.0]])
    np.testing.assert_allclose(cornered_hat(pairs), [1.0, 4.0, 9.0], rtol=1e-12)


def test_cornered_hat_of_exact_pairs():
    # Expected: the variances that the pairs were made of; a pair that is missing changes nothing.
    variance = np.array([0.1, 2.0, 3.0, 0.5, 7.0])
    pairs = variance[:, None] + variance
    np.testing.assert_allclose(cornered_hat(pairs), variance, rtol=1e-12)
    pairs[0, 3] = pairs[3, 0] = np.nan
    np.testing.assert_allclose(cornered_hat(pairs), variance, rtol=1e-12)


def test_hat_is_never_negative():
    # Expected: the closed form gives σ_1² = -1. With 0 in its place, by hand: (a - 1)² + (b - 2)² + (a + b - 5)² is
    # least at a = 5/3, b = 8/3.
    pairs = np.array([[0.0, 1.0, 2.0], [1.0, 0.0, 5.0], [2.0, 5.0, 0.0]])
    np.testing.assert_allclose(cornered_hat(pairs), [0.0, 5 / 3, 8 / 3], atol=1e-12)


def test_two_gyros_share_where_nothing_tells_them_apart():
    # Expected: half of the difference's variance each: with "quiet" off, and of two that are alike with it.
    np.testing.assert_allclose(cornered_hat(np.array([[0.0, 3.0], [3.0, 0.0]])), [1.5, 1.5])
    array = simulated(12000, 200.0, [1.0, 2.0], motion(12000, 200.0))
    found = parity_variances(array, replace(MOVING, without=frozenset({"quiet"})))
    difference = np.diff(array.rate, axis=1).var()
    np.testing.assert_allclose(found.variance, difference / 2.0, rtol=0.002)
    np.testing.assert_allclose(found.weights(), 0.5, atol=1e-12)
    assert "cannot be told apart" in found.note
    alike = parity_variances(simulated(12000, 200.0, [1.0, 1.0], motion(12000, 200.0)), MOVING)
    np.testing.assert_allclose(alike.weights(), 0.5, atol=1e-12)


def test_two_gyros_are_told_apart_where_the_motion_is_small():
    # Known truth: variances of 1 and 4, motion of low frequency; no record of the noise at rest.
    found = parity_variances(simulated(12000, 200.0, [1.0, 2.0], motion(12000, 200.0)), MOVING)
    np.testing.assert_allclose(found.variance[0], [1.0, 4.0], rtol=0.08)
    np.testing.assert_allclose(found.weights()[0], [0.8, 0.2], atol=0.03)
    assert "the motion is small" in found.note


def test_block_moments_know_every_residual():
    # Expected: the residuals of the samples themselves; gaps of any place, a stretch shorter than a block.
    rng = np.random.default_rng(4)
    array = simulated(5000, 100.0, [1.0, 2.0, 0.5], motion(5000, 100.0), seed=4)
    array = replace(array, segment=np.repeat([0, 1, 2, 3], [1777, 9, 1214, 2000]))
    moments = block_moments(array)
    assert moments.start[0] == 0
    assert moments.stop[-1] == 5000
    np.testing.assert_array_equal(moments.start[1:], moments.stop[:-1])
    assert {1777, 1786, 3000} <= set(moments.start.tolist())
    weights = rng.dirichlet(np.ones(3), len(moments.start))
    square, mean = moments.residual(weights)
    for block in range(len(moments.start)):
        y = array.rate[moments.start[block] : moments.stop[block]]
        e = y - (y @ weights[block])[:, None]
        np.testing.assert_allclose(square[block], (e**2).mean(axis=0), rtol=1e-9)
        np.testing.assert_allclose(mean[block], e.mean(axis=0), atol=1e-12)


def test_rates_are_left_as_they_are():
    array = simulated(2000, 200.0, np.ones(4), motion(2000, 200.0))
    before = array.rate.copy()
    parity_variances(array, MOVING)
    np.testing.assert_array_equal(array.rate, before)


def test_pieces_do_not_matter(monkeypatch):
    array = simulated(5000, 200.0, np.ones(3), motion(5000, 200.0))
    whole = block_moments(array)
    monkeypatch.setattr("vgyro.fusion.noise.difference_blocks.PIECE", 137)
    pieces = block_moments(array)
    np.testing.assert_allclose(pieces.square, whole.square, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(pieces.excluded, whole.excluded)


def hand_made(square, samples):
    """Blocks without slow part, of second moments [M, N, N]."""
    blocks, gyros = square.shape[:2]
    place = np.arange(blocks)
    low, high = np.maximum(place - SLOW_BLOCKS, 0), np.minimum(place + SLOW_BLOCKS, blocks - 1)
    start = samples * place.astype(np.int64)
    none = np.zeros((blocks, gyros))
    return BlockMoments(start, start + samples, low, high, square, none, none.astype(bool))


def test_greatest_likelihood_of_the_parity_space():
    # Expected: the likelihood of the Helmert contrasts of y, maximised by scipy (L-BFGS-B).
    rng = np.random.default_rng(5)
    truth, samples, blocks = np.array([1.0, 0.3, 2.0, 25.0, 0.05]), 60, 20
    y = rng.standard_normal((blocks, samples, 5)) * np.sqrt(truth)
    moments = hand_made(np.einsum("bti,btj->bij", y, y), samples)
    found = constant_variances(moments, np.eye(5))[0]
    contrast = helmert(5)
    # All windows hold all blocks: the slow part took 1/20 of a sample from each.
    mean = contrast @ (moments.square.sum(axis=0) / (blocks * (samples - 1 / blocks))) @ contrast.T

    def deviance(logarithm):
        S = contrast @ np.diag(np.exp(logarithm)) @ contrast.T
        return np.linalg.slogdet(S)[1] + np.trace(np.linalg.solve(S, mean))

    best = minimize(deviance, np.log(truth), method="L-BFGS-B", options={"ftol": 1e-15, "gtol": 1e-10})
    np.testing.assert_allclose(found, np.exp(best.x), rtol=1e-4)


def test_best_weights_dense():
    # Expected: R⁻¹1/(1'R⁻¹1) of the gyros that are left, by a dense solve.
    rng = np.random.default_rng(6)
    variance, excluded = rng.uniform(0.1, 3.0, (40, 4)), rng.random((40, 4)) < 0.2
    excluded[excluded.all(axis=1)] = False
    correlation = np.full((4, 4), 0.3) + 0.7 * np.eye(4)
    best = best_weights(variance, excluded, correlation)
    for block in range(40):
        kept = np.flatnonzero(~excluded[block])
        sigma = np.sqrt(variance[block, kept])
        share = np.linalg.solve(np.outer(sigma, sigma) * correlation[np.ix_(kept, kept)], np.ones(len(kept)))
        np.testing.assert_allclose(best.weights[block, kept], share / share.sum(), rtol=1e-10)
        assert best.variance[block] == pytest.approx(1 / share.sum())
        assert (best.weights[block, excluded[block]] == 0).all()


@pytest.mark.parametrize(("samples", "rate_hz"), RATES)
@pytest.mark.parametrize("seed", range(4))
def test_known_truth_in_motion(samples, rate_hz, seed):
    # Expected: the simulated variances, within 3 standard errors (Cramér-Rao).
    sigma = np.array([1.0, 0.7, 1.5, 5.0, 1.0, 2.0])
    array = simulated(samples, rate_hz, sigma, motion(samples, rate_hz), seed)
    found = parity_variances(array, MOVING, changing=False).variance[0]
    assert (np.abs(found - sigma**2) <= 3 * standard_errors(sigma**2, samples)).all()


@pytest.mark.parametrize(("samples", "rate_hz"), RATES)
def test_drift_is_not_noise(samples, rate_hz):
    # Expected: the white variance 1, within 4 standard errors; the ramp alone has a variance of 1.3 to 5.
    array = simulated(samples, rate_hz, np.ones(6), motion(samples, rate_hz), seed=3, walk=0.01)
    array.rate[:, 3] += np.linspace(0.0, 6.0, samples)
    found = parity_variances(array, MOVING, changing=False).variance[0]
    assert (np.abs(found - 1.0) <= 4 * standard_errors(np.ones(6), samples)).all()


@pytest.mark.parametrize(("samples", "rate_hz"), RATES)
def test_single_outliers_are_left_out(samples, rate_hz):
    # Expected: as without the outliers, but for the few blocks that are lost.
    array = simulated(samples, rate_hz, np.ones(5), seed=8)
    clean = parity_variances(array, MOVING, changing=False).variance[0]
    array.rate[[samples // 3, samples // 2], [0, 1]] = [1000.0, -200.0]
    found = parity_variances(array, MOVING, changing=False).variance[0]
    np.testing.assert_allclose(found, clean, rtol=0.03)


def test_outliers_are_single():
    square = np.ones((40, 2))
    square[10, 0] = 70.0
    square[20:22, 1] = 70.0
    found = outliers(square)
    assert found[10, 0]
    assert found.sum() == 1, "two neighbours of one size are a short burst"


@pytest.mark.parametrize(("samples", "rate_hz"), RATES)
def test_measured_correlation(samples, rate_hz):
    # Expected: with the correlation of the noise record the simulated variances, in motion too; without it only their
    # part that is not common, 1 - ρ of it.
    rho, sigma = 0.4, np.full(6, 1.5)
    correlation = np.full((6, 6), rho) + (1 - rho) * np.eye(6)
    array = simulated(samples, rate_hz, sigma, seed=2, correlation=correlation)
    unknown = replace(array, noise=replace(array.noise, correlation=np.eye(6)))
    for one, parameters, share in (
        (array, FilterParameters(), 1.0), (array, MOVING, 1.0), (unknown, MOVING, 1.0 - rho),
    ):  # fmt: skip
        expected = share * sigma**2
        found = parity_variances(one, parameters, changing=False).variance[0]
        assert (np.abs(found - expected) <= 4 * standard_errors(expected, samples)).all()


def test_faulty_stretches_do_not_count():
    array = simulated(12000, 200.0, np.ones(4), seed=9)
    array.rate[3000:6000, 2] *= 20.0
    clean = parity_variances(array.part(slice(6000, 12000)), MOVING, changing=False).variance[0]
    faults = (FaultEvent(2, "noise", 3000, 6000, 50.0, 20.0, "1"),)
    found = parity_variances(replace(array, faults=faults), MOVING, changing=False)
    np.testing.assert_allclose(found.variance[0], clean, rtol=0.1)
    inside = (found.start < 6000) & (found.stop > 3000)
    np.testing.assert_array_equal(found.excluded[:, 2], inside)
    assert (found.weights()[inside, 2] == 0).all()
    assert not found.excluded[:, [0, 1, 3]].any()


def test_pairs_of_second_moments():
    # Expected: the variance of the differences of the samples.
    y = np.random.default_rng(1).standard_normal((50, 4))
    np.testing.assert_allclose(
        pair_variances(y.T @ y / 50), ((y[:, :, None] - y[:, None, :]) ** 2).mean(axis=0), rtol=1e-10, atol=1e-14
    )


def test_too_little_to_go_by():
    with pytest.raises(CannotRun, match="one gyro"):
        parity_variances(simulated(1000, 200.0, [1.0]), MOVING)
    with pytest.raises(CannotRun, match="16 blocks"):
        parity_variances(simulated(700, 200.0, [1.0, 1.0, 1.0]), MOVING)
