"""Tasks calibrate and convert on small artefacts of known truth."""

from pathlib import Path

import numpy as np
import pytest
from task_options import complete

from vgyro.board import Board, parse_board
from vgyro.dataset import Manifest
from vgyro.errors import DataError
from vgyro.simulate import manifest_of, parse_twin, simulate_recording
from vgyro.storage.tables import Provenance, read_columns, read_json, read_metadata, write_json, write_table
from vgyro.tasks.calibration import calibrate
from vgyro.tasks.common import Task
from vgyro.tasks.rates import convert

NOWHERE = Provenance({}, "", "")
RATE_HZ = 200.0
RATES = (0.0, 100.0, 200.0, 300.0, -100.0, -200.0, -300.0, 0.0)
SCALE, BIAS = 0.0149, 40.0


@pytest.fixture(scope="module")
def board(root: Path) -> Board:
    return parse_board((root / "config/boards/dsp6.yaml").read_text(encoding="utf-8"), "dsp6")


def counts_of(board: Board, rate: np.ndarray, seed: int = 1) -> dict[str, np.ndarray]:
    """Frames of a board whose gyros all have SCALE and BIAS, with a count of noise."""
    rng = np.random.default_rng(seed)
    columns = {"time": np.arange(rate.size) / RATE_HZ, "segment": np.zeros(rate.size, np.int32)}
    for gyro in board.gyros:
        ideal = gyro.sign * rate / SCALE + BIAS + rng.standard_normal(rate.size)
        columns[gyro.field] = np.clip(np.round(ideal), -32768, 32767).astype(np.int16)
    for temperature in board.temperatures:
        columns[temperature.field] = np.full(rate.size, 100, np.int16)
    return columns


def staircase() -> np.ndarray:
    return np.repeat(RATES, int(6 * RATE_HZ))


def manifest(*recordings: dict) -> Manifest:
    return Manifest.model_validate({"board": "dsp6", "recordings": recordings})


def calibration_run(name: str = "calibration", reference: dict | None = None) -> dict:
    plateaus = [{"start": 6.0 * i + 1, "stop": 6.0 * i + 5.9, "rate": rate} for i, rate in enumerate(RATES)]
    reference = reference or {"kind": "plateaus", "plateaus": plateaus}
    return {"name": name, "kind": "calibration", "files": "x.bin", "reference": reference}


def write_frames(folder: Path, columns: dict[str, np.ndarray], status: str = "good") -> Path:
    write_table(folder / "frames.parquet", columns, "frames", NOWHERE)
    write_json(folder / "integrity.json", {"status": status, "rate_hz": RATE_HZ, "clocks": []})
    return folder / "frames.parquet"


def run_calibrate(
    folder: Path, board: Board, record: Manifest, frames: list[Path], logs: list[Path] | None = None
) -> dict:
    inputs = {
        "frames": frames,
        "integrity": [path.with_name("integrity.json") for path in frames],
        "references": logs or [],
    }
    options = {"manifest": record.model_dump(mode="json"), "board": board.model_dump(mode="json"), "dataset": "d",
               "analysis": complete()}  # fmt: skip
    calibrate.main(Task(inputs, {"calibration": folder / "calibration.json"}, options, ""))
    return read_json(folder / "calibration.json")


def uncalibrated(folder: Path, board: Board, record: Manifest) -> dict:
    """Calibrate from recordings that give nothing: those at rest are refused."""
    resting = [recording for recording in record.recordings if recording.kind in ("static", "thermal")]
    nothing = counts_of(board, np.empty(0))
    frames = [write_frames(folder / f"refused-{recording.name}", nothing, "refused") for recording in resting]
    return run_calibrate(folder, board, record, frames)


