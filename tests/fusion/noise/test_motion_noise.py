"""Noise that comes with the motion: simulated truth, closed forms, and what it does to weights and to heavy tails."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vgyro.fusion import METHODS, ArrayNoise, ArrayRates, FilterParameters
from vgyro.fusion.noise.motion_noise import LOUD, motion_noise
from vgyro.fusion.noise.parity import parity_variances
from vgyro.fusion.ours.prepared import prepared

RATE_HZ, SAMPLES = 100.0, 60_000
SIGMA = np.array([0.1, 0.1, 0.2, 0.2, 0.4, 0.4])
GYROS = len(SIGMA)
JITTER_S, SHARE = 0.4e-3, 4e-3
MOVING = FilterParameters(in_motion=True)
STILL_S = 300.0
"""The board rests so long, then turns."""


def motion() -> np.ndarray:
    """Rest, then turns of 60 and 20 deg/s r.m.s. at .2 and 1.1 Hz."""
    time = np.arange(SAMPLES) / RATE_HZ
    turning = 85.0 * np.sin(2 * np.pi * 0.2 * time) + 28.0 * np.sin(2 * np.pi * 1.1 * time + 1.0)
    return np.where(time < STILL_S, 0.0, turning)


def simulated(seed: int, jitter_s: float = JITTER_S, share: float = SHARE) -> tuple[ArrayRates, np.ndarray]:
    """White gyros whose instants jitter, and whose errors grow with the rate; and the true rate."""
    truth = motion()
    rng = np.random.default_rng(seed)
    own, late, odd = rng.standard_normal((3, SAMPLES, GYROS))
    derivative = np.gradient(truth, 1.0 / RATE_HZ)[:, None]
    rate = truth[:, None] + own * SIGMA + late * jitter_s * derivative + odd * share * truth[:, None]
    noise = ArrayNoise(SIGMA / np.sqrt(RATE_HZ), np.zeros(GYROS), np.eye(GYROS))
    none = np.zeros(SAMPLES, dtype=bool)
    return ArrayRates(np.asfortranarray(rate), RATE_HZ, np.zeros(SAMPLES, dtype=np.int32), none, noise), truth


@pytest.mark.parametrize(("jitter_s", "share"), [(JITTER_S, SHARE / 3), (JITTER_S, 0.0), (0.0, SHARE)])
def test_jitter_and_share_are_those_simulated(jitter_s, share):
    found = motion_noise(simulated(1, jitter_s, share)[0])
    assert found is not None
    assert found.jitter_s == pytest.approx(jitter_s, rel=0.05, abs=0.05e-3)
    assert found.share == pytest.approx(share, rel=0.05, abs=0.5e-3)
    assert found.usual == pytest.approx(np.mean(SIGMA**2), rel=0.03)


@pytest.mark.parametrize(("share", "seen"), [(0.0, False), (0.5e-3, False), (1.5e-3, True)])
def test_it_must_pay_for_itself(share, seen):
    """White noise has none. With Σν = 300,000 the price is 25, and the deviance some Σν/4·var(q/σ²): 4 and 400."""
    assert (motion_noise(simulated(2, 0.0, share)[0]) is not None) == seen


@pytest.mark.parametrize(("step", "seen"), [(0.24, True), (0.32, False)])
def test_of_gyros_whose_noise_is_below_their_step_nothing_is_said(step, seen):
    """The mean variance, with that of the rounding, is (.27 deg/s)² to (.28 deg/s)²."""
    array, _ = simulated(6)
    rounded = replace(array, rate=np.asfortranarray(np.round(array.rate / step) * step))
    assert (motion_noise(rounded) is not None) == seen


def test_in_motion_gyros_count_alike_and_at_rest_by_their_noise():
    """Closed form: w ∝ 1/(σ² + q) with q = (a·ẇ)² + (c·w)²."""
    array, truth = simulated(3)
    found = parity_variances(array, MOVING)
    assert found.added is not None
    weights = found.weights()
    derivative = np.gradient(truth, 1.0 / RATE_HZ)
    q = (JITTER_S * derivative) ** 2 + (SHARE * truth) ** 2
    q = np.array([q[one:two].mean() for one, two in zip(found.start, found.stop, strict=True)])
    expected = 1.0 / (SIGMA**2 + q[:, None])
    expected /= expected.sum(axis=1, keepdims=True)
    loud = q > LOUD * np.mean(SIGMA**2)
    assert loud.sum() > 500
    assert (~loud).sum() > 500
    np.testing.assert_allclose(weights, expected, atol=0.02)
    assert "comes with the motion" in found.note


def test_what_motion_adds_is_correlated_with_nothing():
    """Closed form: u = R⁻¹1/(1'R⁻¹1), R = σσ'∘C + q·I, and its variance u'Ru."""
    array, _ = simulated(3)
    C = np.full((GYROS, GYROS), 0.4) + 0.6 * np.eye(GYROS)
    found = replace(parity_variances(array, MOVING), correlation=C)
    weights, variance = found.weights(), found.combined_variance()
    assert found.added is not None
    for block in (0, int(np.argmax(found.added))):
        sigma = np.sqrt(found.variance[block] - found.added[block])
        R = np.outer(sigma, sigma) * C + found.added[block] * np.eye(GYROS)
        u = np.linalg.solve(R, np.ones(GYROS))
        np.testing.assert_allclose(weights[block], u / u.sum(), rtol=1e-9)
        assert variance[block] == pytest.approx(1.0 / u.sum(), rel=1e-9)
    more = found.scaled(np.full(GYROS, 4.0))
    np.testing.assert_allclose(more.variance - found.added[:, None], 4.0 * (found.variance - found.added[:, None]))


def test_better_than_average_and_inverse_variance():
    """Neither is right throughout: the one is at rest not, the other is not in motion."""
    array, truth = simulated(4)
    errors = {
        name: np.std(METHODS[name].fuse(array, MOVING).rate - truth)
        for name in ("average", "inverse_variance_arw", "recommended_unsmoothed")
    }
    assert errors["recommended_unsmoothed"] < 0.99 * min(errors["average"], errors["inverse_variance_arw"])
    without = replace(MOVING, without=frozenset({"motion"}))
    assert (
        np.std(METHODS["recommended_unsmoothed"].fuse(array, without).rate - truth)
        > 1.01 * errors["recommended_unsmoothed"]
    )


def test_where_the_motion_adds_noise_no_sample_is_taken_for_a_tail():
    array, _ = simulated(5)
    found = motion_noise(array)
    assert found is not None
    loud = found.loud_samples()
    ready = prepared(array, replace(MOVING, without=frozenset({"response", "clipped"}))).array
    np.testing.assert_array_equal(ready.rate[loud], array.rate[loud])
