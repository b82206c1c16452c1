"""Variances that change: averages against dense sums, fusion against oracles."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from vgyro import engine as engines
from vgyro.fusion import ArrayNoise, ArrayRates, FilterParameters, SampleWeights
from vgyro.fusion.events import FaultEvent
from vgyro.fusion.noise.parity import parity_variances
from vgyro.fusion.noise.variance_model import Memory, chosen_memory, effective_share
from vgyro.fusion.ours.parity_weights import parity_weights, residual_weights

MOVING = FilterParameters(in_motion=True)
low_pass = engines.get("native").kalman.low_pass


def simulated(samples, rate_hz, sigma, truth=0.0, seed=0, faults=()):
    """White gyros of noise `sigma` [N] or [T, N] deg/s a sample."""
    gyros = np.asarray(sigma).shape[-1]
    noise = np.random.default_rng(seed).standard_normal((samples, gyros)) * sigma
    rate = np.asfortranarray(np.asarray(truth)[..., None] + noise)
    of_array = ArrayNoise(np.ones(gyros), np.ones(gyros), np.eye(gyros))
    segment, at_rest = np.zeros(samples, dtype=np.int32), np.zeros(samples, dtype=bool)
    return ArrayRates(rate, rate_hz, segment, at_rest, of_array, faults=faults)


def faulty(samples, rate_hz, seed):
    """True s.d. [T, 6]: gyro 4 has five times the noise, gyros 1 and 2 have 10 s bursts of eight times the noise."""
    sigma = np.ones((samples, 6))
    sigma[:, 3] = 5.0
    rng, length = np.random.default_rng(1000 + seed), round(10 * rate_hz)
    for gyro in (0, 1):
        for begin in rng.integers(0, samples - length, 4):
            sigma[begin : begin + length, gyro] = 8.0
    return sigma


@pytest.mark.parametrize("tau", [0.7, 5.0, math.inf])
def test_two_sided_average_dense(tau):
    # Expected: Σ ν_c·keep^|b - c|·x_c / Σ ν_c·keep^|b - c|, with and without c = b, written out as matrices.
    rng = np.random.default_rng(2)
    x, freedom = rng.chisquare(5, 80) / 5, rng.integers(0, 30, 80).astype(float)
    keep = math.exp(-0.25 / tau)
    share = keep ** np.abs(np.subtract.outer(np.arange(80), np.arange(80))) * freedom
    alone = share * (1 - np.eye(80))
    found = Memory(keep, tau).average(x, freedom, low_pass)
    np.testing.assert_allclose(found[0], share @ x / share.sum(axis=1), rtol=1e-9)
    np.testing.assert_allclose(found[1], alone @ x / alone.sum(axis=1), rtol=1e-9)


@pytest.mark.parametrize("nu", [1, 4, 50])
def test_degrees_of_freedom_from_neighbours(nu):
    # Expected: ν, as that of the simulated χ².
    x = np.random.default_rng(nu).chisquare(nu, 40000) / nu
    assert effective_share(x, np.full(40000, 100.0)) == pytest.approx(nu / 100.0, rel=0.05)


def test_time_constant_follows_the_data():
    # Expected: constant for white noise, a short EWMA for a variance that wanders fast or jumps.
    rng = np.random.default_rng(3)
    freedom, white = np.full(4000, 50.0), rng.chisquare(50, 4000) / 50
    assert chosen_memory(white, freedom, 0.25, low_pass).tau_s == math.inf
    jump = chosen_memory(white * np.where(np.arange(4000) // 1000 % 2, 9.0, 1.0), freedom, 0.25, low_pass)
    assert jump.tau_s <= 10.0
    wander = np.exp(lfilter([0.1], [1, -0.99], rng.standard_normal(4000)))
    quick = chosen_memory(white * wander, freedom, 0.25, low_pass)
    assert quick.tau_s <= 10.0


@pytest.mark.parametrize(("samples", "rate_hz"), [(12000, 200.0), (3600, 1.0)])
@pytest.mark.parametrize("seed", range(8))
def test_white_identical_gyros_lose_nothing(samples, rate_hz, seed):
    # Expected: the error of the plain average, which is the best there is, within 1 %; the known loss below 0.5 %.
    array = simulated(samples, rate_hz, np.ones(6), seed=seed)
    found = parity_variances(array, MOVING)
    loss = math.sqrt(6.0 * np.average((found.weights() ** 2).sum(axis=1), weights=found.shares)) - 1.0
    assert loss <= 0.005
    for method in (parity_weights, residual_weights):
        assert method(array, MOVING).rate.std() <= 1.01 * array.rate.mean(axis=1).std()


@pytest.mark.parametrize("seed", range(8))
def test_faulty_array_in_motion(seed):
    # Expected: the error of the combination that knows the true R_t; stated bound 1.03 of it.
    samples, rate_hz = 60000, 200.0
    truth = 20.0 * np.sin(2 * np.pi * 0.5 * np.arange(samples) / rate_hz)
    sigma = faulty(samples, rate_hz, seed)
    array = simulated(samples, rate_hz, sigma, truth, seed)
    oracle = (array.rate / sigma**2).sum(axis=1) / (1.0 / sigma**2).sum(axis=1)
    found = residual_weights(array, MOVING)
    best = (oracle - truth).std()
    assert (found.rate - truth).std() <= 1.03 * best
    assert (parity_weights(array, MOVING).rate - truth).std() > 1.03 * best, "constant weights must not do"


def test_weights_are_those_of_the_dense_covariances():
    # Expected: R⁻¹1/(1'R⁻¹1) of R_t = σσ'∘C, block by block, of either sign.
    correlation = np.full((4, 4), 0.3) + 0.7 * np.eye(4)
    sigma = 1.0 + np.outer(np.arange(9000) >= 4000, [2.0, 0.0, 0.0, 0.5])
    white = np.random.default_rng(5).standard_normal((9000, 4)) @ np.linalg.cholesky(correlation).T
    array = simulated(9000, 100.0, np.ones(4))
    array = replace(array, rate=white * sigma, noise=replace(array.noise, correlation=correlation))
    found = parity_variances(array, FilterParameters())
    R = np.sqrt(found.variance[:, :, None] * found.variance[:, None, :]) * found.correlation
    weights = found.weights()
    solved = np.linalg.solve(R, np.ones((len(R), 4, 1)))[..., 0]
    np.testing.assert_allclose(weights, solved / solved.sum(axis=1, keepdims=True), atol=1e-8)
    np.testing.assert_allclose(found.combined_variance(), np.einsum("bi,bij,bj->b", weights, R, weights), rtol=1e-10)
    assert np.ptp(weights[:, 0]) > 0.1


def test_gyros_at_fault_have_no_weight():
    # Expected: the others' weights as if the gyro were not there; equal weights where all are at fault.
    faults = tuple(FaultEvent(gyro, "noise", 4000, 5000, 9.0, 2.0, "1") for gyro in range(4))
    faults += (FaultEvent(2, "burst", 1000, 3000, 9.0, 30.0, "1"),)
    array = simulated(12000, 200.0, [1.0, 2.0, 1.0, 1.5], seed=4, faults=faults)
    array.rate[1000:3000, 2] *= 30.0
    found = parity_variances(array, MOVING)
    weights, block = found.weights(), found.block_of_sample()
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, atol=1e-12)
    one = weights[block[2000]]
    inverse = 1.0 / found.variance[block[2000]][[0, 1, 3]]
    assert one[2] == 0.0
    np.testing.assert_allclose(one[[0, 1, 3]], inverse / inverse.sum(), rtol=1e-9)
    np.testing.assert_allclose(weights[block[4500]], 0.25)
    assert "8.3% of the samples: every gyro" in found.note
    assert found.variance[block[2000], 2] == pytest.approx(1.0, rel=0.2), "the neighbours' variance, not the fault's"


@pytest.mark.parametrize("rate_hz", [200.0, 1.0])
@pytest.mark.parametrize("noise", [0.0, 1e-5])
def test_stuck_gyro_at_rest(rate_hz, noise):
    # A gyro that measures nothing looks perfect at rest. Expected: no weight while stuck, its share before.
    array = simulated(6000, rate_hz, np.ones(5), seed=6)
    array.rate[3000:, 3] = 0.3 + noise * array.rate[3000:, 3]
    found = parity_variances(array, MOVING)
    weights, block = found.weights(), found.block_of_sample()
    assert (weights[block[3050:], 3] == 0).all()
    assert (weights[block[:2900], 3] > 0.15).all()
    array.rate[:, 3] = 0.3 + noise * array.rate[:, 3]
    for method in (parity_weights, residual_weights):
        used = method(array, MOVING).weights
        used = np.concatenate(list(used.pieces())) if isinstance(used, SampleWeights) else used[None]
        assert (used[:, 3] == 0).all()
        np.testing.assert_allclose(used[:, [0, 1, 2, 4]], 0.25, atol=0.02)


@pytest.mark.parametrize("rate_hz", [200.0, 1.0])
def test_an_outlier_harms_one_gyro_alone(rate_hz):
    # Expected: no weight for the gyro in that block, and the others' share as ever.
    array = simulated(6000, rate_hz, np.ones(5), seed=7)
    array.rate[3000, 1] = 500.0
    found = parity_variances(array, MOVING)
    block = found.block_of_sample()[3000]
    assert found.weights()[block, 1] < 1e-3
    np.testing.assert_allclose(found.weights()[block, [0, 2, 3, 4]], 0.25, atol=0.01)
    np.testing.assert_allclose(found.weights()[block + 1], 0.2, atol=0.01)


@pytest.mark.parametrize("method", [parity_weights, residual_weights])
def test_a_common_rate_adds_itself(method):
    # Expected: nothing but the rate is added, whatever it is.
    array = simulated(6000, 100.0, faulty(6000, 100.0, 3), seed=3)
    truth = 50.0 * np.sin(np.arange(6000) / 70.0)
    moved = replace(array, rate=array.rate + truth[:, None])
    before, after = (method(one, MOVING).rate for one in (array, moved))
    np.testing.assert_allclose(after, before + truth, atol=1e-6)


def coloured(samples, sigma, phi, seed):
    """AR(1) noise of variances σ²."""
    white = np.random.default_rng(seed).standard_normal((samples, len(sigma)))
    return lfilter([math.sqrt(1 - phi**2)], [1, -phi], white, axis=0) * sigma


def test_colour_of_a_sensor_pole():
    # Expected: φ = e^(-2π·40/500) of a first-order low-pass at 40 Hz, sampled at 500 Hz; variances with the colour.
    phi, samples = math.exp(-2 * math.pi * 40 / 500), 30000
    sigma = np.array([1.0, 1.0, 2.0, 5.0, 1.0, 1.0])
    array = simulated(samples, 500.0, np.ones(6), seed=1)
    truth = 20.0 * np.sin(np.arange(samples) * np.pi / 500.0)
    array = replace(array, rate=np.asfortranarray(truth[:, None] + coloured(samples, sigma, phi, 1)))
    found = parity_variances(array, MOVING)
    np.testing.assert_allclose(found.phi, phi, atol=0.02)
    assert found.colour() == pytest.approx(phi, abs=0.02)
    np.testing.assert_allclose(found.variance, np.broadcast_to(sigma**2, found.variance.shape), rtol=0.08)
    assert np.isinf(found.tau_s).all(), "colour is no change of the variance"


@pytest.mark.parametrize(("samples", "rate_hz"), [(30000, 500.0), (3600, 1.0)])
def test_white_noise_has_no_colour(samples, rate_hz):
    # Expected: φ = 0; at three standard errors one of 740 is not.
    found = [parity_variances(simulated(samples, rate_hz, np.ones(6), seed=s), MOVING, False).phi for s in range(6)]
    assert (np.array(found) > 0).sum() <= 1


def test_colour_of_two_gyros_and_of_a_dead_one():
    # Expected: φ = 0.8 of the gyros that measure.
    rate = coloured(20000, np.ones(3), 0.8, 2)
    pair = replace(simulated(20000, 200.0, np.ones(2)), rate=np.asfortranarray(rate[:, :2]))
    np.testing.assert_allclose(parity_variances(pair, MOVING, False).phi, 0.8, atol=0.02)
    rate[:, 1] = 0.0
    three = replace(simulated(20000, 200.0, np.ones(3)), rate=np.asfortranarray(rate))
    np.testing.assert_allclose(parity_variances(three, MOVING, False).phi, [0.8, 0.0, 0.8], atol=0.02)
