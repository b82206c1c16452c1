"""A board that is declared to stand still: what is motion, and what never is."""

import numpy as np
import pytest

from vgyro.calibration.moves import find_moves, gyro_windows, noise_level, seems_to_move, window_length
from vgyro.config import RestOptions
from vgyro.runs import true_runs

RATE_HZ, SIGMA = 100.0, 0.05
OPTIONS = RestOptions()


def moving(rate: np.ndarray, axes: str | None = None, scale: float = 1.0, rate_hz: float = RATE_HZ) -> list:
    """Motions found in rates [T, N], as seconds."""
    length = window_length(rate_hz, OPTIONS)
    windows = [gyro_windows(column, length) for column in (rate / scale).T]
    found = find_moves(windows, list(axes or "z" * rate.shape[1]), [scale] * rate.shape[1], OPTIONS)
    return [(start * length / rate_hz, stop * length / rate_hz) for start, stop in true_runs(found).tolist()]


def differences(rate: np.ndarray) -> dict:
    """Noise levels of gyros of one axis from the difference of each and the next one."""
    length = window_length(RATE_HZ, OPTIONS)
    pairs = [(gyro_windows(one, length), gyro_windows(one - other, length))
             for one, other in zip(rate.T, np.roll(rate, -1, axis=1).T, strict=True)]  # fmt: skip
    found = {place: noise_level(*pair) for place, pair in enumerate(pairs)}
    return {place: level for place, level in found.items() if level is not None}


@pytest.mark.parametrize(("size", "found"), [(10.0, True), (0.25, False)])
def test_a_board_that_never_rests(size, found):
    # A sinusoid of 0.7 Hz, 200 and 5 times the noise of a sample; the difference of two gyros has √2 times that noise.
    rate = in_hand(white(60, 3), 0, 60, size=size)
    levels = differences(rate)
    assert bool(levels) == found
    windows = [gyro_windows(column, window_length(RATE_HZ, OPTIONS)) for column in rate.T]
    assert find_moves(windows, ["z"] * 3, [1.0] * 3, OPTIONS, levels).all() == found


def test_noise_that_is_common_and_smooth_has_no_level_of_its_own():
    # Low-passed noise is smooth, too, but no gyro's is another's; common vibration is quick.
    time = np.arange(round(600 * RATE_HZ)) / RATE_HZ
    kernel = np.ones(60) / np.sqrt(60)
    own = np.stack([np.convolve(column, kernel, "same") for column in white(600, 3).T], axis=1)
    common = np.convolve(white(600, 1, 5)[:, 0], kernel, "same")[:, None]
    assert all(seems_to_move(gyro_windows(column, 100)) for column in own.T)
    assert differences(own) == {}
    assert differences(own + 3 * common) == {}
    assert differences(white(600, 3) + np.sin(2 * np.pi * 33 * time)[:, None]) == {}


def white(seconds: float, gyros: int, seed: int = 1, rate_hz: float = RATE_HZ) -> np.ndarray:
    return SIGMA * np.random.default_rng(seed).standard_normal((round(seconds * rate_hz), gyros))


def in_hand(rate: np.ndarray, start: float, stop: float, gyros: slice = slice(None), size: float = 10.0) -> np.ndarray:
    time = np.arange(len(rate)) / RATE_HZ
    there = (time >= start) & (time < stop)
    rate[there, gyros] += (size * np.sin(2 * np.pi * 0.7 * (time[there] - start)))[:, None]
    return rate


@pytest.mark.parametrize("gyros", [1, 2, 3, 6])
def test_motion_between_two_rests(gyros):
    assert moving(in_hand(white(60, gyros), 18, 42)) == [(18, 42)]


def test_a_board_that_moves_most_of_the_time():
    assert moving(in_hand(white(100, 3), 10, 80)) == [(10, 80)]


def test_counts_that_lack_values():
    rate = in_hand(white(60, 3), 18, 42)
    rate[::2, 0] = np.nan
    rate[3000:, 1] = np.nan
    assert moving(rate, scale=0.01) == [(18, 42)]


def test_a_steady_turn_whose_ends_alone_vary():
    rate = white(60, 3)
    rate[2050:3950] += 3.0
    assert moving(rate) == [(20, 40)]
    # A step that the gyros do not agree on is no turn.
    rate = white(60, 4)
    rate[2050:3950] += [3.0, -2.0, 1.0, -4.0]
    assert moving(rate) == []


def test_the_rest_is_where_the_board_stands_longer():
    rate = white(60, 3)
    rate[1050:] += 3.0
    assert moving(rate) == [(0, 11)]


def test_poses_that_differ_less_than_the_noise_are_rests():
    rate = in_hand(white(60, 3), 20, 30)
    rate[3000:] += 3 * SIGMA
    assert moving(rate) == [(20, 30)]


