"""A simulated calibration, from the counts on: its 95 % intervals hold the truth that was put into the twin."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from vgyro.board import Board
from vgyro.calibration import (
    Finding,
    GyroNominal,
    ScaleFit,
    average_plateaus,
    bias_temperature,
    fit_bias_temperature,
    fit_scale_factor,
    scale_temperature,
    thermal_points,
)
from vgyro.calibration.figures import BELOW, VALUE
from vgyro.simulate import Twin, calibration_truth, parse_twin, simulate_recording, thermal_truth
from vgyro.storage.inputs import read_board

ROOT = Path(__file__).resolve().parents[2]
TEMPERATURES = ("cold", "cool", "cycle1", "warm", "hot")
IN_ONE_TEST = ("scale", "bias", "nonlinearity_full_scale", "nonlinearity_reading", "nonlinearity_rms", "asymmetry",
               "hysteresis", "zero_shift", "zero_offset")  # fmt: skip
QUICK_HZ = 50.0  # the same density of noise, a quarter of the samples


@cache
def shipped() -> tuple[Twin, Board]:
    """The twin calibration, and its board."""
    text = (ROOT / "config/twins/calibration.yaml").read_text(encoding="utf-8")
    return parse_twin(text, "calibration.yaml"), read_board("dsp6", boards=ROOT / "config/boards")


def changed(twin: Twin, recording: str, rate_hz: float | None, gyros: dict[str, dict]) -> Twin:
    """The twin with one recording, at another sample rate, its gyros' errors changed."""
    spec = twin.recording(recording).model_copy(update={"rate_hz": rate_hz})
    errors = {name: truth.model_copy(update=gyros.get(name, {})) for name, truth in twin.gyros.items()}
    return twin.model_copy(update={"recordings": (spec,), "gyros": errors})


def only(board: Board, gyro: str) -> Board:
    """The board with one gyro: every gyro has random streams of its own, so it is the same one."""
    kept = tuple(one for one in board.gyros if one.name == gyro)
    return board.model_copy(update={"gyros": kept, "temperatures": board.temperatures[:1]})


def calibrated(twin: Twin, board: Board, recording: str, seed: int) -> ScaleFit:
    """The fit of the board's only gyro."""
    (gyro,), (thermometer,) = board.gyros, board.temperatures
    simulated = simulate_recording(twin, board, recording, seed)
    celsius = simulated.counts[thermometer.field] * thermometer.scale + thermometer.offset
    plateaus = [(plateau.start, plateau.stop, plateau.rate) for plateau in simulated.plateaus]
    counts = simulated.counts[gyro.field][:, None]
    assert board.adc is not None
    means = average_plateaus(
        counts, simulated.time, plateaus, (board.adc.low, board.adc.high), temperature=celsius
    )  # fmt: skip
    nominal = GyroNominal(gyro.name, gyro.scale, gyro.bias, gyro.sign, gyro.range_deg_s)
    return fit_scale_factor(means, [nominal], twin.latitude_deg)[0]


def steepness(twin: Twin, board: Board, seed: int, scale: float) -> Finding:
    """Bias against temperature of the board's only gyro, from the sweep of the chamber."""
    (gyro,), (thermometer,) = board.gyros, board.temperatures
    simulated = simulate_recording(twin, board, "sweep", seed)
    celsius = simulated.counts[thermometer.field] * thermometer.scale + thermometer.offset
    blocks = thermal_points(simulated.counts[gyro.field][:, None], celsius, simulated.rate_hz)
    fit = fit_bias_temperature(blocks.temperature[:, 0], blocks.counts[:, 0], blocks.time)
    return bias_temperature(fit, scale, gyro.sign)


def limits(fit: ScaleFit, figure: str) -> tuple[float, float]:
    if figure in ("scale", "bias"):
        return getattr(fit, f"{figure}_low"), getattr(fit, f"{figure}_high")
    return fit.figures[figure].low, fit.figures[figure].high


