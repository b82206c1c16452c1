"""Windows in which some gyros have no model."""

from dataclasses import fields

import numpy as np
import pytest

from vgyro.engine.models import DCC_STATUSES, DccWindows
from vgyro.engine.native.garch import fit_garch_windows
from vgyro.volatility import Window, fit_dcc, fit_garch
from vgyro.volatility.windowed import fit_array_dcc_windows, fitted_residuals


@pytest.fixture(scope="module")
def values(simulator, equicorrelated):
    return simulator(360, [1e-4] * 4, [0.08] * 4, [0.85] * 4, 0.05, 0.9, equicorrelated(4, 0.3), seed=2)[0]


def windows_fit(r, engine="native"):
    """GARCH and DCC of windows r [K, T, N]."""
    garch = fit_garch_windows(r)
    return fit_array_dcc_windows(r, garch, engine)


@pytest.mark.parametrize("definition", ["level", "demeaned", "difference", "residual"])
def test_a_stuck_gyro_is_left_out_whatever_is_subtracted(values, definition):
    # Expected: the fit of the other gyros alone.
    stuck = values.copy()
    stuck[:, 2] = 0.25
    r = fitted_residuals(stuck, Window(0, 360), definition)
    assert len(r) == (359 if definition == "difference" else 360)
    found = windows_fit(r[None])
    others = [0, 1, 3]
    garch = fit_garch(r[:, others])
    alone = fit_dcc(r[:, others] / np.sqrt(garch.variance))
    assert (found.a[0], found.b[0]) == pytest.approx((alone.a, alone.b), abs=1e-6)
    np.testing.assert_allclose(found.target[0][np.ix_(others, others)], alone.target)
    assert np.isnan(found.target[0, 2]).all()
    assert np.isfinite(found.statistic[0])


@pytest.mark.parametrize("engine", ["native", "reference"])
def test_windows_with_different_gyros(values, engine):
    # Expected: each window fitted alone. None stuck, two different ones stuck, three stuck, all stuck.
    r = np.stack([values] * 6)
    for window, gyros in enumerate(([], [2], [], [0], [0, 1, 3], [0, 1, 2, 3])):
        r[window, :, gyros] = 0.0
    found = windows_fit(r, engine)
    names = [DCC_STATUSES[code] for code in found.status]
    assert names[2] == names[0]
    assert names[4:] == ["one gyro"] * 2
    assert np.isnan([found.a[4:], found.b[4:], found.log_likelihood[4:], found.statistic[4:]]).all()
    assert found.target[4, 2, 2] == 1.0
    assert np.isnan(found.target[4]).sum() == 15
    assert np.isnan(found.target[5]).all()
    for window in range(6):
        alone = windows_fit(r[window : window + 1], engine)
        for field in fields(DccWindows):
            expected = getattr(alone, field.name)[0]
            np.testing.assert_array_equal(getattr(found, field.name)[window], expected, err_msg=field.name)


def test_one_gyro(values):
    found = windows_fit(values[None, :, :1])
    assert DCC_STATUSES[found.status[0]] == "one gyro"
    assert np.isnan([found.a, found.b, found.log_likelihood]).all()


def test_too_short():
    found = windows_fit(np.ones((2, 3, 2)))
    assert [DCC_STATUSES[code] for code in found.status] == ["too short"] * 2
    assert np.isnan(found.target).all()
    assert len(windows_fit(np.empty((0, 360, 2))).a) == 0
