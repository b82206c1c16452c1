"""Series that lack values: their own samples, their own rate, and what they correlate with."""

import math

import numpy as np
import pytest

from vgyro.metrics import allan_deviation, correlation_matrix, correlation_of, noise_from_differences, own_samples
from vgyro.metrics.sampling import Sampling
from vgyro.metrics.static.lacking import cleaned_of

RATE_HZ, SAMPLES = 100.0, 20_000


def series(gyros: int = 1, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((gyros, SAMPLES))


def sampling(samples: int = SAMPLES) -> Sampling:
    return Sampling.of(RATE_HZ, np.zeros(samples, np.int32))


def test_the_same_objects_where_nothing_is_missing():
    values, when = series()[0], sampling()
    assert own_samples(values, when) == (values, when) or own_samples(values, when)[0] is values
    assert own_samples(values, when)[1] is when


def test_single_values_are_lost_and_the_rate_stays():
    values = series()[0]
    values[[500, 700, 701]] = np.nan
    own, when = own_samples(values, sampling())
    assert len(own) == SAMPLES - 3
    assert (when.rate_hz, when.missing) == (RATE_HZ, 3)


@pytest.mark.parametrize("every", [2, 5])
def test_a_rate_of_its_own(every):
    values = series()[0]
    kept = values[3::every].copy()
    values[np.arange(SAMPLES) % every != 3 % every] = np.nan
    own, when = own_samples(values, sampling())
    np.testing.assert_array_equal(own[-len(kept) :], kept)
    assert when.rate_hz == RATE_HZ / every
    assert when.missing == 0
    # Truth: white noise of 1 deg/s a sample.
    curve = allan_deviation(own, when.rate_hz, np.array([1.0]), sampling=when)
    assert curve.deviation[0] == pytest.approx(1 / math.sqrt(RATE_HZ / every), rel=0.1)


@pytest.mark.parametrize(("share", "halved"), [(0.4, False), (0.6, True)])
def test_most_values_must_follow_the_own_rate(share, halved):
    values = series()[0]
    values[: round(share * 2 * SAMPLES / (1 + share)) : 2] = np.nan
    own, when = own_samples(values, sampling())
    assert (when.rate_hz == RATE_HZ / 2) == halved
    assert len(own) == len(when)


def test_correlation_of_pairs():
    common, own = series(1, 2)[0], series(4)
    rates = 0.8 * common + 0.6 * own
    whole = correlation_matrix(list(rates), RATE_HZ)
    lacking = rates.copy()
    lacking[1, ::2] = np.nan
    lacking[3, SAMPLES // 2 :] = np.nan
    found = correlation_of(list(lacking), [1, 3], RATE_HZ, np.zeros(SAMPLES, np.int32), 0.95)
    np.testing.assert_array_equal(found.value[np.ix_([0, 2], [0, 2])], whole.value[np.ix_([0, 2], [0, 2])])
    off = ~np.eye(4, dtype=bool)
    assert np.all((found.low <= 0.64) & (found.high >= 0.64) | ~off)
    np.testing.assert_array_equal(np.diag(found.value), 1.0)
    width = found.high - found.low
    assert width[0, 1] > 1.3 * width[0, 2]
    # Two gyros that are never there together have none.
    lacking[0, 1::2] = np.nan
    lacking[1] = np.where(np.arange(SAMPLES) % 2 == 1, rates[1], np.nan)
    apart = correlation_of(list(lacking[:3]), [0, 1], RATE_HZ, np.zeros(SAMPLES, np.int32), 0.95)
    assert math.isnan(apart.value[0, 1])
    assert apart.value[0, 2] == pytest.approx(0.64, abs=0.03)


def test_outliers_beside_missing_values():
    values = series()[0]
    values[1000], values[1001:1003] = 100.0, np.nan
    found = cleaned_of(values, RATE_HZ, np.zeros(SAMPLES, np.int32), 8.0)
    assert abs(found[1000]) < 3
    assert np.isnan(found[1001:1003]).all()
    assert np.isnan(found).sum() == 2


def test_noise_of_differences():
    rates = list(series(3))
    expected = noise_from_differences(rates, RATE_HZ)[0]
    rates[1][::2] = np.nan
    found = noise_from_differences(rates, RATE_HZ)[0]
    # Every second sample of white noise has √2 times the density; the differences share that among the two.
    assert found[0] == pytest.approx(expected[0], rel=0.15)
    assert found[2] == pytest.approx(expected[2], rel=0.15)
    rates[1][:] = np.nan
    without = noise_from_differences(rates, RATE_HZ)[0]
    assert math.isnan(without[1])
    assert without[0] > 0
