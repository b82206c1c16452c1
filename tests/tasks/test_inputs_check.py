"""What the workflow plans with: data sets that can run, and every mistake."""

import pytest

from vgyro.config import Config
from vgyro.tasks.inputs_check import load_datasets, reference_file

BOARD = """\
name: tiny
title: a gyro
rate_hz: 100
frame: {kind: binary, sync: EB 90, length: 4, fields: [{name: g, type: i16, at: 2}], checksum: {family: none}}
gyros: [{name: g, field: g, axis: z, scale: 0.1}]
"""
GOOD = "board: tiny\nrecordings:\n- {name: a, kind: static, files: a.bin}\n"


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A project with a board and the two data sets `one` and `two`, whose files are not there."""
    (tmp_path / "config/boards").mkdir(parents=True)
    (tmp_path / "config/boards/tiny.yaml").write_text(BOARD)
    (tmp_path / "config/config.yaml").write_text("")
    for name in ("one", "two"):
        (tmp_path / "raw" / name).mkdir(parents=True)
        (tmp_path / "raw" / name / "dataset.yaml").write_text(GOOD)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.usefixtures("project")
def test_all_data_sets_are_found_in_the_order_of_their_names():
    loaded = load_datasets()
    assert (list(loaded.datasets), loaded.problems, loaded.config_ok) == (["one", "two"], [], True)
    manifest, board, folder = loaded.datasets["one"]
    assert (manifest.board, board.name, folder.as_posix()) == ("tiny", "tiny", "raw/one")


def test_a_wrong_manifest_leaves_out_its_data_set_only(project):
    (project / "raw/one/dataset.yaml").write_text(GOOD + "titel: x\n")
    loaded = load_datasets()
    assert list(loaded.datasets) == ["two"]
    assert loaded.config_ok
    assert [str(problem) for problem in loaded.problems] == [
        "raw/one/dataset.yaml:4: titel: unknown key; did you mean 'title'?"
    ]


def test_config_chooses_the_data_sets_in_its_order(project):
    (project / "config/config.yaml").write_text("datasets: [two, one, two]\n")
    assert list(load_datasets().datasets) == ["two", "one"]
    (project / "config/config.yaml").write_text("datasets: [one]\n")
    assert list(load_datasets().datasets) == ["one"]


def test_a_wrong_config_is_told_from_a_wrong_manifest(project):
    (project / "config/config.yaml").write_text("analysis: {engin: native}\n")
    loaded = load_datasets()
    assert (loaded.config, loaded.config_ok) == (Config(), False)
    assert loaded.problems[0].key == "analysis.engin"


def test_a_config_that_is_not_there_is_a_mistake(project):
    (project / "config/config.yaml").unlink()
    loaded = load_datasets()
    assert not loaded.config_ok
    assert str(loaded.problems[0]) == "config/config.yaml:1: no such file; check the path"


@pytest.mark.usefixtures("project")
def test_missing_files_are_left_to_the_decoding_unless_asked_for():
    assert load_datasets().problems == []
    loaded = load_datasets(files=True)
    assert loaded.datasets == {}
    assert [problem.message for problem in loaded.problems] == [
        "no such file: raw/one/a.bin",
        "no such file: raw/two/a.bin",
    ]


def test_only_the_used_gyros_are_on_the_board(project):
    board = BOARD.replace("axis: z, scale: 0.1}]", "axis: z, scale: 0.1}, {name: h, field: g, axis: y, scale: 0.1}]")
    (project / "config/boards/tiny.yaml").write_text(board)
    (project / "raw/one/dataset.yaml").write_text(GOOD + "gyros: [h]\n")
    datasets = load_datasets().datasets
    assert datasets["one"].board.axes == ["y"]
    assert datasets["two"].board.axes == ["z", "y"]


def test_a_board_may_lie_beside_the_manifest(project):
    (project / "raw/one/mine.yaml").write_text(BOARD.replace("name: tiny", "name: mine"))
    (project / "raw/one/dataset.yaml").write_text(GOOD.replace("board: tiny", "board: ./mine.yaml"))
    assert load_datasets().datasets["one"].board.name == "mine"


def test_the_logged_reference_lies_beside_the_dumps(project):
    text = "board: tiny\nfolder: data\nrecordings:\n- {name: a, kind: static, files: a.bin}\n"
    text += "- {name: b, kind: random, files: b.bin, reference: {kind: file, file: table.csv}}\n"
    (project / "raw/one/dataset.yaml").write_text(text)
    manifest, _, folder = load_datasets().datasets["one"]
    assert reference_file(manifest, "b", folder).as_posix() == "raw/one/data/table.csv"
    assert reference_file(manifest, "a", folder) is None
