"""The task and the whole data set: files, truth, and one recording alone equal to the one made with the others."""

import json
from pathlib import Path

import pytest

from vgyro.dataset import parse_manifest
from vgyro.storage.tables import read_columns, read_json, read_metadata
from vgyro.tasks.common import run_task
from vgyro.tasks.simulate import main, simulate_dataset
from vgyro.validation import InvalidFile

TWIN = """
name: tiny
board: dsp6
seed: 4
gyros: {all: {arw_deg_rt_h: 6}}
line: {leading_bytes: 9, flips: 3}
recordings:
  - {name: still, kind: static, duration_s: 5}
  - {name: shaken, kind: random, duration_s: 5, motion: {kind: random, sd: 5, bandwidth_hz: 1}}
"""


@pytest.fixture
def twin_file(tmp_path: Path) -> Path:
    path = tmp_path / "tiny.yaml"
    path.write_text(TWIN, encoding="utf-8")
    return path


def test_data_set_has_every_file(twin_file: Path, tmp_path: Path, root: Path) -> None:
    folder = tmp_path / "raw"
    simulate_dataset(twin_file, folder, boards=root / "config/boards")
    files = sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())
    assert files == ["dataset.yaml", "shaken.bin", "shaken_reference.parquet", "still.bin", "truth/damage.json",
                     "truth/shaken.parquet", "truth/still.parquet"]  # fmt: skip
    manifest = parse_manifest((folder / "dataset.yaml").read_text(encoding="utf-8"), "dataset.yaml")
    assert manifest.simulated
    assert manifest.twin == "tiny"
    assert len(read_columns(folder / "shaken_reference.parquet")["rate"]) == 1000
    damage = read_json(folder / "truth/damage.json")
    assert [item["kind"] for item in damage["still"]] == ["leading", "flip", "flip", "flip"]
    metadata = read_metadata(folder / "truth/still.parquet")
    assert metadata["units"]["bias_g1"] == "deg/s"
    assert metadata["damage"] == damage["still"]


def test_twice_the_same_bytes_and_another_seed_others(twin_file: Path, tmp_path: Path, root: Path) -> None:
    for folder, seed in (("a", None), ("b", None), ("c", 5)):
        simulate_dataset(twin_file, tmp_path / folder, seed, boards=root / "config/boards")
    for path in sorted((tmp_path / "a").rglob("*.*")):
        twin_of_it = tmp_path / "b" / path.relative_to(tmp_path / "a")
        assert path.read_bytes() == twin_of_it.read_bytes(), path
    assert (tmp_path / "a/still.bin").read_bytes() != (tmp_path / "c/still.bin").read_bytes()


def test_task_makes_one_recording_as_in_the_set(twin_file: Path, tmp_path: Path, root: Path) -> None:
    simulate_dataset(twin_file, tmp_path / "set", boards=root / "config/boards")
    outputs = {"dump": "x.bin", "truth": "x.parquet", "reference": "x_ref.parquet", "damage": "x.json"}
    arguments = ["--input", "twin", str(twin_file), "--input", "board", str(root / "config/boards/dsp6.yaml")]
    for name, file in outputs.items():
        arguments += ["--output", name, str(tmp_path / file)]
    run_task(main, [*arguments, "--options", json.dumps({"recording": "shaken"})])
    assert (tmp_path / "x.bin").read_bytes() == (tmp_path / "set/shaken.bin").read_bytes()
    ours, theirs = read_columns(tmp_path / "x_ref.parquet"), read_columns(tmp_path / "set/shaken_reference.parquet")
    assert all((ours[name] == theirs[name]).all() for name in ("time", "rate"))


def test_a_twin_of_gyros_that_the_board_lacks(twin_file: Path, tmp_path: Path, root: Path) -> None:
    twin_file.write_text(TWIN.replace("gyros: {all", "gyros: {g7: {}, all"), encoding="utf-8")
    with pytest.raises(InvalidFile, match="no gyro 'g7'"):
        simulate_dataset(twin_file, tmp_path / "raw", boards=root / "config/boards")
