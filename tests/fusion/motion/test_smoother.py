"""The smoother: against the dense posterior, filterpy, closed forms, and simulated truths."""

import math
from dataclasses import replace

import numpy as np
import pytest

from vgyro.errors import DataError
from vgyro.fusion.motion import smoother
from vgyro.fusion.motion.models import Motion, SpectralLine, SteadyGain, fixed_bandwidth, random_walk_keep
from vgyro.fusion.motion.noisy_rate import NoisyRate, Standstill
from vgyro.fusion.motion.start import wide_start

RATE = 20.0
MOTIONS = [
    Motion("random_walk", {"q": 3.0}, RATE),
    Motion("acceleration", {"q": 40.0}, RATE),
    Motion("jerk", {"q": 500.0}, RATE),
    Motion("markov", {"tau_s": 0.8, "sd": 2.0}, RATE),
    Motion("oscillator", {"frequency_hz": 0.5, "damping": 0.1, "sd": 2.0, "q": 0.01}, RATE),
    Motion(
        "oscillator", {"frequency_hz": 0.4, "damping": 0.3, "second_hz": 0.9, "second_damping": 0.06, "sd": 2.0}, RATE
    ),
]


def dense(z, r, motion, phi):
    """Posterior mean and variance of the rate, by one least-squares problem over the whole path.

    The path is linear in u ~ N(0, 1), start and steps in units of their roots; the noise has a dense covariance.
    """
    model = motion.dynamics()
    mean, spread = wide_start(z, r, model)
    samples, states = len(z), len(mean)
    root, step = np.linalg.cholesky(spread), semidefinite_root(model.process)
    path, state, middle = np.zeros((samples, samples * states)), np.zeros((states, samples * states)), np.empty(samples)
    for t in range(samples):
        state, mean = (model.transition @ state, model.transition @ mean) if t else (state, mean)
        state[:, t * states : (t + 1) * states] = step if t else root
        path[t], middle[t] = model.reads @ state, model.reads @ mean
    told = np.flatnonzero(np.isfinite(r))
    noise = np.sqrt(np.outer(r, r)[np.ix_(told, told)]) * phi ** np.abs(np.subtract.outer(told, told))
    white = np.linalg.inv(np.linalg.cholesky(noise))
    system = np.vstack([white @ path[told], np.eye(samples * states)])
    known = np.r_[white @ (z - middle)[told], np.zeros(samples * states)]
    orthogonal, triangle = np.linalg.qr(system)
    gain = np.linalg.solve(triangle.T, path.T)
    return middle + gain.T @ (orthogonal.T @ known), np.sum(gain**2, axis=0)


def semidefinite_root(matrix):
    values, vectors = np.linalg.eigh(matrix)
    return vectors * np.sqrt(np.maximum(values, 0.0))


