"""What a twin's gyro makes of the rate, against the formulas of docs/twins.md written out here."""

from collections.abc import Callable

import numpy as np
import pytest

from vgyro.board import Board
from vgyro.simulate import Twin, check_against_board, lasting, manifest_of, simulate_pieces, simulate_recording
from vgyro.simulate.transfer import Direction

LOOP = [0, 100, 200, 300, 200, 100, 0, -100, -200, -300, -200, -100, 0]
TABLE = f"kind: calibration, motion: {{kind: rate_table, rates: {LOOP}, settle_s: 1, plateau_s: 1}}"


def plateau_rates(simulated) -> np.ndarray:
    """Mean of g1 on every plateau; without noise it is the same at every sample."""
    time = simulated.time
    inside = [(time >= p.start) & (time < p.stop) for p in simulated.plateaus]
    return np.array([simulated.rates[mask, 0].mean() for mask in inside])


@pytest.mark.parametrize(
    ("gyro", "expected"),
    [
        # The cubic is the largest at both ends, where it is p of 300 deg/s, and zero at u² = 0.6.
        ("nonlinearity_ppm: 120", lambda x, _: 120e-6 * 300 * ((x / 300) ** 3 - 0.6 * x / 300) / 0.4),
        ("asymmetry_ppm: 300", lambda x, _: 150e-6 * np.abs(x)),
        ("hysteresis_ppm: 80", lambda x, d: -d * 40e-6 * 300 * (1 - (x / 300) ** 2)),
        ("scale_temperature_ppm_k: -400", lambda x, _: -400e-6 * 20 * x),
        ("temperature_coefficient: 0.002, temperature_quadratic: 0.0003, temperature_cubic: -1.0e-05",
         lambda x, _: np.full_like(x, 0.002 * 20 + 0.0003 * 400 - 1e-5 * 8000)),
    ],
)  # fmt: skip
def test_noiseless_transfer_is_the_formula(
    quiet: Callable[..., Twin], dsp6: Board, gyro: str, expected: Callable
) -> None:
    twin = quiet(TABLE, f"{{g1: {{{gyro}}}}}", "temperature: {start_c: 45}")
    simulated = simulate_recording(twin, dsp6, "run")
    rate = np.array(LOOP, dtype=float)
    direction = np.array([0, 1, 1, 1, -1, -1, -1, -1, -1, -1, 1, 1, 1])
    assert plateau_rates(simulated) - rate == pytest.approx(expected(rate, direction), abs=1e-9)
    assert np.array_equal(simulated.rates[:, 1], simulated.reference)


def test_the_cubic_has_no_slope_of_its_own(quiet: Callable[..., Twin], dsp6: Board) -> None:
    # The least-squares line over a fine, even grid: slope 1, largest deviation the figure that was put in.
    rates = np.linspace(-300, 300, 601).tolist()
    motion = f"kind: calibration, motion: {{kind: rate_table, rates: {rates}, settle_s: 0, plateau_s: 0.01}}"
    simulated = simulate_recording(quiet(motion, "{g1: {nonlinearity_ppm: 120}}"), dsp6, "run")
    seen = plateau_rates(simulated)
    slope, offset = np.polyfit(rates, seen, 1)
    assert slope == pytest.approx(1, abs=2e-6)
    assert np.abs(seen - slope * np.array(rates) - offset).max() == pytest.approx(120e-6 * 300, rel=0.01)


def test_slopes_of_both_directions_differ_by_the_asymmetry(quiet: Callable[..., Twin], dsp6: Board) -> None:
    twin = quiet(TABLE, "{g1: {asymmetry_ppm: 300, nonlinearity_ppm: 120}}")
    seen, rate = plateau_rates(simulate_recording(twin, dsp6, "run")), np.array(LOOP, dtype=float)
    plus, minus = (np.polyfit(rate[side], seen[side], 1)[0] for side in (rate >= 0, rate <= 0))
    # The cubic changes both slopes alike, by some ppm of 1: the ratio by so many ppm of itself.
    assert (plus - minus) / ((plus + minus) / 2) == pytest.approx(300e-6, rel=1e-3)


