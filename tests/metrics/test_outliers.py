"""Outliers: what is one, and what is not. Simulated, so that every outlier is known."""

from functools import cache

import numpy as np
import pytest
from scipy.signal import lfilter

from vgyro.metrics.outliers import find_outliers

RATE_HZ = 200.0
DAY = 17_280_000


def white(seed: int, samples: int = 400_000) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(samples)


def garch(seed: int, samples: int) -> tuple[np.ndarray, np.ndarray]:
    """GARCH(0.05, 0.9) of unit variance, and its conditional deviations."""
    draws, values, deviations, variance = white(seed, samples).tolist(), [], [], 1.0
    previous = 1.0
    for draw in draws:
        variance = 0.05 + 0.05 * previous**2 + 0.9 * variance
        deviations.append(variance**0.5)
        previous = draw * deviations[-1]
        values.append(previous)
    return np.array(values), np.array(deviations)


def with_spikes(
    rate: np.ndarray, height: float, every: int, seed: int, deviation: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """rate with single samples `height` (times deviation [T]) off, one in each `every` samples, and where they are."""
    rng = np.random.default_rng(seed)
    at = np.arange(0, rate.size - every, every) + rng.integers(every, size=len(range(0, rate.size - every, every)))
    found = rate.copy()
    found[at] += height * rng.choice([-1, 1], at.size) * (1 if deviation is None else deviation[at])
    return found, at


@cache
def backgrounds() -> dict[str, np.ndarray]:
    """Noise of 400 000 samples without any outlier."""
    noise, time = white(1), np.arange(400_000) / RATE_HZ
    heavy = noise.copy()
    heavy[(np.arange(20)[:, None] * 20_000 + np.arange(100)).ravel()] *= 8  # 0.5 s
    return {
        "white": noise,
        "drift": noise + np.cumsum(0.01 * white(2)),
        "steps": noise + np.repeat(30 * white(3, 40), 10_000),
        "slow motion": noise + 30 * np.sin(2 * np.pi * 0.5 * time),
        "garch": garch(4, 400_000)[0],
        "garch by the second": noise * np.repeat(garch(5, 2000)[1], 200),
        "heavy stretches": heavy,
        "low-pass": lfilter([0.05], [1, -0.95], noise),
        "noise of the angle": np.diff(noise),
        "quantised": np.round(noise / 3) * 3,
        "single precision": noise.astype(np.float32),
    }


@pytest.mark.parametrize("name", backgrounds())
def test_noise_has_no_outliers(name: str):
    assert find_outliers(backgrounds()[name], RATE_HZ).sum() == 0


@pytest.mark.parametrize("name", ["white", "drift", "steps", "slow motion", "single precision"])
def test_spikes_of_twelve_deviations_are_found(name: str):
    rate, at = with_spikes(backgrounds()[name], 12.0, 400, 6)
    found = find_outliers(rate, RATE_HZ)
    assert found[at].mean() >= 0.99
    assert found.sum() == found[at].sum()


def test_a_few_in_a_row_and_one_percent():
    rate, at = with_spikes(white(7), 20.0, 100, 8)
    assert find_outliers(rate, RATE_HZ)[at].mean() > 0.99
    rate = white(9)
    at = np.arange(500, 399_000, 1000)[:, None] + np.arange(3)
    rate[at] += 15.0
    found = find_outliers(rate, RATE_HZ)
    assert found[at].mean() > 0.99
    assert found.sum() <= at.size


def test_the_threshold_counts():
    rate, at = with_spikes(white(10), 12.0, 400, 11)
    assert find_outliers(rate, RATE_HZ, threshold=6.0)[at].all()
    assert find_outliers(rate, RATE_HZ, threshold=16.0)[at].mean() < 0.01


def test_a_stretch_with_a_level_of_its_own_is_none():
    # Between two stretches at 0, eight samples at 50: outliers to the eye that does not know of the gaps.
    rate = white(12, 4000)
    rate[2000:2003] += 50.0
    assert np.flatnonzero(find_outliers(rate, RATE_HZ)).tolist() == [2000, 2001, 2002]
    segment = np.repeat([0, 1, 2], [2000, 3, 1997])
    assert not find_outliers(rate, RATE_HZ, segment).any()


def test_ends_of_the_series():
    rate = white(13, 4000)
    rate[[0, 1, -1]] += [20, -20, 20]
    assert np.flatnonzero(find_outliers(rate, RATE_HZ)).tolist() == [0, 1, 3999]


def test_constant_and_short_series():
    for rate in (np.full(1000, 3.0), np.zeros(3), np.empty(0), white(14, 20)):
        assert not find_outliers(rate, RATE_HZ).any()
    spoiled = np.full(1000, 3.0) + 1e-3 * np.round(white(15, 1000))
    spoiled[500] = 4.0
    assert np.flatnonzero(find_outliers(spoiled, RATE_HZ)).tolist() == [500]


@pytest.mark.full
@pytest.mark.parametrize("kind", ["white", "garch", "garch by the second"])
def test_no_false_outlier_in_a_day(kind: str):
    # And 99 % of spikes of 12 standard deviations of the noise at that place are found.
    rate, deviation = white(16, DAY), np.ones(DAY)
    if kind == "garch":
        rate, deviation = garch(16, DAY)
    elif kind == "garch by the second":
        deviation = np.repeat(garch(17, DAY // 200)[1], 200)
        rate = rate * deviation
    assert find_outliers(rate, RATE_HZ).sum() == 0
    spoiled, at = with_spikes(rate, 12.0, 1000, 18, deviation)
    share = find_outliers(spoiled, RATE_HZ)[at].mean()
    assert share >= 0.99, share
