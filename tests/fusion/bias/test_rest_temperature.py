"""Temperature coefficients from a record at rest, and what slow errors in motion make of them.

Expected: the simulated truth, and the joint Gaussian posterior computed densely.
"""

from dataclasses import replace

import numpy as np
import pytest

from vgyro.fusion import ArrayNoise, ArrayRates, FilterParameters
from vgyro.fusion.bias.estimate import slow_errors
from vgyro.fusion.bias.model import Walk
from vgyro.fusion.bias.rest_temperature import NULLED_WITHIN, temperature_at_rest
from vgyro.fusion.rest_scales import own_scales
from vgyro.fusion.types import TemperatureAtRest

ARW, RRW, GYROS, SECONDS = 0.03, 5e-4, 6, 600
MOVING = FilterParameters(in_motion=True)
NOISE = ArrayNoise(np.full(GYROS, ARW), np.full(GYROS, RRW), np.eye(GYROS))
NULLED = 25.0


def record(seed, slopes, moving=False, span=30.0, biases=0.05, common=None, known=None):
    """Means of 1 s: biases, walks, white noise, slopes from NULLED on, a common drift."""
    rng = np.random.default_rng(seed)
    rate = biases * rng.standard_normal(GYROS) + ARW * rng.standard_normal((SECONDS, GYROS))
    rate = rate + np.cumsum(RRW * rng.standard_normal((SECONDS, GYROS)), axis=0)
    degrees = 22.0 + span * np.linspace(0, 1, SECONDS)
    rate += np.outer(degrees - NULLED, slopes)
    if common is not None:
        rate += common[:, None]
    truth = 20.0 * np.sin(np.arange(SECONDS) / 5.0) if moving else np.zeros(SECONDS)
    at_rest = np.full(SECONDS, not moving)
    noise = replace(NOISE, temperature=known)
    return ArrayRates(rate + truth[:, None], 1.0, np.zeros(SECONDS, int), at_rest, noise, temperature=degrees), rate


def slopes_of(seed, spread=0.001, mean=0.01):
    return mean + spread * np.random.default_rng([seed, 7]).standard_normal(GYROS)


@pytest.fixture(scope="module")
def of_twenty():
    """True slopes, and what twenty records show."""
    return [(slopes_of(seed), temperature_at_rest(record(seed, slopes_of(seed))[0])) for seed in range(20)]


def test_the_slopes_and_what_all_share_lie_within_their_deviations(of_twenty):
    """The common slope is seen as well as the differences: (estimate - truth)/s.d. of 20 records has mean square 1."""
    errors, common = [], []
    for true, found in of_twenty:
        errors.append((found.slope - true) / np.sqrt(np.diag(found.covariance)))
        common.append((found.slope - true).mean() / np.sqrt(found.covariance.mean()))
        assert np.abs(found.slope / true - 1.0).max() < 0.35
    assert 0.5 < np.mean(np.square(errors)) < 2.0  # 1.3 with the true walks: they are chosen by the same record
    assert 0.5 < np.mean(np.square(common)) < 1.7


def test_where_the_biases_are_zero(of_twenty):
    found = [one for _, one in of_twenty]
    ratios = [(one.nulled - NULLED) / one.nulled_sd for one in found]
    assert 0.5 < np.mean(np.square(ratios)) < 1.9
    assert 1.0 < np.median([one.nulled_sd for one in found]) < 3.0  # .05/√6 deg/s over .01 deg/s/K


def test_without_a_common_slope_the_temperature_of_zero_bias_is_not_known():
    slopes = np.array([0.01, -0.01, 0.008, -0.008, 0.009, -0.009])
    found = temperature_at_rest(record(1, slopes)[0])
    assert found.nulled_sd > 0.5 * NULLED_WITHIN
    assert found.nulled == pytest.approx(37.0, abs=NULLED_WITHIN)


@pytest.mark.parametrize(("slopes", "span"), [(0.0, 30.0), (0.01, 0.9)])
def test_none_where_nothing_follows_or_the_temperature_stays(slopes, span):
    assert temperature_at_rest(record(3, np.full(GYROS, slopes), span=span)[0]) is None


def test_none_without_temperature_or_rest():
    array, _ = record(3, slopes_of(3))
    assert temperature_at_rest(replace(array, temperature=None)) is None
    assert temperature_at_rest(replace(array, at_rest=np.zeros(SECONDS, bool))) is None


def test_a_common_walk_beside_the_temperature_widens_the_slopes(monkeypatch):
    """What all drift together is seen in the Allan covariances without the temperature, and counts."""
    walk = np.cumsum(3e-3 * np.random.default_rng(1).standard_normal(SECONDS))
    array, true = record(1, slopes_of(1), common=walk)[0], slopes_of(1)
    found = temperature_at_rest(array)
    monkeypatch.setattr("vgyro.fusion.bias.rest_temperature.common_walk", lambda _: 0.0)
    without = temperature_at_rest(array)
    assert found.covariance.mean() > 4.0 * without.covariance.mean()
    assert abs((found.slope - true).mean()) < 2.0 * np.sqrt(found.covariance.mean())
    assert abs((without.slope - true).mean()) > 2.0 * np.sqrt(without.covariance.mean())


def test_the_allan_covariances_are_those_without_the_temperature():
    true = slopes_of(5)
    with_it, without = record(5, true)[0], record(5, 0.0 * true)[0]
    found = temperature_at_rest(with_it).scales
    expected = own_scales(without)
    np.testing.assert_allclose(np.diagonal(found.covariance[0]), np.diagonal(expected.covariance[0]), rtol=0.02)
    assert found.covariance[-1].mean() < 0.05 * own_scales(with_it).covariance[-1].mean()