def run_convert(
    folder: Path, board: Board, record: Manifest, name: str, frames: Path, logs: list[Path] | None = None
) -> dict[str, np.ndarray]:
    inputs = {
        "frames": [frames],
        "integrity": [frames.with_name("integrity.json")],
        "calibration": [folder / "calibration.json"],
        "reference": logs or [],
    }
    options = {"manifest": record.model_dump(mode="json"), "board": board.model_dump(mode="json"), "recording": name}
    task = Task(inputs, {"rates": folder / f"{name}.parquet"}, {**options, "analysis": complete()}, "")
    convert.main(task)
    return read_columns(folder / f"{name}.parquet")


def test_measured_calibration_gives_back_the_rate(tmp_path: Path, board: Board):
    record = manifest(calibration_run(), {"name": "turn", "kind": "constant", "files": "y.bin",
                                          "reference": {"kind": "constant", "rate": 40.0}})  # fmt: skip
    frames = write_frames(tmp_path / "calibration", counts_of(board, staircase()))
    found = run_calibrate(tmp_path, board, record, [frames])
    for gyro in board.gyros:
        row = found["gyros"][gyro.name]
        assert row["source"] == "measured"
        assert row["scale_low"] < SCALE < row["scale_high"]
        assert row["bias_low"] < BIAS < row["bias_high"]
        assert len(row["points"]) == len(RATES)
        assert max(abs(point["residual_deg_s"]) for point in row["points"]) < 0.01
    assert found["recordings"] == {board.axes[0]: "calibration"}
    turning = write_frames(tmp_path / "turn", counts_of(board, np.full(4000, 40.0), seed=2))
    rates = run_convert(tmp_path, board, record, "turn", turning)
    for gyro in board.gyros:
        assert rates[gyro.name].mean() == pytest.approx(40.0, abs=0.02)
    assert np.all(rates["reference"] == 40.0)
    assert not rates["at_rest"].any()
    metadata = read_metadata(tmp_path / "turn.parquet")
    assert metadata["reference_axis"] == board.axes[0]
    assert metadata["units"][board.gyros[0].name] == "deg/s"


def test_logged_reference(tmp_path: Path, board: Board):
    log = tmp_path / "log.csv"
    time = np.arange(0, 48, 0.1)
    log.write_text("t,w\n" + "\n".join(f"{t:.1f},{RATES[min(int(t // 6), 7)]}" for t in time), encoding="utf-8")
    reference = {"kind": "file", "file": "log.csv", "time": "t", "rate": "w"}
    record = manifest(calibration_run(reference=reference))
    frames = write_frames(tmp_path / "calibration", counts_of(board, staircase()))
    found = run_calibrate(tmp_path, board, record, [frames], [log])
    assert found["gyros"][board.gyros[0].name]["scale"] == pytest.approx(SCALE, rel=1e-4)
    wrong = manifest(calibration_run(reference={**reference, "rate": "speed"}))
    with pytest.raises(DataError, match="no column 'speed'"):
        run_calibrate(tmp_path, board, wrong, [frames], [log])


def test_a_gyro_the_wrong_way_round_is_one_clear_error(tmp_path: Path, board: Board):
    turned = tuple(gyro.model_copy(update={"sign": -gyro.sign}) if gyro.name == "g3" else gyro for gyro in board.gyros)
    wrong = board.model_copy(update={"gyros": turned})
    frames = write_frames(tmp_path / "calibration", counts_of(board, staircase()))
    with pytest.raises(DataError) as caught:
        run_calibrate(tmp_path, wrong, manifest(calibration_run()), [frames])
    words = str(caught.value)
    assert words.startswith("calibration, board dsp6: ")
    assert "'g3'" in words
    assert "Set its sign to 1 in the board file" in words


