"""Scale factor and bias from plateaus: known truth, intervals, faults."""

import math
from dataclasses import replace

import numpy as np
import pytest
from rate_table import BIAS, LOOP, ONCE, SCALE, bent, fit, gyro, truth, turn
from scipy.stats import linregress

from vgyro.calibration import GyroNominal, PlateauMeans, cross_axis, fit_scale_factor
from vgyro.errors import DataError, TooShort
from vgyro.units import EARTH_RATE_DEG_H

WHITE = 0.022  # deg/s, of a plateau mean
FEW = np.array([0.0, 100.0, -100.0, 0.0])


def exact(rates: np.ndarray = ONCE) -> PlateauMeans:
    return turn(rates, np.random.default_rng(0), 1)


def test_exact_line():
    (found,) = fit(exact())
    assert (found.source, found.scale, found.bias) == ("measured", pytest.approx(SCALE), pytest.approx(BIAS))
    assert found.nonlinearity_ppm == pytest.approx(0, abs=1e-6)
    assert found.floor_ppm == pytest.approx(0, abs=1e-4)
    assert {name: finding.state for name, finding in found.figures.items()} == {
        **dict.fromkeys(
            (
                "nonlinearity_full_scale",
                "nonlinearity_reading",
                "nonlinearity_rms",
                "asymmetry",
                "zero_shift",
                "zero_offset",
            ),
            "below the floor",
        ),
        "hysteresis": "not measured",
    }


def test_few_plateaus_equal_scipy():
    # Four plateaus leave no room for more than a line: ordinary least squares, t with 2 degrees of freedom, 4.3027.
    means = turn(FEW, np.random.default_rng(1), 1, white=WHITE)
    (found,), theirs = fit(means), linregress(FEW, means.mean[:, 0])
    assert found.scale == pytest.approx(1 / theirs.slope, rel=1e-12)
    assert found.bias == pytest.approx(theirs.intercept, rel=1e-12)
    assert 1 / found.scale_low - theirs.slope == pytest.approx(4.3027 * theirs.stderr, rel=1e-4)
    assert found.bias_high - theirs.intercept == pytest.approx(4.3027 * theirs.intercept_stderr, rel=1e-4)
    assert found.scale_error == pytest.approx(theirs.stderr / theirs.slope**2, rel=1e-6)
    assert found.figures["nonlinearity_rms"].state == "not measured"


def test_the_line_through_a_bent_gyro_is_the_least_squares_line():
    transfer = bent(120, 300)
    (found,) = fit(turn(LOOP, np.random.default_rng(0), 1, transfer))
    right = truth(LOOP, transfer)
    assert found.scale == pytest.approx(right["scale"], rel=1e-9)
    assert found.bias == pytest.approx(right["bias"], rel=1e-6)
    assert found.nonlinearity_ppm == pytest.approx(right["nonlinearity_full_scale"], rel=1e-3)


def test_floor_of_the_reference_test():
    # METRICS: N = 6.17 deg/√h and 20 s a point give a floor of about 150-200 ppm of 300 deg/s.
    means = turn(ONCE, np.random.default_rng(3), 30, white=6.17 / 60 / math.sqrt(20))
    assert 150 < np.median([found.floor_ppm for found in fit(means)]) < 200


def test_the_floor_is_what_half_of_linear_gyros_show():
    fits = fit(turn(LOOP, np.random.default_rng(4), 60, white=WHITE))
    above = np.mean([found.nonlinearity_ppm > found.floor_ppm for found in fits])
    assert 0.25 < above < 0.75  # 0.5 ± 4 standard errors of 60 tests


def test_residuals():
    (found,) = fit(turn(LOOP, np.random.default_rng(5), 1, white=WHITE))
    points = found.points
    np.testing.assert_allclose(points.residual, (points.mean_count - found.bias) * found.scale - points.rate, atol=1e-9)
    np.testing.assert_allclose(points.standard_error, WHITE, rtol=1e-3)
    assert points.direction.tolist()[:3] == [0, 1, 1]