@pytest.mark.parametrize(("seen", "found"), [(1, False), (2, True)])
def test_most_gyros_of_an_axis(seen, found):
    # Of three: one is a fault, two are motion.
    assert bool(moving(in_hand(white(60, 3), 20, 30, slice(seen)))) == found


@pytest.mark.parametrize(("axes", "found"), [("xyz", False), ("xxz", True)])
def test_an_axis_with_one_gyro_needs_another_one_with_it(axes, found):
    # The first two of three see it: about two axes of one gyro each, or about one axis of two.
    both = bool(moving(in_hand(white(60, 3), 20, 30, slice(2)), axes))
    alone = bool(moving(in_hand(white(60, 3), 20, 30, slice(1)), axes))
    assert both
    assert not alone
    assert found or axes == "xyz"


@pytest.mark.parametrize(("seconds", "found"), [(0.9, False), (3.0, True)])
def test_a_knock_is_no_motion(seconds, found):
    rate = white(60, 3)
    start, stop = 2005, 2005 + round(seconds * RATE_HZ)
    rate[start:stop] += 20 * SIGMA * np.random.default_rng(2).standard_normal((stop - start, 1))
    assert bool(moving(rate)) == found


@pytest.mark.parametrize(("times", "found"), [(3.0, False), (6.0, True)])
def test_threshold(times, found):
    # Common noise beside the gyros' own: a deviation of √(1 + times²) quiet levels, against four.
    rate = white(60, 3)
    rate[2000:3000] += times * SIGMA * np.random.default_rng(3).standard_normal((1000, 1))
    assert bool(moving(rate)) == found


def test_a_short_rest_between_two_motions_is_none():
    rate = in_hand(in_hand(white(80, 3), 20, 30), 35, 45)
    assert moving(rate) == [(20, 45)]
    assert moving(in_hand(in_hand(white(80, 3), 20, 30), 37, 45)) == [(20, 30), (37, 45)]


def slow(kind: str, time: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    samples = len(time)
    if kind == "random walk":
        return np.cumsum(rng.standard_normal((samples, 4)), axis=0) * 0.02 / np.sqrt(RATE_HZ)
    if kind == "flicker":
        scales = [np.repeat(rng.standard_normal((samples // step + 1, 4)), step, axis=0)[:samples]
                  for step in 4 ** np.arange(2, 8)]  # fmt: skip
        return 0.02 * np.sum(scales, axis=0)
    if kind == "warming up":
        return np.outer(2.0 * np.exp(-time / 60), [1.0, 0.9, 1.1, -0.5])
    if kind == "temperature":
        return np.outer(1.5 * np.sin(2 * np.pi * time / 600), [1.0, 1.0, 0.8, 0.9])
    if kind == "common vibration":
        return np.outer(3 * SIGMA * np.sin(2 * np.pi * 33.0 * time), np.ones(4))
    if kind == "heteroskedastic":
        return white(samples / RATE_HZ, 4, 9) * np.sqrt(1 + np.sin(2 * np.pi * time / 200))[:, None]
    return np.zeros((samples, 4))


KINDS = ("white", "random walk", "flicker", "warming up", "temperature", "common vibration", "heteroskedastic")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(3))
def test_true_rest_is_never_cut(kind, seed):
    rng = np.random.default_rng(100 + seed)
    time = np.arange(round(1200 * RATE_HZ)) / RATE_HZ
    rate = white(1200, 4, seed) + slow(kind, time, rng) + rng.normal(0, 2, 4)
    # And a fault of one gyro at each time: a burst, a step, a stretch at a rail, a spike of all of them at once.
    rate[10_000:13_000, 0] += 1.0 * rng.standard_normal(3000)
    rate[40_000:, 1] += 5.0
    rate[70_000:80_000, 2] = 300.0
    rate[90_000] += 100.0
    rate[100_000:101_000, 3] = np.nan
    assert moving(rate) == []
    # The same in coarse counts, some of which flip between two values.
    assert moving(np.round(rate / 0.2) * 0.2, scale=0.2) == []
    assert moving(rate, "xxyy") == []


@pytest.mark.parametrize(("rate_hz", "seconds"), [(1.0, 20_000), (5.0, 4000), (2000.0, 60)])
def test_rest_at_other_rates(rate_hz, seconds):
    for seed in range(5):
        assert moving(white(seconds, 2, seed, rate_hz), rate_hz=rate_hz) == []


@pytest.mark.parametrize("rate", [np.zeros((500, 3)), np.zeros((0, 3)), np.full((3000, 2), np.nan), white(7, 2)])
def test_nothing_to_judge(rate):
    assert moving(rate) == []