def test_a_table_about_one_axis_tells_the_cross_axis_of_the_others(tmp_path: Path, root: Path):
    # Simulated: gx sees 0.5 % of the rate about y, gz nothing. White noise of 0.05 deg/√h over 4 s is 0.4 mdeg/s.
    kvh = parse_board((root / "config/boards/kvh1750.yaml").read_text(encoding="utf-8"), "kvh1750")
    rates = [0, 50, 100, 150, 100, 50, 0, -50, -100, -150, -100, -50, 0]
    twin = parse_twin(
        "name: t\nboard: kvh1750\nseed: 5\ngyros: {all: {arw_deg_rt_h: 0.05}, gx: {cross_axis: 0.005}}\n"
        "recordings: [{name: calibration, kind: calibration, axis: y, rate_hz: 50, motion: "
        f"{{kind: rate_table, rates: {rates}, settle_s: 1, plateau_s: 4}}}}]",
        "t.yaml",
    )
    simulated = simulate_recording(twin, kvh, "calibration")
    segment = np.zeros(simulated.time.size, np.int32)
    columns = {"time": simulated.time, "segment": segment, **simulated.counts}
    record = manifest_of(twin)
    found = run_calibrate(tmp_path, kvh, record, [write_frames(tmp_path / "calibration", columns)])
    about_y = found["gyros"]["gx"]["figures"]["cross_axis"]
    assert about_y["low"] < 0.5 < about_y["high"]
    assert about_y["value"] == pytest.approx(0.5, abs=0.005)
    assert about_y["note"] == "about y"
    assert found["gyros"]["gz"]["figures"]["cross_axis"]["state"] == "below the floor"
    assert found["gyros"]["gy"]["figures"]["cross_axis"]["note"] == "no recording about another axis"
    assert found["gyros"]["gy"]["source"] == "measured"
    assert found["gyros"]["gx"]["source"] == "nominal"


def test_refused_recordings_are_skipped(tmp_path: Path, board: Board):
    record = manifest(calibration_run("first"), calibration_run("second"))
    bad = write_frames(tmp_path / "first", counts_of(board, np.empty(0)), "refused")
    good = write_frames(tmp_path / "second", counts_of(board, staircase()))
    found = run_calibrate(tmp_path, board, record, [bad, good])
    assert found["recordings"] == {board.axes[0]: "second"}
    assert "refused" in found["skipped"]["first"]


def test_without_calibration_the_nominal_scale_is_named(tmp_path: Path, board: Board):
    record = manifest({"name": "static", "kind": "static", "files": "x.bin"})
    found = uncalibrated(tmp_path, board, record)
    for gyro in board.gyros:
        row = found["gyros"][gyro.name]
        assert (row["source"], row["scale"], row["scale_low"]) == ("nominal", gyro.scale, None)
        assert row["note"].startswith("nominal scale")
    frames = write_frames(tmp_path / "static", counts_of(board, np.zeros(500)))
    rates = run_convert(tmp_path, board, record, "static", frames)
    assert rates["at_rest"].all()
    assert "reference" not in rates
    assert set(read_metadata(tmp_path / "static.parquet")["calibration"].values()) == {"nominal"}
    assert [name for name in rates if name.startswith("temp_")] == [f"temp_{t.name}" for t in board.temperatures]


def test_rest_listed_found_and_clipped(tmp_path: Path, board: Board):
    listed = {"name": "listed", "kind": "free", "files": "x.bin", "rest": [[1.0, 2.0]]}
    record = manifest(listed, {"name": "found", "kind": "free", "files": "x.bin"})
    uncalibrated(tmp_path, board, record)
    rate = np.concatenate([np.zeros(4000), 50 * np.sin(np.arange(2000) / 50), np.zeros(4000)])
    columns = counts_of(board, rate)
    columns[board.gyros[0].field][1000] = 32767
    frames = write_frames(tmp_path / "frames", columns)
    at_rest = run_convert(tmp_path, board, record, "listed", frames)["at_rest"]
    assert at_rest.sum() == 201
    at_rest = run_convert(tmp_path, board, record, "found", frames)["at_rest"]
    assert not at_rest[1000]
    assert not at_rest[4000:6000].any()
    assert at_rest.sum() > 7000
    assert read_metadata(tmp_path / "found.parquet")["clipped"][board.gyros[0].name] == 1