def test_a_gyro_mounted_upside_down():
    means = turn(ONCE, np.random.default_rng(4), 1, white=WHITE, sign=-1)
    (found,) = fit_scale_factor(means, [gyro(sign=-1)])
    assert found.scale == pytest.approx(SCALE, rel=1e-3)
    assert found.scale_low < SCALE < found.scale_high
    assert np.abs(found.points.residual).max() < 0.2


def test_a_gyro_against_its_sign_is_named():
    means = turn(ONCE, np.random.default_rng(5), 1, white=WHITE, sign=-1)
    with pytest.raises(DataError, match="'g1' turns against the table") as error:
        fit(means, where="calibration")
    assert "sign to -1" in str(error.value)
    assert str(error.value).startswith("calibration:")


def test_stuck_and_clipped_gyros_keep_nominal_values():
    means = exact()
    (stuck,) = fit(replace(means, mean=np.full_like(means.mean, 12.0)))
    assert (stuck.source, stuck.scale, stuck.figures) == ("nominal", gyro().scale, {})
    assert "does not answer" in stuck.note
    (clipped,) = fit(replace(means, mean=np.full_like(means.mean, np.nan)))
    assert "clipped" in clipped.note


def test_a_clipped_plateau_is_left_out():
    means = exact()
    means.mean[np.abs(ONCE) == 300] = np.nan
    (found,) = fit(means)
    assert found.scale == pytest.approx(SCALE)
    assert found.points.rate.max() == 275
    assert len(found.points.rate) == len(found.points.temperature) == len(found.points.direction) == len(ONCE) - 2


def test_earth_rate():
    # At 30° the vertical axis feels half of the Earth rate: it must not end up in the bias.
    felt = 0.5 * EARTH_RATE_DEG_H / 3600
    means = turn(ONCE, np.random.default_rng(0), 1, lambda rate: rate + felt)
    (with_latitude,), (without,) = fit(means, latitude_deg=30.0), fit(means)
    assert with_latitude.bias == pytest.approx(BIAS, abs=1e-6)
    assert without.bias == pytest.approx(BIAS + felt / SCALE, abs=1e-6)
    np.testing.assert_allclose(with_latitude.points.residual, 0, atol=1e-9)


def test_too_few_rates():
    with pytest.raises(TooShort, match="2 different rates"):
        fit(exact(np.array([0.0, 10.0, 0.0])))


def test_rates_of_a_log_scatter():
    # A logged table holds 25 deg/s as 25.004 and 24.997: one rate, visited twice.
    wobble = 0.004 * np.random.default_rng(7).standard_normal(LOOP.size)
    means = turn(LOOP, np.random.default_rng(8), 1, white=WHITE)
    (found,) = fit(replace(means, rate=LOOP + wobble, mean=means.mean + wobble[:, None] / SCALE))
    assert found.figures["hysteresis"].state == "below the floor"
    assert found.scale_low < SCALE < found.scale_high


def test_rates_in_order_leave_no_drift():
    # From -300 to 300 in one go: a drift in time is a change of scale factor.
    rates = np.arange(-300.0, 301.0, 25.0)
    (found,) = fit(turn(rates, np.random.default_rng(9), 1, white=WHITE))
    assert "no drift" in found.note


def test_cross_axis():
    # A gyro tilted by 0.5° sees sin(0.5°) = 0.87 % of the table's rate; another stands upright.
    means = turn(LOOP, np.random.default_rng(10), 2, lambda rate: rate * math.sin(math.radians(0.5)), white=1e-3)
    upright = turn(LOOP, np.random.default_rng(11), 1, np.zeros_like, white=1e-3)
    means = replace(means, mean=np.column_stack([means.mean[:, 0], upright.mean]))
    tilted, none = cross_axis(means, [GyroNominal("x", SCALE, 0.0, 1), GyroNominal("y", SCALE, 0.0, -1)])
    assert tilted.state == "value"
    assert tilted.low < 100 * math.sin(math.radians(0.5)) < tilted.high
    assert none.state == "below the floor"
    assert none.low < 0 < none.high
