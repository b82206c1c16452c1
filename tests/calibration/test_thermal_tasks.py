"""Tasks calibrate and convert on the twin `calibration`: known figures, from counts to compensated rates."""

from pathlib import Path

import numpy as np
import pytest
from task_options import complete

from vgyro.board import Board
from vgyro.calibration.figures import FIGURES
from vgyro.dataset import Manifest, used_board
from vgyro.simulate import (
    Twin,
    calibration_truth,
    manifest_of,
    parse_twin,
    repeatability_truth,
    simulate_recording,
    thermal_truth,
)
from vgyro.storage.inputs import read_board
from vgyro.storage.tables import (
    Provenance,
    TableWriter,
    read_columns,
    read_json,
    read_metadata,
    write_json,
    write_table,
)
from vgyro.tasks.calibration import calibrate
from vgyro.tasks.calibration.calibrate import KINDS
from vgyro.tasks.common import Task
from vgyro.tasks.rates import convert

NOWHERE = Provenance({}, "", "")
RATE_HZ = 25.0  # the density of the noise is that of 200 Hz
GYROS = ("g1", "g5")


class Lab:
    """The twin's recordings as frames in a folder, and the tasks on them."""

    def __init__(self, folder: Path, twin: Twin, board: Board, manifest: Manifest) -> None:
        self.folder, self.twin, self.board, self.manifest = folder, twin, board, manifest
        for recording in twin.recordings:
            simulated = simulate_recording(twin, board, recording.name)
            segment = np.zeros(simulated.time.size, np.int32)
            narrow = {name: values.astype(np.int16) for name, values in simulated.counts.items()}
            columns = {"time": simulated.time, "segment": segment, **narrow}
            write_table(folder / recording.name / "frames.parquet", columns, "frames", NOWHERE)
            write_json(
                folder / recording.name / "integrity.json",
                {"status": "good", "rate_hz": self.board.rate_hz, "clocks": []},
            )

    def calibrate(self, name: str = "calibration.json", drop: tuple[str, ...] = (), **options: str) -> dict:
        """calibration.json from all recordings but some."""
        kept = tuple(one for one in self.manifest.recordings if one.name not in drop)
        record = self.manifest.model_copy(update={"recordings": kept})
        used = [self.folder / one.name for one in kept if one.kind in KINDS]
        inputs = {kind: [path / file for path in used] for kind, file in
                  (("frames", "frames.parquet"), ("integrity", "integrity.json"))}  # fmt: skip
        given = {
            "manifest": record.model_dump(mode="json"),
            "board": self.board.model_dump(mode="json"),
            "analysis": complete({"calibration": options}),
            "dataset": "d",
        }
        calibrate.main(Task(inputs, {"calibration": self.folder / name}, given, ""))
        return read_json(self.folder / name)

    def convert(self, recording: str, calibration: str = "calibration.json") -> tuple[dict[str, np.ndarray], dict]:
        """Rates of a recording, and their metadata."""
        inputs = {
            "frames": [self.folder / recording / "frames.parquet"],
            "integrity": [self.folder / recording / "integrity.json"],
            "calibration": [self.folder / calibration],
        }
        given = {
            "manifest": self.manifest.model_dump(mode="json"),
            "board": self.board.model_dump(mode="json"),
            "recording": recording,
            "analysis": complete(),
        }
        path = self.folder / f"{recording}-{calibration}.parquet"
        convert.main(Task(inputs, {"rates": path}, given, ""))
        return read_columns(path), read_metadata(path)


