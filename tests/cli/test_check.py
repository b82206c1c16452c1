"""vgyro check: every mistake in every file, at once."""

import binascii
import json
import struct

import numpy as np
import pytest

NOISE = np.random.default_rng(1).normal(0, 20, (1000, 2)).round().astype(int)
GOOD = "board: tiny\nrecordings:\n- {name: a, kind: static, files: a.bin}\n"


def write(project, name, text, files=("a.bin",)):
    folder = project / "raw" / name
    folder.mkdir()
    (folder / "dataset.yaml").write_text(text)
    for file in files:
        (folder / file).write_bytes(frames(NOISE))


def frames(counts) -> bytes:
    """A dump of the board `tiny`: counts [T, 2]."""
    bodies = [b"\xeb\x90" + struct.pack(">H2h", index % 65536, *row) for index, row in enumerate(counts.tolist())]
    return b"".join(body + struct.pack(">H", binascii.crc_hqx(body, 0xFFFF)) for body in bodies)


def test_nothing_wrong(project, vgyro):
    write(project, "bench", GOOD)
    outcome = vgyro("check")
    assert outcome == (0, "bench: 1 recording, 2 gyros of board tiny\nnothing wrong\n", "")


@pytest.mark.usefixtures("project")
def test_no_data_set_yet(vgyro):
    outcome = vgyro("check")
    assert outcome.code == 0
    assert "start one with vgyro new-dataset" in outcome.out


def test_everything_wrong_is_named_at_once_and_the_rest_can_run(project, vgyro):
    (project / "config/config.yaml").write_text("datasets: [bench, bnch, broken, far, lost]\n")
    write(project, "bench", GOOD)
    write(project, "broken", "board: tyni\ntitel: x\nrecordings:\n- {name: a, kind: statik, files: a.bin}\n")
    write(project, "far", "board: tyni\nrecordings:\n- {name: a, kind: static, files: a.bin}\n")
    write(project, "lost", GOOD.replace("a.bin", "[a.bin, a.bni, 'x*.bin']"))
    outcome = vgyro("check")
    assert outcome.code == 3
    assert outcome.out == "bench: 1 recording, 2 gyros of board tiny\n"
    assert outcome.err.splitlines() == [
        "config/config.yaml:1: datasets.1: there is no raw/bnch/dataset.yaml; did you mean 'bench'?",
        "raw/broken/dataset.yaml:1: board: no board 'tyni' in config/boards; did you mean 'tiny'?",
        "raw/broken/dataset.yaml:2: titel: unknown key; did you mean 'title'?",
        "raw/broken/dataset.yaml:4: recordings.0.kind: expected one of calibration, static, constant, random, "
        "sinusoid, thermal, free; found 'statik'; did you mean 'static'?",
        "raw/far/dataset.yaml:1: board: no board 'tyni' in config/boards; did you mean 'tiny'?",
        "raw/lost/dataset.yaml:3: recordings.0.files.1: no such file: raw/lost/a.bni; did you mean 'a.bin'?",
        "raw/lost/dataset.yaml:3: recordings.0.files.2: no file fits raw/lost/x*.bin",
        "7 mistakes; 1 data set can run",
    ]


def test_a_wrong_config_is_named_together_with_wrong_manifests(project, vgyro):
    (project / "config/config.yaml").write_text("analysis:\n  volatility:\n    windw: 5\n")
    write(project, "broken", GOOD + "titel: x\n")
    errors = vgyro("check").err.splitlines()
    assert errors[0] == "config/config.yaml:3: analysis.volatility.windw: unknown key; did you mean 'window'?"
    assert errors[1] == "raw/broken/dataset.yaml:4: titel: unknown key; did you mean 'title'?"


def test_a_wrong_board_file_is_named_where_it_is_wrong(project, vgyro):
    board = project / "config/boards/tiny.yaml"
    board.write_text(board.read_text().replace("rate_hz: 100", "rate_hz: quick"))
    write(project, "bench", GOOD)
    assert vgyro("check").err.startswith("config/boards/tiny.yaml:3: rate_hz: expected a number, found 'quick'\n")


def test_one_data_set_may_be_checked_alone(project, vgyro):
    write(project, "bench", GOOD)
    write(project, "broken", "board: tiny\n")
    assert vgyro("check", "raw/bench/dataset.yaml").code == 0
    assert vgyro("check", "raw/bench").code == 0
    assert vgyro("check", "raw/broken").code == 3
    assert vgyro("check", "raw/nothing").err.startswith("raw/nothing:1: no such file")


def test_a_method_that_does_not_exist_gets_the_nearest(project, vgyro):
    write(project, "bench", GOOD + "analysis:\n  fusion:\n    methods: [median, avrage]\n")
    outcome = vgyro("check")
    assert outcome.code == 3
    message = (
        "raw/bench/dataset.yaml:6: analysis.fusion.methods.1: there is no method 'avrage'; did you mean 'average'?"
    )
    assert outcome.err.splitlines()[0] == message


def test_overrides_that_clash_with_config_are_found(project, vgyro):
    (project / "config/config.yaml").write_text("analysis: {volatility: {step: 100}}\n")
    write(project, "bench", GOOD + "analysis:\n  volatility:\n    window: 60\n")
    assert vgyro("check").err.startswith("raw/bench/dataset.yaml:5: analysis.volatility: step = 100 is longer than")


def test_names_that_the_workflow_needs_are_refused(project, vgyro):
    write(project, "index", GOOD)
    write(project, "my bench", GOOD)
    errors = vgyro("check").err
    assert "raw/index/dataset.yaml:1: the folder's name 'index' is taken by the workflow; rename it" in errors
    assert "raw/my bench/dataset.yaml:1: the folder's name 'my bench' may hold only letters, digits, - and _" in errors


def test_a_folder_or_reference_that_is_not_there(project, vgyro):
    write(project, "a", "folder: nowhere\n" + GOOD)
    reference = "{name: b, kind: random, files: a.bin, reference: {kind: file, file: table.csv}}"
    write(project, "b", f"board: tiny\nrecordings:\n- {reference}\n")
    errors = vgyro("check").err.splitlines()
    assert errors[0] == "raw/a/dataset.yaml:1: folder: no such folder: raw/a/nowhere; point `folder` at the files"
    assert errors[1] == "raw/b/dataset.yaml:3: recordings.0.reference.file: no such file: raw/b/table.csv"


def test_json_holds_the_same(project, vgyro):
    write(project, "bench", GOOD)
    write(project, "broken", "board: tiny\nrecordings: []\n")
    outcome = vgyro("check", "--json")
    assert outcome.code == 3
    assert json.loads(outcome.out) == {
        "ok": False,
        "datasets": ["bench"],
        "problems": [
            {
                "source": "raw/broken/dataset.yaml",
                "line": 2,
                "key": "recordings",
                "message": "expected at least 1 item, found 0",
            }
        ],
        "warnings": [],
    }
