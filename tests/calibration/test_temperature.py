"""Scale factor and bias against temperature: known curves, coverage, compensation, self-heating."""

import math

import numpy as np
import pytest

from vgyro.calibration import (
    BELOW,
    MISSING,
    VALUE,
    Compensation,
    bias_temperature,
    compensate,
    fit_bias_temperature,
    scale_temperature,
    self_heating,
    smooth_temperature,
    thermal_points,
)
from vgyro.errors import TooShort
from vgyro.simulate.noise import unit_flicker

SCALE = 0.0149
CUBIC = np.array([0.0, 0.002, 2e-5, -4e-7])  # deg/s, deg/s/K, …, about 25 °C
SWEEP = ([0, 100, 450, 600, 1300, 1450, 1800], [25, 25, 60, 60, -10, -10, 25])  # s, °C
# N deg/s/√Hz, B deg/s, K deg/s/√s: 0.5 °/√h, 2 deg/h, 2 deg/h/√h; 6 °/√h, 54 deg/h, 29 deg/h/√h.
QUIET = (0.5 / 60, 2 / 3600, 2 / 216_000)
LOUD = (6.17 / 60, 54 / 3600, 29 / 216_000)


def noise(
    number: int, seconds: float, coefficients: tuple[float, float, float], rng: np.random.Generator
) -> np.ndarray:
    """Means of `seconds` each of white noise, flicker and random walk, deg/s."""
    n, b, k = coefficients
    walk = np.cumsum(k * math.sqrt(seconds) * rng.standard_normal(number))
    return n / math.sqrt(seconds) * rng.standard_normal(number) + b * unit_flicker(number, rng) + walk


def sweep(points: int = 150) -> tuple[np.ndarray, np.ndarray]:
    time = (np.arange(points) + 0.5) * 1800 / points
    return time, np.interp(time, *SWEEP)


def slope_of(coefficients: np.ndarray, temperature: np.ndarray) -> float:
    """Of the straight line through the curve over the range, deg/h/K, by numpy's polyfit on a fine grid."""
    grid = np.linspace(temperature.min(), temperature.max(), 2000)
    return 3600 * float(np.polyfit(grid, np.polynomial.polynomial.polyval(grid - 25, coefficients), 1)[0])


def test_cubic_without_noise():
    time, temperature = sweep()
    bias = (0.84 + np.polynomial.polynomial.polyval(temperature - 25, CUBIC)) / SCALE
    found = fit_bias_temperature(temperature, bias, time, reference_c=25.0)
    assert found.order == 3
    np.testing.assert_allclose(found.coefficients * SCALE, [0.84, *CUBIC[1:]], rtol=1e-6, atol=1e-12)
    assert bias_temperature(found, SCALE).value == pytest.approx(slope_of(CUBIC, temperature), rel=1e-2)
    assert bias_temperature(found, SCALE, -1).value == pytest.approx(-slope_of(CUBIC, temperature), rel=1e-2)
    assert (found.low_c, found.high_c) == (pytest.approx(-10), pytest.approx(60))


@pytest.mark.parametrize(
    ("coefficients", "runs"),
    [
        pytest.param(QUIET, 10, id="quiet"),
        pytest.param(QUIET, 100, id="quiet, all", marks=pytest.mark.full),
        pytest.param(LOUD, 100, id="loud", marks=pytest.mark.full),
    ],
)
def test_slope_and_curve_of_a_sweep(coefficients: tuple[float, float, float], runs: int):
    rng = np.random.default_rng(1)
    time, temperature = sweep()
    true = slope_of(CUBIC, temperature)
    curve, flat = [], []
    for _ in range(runs):
        wander = noise(len(time), 12.0, coefficients, rng) / SCALE
        bias = np.polynomial.polynomial.polyval(temperature - 25, CUBIC) / SCALE
        curve.append(fit_bias_temperature(temperature, bias + wander, time, reference_c=25.0))
        flat.append(fit_bias_temperature(temperature, wander, time, reference_c=25.0))
    found = [bias_temperature(fit, SCALE) for fit in curve]
    assert np.mean([finding.low <= true <= finding.high for finding in found]) >= 0.9
    assert np.mean([bias_temperature(fit, SCALE).state == VALUE for fit in flat]) <= 0.1
    assert np.mean([fit.order > 0 for fit in flat]) <= 0.1
    if coefficients is QUIET:
        assert all(fit.order == 3 for fit in curve)


