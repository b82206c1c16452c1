"""Biases that depend on temperature, against simulated truth: slopes, what is shared, and where none is fitted."""

from dataclasses import replace

import numpy as np
import pytest
from slow_gyros import ARW, EQUAL, MOVING, RRW, SEEDS, simulated

from vgyro.fusion import FilterParameters
from vgyro.fusion.bias.estimate import combined_without, slow_errors
from vgyro.fusion.bias.model import Walk


@pytest.mark.full
def test_temperature_slopes_are_found():
    # Expected: differences of the true slopes, (found - true)/s.d. of mean square 1 over 8 seeds and 5 differences; and
    # with standstill their mean as well.
    slopes = np.array([0.03, -0.02, 0.01, 0.05, -0.04, 0.0])
    temperature = 30.0 + 6.0 * np.sin(np.arange(600) / 30.0)
    at_rest = np.arange(600) % 150 < 30
    squares, common = [], []
    for seed in SEEDS:
        array, _ = simulated(600, seed, temperature=temperature, slopes=slopes)
        found = slow_errors(array, MOVING, ARW**2).temperature
        contrast = np.diff(np.eye(6), axis=0)
        error, covariance = contrast @ (found.slope - slopes), contrast @ found.covariance @ contrast.T
        squares.append(error @ np.linalg.solve(covariance, error) / 5)
        resting, _ = simulated(600, seed, at_rest=at_rest, temperature=temperature, slopes=slopes)
        found = slow_errors(resting, MOVING, ARW**2).temperature
        common.append((found.slope - slopes).mean() / np.sqrt(EQUAL @ found.covariance @ EQUAL))
    # chi² of 40 degrees of freedom over 40, 99 %: 0.55 to 1.65; of 8 over 8: 0.17 to 2.7.
    assert 0.55 < np.mean(squares) < 1.65
    assert 0.17 < np.mean(np.square(common)) < 2.7


def test_shared_slope_at_rest_as_a_whole():
    # Expected: the mean of the true slopes, within its s.d. (mean square of 8 values: chi², 0.17 to 2.7 at 99 %), for a
    # rate that is one constant of any size, and that constant is left in the result.
    temperature = 30.0 + 6.0 * (1 - np.exp(-np.arange(600) / 150.0))
    slopes = np.array([0.03, -0.02, 0.01, 0.05, -0.04, 0.02])
    errors = []
    for seed in SEEDS:
        array, _ = simulated(
            600, seed, spread=0.02, at_rest=np.ones(600, dtype=bool), temperature=temperature, slopes=slopes
        )
        walk = Walk(RRW)
        found = slow_errors(array, FilterParameters(), ARW**2, walk=walk)
        errors.append(
            (found.temperature.slope - slopes) @ EQUAL / np.sqrt(EQUAL @ found.temperature.covariance @ EQUAL)
        )
        moved = replace(array, rate=array.rate + 7.0)
        again = slow_errors(moved, FilterParameters(), ARW**2, walk=walk)
        difference = combined_without(moved, EQUAL, again) - combined_without(array, EQUAL, found)
        np.testing.assert_allclose(difference, 7.0, atol=1e-9)
        # In motion nothing says so: the s.d. is larger by far.
        turning = slow_errors(replace(array, at_rest=~array.at_rest), MOVING, ARW**2, walk=walk)
        assert EQUAL @ turning.temperature.covariance @ EQUAL > 4 * EQUAL @ found.temperature.covariance @ EQUAL
    assert 0.17 < np.mean(np.square(errors)) < 2.7


@pytest.mark.full
def test_drift_is_not_taken_for_temperature():
    # Expected: no slopes, for there are none, though the temperature drifts as the biases do. K is not known well.
    temperature = 30.0 + 10.0 * np.linspace(0, 1, 1000) ** 0.5
    for seed in SEEDS:
        array, _ = simulated(1000, seed, temperature=temperature)
        array = replace(array, noise=replace(array.noise, rrw=RRW / 3))
        slow = slow_errors(array, MOVING, ARW**2)
        assert slow.temperature is None
        assert "not regressed on the temperature" in slow.note


def test_when_the_temperature_is_not_used():
    array, _ = simulated(300, 1, temperature=30.0 + 0.4 * np.sin(np.arange(300) / 30.0))
    assert "temperature within 0.8 K: not regressed on" in slow_errors(array, MOVING, ARW**2).note
    assert "temperature is off" in slow_errors(array, replace(MOVING, temperature="off"), ARW**2).note
    holes = replace(array, temperature=np.where(np.arange(300) < 5, np.nan, array.temperature))
    assert "temperature unknown in 5 of 300 blocks" in slow_errors(holes, MOVING, ARW**2).note