@pytest.fixture(scope="module")
def lab(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Lab:
    text = (root / "config/twins/calibration.yaml").read_text(encoding="utf-8")
    twin = parse_twin(text, "calibration.yaml")
    slow = tuple(recording.model_copy(update={"rate_hz": RATE_HZ}) for recording in twin.recordings)
    twin = twin.model_copy(update={"recordings": slow})
    manifest = manifest_of(twin).model_copy(update={"gyros": GYROS})
    board = used_board(manifest, read_board("dsp6", boards=root / "config/boards"))
    return Lab(tmp_path_factory.mktemp("lab"), twin, board, manifest)


@pytest.fixture(scope="module")
def found(lab: Lab) -> dict:
    return lab.calibrate()


@pytest.fixture(scope="module")
def off(lab: Lab) -> str:
    """Name of a calibration that compensates nothing."""
    lab.calibrate("off.json", drop=("cycle2", "cycle3", "cool", "warm", "static"), temperature="off")
    return "off.json"


def near(record: dict, truth: float) -> bool:
    """Within twice the half width of its 95 % interval: true but once in ten thousand."""
    middle, half = (record["low"] + record["high"]) / 2, (record["high"] - record["low"]) / 2
    return abs(truth - middle) <= 2 * half


@pytest.mark.parametrize("gyro", GYROS)
def test_every_figure_is_near_the_truth(lab: Lab, found: dict, gyro: str) -> None:
    record = found["gyros"][gyro]
    assert list(record["figures"]) == list(FIGURES)
    truth = {
        **calibration_truth(lab.twin, lab.board, "cycle1")[gyro],
        **repeatability_truth(lab.twin, lab.board, ["cycle1", "cycle2", "cycle3"])[gyro],
        "bias_temperature": thermal_truth(lab.twin, lab.board, "sweep")[gyro]["bias_temperature"],
        "self_heating": thermal_truth(lab.twin, lab.board, "static")[gyro]["self_heating"],
    }
    for name, figure in record["figures"].items():
        assert figure["unit"] == FIGURES[name].unit
        if name == "cross_axis":
            assert (figure["state"], figure["note"]) == ("not measured", "one axis only")
        else:
            assert near(figure, truth[name]), (name, figure, truth[name])
    for name in ("scale", "bias"):
        assert near({key: record[f"{name}_{key}"] for key in ("low", "high")}, truth[name])


def test_what_stands_beside_the_figures(found: dict) -> None:
    test = found["test"]["z"]
    names = ["cycle1", "cycle2", "cycle3", "cold", "cool", "warm", "hot"]
    assert (test["recordings"], test["rates"], test["full_scale"]) == (names, 25, 300)
    assert test["whole_turns"]
    assert test["seconds_a_point"] == pytest.approx(14.4)  # whole turns at every rate but zero
    assert test["earth_rate_deg_s"] == pytest.approx(15.04 / 3600 * np.sin(np.radians(48.2)))
    assert test["temperature_c"] == pytest.approx([-10, 60], abs=0.1)
    assert found["recordings"] == {"z": "cycle1"}
    points = found["gyros"]["g1"]["points"]
    assert [point["direction"] for point in points][:14] == ["none", *["up"] * 12, "down"]
    assert {point["recording"] for point in points} == {"cycle1"}
    assert points[0]["temperature_c"] == pytest.approx(25, abs=0.05)


def test_compensation_takes_the_temperature_out_of_the_bias(lab: Lab, found: dict, off: str) -> None:
    # From the twin's polynomial: -0.028 deg/s at -10 °C, 0.077 at 60 °C, 380 deg/h apart. What is left is noise: 0.5
    # deg/√h in blocks of 10 s is 9.5 deg/h, flicker and walk some more. The calibration used this sweep: in-sample.
    assert not any(row["temperature"]["applied"] for row in read_json(lab.folder / off)["gyros"].values())
    plain, about_plain = lab.convert("sweep", off)
    rates, about = lab.convert("sweep")
    blocks = 10 * int(RATE_HZ)
    for gyro in GYROS:
        before, after = (table[gyro].reshape(-1, blocks).mean(axis=1) * 3600 for table in (plain, rates))
        celsius = rates[f"temp_t{gyro[1]}"].reshape(-1, blocks).mean(axis=1)
        assert np.ptp(before) > 370
        assert after.std() < 15
        assert abs(np.polyfit(celsius, after, 1)[0]) < 0.1
        assert about_plain["temperature"][gyro] == {"applied": False, "note": "no temperature compensation"}
        assert about["temperature"][gyro]["in_sample"]
        assert "in-sample" in about["temperature"][gyro]["note"]
        assert "in-sample" in found["gyros"][gyro]["temperature"]["note"]


@pytest.mark.usefixtures("found")
def test_compensation_of_a_recording_that_it_was_not_found_on(lab: Lab, off: str) -> None:
    # 100 deg/s at 50 °C: -400 ppm/K over 25 K are 1 deg/s of g1, 250 ppm/K are -0.6 deg/s of g5.
    plain, _ = lab.convert("turning", off)
    rates, about = lab.convert("turning")
    for gyro, wrong in (("g1", -1.0), ("g5", 0.63)):
        assert np.mean(plain[gyro]) - 100 == pytest.approx(wrong, abs=0.1)
        assert np.mean(rates[gyro]) - 100 == pytest.approx(0.003, abs=0.02)  # 0.003: the Earth
        assert about["temperature"][gyro]["applied"]
        assert not about["temperature"][gyro]["in_sample"]
        assert about["temperature"][gyro]["outside"] == 0


@pytest.mark.usefixtures("found")
def test_rows_in_pieces_give_the_same_rates(lab: Lab, tmp_path: Path) -> None:
    whole, _ = lab.convert("static")
    frames = read_columns(lab.folder / "static" / "frames.parquet")
    with TableWriter(lab.folder / "pieces" / "frames.parquet", "frames", NOWHERE, row_group=1777) as writer:
        writer.append(frames)
    inputs = {
        "frames": [lab.folder / "pieces" / "frames.parquet"],
        "integrity": [lab.folder / "static" / "integrity.json"],
        "calibration": [lab.folder / "calibration.json"],
    }
    given = {
        "manifest": lab.manifest.model_dump(mode="json"), "board": lab.board.model_dump(mode="json"),
        "recording": "static", "analysis": complete(),
    }  # fmt: skip
    convert.main(Task(inputs, {"rates": tmp_path / "rates.parquet"}, given, ""))
    pieces = read_columns(tmp_path / "rates.parquet")
    for gyro in GYROS:
        np.testing.assert_allclose(pieces[gyro], whole[gyro], rtol=0, atol=1e-9)


def test_without_a_sweep_the_tests_at_several_temperatures_tell(lab: Lab) -> None:
    record = lab.calibrate("tests.json", drop=("sweep", "static", "cycle2", "cycle3"))["gyros"]["g1"]
    assert record["temperature"]["applied"]
    assert record["temperature"]["recordings"] == ["cycle1", "cold", "cool", "warm", "hot"]
    truth = thermal_truth(lab.twin, lab.board, "sweep")["g1"]["bias_temperature"]
    assert near(record["figures"]["bias_temperature"], truth)


def test_one_test_alone_says_what_it_cannot_say(lab: Lab) -> None:
    drop = tuple(one.name for one in lab.manifest.recordings if one.name not in ("cycle1", "turning"))
    record = lab.calibrate("one.json", drop=drop)["gyros"]["g1"]
    assert record["temperature"] is None
    missing = [name for name, figure in record["figures"].items() if figure["state"] == "not measured"]
    assert missing == ["repeatability", "bias_repeatability", "scale_temperature", "bias_temperature",
                       "self_heating", "cross_axis"]  # fmt: skip
    assert all(record["figures"][name]["note"] for name in missing)
