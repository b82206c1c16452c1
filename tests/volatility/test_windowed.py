"""Windows in which some gyros have no model."""

import numpy as np
import pytest

from vgyro.volatility import Window, fit_dcc, fit_garch
from vgyro.volatility.windowed import fit_array_dcc, fitted_residuals


@pytest.fixture(scope="module")
def values(simulator, equicorrelated):
    return simulator(360, [1e-4] * 4, [0.08] * 4, [0.85] * 4, 0.05, 0.9, equicorrelated(4, 0.3), seed=2)[0]


@pytest.mark.parametrize("definition", ["level", "demeaned", "difference", "residual"])
def test_a_stuck_gyro_is_left_out_whatever_is_subtracted(values, definition):
    stuck = values.copy()
    stuck[:, 2] = 0.25
    r = fitted_residuals(stuck, Window(0, 360), definition)
    assert len(r) == (359 if definition == "difference" else 360)
    garch = fit_garch(r)
    assert garch.status[2] == "no variance"
    found = fit_array_dcc(r, garch.omega, garch.alpha, garch.beta, garch.status)
    others = [0, 1, 3]
    alone = fit_dcc(r[:, others] / np.sqrt(garch.variance[:, others]))
    assert (found.fit.a, found.fit.b) == pytest.approx((alone.a, alone.b), abs=1e-6)
    np.testing.assert_allclose(found.fit.target[np.ix_(others, others)], alone.target)
    assert np.isnan(found.fit.target[2]).all()
    assert np.isfinite(found.test.statistic)


def test_all_constant():
    r = fitted_residuals(np.full((100, 3), 0.1), Window(0, 100), "level")
    garch = fit_garch(r)
    assert set(garch.status) == {"no variance"}
    found = fit_array_dcc(r, garch.omega, garch.alpha, garch.beta, garch.status)
    assert np.isnan(found.fit.a)
    assert np.isnan(found.test.p_value)


def test_one_gyro(values):
    garch = fit_garch(values[:, :1])
    found = fit_array_dcc(values[:, :1], garch.omega, garch.alpha, garch.beta, garch.status)
    assert found.fit.status == "one gyro"
    assert np.isnan([found.fit.a, found.fit.b, found.fit.log_likelihood]).all()


def test_too_short():
    nothing = np.full(2, np.nan)
    found = fit_array_dcc(np.empty((0, 2)), nothing, nothing, nothing, np.array(["too short"] * 2, dtype=object))
    assert found.fit.status == "too short"
