"""Allan deviation: published figures, closed forms, allantools."""

import allantools
import numpy as np
import pytest

from vgyro import engine
from vgyro.engine import ENGINES
from vgyro.errors import EngineError, TooShort
from vgyro.metrics import allan_deviation, averaging_factors, read_curve
from vgyro.metrics.allan.noise_type import block_means, exponent_by_autocorrelation, exponent_by_ratio, noise_exponents

NBS14_PHASE = [0.0, 103.11111, 123.22222, 157.33333, 166.44444, 48.55555, -96.33333, -2.22222, 111.88889, 0.0]


def nbs14_series() -> np.ndarray:
    """The 1000 values of NBS Monograph 140, by its generator."""
    values = [1234567890]
    for _ in range(999):
        values.append(16807 * values[-1] % 2147483647)
    return np.array(values) / 2147483647


def test_nbs14_ten_points():
    # Riley, "The calculation of time domain frequency stability"; the data are phase, so rates are their differences.
    curve = allan_deviation(np.diff(NBS14_PHASE), 1.0, taus=np.array([1.0, 2.0]))
    np.testing.assert_allclose(curve.deviation, [91.22945, 85.95287], rtol=1e-6)


def test_nbs14_thousand_points():
    # NIST SP 1065, table 31.
    curve = allan_deviation(nbs14_series(), 1.0, taus=np.array([1.0, 10.0, 100.0]))
    np.testing.assert_allclose(curve.deviation, [0.2922319, 0.09159953, 0.03241343], rtol=1e-6)


@pytest.mark.parametrize("name", ENGINES)
def test_limits_of_sp1065(name: str):
    # NIST SP 1065, table 32: σ = 9.159953e-2 with 146.177 d.o.f. at 95 %. Its chi² is good to 1e-3 only.
    low, high = engine.get(name).allan.limits(np.array([9.159953e-02]), np.array([146.177]), 0.95)
    np.testing.assert_allclose([low[0], high[0]], [8.223942e-02, 1.035201e-01], rtol=1e-3)


@pytest.mark.parametrize("name", ENGINES)
def test_equals_allantools(name: str):
    rate = np.random.default_rng(1).standard_normal(5000)
    curve = allan_deviation(rate, 50.0, engine=name)
    _, expected, _, _ = allantools.oadev(rate, 50.0, "freq", taus=curve.tau)
    np.testing.assert_allclose(curve.deviation, expected, rtol=1e-12)
    for tau, value, low, high, edf, alpha in zip(
        curve.tau, curve.deviation, curve.low, curve.high, curve.edf, curve.exponent, strict=True
    ):
        theirs = allantools.edf_greenhall(int(alpha), 2, round(tau * 50), 5001, overlapping=True)
        assert edf == pytest.approx(theirs, rel=1e-12)
        assert (low, high) == pytest.approx(allantools.confidence_interval(value, theirs, 0.95), rel=1e-9)


def test_white_noise_closed_form():
    # σ(τ) = N/√τ: within five standard errors, √(1/2edf).
    n = 0.1
    rate = n * np.sqrt(100.0) * np.random.default_rng(2).standard_normal(200_000)
    curve = allan_deviation(rate, 100.0)
    assert np.all(np.abs(curve.deviation * np.sqrt(curve.tau) / n - 1) < 5 / np.sqrt(2 * curve.edf))


def test_random_walk_closed_form():
    # A sampled random walk of the rate with K: σ²(τ) = K²τ/3 · (1 + 1/(2m²)).
    k, rate_hz = 0.01, 10.0
    steps = k / np.sqrt(rate_hz) * np.random.default_rng(3).standard_normal(200_000)
    curve = allan_deviation(np.cumsum(steps), rate_hz)
    factor = curve.tau * rate_hz
    expected = k * np.sqrt(curve.tau / 3 * (1 + 1 / (2 * factor**2)))
    assert np.all(np.abs(curve.deviation / expected - 1) < 5 / np.sqrt(2 * curve.edf))
    assert np.all(curve.exponent[factor > 4] == -2)


def test_limits_cover_the_truth():
    # Chi² limits of white noise at τ = 10 s: 95 % of 400 series, ± 3 binomial standard deviations.
    rng = np.random.default_rng(4)
    inside = 0
    for _ in range(400):
        curve = allan_deviation(rng.standard_normal(1000), 1.0, taus=np.array([10.0]))
        inside += curve.low[0] <= 1 / np.sqrt(10) <= curve.high[0]
    assert 0.95 * 400 - 13 <= inside <= 0.95 * 400 + 13


def test_taus_are_three_an_octave_up_to_a_third_and_hold_one_second():
    factors = averaging_factors(200.0, 30_000)
    assert factors[0] == 1
    assert 200 in factors
    assert 30_000 / 3 / 2 ** (1 / 3) < factors[-1] <= 10_000
    large = factors[factors > 50]
    np.testing.assert_allclose(large[3:] / large[:-3], 2, rtol=0.02)