def test_evidence_of_every_order():
    rng = np.random.default_rng(2)
    time, temperature = sweep()
    line = (0.01 * temperature + noise(len(time), 12.0, QUIET, rng)) / SCALE
    found = fit_bias_temperature(temperature, line, time)
    first, second, third = found.evidence
    assert found.order == 1
    assert first.p_value < 1e-6 < 0.01 < min(second.p_value, third.p_value)
    assert first.aic < min(second.aic, third.aic) + 2
    assert found.reference_c == pytest.approx(temperature.mean())


def test_independent_recordings():
    # Five tests: a quadratic leaves two degrees of freedom; numpy's polyfit is the same least squares.
    temperature = np.array([-10.0, 8.0, 25.0, 42.0, 60.0])
    bias = 57 + 0.3 * (temperature - 25) + 0.004 * (temperature - 25) ** 2
    bias += 1e-4 * np.array([1, -1, 0.5, 1, -1])
    found = fit_bias_temperature(temperature, bias, error=np.full(5, 1e-4), reference_c=25.0)
    assert found.order == 2
    np.testing.assert_allclose(found.coefficients[:3], np.polyfit(temperature - 25, bias, 2)[::-1], rtol=1e-9)
    with pytest.raises(TooShort):
        fit_bias_temperature(temperature[:3], bias[:3])
    with pytest.raises(TooShort):
        fit_bias_temperature(25 + temperature / 100, bias)


def test_a_sweep_one_way_is_marked():
    time = np.arange(100.0)
    found = fit_bias_temperature(20 + time / 10, np.random.default_rng(3).standard_normal(100), time)
    assert "one way" in found.note


def test_scale_slope():
    # -0.04 %/K of S is what a scale of 1/S shows at five temperatures.
    temperature = np.array([-10.0, 8.0, 25.0, 42.0, 60.0])
    scale = SCALE / (1 - 400e-6 * (temperature - 25))
    found = scale_temperature(temperature, scale, np.full(5, 1e-7))
    assert found.state == VALUE
    assert found.value == pytest.approx(-400, rel=1e-3)
    two = scale_temperature(temperature[[0, 4]], scale[[0, 4]], np.full(2, 1e-7))
    assert two.value == pytest.approx(-400, rel=0.01)
    assert math.isnan(two.low)
    assert "two temperatures" in two.note
    assert scale_temperature(np.full(4, 25.0), scale[:4], np.full(4, 1e-7)).state == MISSING


def test_limits_of_the_scale_slope():
    # Recordings repeat to 30 ppm; each S_i is known to 15 ppm.
    rng = np.random.default_rng(4)
    temperature = np.array([-10.0, 8.0, 25.0, 25.0, 25.0, 42.0, 60.0])
    found, none = [], []
    for _ in range(400):
        scatter = 1 + 1e-6 * (30 * rng.standard_normal(7) + 15 * rng.standard_normal(7))
        found.append(
            scale_temperature(temperature, SCALE * scatter / (1 - 4e-6 * (temperature - 25)), np.full(7, 2e-7))
        )
        none.append(scale_temperature(temperature, SCALE * scatter, np.full(7, 2e-7)))
    assert 0.92 <= np.mean([finding.low <= -4 <= finding.high for finding in found]) <= 0.98
    assert 0.92 <= np.mean([finding.state == BELOW for finding in none]) <= 0.98


