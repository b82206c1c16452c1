"""What the biases follow beside their walks: a warm-up is found where there is one. Expected: the simulated truth."""

from dataclasses import replace

import numpy as np
import pytest

from vgyro.fusion import ArrayNoise, ArrayRates, FilterParameters
from vgyro.fusion.bias.estimate import slow_errors
from vgyro.fusion.bias.model import Walk
from vgyro.fusion.events import FaultEvent

ARW, RRW, GYROS, SECONDS, SETTLES = 0.03, 5e-4, 6, 900, 200.0
MOVING = FilterParameters(in_motion=True)
NOISE = ArrayNoise(np.full(GYROS, ARW), np.full(GYROS, RRW), np.eye(GYROS))
SIZES = np.array([0.31, 0.18, -0.24, -0.08, -0.14, -0.23])


def record(seed, sizes, walk=RRW, still=False):
    """Means of 1 s, and the true slow errors."""
    rng, time = np.random.default_rng(seed), np.arange(SECONDS, dtype=float)
    truth = 0.05 * rng.standard_normal(GYROS) + np.cumsum(walk * rng.standard_normal((SECONDS, GYROS)), axis=0)
    truth = truth + np.outer(np.exp(-time / SETTLES), sizes)
    rate = truth + ARW * rng.standard_normal((SECONDS, GYROS))
    rate += 0.0 if still else 20.0 * np.sin(time / 5.0)[:, None]
    return ArrayRates(rate, 1.0, np.zeros(SECONDS, int), np.full(SECONDS, still), NOISE), truth


def common_error(slow, truth):
    """S.d. of the error of the mean of the gyros over time."""
    return float((slow.bias - truth).mean(axis=1).std())


@pytest.mark.parametrize("seed", range(3))
def test_a_warm_up_is_no_walk_of_the_gyro_with_the_largest(seed):
    """Its common part is in no difference; walks of unequal size would lay it on the gyros that settle most."""
    array, truth = record(seed, SIZES)
    slow = slow_errors(array, MOVING, NOISE.arw**2)
    assert "settle, as in a warm-up" in slow.note
    assert slow.temperature is None
    walks = slow_errors(array, replace(MOVING, without=frozenset({"warm_up"})), NOISE.arw**2)
    assert "warm-up" not in walks.note
    average = float(truth.mean(axis=1).std())
    assert common_error(slow, truth) < 1.1 * average
    assert common_error(walks, truth) > 1.5 * average
    own = (slow.bias - truth) - (slow.bias - truth).mean(axis=1)[:, None]
    assert own.std() < 0.01


@pytest.mark.parametrize(("size", "found"), [(0.1, False), (1.0, True)])
def test_a_small_warm_up_is_left_to_the_walks(size, found):
    array, _ = record(5, size * SIZES)
    assert ("warm-up" in slow_errors(array, MOVING, NOISE.arw**2).note) == found


def test_fast_walks_are_no_warm_up():
    for seed in range(3):
        array, _ = record(seed, 0.0 * SIZES, walk=10 * RRW)
        assert "warm-up" not in slow_errors(array, MOVING, NOISE.arw**2).note


def test_given_walks_stay_as_they_are():
    array, _ = record(1, SIZES)
    slow = slow_errors(array, MOVING, NOISE.arw**2, walk=Walk(np.full(GYROS, RRW)))
    assert "warm-up" not in slow.note


def test_at_rest_as_a_whole_the_common_part_is_seen():
    array, truth = record(2, SIZES + 0.3, still=True)
    slow = slow_errors(array, FilterParameters(), NOISE.arw**2)
    assert "settle, as in a warm-up" in slow.note
    assert common_error(slow, truth) < 0.3 * float(truth.mean(axis=1).std())


def test_with_a_temperature_that_says_it_no_warm_up_is_looked_for():
    array, _ = record(3, SIZES)
    warm = replace(array, temperature=40.0 - 20.0 * np.exp(-np.arange(SECONDS) / SETTLES))
    note = slow_errors(warm, MOVING, NOISE.arw**2).note
    assert "regressed on the temperature" in note
    assert "warm-up" not in note


@pytest.mark.parametrize("follows", ["warm-up", "temperature"])
def test_with_a_gyro_that_no_block_uses(follows):
    """At fault throughout: its slow error is what the prior says, and the others' are as without it."""
    array, truth = record(4, SIZES)
    if follows == "temperature":
        array = replace(array, temperature=40.0 - 20.0 * np.exp(-np.arange(SECONDS) / SETTLES))
    dead = FaultEvent(2, "dead", 0, SECONDS, 99.0, np.nan, "")
    slow = slow_errors(replace(array, faults=(dead,)), MOVING, NOISE.arw**2)
    assert follows in slow.note
    others = np.delete(np.arange(GYROS), 2)
    own = (slow.bias - truth)[:, others]
    assert (own - own.mean(axis=1)[:, None]).std() < 0.01
    assert np.isfinite(slow.covariance).all()


def test_a_healthy_array_costs_no_look_for_a_warm_up(monkeypatch):
    monkeypatch.setattr("vgyro.fusion.bias.followed.quick_gains", None)
    slow_errors(record(1, 0.0 * SIZES)[0], MOVING, NOISE.arw**2)
    with pytest.raises(TypeError):
        slow_errors(record(1, SIZES)[0], MOVING, NOISE.arw**2)


@pytest.mark.parametrize(("over", "found"), [(-0.1, False), (0.1, True)])
def test_a_warm_up_costs_its_time_constant(monkeypatch, over, found):
    """2Δ log L of ln(blocks) more than the coefficients alone cost.  over : that, in units of log L"""
    from vgyro.fusion.bias import followed

    real = followed.choose

    def near(evidence, *arguments):
        choice = real(evidence, *arguments)
        gain = choice.needed + np.log(SECONDS) + over
        return replace(choice, slopes_gain=gain) if evidence.has_slopes else choice

    monkeypatch.setattr(followed, "choose", near)
    assert ("warm-up" in slow_errors(record(1, SIZES)[0], MOVING, NOISE.arw**2).note) == found


def test_at_rest_the_slopes_common_part_is_not_drawn_to_zero():
    """The spread of the slopes says nothing of their mean, which a constant rate shows: .01 deg/s/K ± .0001."""
    slopes = 0.01 + 1e-3 * np.array([1, -1, 2, -2, 1.5, -1.5])
    degrees, found = 25.0 + 30.0 * np.linspace(-0.5, 0.5, SECONDS), []
    for seed in range(4):
        array, _ = record(seed, 0.0 * SIZES, still=True)
        warm = replace(array, rate=array.rate + np.outer(degrees - 25.0, slopes), temperature=degrees)
        found.append(slow_errors(warm, FilterParameters(), NOISE.arw**2).temperature.slope.mean())
    assert np.mean(found) == pytest.approx(0.01, abs=0.0004)