def found(seeds: range, rate_hz: float | None) -> dict[str, int]:
    """Figure → seeds in which its interval held the truth; g1: 120 ppm, 300 ppm, 60 ppm, -400 ppm/K."""
    twin, whole = shipped()
    board = only(whole, "g1")
    quick = {name: changed(twin, name, rate_hz, {}) for name in TEMPERATURES}
    truth = calibration_truth(twin, board, "cycle1")["g1"]
    held = dict.fromkeys((*IN_ONE_TEST, "scale_temperature", "bias_temperature"), 0)
    sweep = changed(twin, "sweep", rate_hz, {})
    slope = thermal_truth(twin, board, "sweep")["g1"]["bias_temperature"]
    for seed in seeds:
        fits = {name: calibrated(quick[name], board, name, seed) for name in TEMPERATURES}
        for figure in IN_ONE_TEST:
            low, high = limits(fits["cycle1"], figure)
            held[figure] += low <= truth[figure] <= high
        warmth, scale, error = (
            np.array([getattr(fit, key) for fit in fits.values()]) for key in ("temperature_c", "scale", "scale_error")
        )
        finding = scale_temperature(warmth, scale, error)
        held["scale_temperature"] += finding.low <= truth["scale_temperature"] <= finding.high
        steep = steepness(sweep, board, seed, fits["cycle1"].scale)
        held["bias_temperature"] += steep.low <= slope <= steep.high
    return held


def test_ten_calibrations_hold_the_truth() -> None:
    # Intervals of 95 %: 8 of 10 or more but for one case in a hundred (binomial); the whole test has 100 seeds.
    held = found(range(10), QUICK_HZ)
    assert min(held.values()) >= 8, held


@pytest.mark.full
def test_the_truth_is_within_the_intervals_of_ninety_calibrations_of_a_hundred() -> None:
    # The bound of the issue; nominal coverage is 95.
    held = found(range(100, 200), None)
    assert min(held.values()) >= 90, held


def below_the_floor(seeds: range, rate_hz: float | None) -> tuple[float, int]:
    """Mean floor of the test, ppm, and in how many seeds 50 ppm (g3) are reported as below it."""
    twin, whole = shipped()
    # Noise that gives a floor of 77 ppm at 14.4 s a point; that of g3 as shipped gives 12 ppm.
    noisy = changed(twin, "cycle1", rate_hz, {"all": {"arw_deg_rt_h": 3.12}})
    board = only(whole, "g3")
    findings = [calibrated(noisy, board, "cycle1", seed).figures["nonlinearity_full_scale"] for seed in seeds]
    assert calibration_truth(noisy, board, "cycle1")["g3"]["nonlinearity_full_scale"] == pytest.approx(50, abs=0.1)
    assert all(np.isnan(one.value) == (one.state == BELOW) for one in findings)
    return float(np.mean([one.floor for one in findings])), sum(one.state == BELOW for one in findings)


def test_fifty_ppm_under_a_floor_of_77_are_not_claimed() -> None:
    floor, below = below_the_floor(range(10), QUICK_HZ)
    assert floor == pytest.approx(77, rel=0.1)
    assert below >= 9


@pytest.mark.full
def test_fifty_ppm_under_a_floor_of_77_are_not_claimed_in_ninety_of_100_tests() -> None:
    floor, below = below_the_floor(range(100, 200), None)
    assert floor == pytest.approx(77, rel=0.05)
    assert below >= 90


def test_fifty_ppm_at_twice_the_floor_and_more_are_found() -> None:
    twin, whole = shipped()
    finding = calibrated(twin, only(whole, "g3"), "cycle1", 1).figures["nonlinearity_full_scale"]
    assert finding.floor < 25  # 12 on average, and it is itself an estimate
    assert finding.state == VALUE
    assert finding.low <= 50 <= finding.high
