"""Delays between the gyros of one board."""

from __future__ import annotations

import numpy as np
import pytest
from moving_arrays import board, random_motion

from vgyro.alignment import relative_delays
from vgyro.alignment.delays import FOUND, NO_MOTION, TOO_FEW
from vgyro.alignment.moving import MOST_VALUES, moving_rows

RATE = 200.0
NOISES = np.array([0.05, 0.1, 0.2, 0.1, 0.3, 0.1])
EQUAL = np.zeros(6)


def one_late(gyros: int, samples: float) -> np.ndarray:
    delays = np.zeros(gyros)
    delays[gyros // 2] = samples / RATE
    return delays


@pytest.mark.parametrize(("gyros", "late"), [(6, 3.0), (3, 3.0), (3, -3.0), (4, 0.4), (6, 25.0)])
def test_one_late_gyro_is_found_within_a_tenth_of_a_sample(gyros: int, late: float) -> None:
    for seed in range(2):
        rng = np.random.default_rng(seed)
        true = one_late(gyros, late)
        found = relative_delays(board(rng, random_motion(rng, 10), true), RATE)
        assert found.status == FOUND
        np.testing.assert_allclose(found.delay_s, true, atol=0.1 / RATE)
        np.testing.assert_array_equal(found.significant, true != 0)
        assert (found.high - found.low).max() < 0.1 / RATE


def test_of_two_gyros_each_has_half() -> None:
    rng = np.random.default_rng(1)
    found = relative_delays(board(rng, random_motion(rng, 10), np.array([0.0, 0.01])), RATE)
    np.testing.assert_allclose(found.delay_s, [-0.005, 0.005], atol=2e-4)
    assert found.significant.all()


@pytest.mark.parametrize(("apart", "others"), [(0.04, 0.0), (0.4, -0.5)])
def test_gyros_within_a_tenth_of_a_sample_are_the_others(apart: float, others: float) -> None:
    # Small delays, far beyond the noise: together they are the others' time; if they are larger, the mean of all is.
    rng = np.random.default_rng(1)
    true = np.array([0.0, apart, -apart, 2 * apart, -2 * apart, 3.0]) / RATE
    found = relative_delays(board(rng, random_motion(rng, 20), true), RATE)
    np.testing.assert_allclose(found.delay_s, true + others / RATE, atol=0.02 / RATE)


@pytest.mark.parametrize("kind", ["plain", "noises and walk", "weak", "burst"])
def test_equal_gyros_have_no_delay(kind: str) -> None:
    for seed in range(3):
        found = relative_delays(equal(kind, np.random.default_rng(seed)), RATE)
        assert found.status == FOUND
        assert not found.significant.any()


def equal(kind: str, rng: np.random.Generator) -> np.ndarray:
    if kind == "plain":
        return board(rng, random_motion(rng, 10), EQUAL)
    bursts = ((20.0, 2.0),) if kind == "burst" else ()
    return board(rng, random_motion(rng, 0.3 if kind == "weak" else 10, bursts), EQUAL, noise=NOISES, walk=0.05)


@pytest.mark.full
def test_false_alarms_in_equal_gyros_are_one_percent() -> None:
    alarms, covered, seeds = 0, 0.0, 100
    for kind in ("plain", "noises and walk", "weak", "burst"):
        for seed in range(seeds):
            found = relative_delays(equal(kind, np.random.default_rng(1000 + seed)), RATE)
            alarms += bool(found.significant.any())
            covered += float(((found.low <= 0) & (found.high >= 0)).mean())
    print("alarms", alarms, "covered", covered / seeds / 4)
    assert alarms <= 9  # of 400, 4 expected: the 99 % point of Poisson's law
    assert covered / seeds / 4 > 0.93


def test_at_rest_nothing_is_said() -> None:
    rng = np.random.default_rng(2)
    found = relative_delays(board(rng, None, EQUAL, noise=NOISES, walk=0.05), RATE)
    assert found.status == NO_MOTION
    assert np.isnan(found.delay_s).all()
    assert not found.significant.any()


@pytest.mark.parametrize(("rms", "moves"), [(0.02, False), (0.08, True)])
def test_motion_counts_from_the_power_of_the_noise_on(rms: float, moves: bool) -> None:
    # Noise 0.1 at 200 Hz is 0.032 in means over a twentieth of a second.
    rng = np.random.default_rng(3)
    rate = board(rng, random_motion(rng, rms), EQUAL)
    assert bool(len(moving_rows(rate, RATE, np.zeros(len(rate))))) == moves


def test_a_dead_gyro_is_left_out() -> None:
    rng = np.random.default_rng(4)
    rate = board(rng, random_motion(rng, 10), np.array([0.0, 0.0, 0.015, 0.0]))
    rate[:, 1] = 0.25
    found = relative_delays(rate, RATE)
    np.testing.assert_allclose(found.delay_s, [0, np.nan, 0.015, 0], atol=1e-3)
    np.testing.assert_array_equal(found.significant, [False, False, True, False])
    rate[:, 2:] = np.nan
    assert relative_delays(rate, RATE).status == TOO_FEW


def test_gaps_and_missing_samples() -> None:
    rng = np.random.default_rng(5)
    true = one_late(4, 3.0)
    motion = random_motion(rng, 10)
    rate = np.concatenate([board(rng, motion, true, samples=5000), board(rng, random_motion(rng, 10), true)])
    rate[rng.integers(0, len(rate), 30), rng.integers(0, 4, 30)] = np.nan
    found = relative_delays(rate, RATE, np.repeat([0, 1], [5000, 12000]))
    np.testing.assert_allclose(found.delay_s, true, atol=0.1 / RATE)


def test_a_large_recording_gives_a_bounded_choice() -> None:
    rng = np.random.default_rng(6)
    piece = board(rng, random_motion(rng, 10), EQUAL).astype(np.float32)
    rate = np.tile(piece, (60, 1))
    rows = moving_rows(rate, RATE, np.zeros(len(rate), dtype=np.int64))
    assert 0.9 * MOST_VALUES < len(rows) * 6 <= MOST_VALUES
    assert len(moving_rows(piece, RATE, np.zeros(len(piece)))) == len(piece)
