"""Engle's test, against statsmodels and closed forms."""

import warnings

import numpy as np
import pytest
from statsmodels.stats.diagnostic import het_arch

from vgyro.errors import TooShort
from vgyro.volatility import arch_lm, kurtosis


def theirs(column, lags):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)
        return het_arch(column, nlags=lags)[:2]


@pytest.mark.parametrize("lags", [1, 2, 5])
@pytest.mark.parametrize("samples", [60, 360, 3600])
def test_equals_statsmodels(samples, lags):
    # Expected: statsmodels 0.15 het_arch, an independent implementation.
    rng = np.random.default_rng(samples + lags)
    r = 0.04 * rng.standard_normal((samples, 3)) * np.exp(0.5 * np.sin(np.arange(samples) / 20))[:, None]
    r[:, 2] += np.linspace(0, 0.2, samples)
    found = arch_lm(r, lags)
    for i in range(3):
        statistic, p_value = theirs(r[:, i], lags)
        assert found.statistic[i] == pytest.approx(statistic, rel=1e-10, abs=1e-10)
        assert found.p_value[i] == pytest.approx(p_value, rel=1e-9, abs=1e-10)


def test_does_not_depend_on_the_unit():
    r = np.random.default_rng(3).standard_normal((400, 1))
    assert arch_lm(1e-5 * r, 2).statistic == pytest.approx(arch_lm(r, 2).statistic, rel=1e-9)


def test_a_square_that_repeats_with_its_lag_is_explained_completely():
    # Closed form: e² alternates between two values, so one lag explains all of it: R² = 1, statistic = T - 1.
    r = np.tile([1.0, 2.0], 50)[:, None]
    assert arch_lm(r, 1).statistic[0] == pytest.approx(99.0, rel=1e-12)


def test_drift_alone_is_reported_as_arch_and_detrending_removes_it():
    # A known simulated truth: white noise of constant variance, with and without a random walk of the level.
    rng = np.random.default_rng(11)
    white = 0.04 * rng.standard_normal((3600, 1))
    drift = np.cumsum(rng.standard_normal((3600, 1)), axis=0) * 0.0015
    assert arch_lm(white + drift).statistic[0] > 50
    assert arch_lm(white).statistic[0] < 10


@pytest.mark.parametrize("value", [0.0, 0.3])
def test_a_constant_gives_nan_and_leaves_the_others_alone(value):
    r = np.random.default_rng(0).standard_normal((100, 2))
    alone = arch_lm(r[:, [1]]).statistic[0]
    r[:, 0] = value
    found = arch_lm(r)
    assert np.isnan(found.statistic[0])
    assert np.isnan(found.p_value[0])
    assert found.statistic[1] == alone


@pytest.mark.parametrize(("samples", "lags"), [(3, 1), (11, 5), (0, 1)])
def test_too_short(samples, lags):
    with pytest.raises(TooShort, match=f"{samples} samples"):
        arch_lm(np.zeros((samples, 1)), lags)
    arch_lm(np.random.default_rng(0).standard_normal((2 * lags + 2, 1)), lags)


def test_samples_that_take_no_part():
    # By definition: what lies outside the kept stretch changes nothing; one sample out takes its lagged rows with it.
    rng = np.random.default_rng(8)
    r = rng.standard_normal((400, 1))
    keep = np.arange(400) < 250
    assert arch_lm(r, 2, keep).statistic[0] == pytest.approx(arch_lm(r[:250], 2).statistic[0], rel=1e-9)
    knocked = r.copy()
    knocked[300] = 1e3
    keep = np.arange(400) != 300
    assert arch_lm(knocked, 2, keep).statistic[0] == pytest.approx(arch_lm(r, 2, keep).statistic[0], rel=1e-6)
    with pytest.raises(TooShort, match="3 samples are kept with their 2 lags"):
        arch_lm(r, 2, np.arange(400) < 5)


def test_kurtosis():
    # Closed form: two equal values ±1 have kurtosis 1; scipy.stats for the rest.
    from scipy.stats import kurtosis as scipy_kurtosis

    x = np.random.default_rng(5).standard_t(5, size=(500, 1))
    assert kurtosis(x)[0] == pytest.approx(scipy_kurtosis(x[:, 0], fisher=False), rel=1e-12)
    assert kurtosis(np.tile([1.0, -1.0], 10)[:, None])[0] == pytest.approx(1.0)
    assert np.isnan(kurtosis(np.full((10, 1), 0.1))[0])
