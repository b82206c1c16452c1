"""The example manifests on the real recordings they were written for."""

import numpy as np
import pytest

from vgyro.calibration import find_rest
from vgyro.config import Analysis, override_analysis
from vgyro.storage import decode_dump
from vgyro.storage.inputs import data_files, read_dataset
from vgyro.volatility import block_means, windows

FOLDERS = {"mimu4444": "mimu4444-array", "adis16405": "adis16405-static"}


@pytest.fixture
def example(root, shared_data, tmp_path, monkeypatch):
    """Write an example's manifest, pointed at the files, and give its path."""

    def fill(name):
        text = (root / "config/examples" / name / "dataset.yaml").read_text()
        assert f"folder: PATH/TO/{FOLDERS[name]}\n" in text
        folder = tmp_path / name
        folder.mkdir()
        (folder / "dataset.yaml").write_text(text.replace(f"PATH/TO/{FOLDERS[name]}", str(shared_data / FOLDERS[name])))
        return folder / "dataset.yaml"

    monkeypatch.chdir(root)
    return fill


def test_the_examples_are_right_once_they_point_at_the_files(example, vgyro):
    outcome = vgyro("check", *(example(name) for name in FOLDERS))
    assert outcome.err == ""
    assert outcome.out.splitlines()[:2] == [
        "mimu4444: 2 recordings, 24 gyros of board mimu4444",
        "adis16405: 3 recordings, 3 gyros of board adis16405",
    ]


@pytest.mark.parametrize("name", FOLDERS)
def test_as_they_stand_they_ask_for_the_folder(root, vgyro, monkeypatch, name):
    monkeypatch.chdir(root)
    outcome = vgyro("check", f"config/examples/{name}")
    assert outcome.code == 3
    assert f"folder: no such folder: config/examples/{name}/PATH/TO/{FOLDERS[name]}; point `folder` at" in outcome.err


def test_a_window_is_one_rest_pose_of_the_mimu_array(example):
    # The paper's protocol: 20 poses of about 23 s, then rotation by hand.
    path = example("mimu4444")
    manifest, board = read_dataset(path)
    analysis = override_analysis(Analysis(), manifest.analysis)
    frames = decode_dump(data_files(manifest, "exp_1", path.parent), board)
    rates = np.column_stack([g.sign * (frames.counts[g.field] - g.bias) * g.scale for g in board.gyros])
    rest = find_rest(rates, board.rate_hz, analysis.rest, frames.segment)
    options = analysis.volatility
    series = block_means(rates, board.rate_hz, options.rate_hz, frames.segment, rest)
    found = windows(series.stretch, options.window, options.step)
    assert len(found) == 20
    assert len({int(series.stretch[window.start]) for window in found}) == 20


@pytest.mark.parametrize("file", ["mimu4444-array/exp_2_data.bin", "adis16405-static/rec3.parquet"])
def test_new_dataset_knows_the_board_of_real_files(shared_data, root, tmp_path, vgyro, monkeypatch, file):
    monkeypatch.chdir(root)
    outcome = vgyro("new-dataset", shared_data / file, "--name", "real", "--raw", tmp_path)
    assert (outcome.code, outcome.err) == (0, "")
    assert f"board {file.split('-')[0]} " in outcome.out
    assert vgyro("check", tmp_path / "real").code == 0
