"""Constant variances, their outliers and memories: closed forms and dense algebra."""

import numpy as np
import pytest

from vgyro import engine as engines
from vgyro.fusion.noise.cornered_hat import _climb, best_weights, cornered_hat, outliers
from vgyro.fusion.noise.variance_model import chosen_memory, effective_share
from vgyro.fusion.rest_scales import own_scales

low_pass = engines.get("native").kalman.low_pass


def test_a_block_whose_neighbours_are_not_known_is_no_outlier():
    # Rule: sixteen times the largest of the eight about it, and 25 times the mean; zero: not known.
    square = np.zeros((120, 2))
    square[20:, 0], square[0, 0] = 1.0, 1000.0
    square[:, 1], square[60, 1] = 1.0, 1000.0
    assert np.argwhere(outliers(square)).tolist() == [[60, 1]]
    square[62, 1] = 63.0
    assert not outliers(square).any()
    square[62, 1] = 62.0
    assert outliers(square)[60, 1]


def test_variances_climb_to_the_greatest_likelihood():
    # Expected: the likelihood of the parity space, log|R| - log(1/1'R⁻¹1) + tr of e'R⁻¹e, by its differences: at the
    # variances that are found no step of 1 % is likelier.
    rng = np.random.default_rng(1)
    samples = rng.standard_normal((60, 4)) * np.array([1.0, 1.5, 2.0, 3.0])
    square = samples.T @ samples / 60
    off = np.eye(4) - 0.25

    def deviance(variance):
        weights = best_weights(variance[None], np.zeros((1, 4), bool), np.eye(4))
        residual = np.eye(4) - np.outer(np.ones(4), weights.weights[0])
        seen = np.diag(residual @ off @ square @ off @ residual.T)
        return float(np.log(variance).sum() - np.log(weights.variance[0]) + (seen / variance).sum())

    kept = np.ones((1, 4), bool)
    found = _climb(np.ones(4), (off @ square @ off)[None], np.array([60.0]), kept, np.eye(4))
    for gyro in range(4):
        for step in (0.99, 1.01):
            assert deviance(np.where(np.arange(4) == gyro, step, 1.0) * found) > deviance(found)
    np.testing.assert_allclose(cornered_hat(np.array([[0.0, 3.0, 4.0], [3.0, 0.0, 5.0], [4.0, 5.0, 0.0]])), [1, 2, 3])


@pytest.mark.parametrize(("block_s", "tau_s"), [(0.25, 0.5), (0.26, 1.0), (0.5, 1.0)])
def test_the_shortest_memory_is_two_blocks(block_s, tau_s):
    # Truth: variances that change by a factor of a hundred every six blocks: the shortest memory that may be predicts
    # best, of those of 0.5, 1, 2 s, … the first that is two blocks or longer.
    freedom = np.full(6000, 50.0)
    variance = np.where(np.arange(6000) // 6 % 2 == 0, 1.0, 100.0)
    square = variance * np.random.default_rng(1).chisquare(50.0, 6000) / 50.0
    assert chosen_memory(square, freedom, block_s, low_pass).tau_s == tau_s


def test_degrees_of_freedom_from_neighbours():
    # Truth: mean squares of 20 samples that count as 5, as neighbours scatter; blocks without any are left out.
    square = np.random.default_rng(2).chisquare(5.0, 20_000) / 5.0
    freedom = np.full(20_000, 20.0)
    assert effective_share(square, freedom) == pytest.approx(0.25, rel=0.05)
    freedom[::4], square[::4] = 0.0, 1e6
    assert effective_share(square, freedom) == pytest.approx(0.25, rel=0.05)


def test_scales_of_the_recording_itself(make_array):
    # Closed forms: τ of 1, 2, 4 … samples, to a quarter of the longest stretch, T/τ - 1 pairs of means in each stretch
    # that holds any; white noise has n²/τ.
    segment = np.repeat([0, 1], [4096, 1024])
    found = own_scales(make_array(5120, [0.1, 0.2], rate_hz=10.0, segment=segment))
    factors = 2.0 ** np.arange(11)
    np.testing.assert_allclose(found.tau, factors / 10.0)
    np.testing.assert_allclose(found.pairs, np.maximum(4096 / factors - 1, 0) + np.maximum(1024 / factors - 1, 0))
    np.testing.assert_allclose(found.covariance[0].diagonal(), np.array([0.1, 0.2]) ** 2 * 10.0, rtol=0.1)
    assert found.own