def measured(samples, seed=4):
    rng = np.random.default_rng(seed)
    z, r = np.cumsum(rng.standard_normal(samples)), 10.0 ** rng.uniform(-1.5, 0.5, samples)
    r[[5, 6, samples // 2]] = np.inf
    return z, r


@pytest.mark.parametrize("phi", [0.0, 0.5])
@pytest.mark.parametrize("motion", MOTIONS, ids=lambda motion: motion.model)
def test_against_the_dense_posterior_and_filterpy(motion, phi):
    # Expected: np.linalg on the joint covariance of both stretches, one by one; and the reference engine, filterpy.
    z, r = measured(100)
    segment = np.repeat([0, 3], [60, 40])
    found = smoother.smooth(NoisyRate(z, r, segment, RATE, phi), motion)
    for part in (slice(0, 60), slice(60, 100)):
        rate, variance = dense(z[part], r[part], motion, phi)
        np.testing.assert_allclose(found.rate[part], rate, rtol=1e-8, atol=1e-8)
        np.testing.assert_allclose(found.variance[part], variance, rtol=1e-8)
    theirs = smoother.smooth(NoisyRate(z, r, segment, RATE, phi), motion, engine="reference")
    np.testing.assert_allclose(found.rate, theirs.rate, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(found.variance, theirs.variance, rtol=1e-8)
    assert found.passes == 0


@pytest.mark.parametrize("ratio", [1e-8, 1e-4, 1e-2, 1.0])
def test_random_walk_far_from_the_ends(ratio):
    # Expected: closed forms; the filter's variance is r(1-a), the smoother's r(1-a)/(1+a), half of it for a slow rate.
    samples, r = int(60 / math.sqrt(ratio)) + 200, 0.25
    motion = Motion("random_walk", {"q": ratio * r * RATE}, RATE)
    z = np.random.default_rng(1).standard_normal(samples)
    found = smoother.smooth(NoisyRate(z, r, np.zeros(samples, dtype=int), RATE), motion)
    keep = random_walk_keep(ratio)
    assert found.variance[samples // 2] == pytest.approx(r * (1 - keep) / (1 + keep), rel=1e-6)
    assert found.variance[-1] == pytest.approx(r * (1 - keep), rel=1e-6)
    if ratio <= 1e-4:
        assert math.sqrt(found.variance[samples // 2] / found.variance[-1]) == pytest.approx(1 / math.sqrt(2), rel=3e-3)
    assert found.passes == 2
    answer = (1 - keep) / (1 + keep) * keep ** np.abs(np.arange(samples) - samples // 2)
    assert found.rate[samples // 2] == pytest.approx(answer @ z, rel=1e-6, abs=1e-9)


def test_passes_only_of_a_first_order_low_pass():
    # Expected: by definition: constant r, white noise, random walk.
    z, walk = np.random.default_rng(1).standard_normal(50), MOTIONS[0]
    still = np.zeros(50, dtype=int)
    assert smoother.smooth(NoisyRate(z, np.full(50, 0.1), still, RATE), walk).passes == 2
    assert smoother.smooth(NoisyRate(z, np.linspace(0.1, 0.2, 50), still, RATE), walk).passes == 0
    assert smoother.smooth(NoisyRate(z, 0.1, still, RATE, 0.2), walk).passes == 0
    assert smoother.smooth(NoisyRate(z, 0.1, still, RATE), MOTIONS[1]).passes == 0


def test_no_smoothing():
    z, r = measured(30)
    found = smoother.smooth(NoisyRate(z, r, np.zeros(30, dtype=int), RATE), fixed_bandwidth(9.0, 1.0, RATE))
    np.testing.assert_array_equal(found.rate, z)
    np.testing.assert_array_equal(found.variance, r)
    assert math.isnan(found.bandwidth_hz)
    assert (found.passes, found.parameters) == (0, "no smoothing")


def test_a_stretch_that_says_nothing():
    z, r = measured(60)
    r[20:40], z[20:40] = np.inf, np.nan
    found = smoother.smooth(NoisyRate(z, r, np.repeat([0, 1, 2], 20), RATE), MOTIONS[1])
    assert np.isnan(found.rate[20:40]).all()
    assert np.isinf(found.variance[20:40]).all()
    assert np.isfinite(found.rate[:20]).all()
    assert np.isfinite(found.rate[40:]).all()


def test_fixed_bandwidth_claims_the_noise_that_it_leaves():
    # Expected: over the variance of what is made of white noise, known from the simulation, mean square / claim = 1.
    z = 0.5 * np.random.default_rng(3).standard_normal(200_000)
    found = smoother.smooth(NoisyRate(z, 0.25, np.zeros(len(z), dtype=int), 200.0), fixed_bandwidth(2.0, 0.25, 200.0))
    assert np.mean(found.rate**2 / found.variance) == pytest.approx(1.0, abs=0.03)
    assert found.bandwidth_hz == pytest.approx(2.0)


@pytest.mark.parametrize("motion", MOTIONS, ids=lambda motion: motion.model)
def test_at_rest_within_a_motion(motion):
    """Known truth: 20 s of a swing between rests of 100 s, at 0.3 deg/s, noise of 0.3 deg/s.

    At rest, 2 s from the motion and more, the error is that of the random walk by itself, within 1 %; in motion that of
    the motion's own smoother with the rest cut off, within 3 %: nothing of either side spoils the other.
    """
    rng, time = np.random.default_rng(5), np.arange(int(220 * RATE)) / RATE
    moving = (time >= 100) & (time < 120)
    swing = 3.0 * np.sin(2 * math.pi * 0.5 * (time - 100)) * np.sin(math.pi * (time - 100) / 20)
    truth = 0.3 + np.where(moving, swing, 0.0)
    z, still = truth + 0.3 * rng.standard_normal(len(time)), np.zeros(len(time), dtype=int)
    rest = fixed_bandwidth(0.5, 0.09, RATE)
    found = smoother.smooth(NoisyRate(z, 0.09, still, RATE), motion, standstill=Standstill(~moving, rest))
    alone = smoother.smooth(NoisyRate(z, 0.09, still, RATE), rest)
    cut = smoother.smooth(NoisyRate(z[moving], 0.09, still[moving], RATE), motion)
    far = (time < 98) | (time > 122)
    assert rms(found.rate[far] - truth[far]) == pytest.approx(rms(alone.rate[far] - truth[far]), rel=0.01)
    # A Markov rate knows its mean: that is worth 0.5 % of the first sample's variance.
    np.testing.assert_allclose(found.variance[time < 98], alone.variance[time < 98], rtol=0.005)
    assert rms(found.rate[moving] - truth[moving]) < 1.03 * rms(cut.rate - truth[moving])
    assert found.passes == 0
    assert "at rest random_walk" in found.parameters


def rms(values):
    return math.sqrt(np.mean(values**2))


@pytest.mark.parametrize("motion", MOTIONS)
def test_standstill_beside_a_line(motion):
    # Expected: a line of no size changes nothing, whatever the states of the model are.
    z = np.random.default_rng(3).standard_normal(300)
    at_rest, rest = np.arange(300) < 100, fixed_bandwidth(0.5, 1.0, RATE)
    with_line = replace(motion, lines=(SpectralLine(3.0, 0.01, 1e-7),))
    plain, other = (
        smoother.smooth(NoisyRate(z, 1.0, np.zeros(300, int), RATE), one, standstill=Standstill(at_rest, rest))
        for one in (motion, with_line)
    )
    assert other.rate == pytest.approx(plain.rate, abs=1e-6)
    assert other.variance == pytest.approx(plain.variance, rel=1e-6)


def test_what_does_not_fit():
    z, still = np.zeros(20), np.zeros(20, dtype=int)
    with pytest.raises(DataError, match="do not fit"):
        smoother.smooth(NoisyRate(z, np.ones(3), still, RATE), MOTIONS[0])
    with pytest.raises(DataError, match="coefficient 1"):
        smoother.smooth(NoisyRate(z, 1.0, still, RATE, 1.0), MOTIONS[0])
    with pytest.raises(DataError, match="the samples of 50 Hz"):
        smoother.smooth(NoisyRate(z, 1.0, still, 50.0), MOTIONS[0])
    with pytest.raises(DataError, match="every variance is infinite"):
        smoother.smooth(NoisyRate(z, np.inf, still, RATE), MOTIONS[0])
    with pytest.raises(DataError, match="random walk, not jerk"):
        smoother.smooth(NoisyRate(z, 1.0, still, RATE), MOTIONS[1], standstill=Standstill(still == 0, MOTIONS[2]))


def test_bandwidths_are_those_at_the_mean_variance():
    z, r = measured(100)
    found = smoother.smooth(NoisyRate(z, r, np.zeros(100, dtype=int), RATE, 0.3), MOTIONS[2])
    steady = SteadyGain(MOTIONS[2], float(r[np.isfinite(r)].mean()), 0.3)
    assert (found.bandwidth_hz, found.noise_bandwidth_hz) == (steady.bandwidth_hz(), steady.noise_bandwidth_hz())