def test_block_means():
    counts = np.arange(2000.0)[:, None] + [0.0, 7.0]
    points = thermal_points(counts, np.linspace(20, 40, 2000), 10.0, 20.0)
    assert points.counts[:, 0].tolist() == [99.5 + 200 * block for block in range(10)]
    np.testing.assert_allclose(points.counts[:, 1] - points.counts[:, 0], 7)
    np.testing.assert_allclose(points.time, 10 + 20 * np.arange(10))
    assert points.temperature[0, 0] == pytest.approx(20 + 20 * 99.5 / 1999)
    off = np.repeat([0, 1], [900, 1100])
    assert len(thermal_points(counts, counts[:, 0], 10.0, 20.0, off).time) == 4 + 5


def test_compensation_takes_the_temperature_off():
    # A board that turns at 100 deg/s between -10 and 60 °C, and beyond the range that was measured.
    temperature = np.linspace(-10, 60, 500)
    truth = Compensation(25.0, -10.0, 60.0, -400e-6, tuple((CUBIC / SCALE).tolist())).anchored(57.0)
    bias = 57.0 + np.polynomial.polynomial.polyval(temperature - 25, CUBIC) / SCALE
    counts = bias - 100 * (1 - 400e-6 * (temperature - 25)) / SCALE
    np.testing.assert_allclose(compensate(counts, temperature, -1, SCALE, truth), 100, rtol=1e-12)
    assert truth.bias_at(np.array([25.0])).tolist() == [57.0]
    np.testing.assert_array_equal(truth.bias_at(np.array([-40.0, 99.0])), truth.bias_at(np.array([-10.0, 60.0])))
    assert truth.scale_factor_at(np.array([99.0]))[0] == pytest.approx(1 / (1 - 400e-6 * 35))


def test_smooth_temperature_keeps_the_slope_and_loses_the_noise():
    rate_hz, slope = 10.0, 0.03
    time = np.arange(6000) / rate_hz
    noisy = 25 + slope * time + 0.05 * np.random.default_rng(5).standard_normal(6000)
    smooth = smooth_temperature(noisy, rate_hz, 60.0)
    error = smooth - 25 - slope * time
    # 601 samples a mean: 0.05/√601; at the very end of a straight line, twice that.
    assert np.std(error[400:-400]) == pytest.approx(0.05 / math.sqrt(601), rel=0.35)
    assert np.abs(error).max() < 5 * 2 * 0.05 / math.sqrt(601)
    np.testing.assert_allclose(smooth_temperature(25 + slope * time, rate_hz), 25 + slope * time, atol=1e-9)
    two = np.concatenate([np.full(1000, 20.0), np.full(1000, 40.0)])
    np.testing.assert_allclose(smooth_temperature(two, rate_hz, 60.0, np.repeat([0, 1], 1000)), two)
    assert smooth_temperature(np.empty(0), rate_hz).size == 0


def test_self_heating_without_noise():
    time = np.arange(1200) + 0.5
    found = self_heating(0.5 - 0.012 * np.exp(-time / 100.0), 1.0)
    # τ is on a grid of factors 1.34, so the fit is off by a little.
    assert found.value == pytest.approx(0.012 * 3600, rel=0.1)
    assert "time constant" in found.note


@pytest.mark.parametrize(
    ("coefficients", "runs"),
    [
        pytest.param(QUIET, 6, id="quiet"),
        pytest.param(QUIET, 100, id="quiet, all", marks=pytest.mark.full),
        pytest.param(LOUD, 100, id="loud", marks=pytest.mark.full),
    ],
)
def test_self_heating(coefficients: tuple[float, float, float], runs: int):
    rng = np.random.default_rng(6)
    warm, cold = [], []
    approach = -0.012 * np.exp(-(np.arange(1200) + 0.5) / 250)
    for _ in range(runs):
        wander = noise(1200, 1.0, coefficients, rng)
        warm.append(self_heating(approach + wander, 1.0))
        cold.append(self_heating(wander, 1.0))
    assert np.mean([finding.low <= 43.2 <= finding.high for finding in warm]) >= 0.9
    assert np.mean([finding.state == BELOW for finding in cold]) >= 0.95
    if coefficients is QUIET:
        assert np.mean([finding.state == VALUE for finding in warm]) >= 0.9


def test_too_short_for_self_heating():
    assert self_heating(np.zeros(10), 1.0).state == MISSING
