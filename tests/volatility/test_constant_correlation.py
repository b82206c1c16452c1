"""Engle & Sheppard's test of constant correlation: algebra against pymgarch and the definition; size by Monte Carlo."""

import numpy as np
import pymgarch
import pytest
from scipy.stats import chi2

from vgyro import engine as engines
from vgyro.volatility import constant_correlation_test


@pytest.mark.parametrize("lags", [1, 2, 5])
def test_same_statistic_as_pymgarch(simulator, equicorrelated, lags):
    # Expected: pymgarch.dcc_test, which has the p-value under chi²(s + 1) only.
    z = simulator(360, [1.0] * 4, [0.0] * 4, [0.0] * 4, 0.05, 0.9, equicorrelated(4, 0.4), seed=6)[0]
    found, theirs = constant_correlation_test(z, lags), pymgarch.dcc_test(eps=z, n_lags=lags)
    assert found.statistic == pytest.approx(theirs.statistic, rel=1e-9)
    assert found.p_value == pytest.approx(theirs.pvalue, rel=1e-7)
    assert found.dof == theirs.df == lags + 1
    assert found.p_value_s == pytest.approx(chi2.sf(theirs.statistic, lags), rel=1e-7)


def test_the_definition_for_two_gyros():
    # Expected: the definition written out with numpy's least squares for one pair.
    z = np.random.default_rng(4).standard_normal((200, 2))
    moment = z.T @ z
    rho = moment[0, 1] / np.sqrt(moment[0, 0] * moment[1, 1])
    # The symmetric root of a 2x2 correlation matrix in closed form.
    p, m = 1 / np.sqrt(1 + rho), 1 / np.sqrt(1 - rho)
    white = z @ (np.array([[p + m, p - m], [p - m, p + m]]) / 2)
    y = white[:, 0] * white[:, 1]
    x = np.column_stack([np.ones(199), y[:-1]])
    delta = np.linalg.lstsq(x, y[1:], rcond=None)[0]
    variance = np.mean((y[1:] - x @ delta) ** 2)
    assert constant_correlation_test(z).statistic == pytest.approx(delta @ x.T @ x @ delta / variance, rel=1e-9)


def test_a_long_changing_record_is_rejected(simulator, equicorrelated):
    # Liu et al. report 180.24, out of reach at T = 360.
    z = simulator(3600, [1.0] * 6, [0.0] * 6, [0.0] * 6, 0.05, 0.93, equicorrelated(6, 0.12), seed=1)[0]
    assert constant_correlation_test(z).p_value < 1e-6


def test_where_it_is_not_defined():
    # Expected by definition; products that are all zero, or that follow from the ones before, leave nothing to regress.
    z = np.random.default_rng(0).standard_normal((100, 2))
    turns = np.tile([[1.0, 0.0], [0.0, 1.0]], (50, 1))
    ramp = np.column_stack([np.tile([1.0, 1.0, -1.0, -1.0], 25), np.tile([1.0, -1.0, -1.0, 1.0], 25)])
    cases = {
        "one gyro": z[:, :1],
        "not positive definite": np.column_stack([z[:, 0], z[:, 0]]),
        "too short": z[:3],
        "failed": np.where(np.arange(100)[:, None] == 5, np.nan, z),
        "no variance": np.column_stack([z[:, 0], np.zeros(100)]),
    }
    for status, bad in [*cases.items(), ("degenerate", turns), ("degenerate", ramp)]:
        found = constant_correlation_test(bad)
        assert found.status == status
        assert np.isnan([found.statistic, found.p_value, found.p_value_s]).all()
    # Three products cannot tell a constant and five lags apart.
    assert constant_correlation_test(z[:8], 5).status == "degenerate"
    assert constant_correlation_test(z).status == "tested"


@pytest.mark.parametrize("lags", [1, 2, 5])
def test_the_engines_agree_where_it_is_degenerate(lags):
    turns = np.tile([[1.0, 0.0], [0.0, 1.0]], (50, 1))[None]
    margins = np.ones((1, 2)), np.zeros((1, 2)), np.zeros((1, 2)), np.zeros((1, 2), dtype=np.uint8)
    for engine in ("native", "reference"):
        assert np.isnan(engines.get(engine).dcc.fit_dcc_windows(turns, *margins, lags).statistic).all()


@pytest.mark.full
def test_size(equicorrelated):
    # A known truth: at T = 360, s = 1 a nominal 5 % test rejects 1.8 % under chi²(s + 1) and 5.5 % under chi²(s).
    # 2000 runs: standard errors .3 % and .5 %.
    rng = np.random.default_rng(20150612)
    root = np.linalg.cholesky(equicorrelated(6, 0.12))
    results = [constant_correlation_test(rng.standard_normal((360, 6)) @ root.T) for _ in range(2000)]
    published = np.mean([result.p_value < 0.05 for result in results])
    honest = np.mean([result.p_value_s < 0.05 for result in results])
    assert 0.008 < published < 0.028
    assert 0.04 < honest < 0.07
