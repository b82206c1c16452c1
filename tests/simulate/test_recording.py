"""Whole recordings: independence of the streams, faults where they should be, counts, plateaus, manifests."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats

from vgyro.board import Board
from vgyro.errors import ConfigError
from vgyro.simulate import Dump, Twin, dump_of, lasting, simulate_pieces, simulate_recording
from vgyro.simulate.recording import truth_table

STILL = "kind: static, duration_s: 20"
LSB = 0.0152587890625


def counts(simulated, gyro: int) -> np.ndarray:
    return simulated.counts[f"g{gyro}"]


def test_same_seed_same_bytes(twin: Twin, dsp6: Board) -> None:
    first, second = (dump_of(simulate_recording(twin, dsp6, "still"), dsp6, twin) for _ in range(2))
    assert first == second
    other = simulate_recording(twin, dsp6, "still", seed=12)
    assert dump_of(other, dsp6, twin, 12)[0] != first[0]


def test_one_recording_alone_equals_the_one_of_the_full_set(twin: Twin, dsp6: Board) -> None:
    full = {recording.name: simulate_recording(twin, dsp6, recording.name) for recording in twin.recordings}
    alone = twin.model_copy(update={"recordings": (twin.recording("shaken"),)})
    again = simulate_recording(alone, dsp6, "shaken")
    assert dump_of(again, dsp6, alone) == dump_of(full["shaken"], dsp6, twin)


def test_recordings_and_gyros_have_streams_of_their_own(twin: Twin, dsp6: Board) -> None:
    plain = twin.model_copy(update={"correlation": 0.0, "dcc": None})
    still, shaken = simulate_recording(plain, dsp6, "still"), simulate_recording(plain, dsp6, "shaken")
    rows = shaken.rates.shape[0]
    both = np.column_stack([still.rates[:rows], shaken.rates - shaken.reference[:, None]])
    fast = np.diff(both, axis=0)
    off_diagonal = np.corrcoef(fast.T)[~np.eye(12, dtype=bool)]
    assert np.abs(off_diagonal).max() < 0.15  # 1600 samples: s.d. 0.025, a little more behind the pole


def test_quantisation_error_is_uniform(quiet: Callable[..., Twin], dsp6: Board) -> None:
    # Closed form: uniform over one count, s.d. 1/√12. Kolmogorov-Smirnov test at a fixed seed.
    twin = quiet(STILL, "{all: {arw_deg_rt_h: 6}}")
    simulated = simulate_recording(twin, dsp6, "run")
    error = counts(simulated, 1) - simulated.rates[:, 0] / LSB
    assert np.abs(error).max() <= 0.5
    assert stats.kstest(error, "uniform", args=(-0.5, 1.0)).pvalue > 0.001
    assert error.std() == pytest.approx(1 / np.sqrt(12), rel=0.05)


def test_scale_error_bias_and_rails(quiet: Callable[..., Twin], dsp6: Board) -> None:
    motion = "kind: constant, duration_s: 1, motion: {kind: constant, rate: 100}"
    gyros = "{g1: {scale_error: 0.05}, g2: {bias_deg_s: 2}, g3: {bias_deg_s: 900}, g4: {bias_deg_s: -900}}"
    simulated = simulate_recording(quiet(motion, gyros), dsp6, "run")
    assert counts(simulated, 1)[0] == round(105 / LSB)
    assert counts(simulated, 2)[0] == round(102 / LSB)
    assert (counts(simulated, 3)[0], counts(simulated, 4)[0]) == (32767, -32768)


def test_temperature_rises_and_drives_the_bias(quiet: Callable[..., Twin], dsp6: Board) -> None:
    more = "temperature: {start_c: 20, rise_k: 10, time_constant_s: 5, reference_c: 20}"
    simulated = simulate_recording(quiet(STILL, "{g1: {temperature_coefficient: 0.5}}", more), dsp6, "run")
    expected = 20 + 10 * (1 - np.exp(-simulated.time / 5))
    assert simulated.temperature == pytest.approx(expected)
    assert simulated.rates[:, 0] == pytest.approx(0.5 * (expected - 20))
    thermometer = dsp6.temperatures[0]
    shown = simulated.counts["t1"] * thermometer.scale + thermometer.offset
    assert np.abs(shown - expected).max() <= thermometer.scale / 2 * 1.0001


@pytest.mark.parametrize(
    ("kind", "size", "check"),
    [
        ("drift", 4.0, lambda x: x[0] == pytest.approx(0, abs=0.02) and x[-1] == pytest.approx(4, abs=0.02)),
        ("step", 4.0, lambda x: np.allclose(x, 4, atol=LSB)),
        ("burst", 4.0, lambda x: x.std() == pytest.approx(4, rel=0.1)),
        ("scale", 0.5, lambda x: np.allclose(x, 15 - 10, atol=LSB)),
        ("dropout", None, lambda x: np.allclose(x, -10)),
    ],
)
def test_faults_act_between_start_and_stop_only(quiet, dsp6: Board, kind, size, check) -> None:
    entry = f"{{kind: {kind}, gyro: g3, start: 2, stop: 6" + ("}" if size is None else f", size: {size}}}")
    motion = f"kind: constant, duration_s: 10, motion: {{kind: constant, rate: 10}}, faults: [{entry}]"
    simulated = simulate_recording(quiet(motion), dsp6, "run")
    shown = counts(simulated, 3) * LSB - 10
    assert check(shown[400:1200])
    assert np.abs(np.delete(shown, slice(400, 1200))).max() <= LSB
    assert np.flatnonzero(simulated.faulty[:, 2]).tolist() == list(range(400, 1200))
    assert not np.delete(simulated.faulty, 2, axis=1).any()
    others = np.column_stack([counts(simulated, gyro) for gyro in (1, 2, 4, 5, 6)])
    assert np.abs(others * LSB - 10).max() <= LSB


def test_noise_fault_multiplies_and_stuck_repeats(quiet: Callable[..., Twin], dsp6: Board) -> None:
    faults = "[{kind: noise, gyro: g1, start: 10, size: 5}, {kind: stuck, gyro: g2, start: 3, stop: 4}]"
    simulated = simulate_recording(quiet(f"{STILL}, faults: {faults}", "{all: {arw_deg_rt_h: 6}}"), dsp6, "run")
    first, last = simulated.rates[:2000, 0].std(), simulated.rates[2000:, 0].std()
    assert last / first == pytest.approx(5, rel=0.1)
    assert simulated.white_sd[-1, 0] == pytest.approx(5 * 0.1 * np.sqrt(200))
    stuck = counts(simulated, 2)
    assert set(stuck[600:800]) == {stuck[599]}
    assert len(set(stuck[800:1000])) > 100


def test_rate_table_holds_its_plateaus(twin: Twin, dsp6: Board) -> None:
    simulated = simulate_recording(twin, dsp6, "table")
    assert [(p.start, p.stop, p.rate) for p in simulated.plateaus] == [(1, 3, 0), (4, 6, 100), (7, 9, -50)]
    for plateau in simulated.plateaus:
        inside = (simulated.time >= plateau.start) & (simulated.time < plateau.stop)
        assert np.all(simulated.reference[inside] == plateau.rate)
    assert np.abs(np.diff(simulated.reference)).max() < 2.0  # moves without a jump


def test_random_rate_is_band_limited(quiet: Callable[..., Twin], dsp6: Board) -> None:
    motion = "kind: random, duration_s: 2000, rate_hz: 20, motion: {kind: random, sd: 20, bandwidth_hz: 0.5}"
    reference = simulate_recording(quiet(motion), dsp6, "run").reference
    assert reference.std() == pytest.approx(20, rel=0.1)  # 2000 independent values: 2 %
    power = np.abs(np.fft.rfft(reference * np.hanning(reference.size))) ** 2
    frequency = np.fft.rfftfreq(reference.size, 1 / 20)
    assert power[frequency > 0.52].sum() < 1e-6 * power.sum()


def test_only_the_axis_that_turns_sees_the_rate(quiet: Callable[..., Twin], board) -> None:
    twin = quiet("kind: constant, duration_s: 1, axis: y, motion: {kind: constant, rate: 10}")
    kvh = board("kvh1750")
    simulated = simulate_recording(twin, kvh, "run")
    assert simulated.rates[0].tolist() == [0, 10, 0]
    assert simulated.counts["gy"] == pytest.approx(np.radians(10))  # the field is a float, in rad/s


def test_missing_seconds_and_counter(quiet: Callable[..., Twin], dsp6: Board) -> None:
    twin = quiet(f"{STILL}, counter_start: 65000, line: {{missing: [[5.0, 6.5]]}}")
    data, done = dump_of(simulate_recording(twin, dsp6, "run"), dsp6, twin)
    assert len(data) == 30 * (4000 - 300)
    counter = np.frombuffer(data, dtype=np.uint8).reshape(-1, 30)[:, 2:4].copy().view(">u2")[:, 0]
    assert counter[0] == 65000
    assert (int(counter[1000]) - int(counter[999])) % 65536 == 301
    assert [(item.kind, item.frame, item.detail) for item in done] == [("missing", 1000, "300 frames")]


def test_truth_names_a_fault_of_one_sample(quiet: Callable[..., Twin], dsp6: Board) -> None:
    twin = quiet(f"{STILL}, faults: [{{kind: step, gyro: g1, start: 5.03, stop: 5.035, size: 9}}]")
    table = truth_table(simulate_recording(twin, dsp6, "run"), dsp6)
    assert table["time"][table["fault_g1"]].tolist() == [5.0]
    assert {"reference", "bias_g6", "sd_g6", "temp_t6"} <= set(table)


EVERY_FAULT = """[{kind: drift, gyro: g1, start: 2, size: 3}, {kind: burst, gyro: g2, start: 3, stop: 15, size: 2},
  {kind: burst, gyro: g2, start: 8, stop: 9, size: 1}, {kind: stuck, gyro: g3, start: 4.99, stop: 11},
  {kind: stuck, gyro: g5, start: 5, stop: 6}, {kind: dropout, gyro: g3, start: 10, stop: 10.5},
  {kind: noise, gyro: g4, start: 1, size: 2}, {kind: scale, gyro: all, start: 12.03, stop: 13, size: 0.1}]"""


@pytest.mark.parametrize("name", ["dsp6", "dsp6-text"])
def test_the_pieces_change_nothing(quiet: Callable[..., Twin], board, monkeypatch, name: str) -> None:
    gyros = "{all: {arw_deg_rt_h: 6, bias_instability_deg_h: 40, rrw_deg_h_rt_h: 200, garch: {alpha: 0.05, beta: 0.9}}}"
    missing = "[[2, 3], [4.99, 6.2], [19, 30]]"
    line = f"{{leading_bytes: 9, flips: 40, drops: 40, insertions: 40, missing: {missing}, cut_tail: 7}}"
    more = "correlation: 0.2\ndcc: {a: 0.03, b: 0.94}\nsensor_pole_hz: 40\n"
    twin, made = quiet(f"{STILL}, faults: {EVERY_FAULT}, line: {line}", gyros, more), board(name)
    whole = simulate_recording(twin, made, "run")
    expected, damage = dump_of(whole, made, twin)
    monkeypatch.setattr("vgyro.simulate.recording.PIECE", 1000)  # 5 s
    pieces = list(simulate_pieces(twin, made, "run"))
    assert [piece.first for piece in pieces] == [0, 1000, 2000, 3000]
    dump = Dump(twin, made, "run", lambda: iter(pieces))
    assert b"".join(dump.feed(piece) for piece in pieces) == expected
    assert dump.damage == damage
    for name, values in truth_table(whole, made).items():
        assert np.array_equal(np.concatenate([truth_table(piece, made)[name] for piece in pieces]), values), name


def test_a_recording_at_rest_of_other_length(quiet: Callable[..., Twin], dsp6: Board) -> None:
    faults = "[{kind: step, gyro: g1, start: 5, stop: 10, size: 9}, {kind: drift, gyro: g2, start: 15, size: 9}]"
    line = "{flips: 8, drops: 4, insertions: 1, missing: [[2, 3]], cut_tail: 7}"
    twin = lasting(quiet(f"{STILL}, faults: {faults}, line: {line}"), 0.1)
    (recording,) = twin.recordings
    assert recording.duration == 360
    assert [(fault.start, fault.stop) for fault in recording.faults] == [(90, 180), (270, None)]
    assert recording.line is not None
    assert (recording.line.flips, recording.line.drops, recording.line.missing) == (144, 72, ((36, 54),))
    assert simulate_recording(twin, dsp6, "run").time.size == 72000
    moving = quiet("kind: constant, duration_s: 1, motion: {kind: constant, rate: 10}")
    assert lasting(moving, 1.0) == moving


def test_an_unknown_recording(twin: Twin, dsp6: Board) -> None:
    with pytest.raises(ConfigError, match="no recording 'stil'; did you mean 'still'"):
        simulate_recording(twin, dsp6, "stil")
