"""Noise in the quiet frequencies: what changes no weights, and windows in which a gyro is at fault."""

from __future__ import annotations

import numpy as np
import pytest

from vgyro.engine.cross_spectra import CrossSpectra
from vgyro.fusion import ArrayNoise, ArrayRates, FilterParameters
from vgyro.fusion.events import FaultEvent
from vgyro.fusion.noise.parity import parity_variances
from vgyro.fusion.noise.quiet_frequencies import Quiet, _usual_shift, _weighed

RATE_HZ, SAMPLES, GYROS = 50.0, 30_000, 6
MOVING = FilterParameters(in_motion=True)


def simulated(correlation: float, seed: int, faults: tuple[FaultEvent, ...] = ()) -> ArrayRates:
    """White gyros of variance 1, correlated in pairs, so that equal weights stay the best; a slow motion."""
    rng = np.random.default_rng(seed)
    time = np.arange(SAMPLES) / RATE_HZ
    rate = 200.0 * np.sin(2 * np.pi * 0.1 * time)[:, None]
    rate = rate + np.sqrt(1.0 - correlation) * rng.standard_normal((SAMPLES, GYROS))
    rate += np.sqrt(correlation) * np.repeat(rng.standard_normal((SAMPLES, GYROS // 2)), 2, axis=1)
    noise = ArrayNoise(np.full(GYROS, np.nan), np.full(GYROS, np.nan), np.eye(GYROS))
    none = np.zeros(SAMPLES, dtype=bool)
    segment = np.zeros(SAMPLES, dtype=np.int32)
    return ArrayRates(np.asfortranarray(rate), RATE_HZ, segment, none, noise, faults=faults)


@pytest.mark.parametrize(("correlation", "counted"), [(0.05, False), (0.3, True), (0.8, True)])
def test_correlations_that_change_no_weights_count_in_the_variance(correlation: float, counted: bool) -> None:
    """Closed form: Var Σu·n = (1 + ρ)/6 of three pairs; 1.1 times 1/6 is asked for."""
    found = parity_variances(simulated(correlation, 1), MOVING)
    expected = (1.0 + correlation * counted) / GYROS
    assert float(np.mean(found.combined_variance())) == pytest.approx(expected, rel=0.06)
    assert ("frequencies at which the motion is small" in found.note) == counted


def test_a_gyro_at_fault_now_and_then_does_not_let_the_motion_in() -> None:
    """Spectra of unlike windows do not cancel in a motion of 200 deg/s: those in which all are good are taken."""
    faults = tuple(
        FaultEvent(gyro, "noise", begin, begin + 200, 50.0, 5.0, "1")
        for gyro, begin in ((0, 2000), (3, 9000), (3, 15_000), (5, 22_000))
    )
    found = parity_variances(simulated(0.5, 2, faults), MOVING)
    assert "frequencies at which the motion is small" in found.note
    assert float(np.median(found.combined_variance())) == pytest.approx(1.5 / GYROS, rel=0.06)


def banded(levels):
    """Spectra of two parts of four uncorrelated gyros of variance 1, and motion that makes these levels in 8 bands."""
    lines = 8 * 64
    # The mean of four has the density 1/4, the differences from it 3/4 each: a level of x over them is 3/4·x - 1/4.
    motion = np.repeat(0.75 * np.asarray(levels) - 0.25, lines // 8)
    density = np.eye(4) + motion[:, None, None]
    windows = np.full((2, 4, 4), 50.0)
    return CrossSpectra(np.arange(1.0, lines + 1), 50.0 * np.tile(density, (2, 1, 1, 1)), windows, 2 * lines)


@pytest.mark.parametrize(("fourth", "flat"), [(1.12, True), (1.3, False)])
def test_a_floor_that_is_flat_over_half_of_the_band(fourth, flat):
    # Rule: at least four of eight bands within 15 % of the mean of the three lowest.
    found = _weighed(banded([0.5, 0.5, 0.5, 0.5 * fourth, 5.0, 9.0, 7.0, 8.0]), np.full(4, 0.25))
    assert found.flat == flat
    np.testing.assert_allclose(found.covariance - found.covariance.mean(), (np.eye(4) - 0.25) / 0.75, atol=0.02)


def test_what_is_common_beyond_the_usual():
    # By definition: the median of the pairs' correlations, less the usual ones, is zero then.
    usual = np.eye(4)
    usual[0, 1] = usual[1, 0] = 0.1
    pairs = np.array([0.1, 0.2, 0.3, 0.5, 0.6, 0.4])
    seen = np.diag([0.5, 0.6, 0.45, 0.5])
    seen[np.triu_indices(4, 1)] = pairs
    seen = seen + seen.T
    shift = _usual_shift(seen, usual, 0.9)
    left = seen - shift
    sigma = np.sqrt(np.diag(left))
    apart = (left / np.outer(sigma, sigma) - usual)[np.triu_indices(4, 1)]
    assert np.median(apart) == pytest.approx(0.0, abs=1e-9)
    # More is common than may be taken off: as much as may.
    assert _usual_shift(np.full((3, 3), 0.9) + 0.1 * np.eye(3), usual, 0.2) == 0.2


@pytest.mark.parametrize(("flat", "lowest", "shift"), [(True, 0.1, 0.1), (True, 5.0, 0.585), (False, 0.1, 0.3)])
def test_how_much_of_the_common_part_is_motion(flat, lowest, shift):
    # By hand: two gyros of variance 0.7 and correlation 0 beside 0.3 of motion: the best combination has 0.65, of which
    # nine tenths may be motion. A flat floor says how much it is, else the usual correlation, 0, does.
    seen = 0.7 * np.eye(2) + 0.3
    found = Quiet(seen, 1.0, 1e4, lowest, flat).noise(np.eye(2))
    np.testing.assert_allclose(seen - found, shift, atol=1e-9)