def known_of(slopes, sd, scales=None):
    return TemperatureAtRest(np.asarray(slopes), sd**2 * np.eye(GYROS), NULLED, 2.0, scales)


def test_in_motion_the_common_part_is_taken_off():
    true = slopes_of(9)
    array, slow_truth = record(9, true, moving=True, biases=0.0, known=known_of(true, 1e-4))
    slow = slow_errors(array, MOVING, NOISE.arw**2)
    assert np.abs(slow.bias.mean(axis=1) - slow_truth.mean(axis=1)).std() < 0.05
    assert slow.temperature.slope == pytest.approx(true, abs=3e-4)
    unknown = slow_errors(replace(array, noise=NOISE), MOVING, NOISE.arw**2)
    left = (unknown.bias - slow_truth).mean(axis=1)
    assert left.std() > 0.08  # 30 K · .01 deg/s/K / √12


def test_the_posterior_is_that_of_slopes_known_beforehand():
    """Joint Gaussian posterior of differences, dense: biases wide, walks given, slopes N(known, Γ)."""
    true, known = slopes_of(11), known_of(slopes_of(11) + 2e-4, 4e-4)
    array, _ = record(11, true, moving=True, known=known)
    walk = Walk(np.full(GYROS, RRW))
    slow = slow_errors(array, MOVING, NOISE.arw**2, walk=walk)
    since = array.temperature - NULLED
    differences = np.eye(GYROS)[1:] - np.eye(GYROS)[0]
    time = np.arange(SECONDS, dtype=float)
    own = RRW**2 * np.minimum.outer(time, time) + ARW**2 * np.eye(SECONDS)
    measured = (array.rate - np.outer(since, known.slope)) @ differences.T
    noise = np.kron(own, differences @ differences.T)
    columns = np.kron(since[:, None], differences)
    biases = np.kron(np.ones((SECONDS, 1)), differences @ differences.T)
    total = noise + 4e-4**2 * columns @ columns.T + 1e2 * biases @ biases.T
    expected = known.slope + 4e-4**2 * columns.T @ np.linalg.solve(total, measured.ravel())
    left = np.eye(GYROS) * 4e-4**2 - 4e-4**4 * columns.T @ np.linalg.solve(total, columns)
    # The prior of the biases is not as wide as here.
    np.testing.assert_allclose(slow.temperature.slope, expected, atol=2e-5)
    np.testing.assert_allclose(np.diag(slow.temperature.covariance), np.diag(left), rtol=0.1)


@pytest.mark.parametrize(("off", "believed"), [(3.0, True), (30.0, False)])
def test_slopes_that_the_differences_contradict_are_not_believed(off, believed):
    """off : errors of the record's slopes over their deviations."""
    true, sd = slopes_of(13), 2e-4
    wrong = true + off * sd * np.array([1, -1, 1, -1, 1, -1]) / 2
    array, _ = record(13, true, moving=True, known=known_of(wrong, sd))
    slow = slow_errors(array, MOVING, NOISE.arw**2)
    assert ("are those of the record at rest" in slow.note) == believed
    assert ("contradict" in slow.note) != believed
    assert np.abs(np.diff(slow.temperature.slope - true)).max() < 1.5e-3
    if not believed:
        assert abs(slow.temperature.slope.mean()) < 0.2 * 0.01


def test_at_rest_as_a_whole_and_with_the_part_off_nothing_is_taken_from_the_record():
    true = slopes_of(15)
    array, _ = record(15, true, known=known_of(true, 1e-4))
    assert "record at rest" not in slow_errors(array, FilterParameters(), NOISE.arw**2).note
    moving, _ = record(15, true, moving=True, known=known_of(true, 1e-4))
    off = replace(MOVING, without=frozenset({"temperature"}))
    assert slow_errors(moving, off, NOISE.arw**2).temperature is None


def test_the_temperature_of_zero_bias_counts_in_the_deviation():
    true = slopes_of(17)
    array, _ = record(17, true, moving=True, known=known_of(true, 1e-4))
    wide = replace(array, noise=replace(NOISE, temperature=replace(known_of(true, 1e-4), nulled_sd=20.0)))
    near, far = (slow_errors(one, MOVING, NOISE.arw**2).covariance.mean() for one in (array, wide))
    assert far - near == pytest.approx((20.0**2 - 2.0**2) * true.mean() ** 2, rel=1e-6)


def test_of_some_gyros():
    known = temperature_at_rest(record(19, slopes_of(19))[0])
    some = replace(NOISE, temperature=known).of([4, 1]).temperature
    np.testing.assert_array_equal(some.slope, known.slope[[4, 1]])
    assert some.covariance[0, 1] == known.covariance[4, 1]
    np.testing.assert_array_equal(some.scales.covariance[:, 0, 1], known.scales.covariance[:, 4, 1])


def test_common_drift_in_motion_is_what_the_temperature_leaves():
    """A record that is all temperature says of no common walk, once its slopes are known."""
    true = slopes_of(21)
    rest = record(21, true)[0]
    known, raw = temperature_at_rest(rest), replace(own_scales(rest), own=False)
    array, _ = record(22, true, moving=True, known=known)
    array = replace(array, noise=replace(array.noise, scales=raw))
    assert "drift together" not in slow_errors(array, MOVING, NOISE.arw**2).note
    blind = replace(array, noise=replace(array.noise, temperature=None))
    assert "drift together" in slow_errors(blind, MOVING, NOISE.arw**2).note
