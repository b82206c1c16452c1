"""True figures of a calibration, against what was put into the twin and against counts made without noise."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from vgyro.board import Board
from vgyro.errors import DataError
from vgyro.simulate import (
    Twin,
    calibration_truth,
    check_against_board,
    parse_twin,
    repeatability_truth,
    simulate_recording,
    thermal_truth,
)
from vgyro.simulate.calibration_truth import true_points

LOOP = [0, 100, 200, 300, 200, 100, 0, -100, -200, -300, -200, -100, 0]
TABLE = f"kind: calibration, motion: {{kind: rate_table, rates: {LOOP}, settle_s: 1, plateau_s: 1}}"
LSB = 0.0152587890625


@pytest.fixture(scope="module")
def shipped(root: Path) -> Twin:
    return parse_twin((root / "config/twins/calibration.yaml").read_text(encoding="utf-8"), "calibration.yaml")


def test_the_shipped_twin_holds_its_figures(shipped: Twin, dsp6: Board) -> None:
    # What its file and docs/twins.md promise.
    assert check_against_board(shipped, dsp6, "calibration") == []
    truth = calibration_truth(shipped, dsp6, "cycle1")
    assert truth["g1"]["nonlinearity_full_scale"] == pytest.approx(120, abs=0.1)
    assert truth["g1"]["asymmetry"] == pytest.approx(300, abs=0.1)
    assert truth["g1"]["hysteresis"] == pytest.approx(60)
    assert truth["g1"]["scale_temperature"] == -400
    # An asymmetry a alone bends the line by a/4 of full scale at zero rate (mean of |x| is 1/2), a little more here.
    assert truth["g6"]["zero_offset"] == pytest.approx(200e-6 / 4 * 300 * 3600, rel=0.1)
    assert truth["g1"]["zero_shift"] == pytest.approx(-30e-6 * 300 * 3600)
    assert truth["g2"]["nonlinearity_full_scale"] == pytest.approx(0, abs=1e-6)
    assert truth["g3"]["nonlinearity_full_scale"] == pytest.approx(50, abs=0.1)
    assert truth["g4"]["nonlinearity_full_scale"] == pytest.approx(120, abs=0.1)
    assert truth["g5"]["hysteresis"] == pytest.approx(150)
    assert truth["g5"]["nonlinearity_full_scale"] == pytest.approx(0, abs=1e-6)
    assert truth["g6"]["asymmetry"] == pytest.approx(-200, abs=0.1)
    for found in repeatability_truth(shipped, dsp6, ["cycle1", "cycle2", "cycle3"]).values():
        assert found == pytest.approx({"repeatability": 30, "bias_repeatability": 36}, rel=1e-3)


def test_the_shipped_sequence_is_that_of_the_standard(shipped: Twin, dsp6: Board) -> None:
    # METRICS.md: zero before and after, at least 11 rates a direction, the maximum among them, whole turns.
    for spec in shipped.recordings:
        if spec.kind != "calibration":
            continue
        rates = np.array(spec.motion.rates)
        assert rates[0] == rates[-1] == 0
        for side in (rates[rates > 0], rates[rates < 0]):
            assert np.unique(side).size >= 11
            assert np.abs(side).max() == dsp6.gyros[0].range_deg_s
        turns = np.abs(rates[rates != 0]) * 14.4 / 360
        assert np.allclose(turns, np.rint(turns))
        assert spec.motion.plateau_s >= 14.4
    temperatures = {spec.temperature.start_c if spec.temperature else 25 for spec in shipped.recordings[:7]}
    assert len(temperatures) >= 4
    assert sum(spec.duration for spec in shipped.recordings) * 200 * 30 < 60e6


def test_points_are_the_counts_without_noise(quiet: Callable[..., Twin], dsp6: Board) -> None:
    gyro = "{g1: {nonlinearity_ppm: 4000, asymmetry_ppm: 3000, hysteresis_ppm: 5000, scale_temperature_ppm_k: -400,"
    gyro += " temperature_coefficient: 0.1, bias_deg_s: 3, scale_error: 0.02}}"
    twin = quiet(TABLE, gyro, "temperature: {start_c: 45}\nlatitude_deg: 48")
    simulated = simulate_recording(twin, dsp6, "run")
    points = true_points(twin, twin.recording("run"), dsp6.gyros[0])
    time = simulated.time
    shown = [simulated.counts["g1"][(time >= p.start) & (time < p.stop)].mean() for p in simulated.plateaus]
    assert np.abs(points.count - shown).max() <= 0.5  # rounding to a count
    assert points.output * 1.02 / LSB == pytest.approx(points.count)


def test_a_straight_gyro_has_its_scale_and_bias(quiet: Callable[..., Twin], dsp6: Board) -> None:
    truth = calibration_truth(quiet(TABLE, "{g2: {scale_error: 0.25, bias_deg_s: 2}}"), dsp6, "run")["g2"]
    assert truth["scale"] == pytest.approx(LSB / 1.25)
    assert truth["bias"] == pytest.approx(2 * 1.25 / LSB)
    assert (truth["zero_shift"], truth["hysteresis"]) == pytest.approx((0, 0), abs=1e-6)


def test_temperature_figures_of_a_recording(quiet: Callable[..., Twin], dsp6: Board) -> None:
    # Closed forms: over an even sweep from -a to a the line through c1·x + c3·x³ has the slope c1 + 0.6·c3·a².
    gyro = "{g1: {temperature_coefficient: 0.002, temperature_quadratic: 0.0001, temperature_cubic: 1.0e-05}}"
    sweep = "temperature: {points: [[0, 5], [1000, 45]], reference_c: 25}"
    twin = quiet("kind: thermal, duration_s: 1000", gyro, sweep)
    found = thermal_truth(twin, dsp6, "run")
    assert found["g1"]["bias_temperature"] == pytest.approx((0.002 + 0.6 * 1e-5 * 400) * 3600, rel=1e-4)
    assert found["g2"]["bias_temperature"] == pytest.approx(0)
    heated = quiet("kind: static, duration_s: 1000", gyro, "temperature: {start_c: 25, rise_k: 6}")
    expected = (0.002 * 6 + 0.0001 * 36 + 1e-5 * 216) * 3600
    assert thermal_truth(heated, dsp6, "run")["g1"]["self_heating"] == pytest.approx(expected)
    assert np.isnan(thermal_truth(quiet("kind: static, duration_s: 10"), dsp6, "run")["g1"]["bias_temperature"])


def test_only_a_rate_table_has_points(shipped: Twin, dsp6: Board) -> None:
    with pytest.raises(DataError, match="not on a rate table"):
        calibration_truth(shipped, dsp6, "static")
