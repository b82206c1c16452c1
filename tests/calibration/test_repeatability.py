"""Repeatability over power cycles, noise taken off."""

import numpy as np
import pytest

from vgyro.calibration import BELOW, MISSING, VALUE, bias_repeatability, scale_repeatability

SCALE = 0.0149


def test_standard_deviation_without_noise():
    scale = SCALE * (1 + 1e-6 * np.array([10.0, -20.0, 40.0, -30.0]))
    found = scale_repeatability(scale, np.zeros(4))
    assert found.value == pytest.approx(1e6 * np.std(scale, ddof=1) / scale.mean())
    # chi² with 3 degrees of freedom: 0.21580 and 9.3484 at 2.5 and 97.5 %.
    assert found.low == pytest.approx(found.value * np.sqrt(3 / 9.3484), rel=1e-4)
    assert found.high == pytest.approx(found.value * np.sqrt(3 / 0.21580), rel=1e-4)
    bias = bias_repeatability(np.array([1.0, 2.0, 4.0]), np.zeros(3), SCALE)
    assert bias.value == pytest.approx(np.std([1, 2, 4], ddof=1) * SCALE * 3600)


@pytest.mark.parametrize("cycles", [3, 7])
@pytest.mark.parametrize(("sigma", "error"), [(30, 5), (30, 18), (0, 18)])
def test_intervals_cover_the_truth(cycles: int, sigma: float, error: float):
    rng = np.random.default_rng(1)
    scales = SCALE * (
        1 + 1e-6 * (sigma * rng.standard_normal((400, cycles)) + error * rng.standard_normal((400, cycles)))
    )
    found = [scale_repeatability(scale, np.full(cycles, SCALE * error * 1e-6)) for scale in scales]
    assert 0.92 <= np.mean([finding.low <= sigma <= finding.high for finding in found]) <= 0.99
    if sigma == 0:
        assert np.mean([finding.state == VALUE for finding in found]) <= 0.05


def test_a_slope_in_temperature_is_no_scatter():
    temperature = np.array([-10.0, 8.0, 25.0, 25.0, 42.0, 60.0])
    scale = SCALE * (1 + 400e-6 * (temperature - 25))
    found = scale_repeatability(scale, np.full(6, 1e-6 * SCALE), temperature)
    assert found.state == BELOW
    assert "temperature" in found.note
    assert scale_repeatability(scale, np.full(6, 1e-6 * SCALE)).value > 5000


def test_one_cycle_says_nothing():
    assert scale_repeatability(np.array([SCALE]), np.array([1e-6])).state == MISSING
