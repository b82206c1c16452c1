"""Vaccaro & Zaki's weights: closed forms of known R and Q, simulated gyros, singular Q, where there is no record."""

from dataclasses import replace

import numpy as np
import pytest

from vgyro.fusion import METHODS, ArrayNoise, ArrayRates, CannotRun, FilterParameters
from vgyro.fusion.papers.vaccaro_zaki import AllanDrift, drift_model, least_drift, vaccaro_zaki
from vgyro.fusion.rest_scales import own_scales
from vgyro.fusion.types import AllanScales
from vgyro.metrics import Sampling, allan_scales

PARAMETERS = FilterParameters()
WALK = np.array([1.0, 2.0, 1.5, 0.7]) * 1e-3
CORRELATION = np.array([[1, 0.3, -0.2, 0], [0.3, 1, 0.4, 0.1], [-0.2, 0.4, 1, 0.2], [0, 0.1, 0.2, 1]])
Q = np.outer(WALK, WALK) * CORRELATION
R = np.diag([0.02, 0.03, 0.02, 0.04]) ** 2 + 1e-4
TAU = 2.0 ** np.arange(-4, 10)
PAIRS = 2.0 ** np.arange(15, 1, -1.0)


def true_scales(white=R, walk=Q, pairs=PAIRS):
    return AllanScales(TAU, white[None] / TAU[:, None, None] + walk[None] * TAU[:, None, None] / 3, pairs)


def optimum(walk):
    solved = np.linalg.solve(walk, np.ones(len(walk)))
    return solved / solved.sum()


def record(seconds, seed, rate_hz=20.0, white=R, walk=Q):
    """Gyros at rest, with white noise of R and random walks of Q."""
    rng = np.random.default_rng(seed)
    samples, gyros = round(seconds * rate_hz), len(white)
    noise, steps = rng.standard_normal((2, samples, gyros))
    rate = noise @ np.linalg.cholesky(white).T * np.sqrt(rate_hz)
    rate += np.cumsum(steps @ np.linalg.cholesky(walk).T / np.sqrt(rate_hz), axis=0)
    unknown = ArrayNoise(np.full(gyros, np.nan), np.full(gyros, np.nan), np.eye(gyros))
    return ArrayRates(rate, rate_hz, np.zeros(samples, dtype=np.int32), np.ones(samples, dtype=bool), unknown)


def with_scales(array, scales):
    return replace(array, noise=replace(array.noise, scales=scales))