def test_sinusoid_with_unknown_phase_and_logged_motion(tmp_path: Path, board: Board):
    time = np.arange(8000) / RATE_HZ
    truth = 62.8 * np.sin(2 * np.pi * 0.25 * time + 0.7)
    reference = {"kind": "sinusoid", "amplitude": 62.8, "frequency_hz": 0.25}
    record = manifest(
        calibration_run(),
        {"name": "swing", "kind": "sinusoid", "files": "x.bin", "reference": reference},
        {"name": "random", "kind": "random", "files": "x.bin", "reference": {"kind": "file", "file": "log.parquet"}},
    )
    run_calibrate(tmp_path, board, record, [write_frames(tmp_path / "c", counts_of(board, staircase()))])
    frames = write_frames(tmp_path / "frames", counts_of(board, truth))
    swing = run_convert(tmp_path, board, record, "swing", frames)
    assert np.abs(swing["reference"] - truth).max() < 0.05
    write_table(tmp_path / "log.parquet", {"time": time[1000:], "rate": truth[1000:]}, "reference", NOWHERE)
    logged = run_convert(tmp_path, board, record, "random", frames, [tmp_path / "log.parquet"])
    assert np.isnan(logged["reference"][:1000]).all()
    np.testing.assert_allclose(logged["reference"][1000:], truth[1000:])


def test_a_log_of_rates_is_not_calibrated(tmp_path: Path, board: Board):
    entry = {"name": "log", "kind": "static", "files": "x.parquet", "log": {"values": "rates"}}
    record = manifest(entry)
    uncalibrated(tmp_path, board, record)
    columns = counts_of(board, np.zeros(300))
    for gyro in board.gyros:
        columns[gyro.field] = np.full(300, 1.25)
    rates = run_convert(tmp_path, board, record, "log", write_frames(tmp_path / "frames", columns))
    for gyro in board.gyros:
        assert np.all(rates[gyro.name] == gyro.sign * 1.25)


def test_the_rate_is_that_of_the_integrity_record(tmp_path: Path, board: Board):
    record = manifest({"name": "static", "kind": "static", "files": "x.bin"})
    uncalibrated(tmp_path, board, record)
    frames = write_frames(tmp_path / "frames", counts_of(board, np.zeros(1000)))
    write_json(tmp_path / "frames" / "integrity.json", {"status": "good", "rate_hz": 99.3, "clocks": []})
    run_convert(tmp_path, board, record, "static", frames)
    assert read_metadata(tmp_path / "static.parquet")["rate_hz"] == 99.3


def test_empty_frames(tmp_path: Path, board: Board):
    record = manifest({"name": "static", "kind": "static", "files": "x.bin"})
    uncalibrated(tmp_path, board, record)
    frames = write_frames(tmp_path / "frames", counts_of(board, np.empty(0)))
    rates = run_convert(tmp_path, board, record, "static", frames)
    assert len(rates["time"]) == 0
    assert {gyro.name for gyro in board.gyros} <= set(rates)


def table_run(tmp_path, board, change) -> list[str]:
    """Suspicions of a calibration whose plateaus are changed by `change(plateau)`."""
    run = calibration_run()
    run["reference"]["plateaus"] = [change(dict(plateau)) for plateau in run["reference"]["plateaus"]]
    record = manifest(run)
    return run_calibrate(tmp_path, board, record, [write_frames(tmp_path, counts_of(board, staircase()))])["suspicions"]


def test_a_good_table_raises_no_suspicion(tmp_path, board):
    assert table_run(tmp_path, board, lambda plateau: plateau) == []


def test_rates_in_radians_and_shifted_plateaus_are_suspicions(tmp_path, board):
    (said,) = table_run(tmp_path, board, lambda plateau: {**plateau, "rate": plateau["rate"] / 57.29578})
    assert said.startswith("calibration: the plateaus' rates look like rad/s: multiply them by 57.29578")
    later = table_run(
        tmp_path, board, lambda plateau: {**plateau, "start": plateau["start"] + 3, "stop": plateau["stop"] + 3}
    )
    assert "moving all plateaus by -3." in later[0]
