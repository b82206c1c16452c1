"""Angle drift against closed forms and simulated noise; its bound against both."""

from __future__ import annotations

import math

import numpy as np
import pytest

from vgyro.metrics.allan.coefficients import Coefficient
from vgyro.metrics.angle import AngleGrid
from vgyro.metrics.sampling import Sampling

HOUR = 3600
N, B, K = 0.1, 0.01, 0.001


def grid_of(samples, rate_hz=1.0, **keywords):
    return AngleGrid.of(Sampling.of(rate_hz, np.zeros(samples, dtype=np.int32)), **keywords)


def white(rng, samples):
    return N * rng.standard_normal(samples)


def walk(rng, samples):
    """Means over 1 s of a random walk, nearly: those of its values at both ends."""
    values = np.concatenate([[0.0], np.cumsum(K * rng.standard_normal(samples))])
    return (values[1:] + values[:-1]) / 2


def flicker(rng, samples):
    """Means over 1 s of noise with the density B²/(2πf) from 1/(16 samples) to 2 Hz."""
    size = 64 * samples
    frequency = np.fft.rfftfreq(size, 0.25)
    density = np.zeros(len(frequency))
    density[1:] = B**2 / (2 * math.pi * frequency[1:])
    parts = rng.standard_normal((2, len(frequency)))
    series = np.fft.irfft(np.sqrt(density * size * 4 / 2) * (parts[0] + 1j * parts[1]), size)
    return series[: 4 * samples].reshape(-1, 4).mean(axis=1)


def test_integrals_are_those_of_a_direct_sum():
    # By hand: r.m.s. of the sums of all 60-sample windows of the error without its mean.
    error = np.random.default_rng(1).standard_normal(1000) + 5.0
    sums = np.convolve(error - error.mean(), np.ones(60), mode="valid")
    found = grid_of(1000).drift(error)
    assert found.value == pytest.approx(math.sqrt(np.mean(sums**2)), rel=1e-12)
    assert found.low < found.value < found.high


def test_bounds_in_closed_form():
    # White noise: N²τ(1 - τ/T). Random walk over T >> τ: K²τ²T/6, its variance about its own mean. A ramp of R: nearly
    # R·τ·(T - τ)/√12.
    found = grid_of(HOUR)
    assert found.bound(N).value == pytest.approx(N * math.sqrt(60 * (1 - 60 / HOUR)), rel=1e-12)
    day = grid_of(86_400)
    assert day.bound(0.0, 0.0, K).value == pytest.approx(K * 60 * math.sqrt(86_400 / 6), rel=1e-3)
    assert found.bound(0.0, 0.0, 0.0, 1e-4).value == pytest.approx(1e-4 * 60 * (HOUR - 60) / math.sqrt(12), rel=1e-3)
    parts = [found.bound(N).value, found.bound(0.0, B).value, found.bound(0.0, 0.0, K).value]
    assert found.bound(N, B, K).value == pytest.approx(math.sqrt(np.sum(np.square(parts))), rel=1e-12)


@pytest.mark.parametrize(("make", "coefficients"), [(white, (N,)), (flicker, (0.0, B)), (walk, (0.0, 0.0, K))])
def test_bound_is_the_mean_square_of_simulated_noise(make, coefficients):
    # 150 recordings of 480 s; the mean square has a standard error of 3 to 7 %: four of those.
    grid, rng = grid_of(480), np.random.default_rng(2)
    squares = [grid.drift(make(rng, 480)).value ** 2 for _ in range(150)]
    error = float(np.std(squares)) / math.sqrt(len(squares))
    assert grid.bound(*coefficients).value ** 2 == pytest.approx(float(np.mean(squares)), abs=4 * error)
    assert error < 0.08 * np.mean(squares)


@pytest.mark.parametrize(("make", "coefficients"), [(white, (N,)), (walk, (0.0, 0.0, K))])
def test_limits_hold_the_expected_drift(make, coefficients):
    # 95 % limits, 200 hours of each noise: at least 90 %.
    grid, rng = grid_of(HOUR), np.random.default_rng(3)
    expected = grid.bound(*coefficients).value
    drifts = [grid.drift(make(rng, HOUR)) for _ in range(200)]
    assert np.mean([one.low <= expected <= one.high for one in drifts]) >= 0.9


def test_limits_of_the_bound_follow_those_of_the_coefficients():
    found = grid_of(HOUR)
    one = found.bound(Coefficient(N, 0.9 * N, 1.2 * N))
    assert one.low == pytest.approx(0.9 * one.value)
    assert one.high == pytest.approx(1.2 * one.value)
    hidden = found.bound(N, 0.0, Coefficient(0.0, 0.0, K))
    assert hidden.low == hidden.value == pytest.approx(found.bound(N).value)
    assert hidden.high == pytest.approx(found.bound(N, 0.0, K).value)


def test_short_losses_are_bridged_and_long_ones_are_not():
    # 50 Hz, a sample lost here and there: the rate is 1 deg/s more in the second half, so that the integrals tell which
    # windows there are. A loss of 10 s cuts them: none lies across it.
    samples, rate_hz = 20_000, 50.0
    kept = np.ones(samples, dtype=bool)
    kept[50::97] = False
    error = np.where(np.arange(samples) < 10_000, 0.0, 1.0)
    position = np.arange(samples)
    few = AngleGrid.of(Sampling.of(rate_hz, np.zeros(samples, np.int32)[kept], position[kept]))
    whole = grid_of(samples, rate_hz)
    assert len(few.first) == len(whole.first) == 341
    assert few.drift(error[kept]).value == pytest.approx(whole.drift(error).value, rel=1e-3)
    kept[9_750:10_250] = False
    cut = AngleGrid.of(Sampling.of(rate_hz, np.zeros(samples, np.int32)[kept], position[kept]))
    assert len(cut.first) == 195 - 59 + 195 - 59
    assert cut.drift(error[kept]).value == pytest.approx(30.0, rel=0.01)


def test_poses_lose_their_own_means():
    segment = np.repeat(np.arange(3), 200).astype(np.int32)
    error = white(np.random.default_rng(4), 600)
    poses = error + np.array([5.0, -3.0, 1.0])[segment]
    grid = AngleGrid.of(Sampling.of(1.0, segment), each=True)
    flat = np.concatenate([part - part.mean() for part in np.split(poses, 3)])
    sums = np.concatenate([np.convolve(part, np.ones(60), mode="valid") for part in np.split(flat, 3)])
    assert grid.drift(poses).value == pytest.approx(math.sqrt(np.mean(sums**2)), rel=1e-12)
    assert grid.bound(N).value == pytest.approx(N * math.sqrt(60 * (1 - 60 / 200)), rel=1e-12)


@pytest.mark.parametrize("samples", [0, 1, 179])
def test_too_short_has_a_note(samples):
    grid = grid_of(samples)
    for found in (grid.drift(np.ones(samples)), grid.bound(N)):
        assert math.isnan(found.value)
        assert found.note == "shorter than 180 s"


def test_without_a_long_stretch_there_is_a_note():
    grid = AngleGrid.of(Sampling.of(1.0, np.repeat(np.arange(10), 50).astype(np.int32)))
    assert "no stretch" in grid.drift(np.ones(500)).note


def test_an_error_that_does_not_change_has_no_drift():
    found = grid_of(600).drift(np.full(600, 0.3))
    assert (found.value, found.low, found.high) == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