def test_direction_is_that_of_the_last_change_across_pieces() -> None:
    rate = np.array([5.0, 5, 6, 6, 6, 4, 4, 4, 7])
    expected = [0, 0, 1, 1, 1, -1, -1, -1, 1]
    whole, pieces = Direction(), Direction()
    assert whole.next(rate).tolist() == expected
    assert np.concatenate([pieces.next(part) for part in np.split(rate, [1, 4, 7])]).tolist() == expected


def test_the_pieces_change_nothing(quiet: Callable[..., Twin], dsp6: Board, monkeypatch) -> None:
    gyros = "{g1: {hysteresis_ppm: 500, nonlinearity_ppm: 400, arw_deg_rt_h: 1}}"
    more = "sensor_pole_hz: 40\ntemperature: {points: [[0, 20], [20, 60]]}\nlatitude_deg: 45"
    twin = quiet(TABLE, gyros, more)
    whole = simulate_recording(twin, dsp6, "run")
    monkeypatch.setattr("vgyro.simulate.recording.PIECE", 1000)
    pieces = [piece.rates for piece in simulate_pieces(twin, dsp6, "run")]
    assert len(pieces) > 2
    np.testing.assert_allclose(np.concatenate(pieces), whole.rates, rtol=0, atol=1e-12)


def test_a_sweep_of_the_chamber_carries_the_self_heating(quiet: Callable[..., Twin], dsp6: Board) -> None:
    more = "temperature: {points: [[2, -10], [12, 50]], rise_k: 4, time_constant_s: 5}"
    simulated = simulate_recording(quiet("kind: thermal, duration_s: 20", more=more), dsp6, "run")
    time = simulated.time
    chamber = -10 + 6 * np.clip(time - 2, 0, 10)
    assert simulated.temperature == pytest.approx(chamber + 4 * (1 - np.exp(-time / 5)))


def test_a_longer_recording_has_a_slower_sweep(quiet: Callable[..., Twin]) -> None:
    more = "temperature: {points: [[0, 20], [10, 60], [20, 20]], noise_k: 0.1}"
    (recording,) = lasting(quiet("kind: thermal, duration_s: 20", more=more), 0.1).recordings
    assert recording.temperature is not None
    assert recording.temperature.points == ((0, 20), (180, 60), (360, 20))
    assert recording.temperature.noise_k == 0.1


def test_cross_axis_and_earth(quiet: Callable[..., Twin], board: Callable[[str], Board]) -> None:
    # 15.04 deg/h times the sine of 30 degrees, on the axis that turns; z sees its share of both.
    motion = "kind: constant, duration_s: 1, axis: y, motion: {kind: constant, rate: 10}"
    twin = quiet(motion, "{gz: {cross_axis: 0.01}}", "latitude_deg: 30")
    simulated = simulate_recording(twin, board("kvh1750"), "run")
    earth = 15.04 / 3600 / 2
    assert simulated.rates[0] == pytest.approx([0, 10 + earth, 0.01 * (10 + earth)])
    assert np.all(simulated.reference == 10)
    assert manifest_of(twin).latitude_deg == 30


def test_a_figure_of_full_scale_needs_a_range(quiet: Callable[..., Twin], dsp6: Board) -> None:
    endless = dsp6.model_copy(update={"gyros": tuple(g.model_copy(update={"range_deg_s": None}) for g in dsp6.gyros)})
    twin = quiet(TABLE, "{all: {nonlinearity_ppm: 100}}")
    assert check_against_board(twin, dsp6, "t") == []
    (problem,) = check_against_board(twin, endless, "t")
    assert problem.key == "gyros.all.nonlinearity_ppm"
    assert "no range_deg_s" in problem.message


@pytest.mark.parametrize(
    ("thermal", "message"),
    [
        ("{points: [[0, 20], [0, 30]]}", "in order of time"),
        ("{points: [[0, 20]]}", "at least two"),
        ("{points: [[0, 20], [9, 30]], start_c: 20}", "leave one of them out"),
    ],
)
def test_a_wrong_sweep_is_refused(quiet: Callable[..., Twin], thermal: str, message: str) -> None:
    with pytest.raises(Exception, match=message):
        quiet("kind: thermal, duration_s: 20", more=f"temperature: {thermal}")