def test_exact_covariances_give_back_the_model():
    found = drift_model(true_scales())
    np.testing.assert_allclose(found.R, R, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(found.Q, Q, rtol=1e-9, atol=1e-18)
    weights, drift = least_drift(found)
    np.testing.assert_allclose(weights, optimum(Q), rtol=1e-9)
    assert drift == pytest.approx(1 / np.linalg.inv(Q).sum(), rel=1e-9)


def test_the_row_in_motion():
    # From the record, not from the rates: these move, and by what they have in common only.
    moving = record(20, 1)
    moving = with_scales(replace(moving, at_rest=np.zeros(len(moving.rate), dtype=bool)), true_scales())
    fused = METHODS["vaccaro_zaki"].fuse(moving, replace(PARAMETERS, in_motion=True))
    np.testing.assert_allclose(fused.weights, optimum(Q), rtol=1e-8)
    np.testing.assert_allclose(fused.rate, moving.rate @ optimum(Q), rtol=1e-8, atol=1e-9)
    assert fused.dc_gain == 1.0
    assert fused.note == f"drift of the combination {np.sqrt(1 / np.linalg.inv(Q).sum()):.3g} deg/s/√s"


def test_simulated_gyros():
    # Eight records of three hours: the drift of the combination over that of the optimum; equal weights have 1.4.
    best = np.sqrt(1 / np.linalg.inv(Q).sum())
    excess = []
    for seed in range(8):
        weights = vaccaro_zaki(record(10_800, seed), PARAMETERS).weights
        excess.append(np.sqrt(weights @ Q @ weights) / best)
    equal = np.sqrt(Q.mean()) / best
    assert np.mean(excess) < 1.15 < equal
    assert max(excess) < equal


def test_weights_of_the_settled_kalman_filter():
    # Expected: a filter of all random walks, x += white of Q·T, whose common part is the rate as good as unknown, gains
    # from slow errors only: y = b + n with w = c'y. For τ far beyond the crossing of R and Q, c'C(τ)c is least at c.
    slow = R / 1e6 + Q * 1e6 / 3
    np.testing.assert_allclose(least_drift(drift_model(true_scales()))[0], optimum(slow), atol=1e-3)


def test_a_singular_q():
    # Expected: numpy's pseudo-inverse. Two gyros share one walk; the fit makes Q of rank 3.
    walk = Q.copy()
    walk[3], walk[:, 3] = walk[2], walk[:, 2]
    walk[3, 3] = walk[2, 2]
    found = drift_model(true_scales(walk=walk))
    assert found.rank == 3
    inverse = np.linalg.pinv(walk, rcond=1e-9)
    np.testing.assert_allclose(least_drift(found)[0], inverse.sum(axis=0) / inverse.sum(), rtol=1e-6)
    fused = vaccaro_zaki(with_scales(record(5, 1), true_scales(walk=walk)), PARAMETERS)
    assert "Q has the rank 3 of 4: pseudo-inverse" in fused.note


def test_what_chance_makes_of_a_short_record_is_no_covariance_and_mended():
    for seed in range(5):
        found = drift_model(own_scales(record(30, seed)))
        assert np.linalg.eigvalsh(found.Q)[0] > -1e-12 * np.trace(found.Q)
        assert np.linalg.matrix_rank(found.Q, hermitian=True) <= found.rank


def test_a_gyro_without_a_walk():
    walk = Q.copy()
    walk[0], walk[:, 0] = 0, 0
    fused = vaccaro_zaki(with_scales(record(5, 1), true_scales(walk=walk)), PARAMETERS)
    assert fused.weights[0] == pytest.approx(0, abs=1e-9)
    assert "no random walk was found in gyro 1" in fused.note
    with pytest.raises(CannotRun, match="no random walk was found in any gyro"):
        least_drift(AllanDrift(R, np.zeros((4, 4)), 0))


def test_a_gyro_that_the_record_does_not_know():
    scales = true_scales()
    scales.covariance[:, 1], scales.covariance[:, :, 1] = np.nan, np.nan
    fused = vaccaro_zaki(with_scales(record(5, 1), scales), PARAMETERS)
    others = np.ix_([0, 2, 3], [0, 2, 3])
    np.testing.assert_allclose(fused.weights, np.insert(optimum(Q[others]), 1, 0.0), rtol=1e-8)
    assert "without gyro 2, of which no Allan covariance is known" in fused.note


def test_covariances_of_the_recording_itself():
    array = record(60, 2)
    segment = np.repeat([0, 1], [500, len(array.rate) - 500]).astype(np.int32)
    array = replace(array, segment=segment)
    expected = allan_scales(list(array.rate.T), Sampling.of(array.rate_hz, segment))
    found = own_scales(array)
    np.testing.assert_allclose(found.tau, expected.tau)
    np.testing.assert_allclose(found.covariance, expected.covariance, rtol=1e-9, atol=1e-14)
    np.testing.assert_allclose(found.pairs, expected.pairs)
    assert vaccaro_zaki(array, PARAMETERS).note.endswith("weights made from this very recording")


@pytest.mark.parametrize("name", ["vaccaro_zaki", "scale_wise_all", "scale_wise_large"])
def test_without_a_record_at_rest(name):
    array = record(10, 1)
    partly = replace(array, at_rest=np.arange(len(array.rate)) < 50)
    for one, parameters in ((partly, PARAMETERS), (array, replace(PARAMETERS, in_motion=True))):
        with pytest.raises(CannotRun, match="no record at rest"):
            METHODS[name].fuse(one, parameters)
    with pytest.raises(CannotRun, match="3 samples"):
        METHODS[name].fuse(array.part(slice(0, 3)), PARAMETERS)
