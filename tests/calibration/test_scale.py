"""Scale factor and bias from plateaus: known truth, intervals, faults."""

import math

import numpy as np
import pytest
from scipy.stats import linregress

from vgyro.calibration import GyroNominal, average_plateaus, fit_scale_factor
from vgyro.errors import DataError, TooShort
from vgyro.units import EARTH_RATE_DEG_H

RATES = np.array([0, *range(25, 301, 25), *range(-25, -301, -25), 0], dtype=float)
GYRO = GyroNominal("g1", 0.0153, 0.0, 1, 300.0)
ERROR = 1.5  # counts, of a plateau mean


def means(rng: np.random.Generator, scale: float = 0.0149, bias: float = 57.0, sign: int = 1) -> np.ndarray:
    return (bias + sign * RATES / scale + ERROR * rng.standard_normal(RATES.size))[:, None]


def fit(mean: np.ndarray, gyro: GyroNominal = GYRO, **options):
    (found,) = fit_scale_factor(RATES, mean, np.full_like(mean, ERROR), [gyro], **options)
    return found


def test_exact_line():
    (found,) = fit_scale_factor(RATES, (57.0 + RATES / 0.0149)[:, None], np.zeros((RATES.size, 1)), [GYRO])
    assert (found.source, found.scale, found.bias) == ("measured", pytest.approx(0.0149), pytest.approx(57.0))
    assert found.nonlinearity_ppm == pytest.approx(0, abs=1e-6)
    assert found.floor_ppm == 0


def test_equals_scipy():
    mean = means(np.random.default_rng(1))
    found, theirs = fit(mean), linregress(RATES, mean[:, 0])
    assert found.scale == pytest.approx(1 / theirs.slope, rel=1e-12)
    assert found.bias == pytest.approx(theirs.intercept, rel=1e-12)
    # Half-width of the slope: t with 24 degrees of freedom, 2.0639.
    assert 1 / found.scale_low - theirs.slope == pytest.approx(2.0639 * theirs.stderr, rel=1e-4)
    assert found.bias_high - theirs.intercept == pytest.approx(2.0639 * theirs.intercept_stderr, rel=1e-4)


def test_intervals_cover_the_truth():
    rng = np.random.default_rng(2)
    fits = [fit(means(rng)) for _ in range(400)]
    scale = sum(found.scale_low <= 0.0149 <= found.scale_high for found in fits)
    bias = sum(found.bias_low <= 57.0 <= found.bias_high for found in fits)
    assert abs(scale - 380) <= 13
    assert abs(bias - 380) <= 13
    # The floor is the median of the nonlinearity of a linear gyro.
    above = sum(found.nonlinearity_ppm > found.floor_ppm for found in fits)
    assert 0.3 * 400 < above < 0.65 * 400


def test_floor_of_the_reference_test():
    # METRICS: N = 6.17 deg/√h and 20 s a point give a floor of about 150-200 ppm of 300 deg/s.
    error = 6.17 / 60 / math.sqrt(20) / 0.0149
    (found,) = fit_scale_factor(RATES, means(np.random.default_rng(3)), np.full((RATES.size, 1), error), [GYRO])
    assert 150 < found.floor_ppm < 200


def test_nonlinearity_and_residuals():
    bent = (57.0 + RATES / 0.0149 + 1e-6 * RATES**3)[:, None]
    (found,) = fit_scale_factor(RATES, bent, np.full_like(bent, 0.01), [GYRO])
    assert found.nonlinearity_ppm == pytest.approx(1e6 * np.abs(found.residual).max() / 300)
    assert found.nonlinearity_ppm > 50 * found.floor_ppm
    np.testing.assert_allclose(found.residual, (bent[:, 0] - found.bias) * found.scale - RATES, atol=1e-9)


def test_a_gyro_mounted_upside_down():
    gyro = GyroNominal("g2", 0.0153, 0.0, -1, 300.0)
    found = fit(means(np.random.default_rng(4), sign=-1), gyro)
    assert found.scale == pytest.approx(0.0149, rel=1e-3)
    assert found.scale_low < 0.0149 < found.scale_high
    assert np.abs(found.residual).max() < 0.2


def test_a_gyro_against_its_sign_is_named():
    with pytest.raises(DataError, match="'g1' turns against the table") as error:
        fit(means(np.random.default_rng(5), sign=-1), where="calibration")
    assert "sign to -1" in str(error.value)
    assert str(error.value).startswith("calibration:")


def test_stuck_and_clipped_gyros_keep_nominal_values():
    mean = np.full((RATES.size, 1), 12.0)
    stuck = fit(mean)
    assert (stuck.source, stuck.scale) == ("nominal", GYRO.scale)
    assert "does not answer" in stuck.note
    clipped = np.full((RATES.size, 1), np.nan)
    assert "clipped" in fit(clipped).note


def test_earth_rate():
    # At 30° the vertical axis feels half of the Earth rate: it must not end up in the bias.
    sensed = RATES + 0.5 * EARTH_RATE_DEG_H / 3600
    mean = (57.0 + sensed / 0.0149)[:, None]
    assert fit(mean, latitude_deg=30.0).bias == pytest.approx(57.0, abs=1e-6)
    assert fit(mean).bias == pytest.approx(57.0 + 0.5 * EARTH_RATE_DEG_H / 3600 / 0.0149, abs=1e-6)


def test_too_few_rates():
    with pytest.raises(TooShort, match="2 different rates"):
        fit_scale_factor(np.array([0.0, 10.0, 0.0]), np.zeros((3, 1)), np.zeros((3, 1)), [GYRO])


def test_plateau_means_and_their_standard_error():
    # White noise of 10 counts, 8 s at 200 Hz: standard error 10/√1600 = 0.25.
    rng = np.random.default_rng(6)
    time = np.arange(4000) / 200.0
    counts = np.where(time < 10, 100.0, 500.0)[:, None] + 10 * rng.standard_normal((4000, 40))
    found = average_plateaus(counts, time, [(1.0, 9.0, 0.0), (11.0, 19.0, 50.0), (30.0, 40.0, 0.0)])
    assert found.samples.tolist() == [1601, 1601, 0]
    np.testing.assert_allclose(found.mean[:2].mean(axis=1), [100, 500], atol=0.2)
    assert np.median(found.standard_error[:2]) == pytest.approx(0.25, rel=0.1)
    assert np.isnan(found.mean[2]).all()


def test_a_clipped_plateau_is_left_out_for_that_gyro():
    time = np.arange(1000) / 100.0
    counts = np.tile([[5.0, 5.0]], (1000, 1)) + np.random.default_rng(7).standard_normal((1000, 2))
    counts[500, 1] = 32767
    found = average_plateaus(counts, time, [(0.0, 9.0, 0.0)], (-32768, 32767))
    assert np.isfinite(found.mean[0, 0])
    assert np.isnan(found.mean[0, 1])