def test_no_difference_bridges_a_gap():
    # Two quiet stretches with a step of 100 between them: bridging would show the step.
    rng = np.random.default_rng(5)
    first, second = rng.standard_normal(3000), 100 + rng.standard_normal(2000)
    segment = np.repeat([0, 1], [3000, 2000])
    pooled = allan_deviation(np.concatenate([first, second]), 10.0, segment=segment)
    one, two = (allan_deviation(part, 10.0, taus=pooled.tau) for part in (first, second))
    shared = len(two.tau)
    counts = [len(part) + 1 - 2 * pooled.tau[:shared] * 10 for part in (first, second)]
    expected = (counts[0] * one.deviation[:shared] ** 2 + counts[1] * two.deviation**2) / (counts[0] + counts[1])
    np.testing.assert_allclose(pooled.deviation[:shared] ** 2, expected, rtol=1e-9)
    assert pooled.tau[-1] <= 100.0
    assert pooled.edf[0] == pytest.approx(one.edf[0] + two.edf[0], rel=1e-9)


def test_many_short_stretches_are_pooled():
    rng = np.random.default_rng(6)
    segment = np.repeat(np.arange(20), 1400)
    rate = rng.standard_normal(28_000) + 5 * rng.standard_normal(20)[segment]
    curve = allan_deviation(rate, 1.0, segment=segment)
    assert curve.tau[-1] <= 1400 / 3
    assert np.all(np.abs(curve.deviation * np.sqrt(curve.tau) - 1) < 5 / np.sqrt(2 * curve.edf))


def test_constant_series_is_zero():
    curve = allan_deviation(np.full(300, 3.0), 10.0)
    assert not curve.deviation.any()
    assert not curve.high.any()
    assert read_curve(curve, 1.0) == (0.0, 0.0, 0.0)


def test_too_short_says_so():
    with pytest.raises(TooShort, match="2 samples"):
        allan_deviation(np.array([1.0, 2.0]), 1.0)
    with pytest.raises(TooShort):
        allan_deviation(np.empty(0), 1.0)


def test_unknown_engine():
    with pytest.raises(EngineError):
        allan_deviation(np.arange(9.0), 1.0, engine="none")


def test_read_curve_interpolates_a_power_law_exactly():
    curve = allan_deviation(np.random.default_rng(7).standard_normal(3000), 62.5)
    left = np.searchsorted(curve.tau, 1.0) - 1
    middle = float(np.sqrt(curve.tau[left] * curve.tau[left + 1]))
    value, low, high = read_curve(curve, middle)
    assert value == pytest.approx(np.sqrt(curve.deviation[left] * curve.deviation[left + 1]))
    assert low < value < high
    assert np.isnan(read_curve(curve, 1e6)).all()


@pytest.mark.parametrize("name", ENGINES)
@pytest.mark.parametrize(("power", "sums"), [(0, 0), (-2, 1)])
def test_noise_type_equals_allantools(power: int, sums: int, name: str):
    series = np.random.default_rng(8).standard_normal(20_000)
    series = np.cumsum(series) if sums else series
    factors = np.array([1, 10, 100])
    for factor, *lags in zip(factors, *engine.get(name).allan.lag_products(series, factors), strict=True):
        ours = round(exponent_by_autocorrelation(*lags))
        assert ours == power
        assert ours == max(allantools.autocorr_noise_id(series, int(factor), data_type="freq")[0], -4)


@pytest.mark.parametrize("name", ENGINES)
def test_noise_type_of_white_noise_of_the_angle(name: str):
    series = np.diff(np.random.default_rng(8).standard_normal(20_001))
    squares, products = engine.get(name).allan.lag_products(series, np.array([1]))
    assert round(exponent_by_autocorrelation(squares[0], products[0])) == 2


def test_noise_type_of_few_blocks_by_the_variance_ratio():
    rng = np.random.default_rng(9)
    white = [exponent_by_ratio(rng.standard_normal(20), np.array([20])) for _ in range(200)]
    walk = [exponent_by_ratio(np.cumsum(rng.standard_normal(20)), np.array([20])) for _ in range(200)]
    assert np.mean(np.array(white) == 0) > 0.8
    assert np.mean(np.array(walk) < 0) > 0.9
    assert np.mean(np.array(walk) == -2) > 0.4


def test_block_means_of_several_stretches():
    rate = np.arange(30.0)
    means = block_means(rate, np.array([0, 11, 20]), np.array([3, 2, 2]), 5)
    np.testing.assert_array_equal(means, [2, 7, 12, 13, 18, 22, 27])
    np.testing.assert_array_equal(block_means(rate[:9], np.array([0]), np.array([2]), 4), [1.5, 5.5])


def test_noise_type_never_rises_with_tau():
    rng = np.random.default_rng(10)
    rate = rng.standard_normal(20_000) + np.cumsum(0.02 * rng.standard_normal(20_000))
    exponents = noise_exponents(
        rate, np.array([0, rate.size]), averaging_factors(1.0, rate.size), engine.get("native").allan
    )
    assert np.all(np.diff(exponents) <= 0)
    assert exponents[0] == 0
    assert exponents[-1] == -2
