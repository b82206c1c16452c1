"""vgyro new-dataset: what it writes must pass vgyro check, and explain every key."""

import json
import struct
from binascii import crc_hqx
from typing import get_args

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml

from vgyro.cli.drafts.manifest_text import RecordingDraft, manifest_text
from vgyro.cli.new_dataset import KINDS
from vgyro.dataset import Kind, Manifest, Recording, parse_manifest
from vgyro.log import Log, LogGyro


def dump(frames=300):
    data = b""
    for k in range(frames):
        body = struct.pack(">HHhh", 0xEB90, k, k % 7, k % 5)
        data += body + struct.pack(">H", crc_hqx(body, 0xFFFF))
    return data


@pytest.fixture
def dumps(project):
    """Two dumps in a folder of their own."""
    folder = project / "captures"
    folder.mkdir()
    for name in ("first run.bin", "second.bin"):
        (folder / name).write_bytes(dump())
    return folder


def test_dumps_become_recordings_of_the_board_that_fits(project, dumps, vgyro):
    outcome = vgyro("new-dataset", *sorted(dumps.iterdir()), "--name", "bench")
    assert (outcome.code, outcome.err) == (0, "")
    text = (project / "raw/bench/dataset.yaml").read_text()
    manifest = parse_manifest(text, "f")
    assert manifest.board == "tiny"
    assert manifest.folder == "../../captures"
    assert [(r.name, r.kind, r.files) for r in manifest.recordings] == [
        ("first-run", "static", ("first run.bin",)),
        ("second", "static", ("second.bin",)),
    ]
    assert "# guessed: its frames make up 100.0% of the first megabyte of first run.bin" in text
    assert vgyro("check").out.startswith("bench: 2 recordings, 2 gyros of board tiny\n")


def test_every_key_is_in_the_file_and_explained():
    text = manifest_text("tiny", ["a note"], ".", [RecordingDraft("a", "a.bin")])
    for model, indent in ((Manifest, ""), (Recording, "    ")):
        for name, field in model.model_fields.items():
            assert f"{name}:" in text
            assert f"{indent}# {field.description}" in text or name == "name"
    assert max(map(len, text.splitlines())) <= 120


def test_commented_keys_may_be_uncommented():
    text = manifest_text("tiny", [], ".", [RecordingDraft("a", "a.bin")])
    keys = [name for name in (*Manifest.model_fields, *Recording.model_fields) if f"# {name}: " in text]
    lines = [
        line.replace("# ", "", 1) if any(line.strip().startswith(f"# {key}: ") for key in keys) else line
        for line in text.splitlines()
    ]
    manifest = parse_manifest("\n".join(lines), "f")
    assert {"title", "gyros", "latitude_deg", "notes"} <= manifest.model_fields_set
    assert {"rate_hz", "rest", "axis"} <= manifest.recordings[0].model_fields_set


def test_the_examples_of_references_are_right():
    text = manifest_text("tiny", [], ".", [RecordingDraft("a", "a.bin", kind="constant")])
    examples = [line.split("#   ")[1] for line in text.splitlines() if "#   reference: " in line]
    assert len(examples) == 4
    for example in examples:
        assert Recording.model_validate(
            {"name": "a", "kind": "free", "files": "a", **yaml.safe_load(example)}
        ).reference


def test_an_existing_data_set_is_not_overwritten(project, dumps, vgyro):
    vgyro("new-dataset", dumps / "second.bin", "--name", "bench")
    before = (project / "raw/bench/dataset.yaml").read_bytes()
    outcome = vgyro("new-dataset", dumps / "second.bin", "--name", "bench", "--board", "tiny")
    assert outcome.code == 2
    assert outcome.err.startswith("vgyro: raw/bench/dataset.yaml: it exists already, and is not overwritten.")
    assert (project / "raw/bench/dataset.yaml").read_bytes() == before


def test_the_name_is_that_of_the_folder(project, dumps, vgyro):
    assert vgyro("new-dataset", dumps / "second.bin").code == 0
    assert (project / "raw/captures/dataset.yaml").exists()


@pytest.mark.parametrize("name", ["my bench", "index", "papers", "../x", "-x"])
def test_a_name_that_the_workflow_cannot_use(dumps, vgyro, name):
    outcome = vgyro("new-dataset", dumps / "second.bin", f"--name={name}")
    assert outcome.code == 2
    assert "cannot be the name of a data set" in outcome.err


def test_files_of_one_name_become_two_recordings(project, dumps, vgyro):
    (dumps / "more").mkdir()
    (dumps / "more/second.bin").write_bytes(dump())
    vgyro("new-dataset", dumps / "second.bin", dumps / "more/second.bin", "--name", "bench")
    manifest = parse_manifest((project / "raw/bench/dataset.yaml").read_text(), "f")
    assert [(r.name, r.files) for r in manifest.recordings] == [
        ("second", ("second.bin",)),
        ("second-2", ("more/second.bin",)),
    ]


def test_a_file_that_fits_no_board(project, vgyro):
    path = project / "noise.bin"
    path.write_bytes(bytes(range(256)) * 20)
    outcome = vgyro("new-dataset", path, "--name", "bench")
    assert outcome.code == 4
    assert "noise.bin: no board of config/boards fits its first megabyte" in outcome.err
    assert not (project / "raw/bench").exists()


@pytest.mark.parametrize(("data", "message"), [(b"", "empty"), (None, "no such file")])
def test_an_empty_or_missing_file(project, vgyro, data, message):
    path = project / "x.bin"
    if data is not None:
        path.write_bytes(data)
    outcome = vgyro("new-dataset", path, "--name", "bench")
    assert outcome.code == 4
    assert message in outcome.err


def test_a_board_that_does_not_exist(dumps, vgyro):
    outcome = vgyro("new-dataset", dumps / "second.bin", "--name", "bench", "--board", "tinny")
    assert (outcome.code, outcome.err) == (3, "vgyro: no board 'tinny' in config/boards; did you mean 'tiny'?\n")


def test_json_says_what_was_found(dumps, vgyro):
    record = json.loads(vgyro("new-dataset", dumps / "second.bin", "--name", "bench", "--json").out)
    assert record["manifest"] == "raw/bench/dataset.yaml"
    assert record["board"] == "tiny"
    assert record["recordings"] == [{"name": "second", "files": ["second.bin"], "kind": "static", "rate_hz": None}]


# --- logs

RNG = np.random.default_rng(11)
NOISE = 0.08 * RNG.standard_normal((3000, 3))
COUNTS = np.rint(8 * RNG.standard_normal((3000, 3))).astype(np.int64)
TIME = np.arange(3000) / 100
TRIPLE = """\
name: triple
title: three gyros
rate_hz: 100
log_channels: [gx, gy, gz]
adc: {low: -32768, high: 32767}
gyros:
- {name: gyro_x, field: gx, axis: x, scale: 0.05, range_deg_s: 300}
- {name: gyro_y, field: gy, axis: y, scale: 0.05, range_deg_s: 300}
- {name: gyro_z, field: gz, axis: z, scale: 0.05, range_deg_s: 300}
"""


@pytest.fixture
def triple(project):
    """The board `triple`, with the channels gx, gy and gz and rails at ±32768."""
    (project / "config/boards/triple.yaml").write_text(TRIPLE)
    return project


def text_log(path, values, names=("gx", "gy", "gz"), time=TIME, unit=""):
    rows = [",".join(["t", *(f"{name}{unit}" for name in names)])]
    rows += [",".join([f"{t:.2f}", *(f"{value:g}" for value in row)]) for t, row in zip(time, values, strict=True)]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(rows) + "\n")
    return path


def written(project, name="log"):
    return parse_manifest((project / f"raw/{name}/dataset.yaml").read_text(), "f")


def test_counts_with_the_channels_of_a_board_are_that_board_s(triple, vgyro):
    outcome = vgyro("new-dataset", text_log(triple / "a.csv", COUNTS), "--name", "log")
    assert (outcome.code, outcome.err) == (0, "")
    manifest = written(triple)
    assert (manifest.board, manifest.array) == ("triple", None)
    log = manifest.recordings[0].log
    assert (log.columns, log.time.column, log.values) == ({}, "t", "counts")
    assert "guessed: a.csv has a column for each of its channels" in outcome.out
    assert vgyro("check").code == 0


@pytest.mark.parametrize(("values", "names", "why"), [
    (NOISE, ("gx", "gy", "gz"), "no whole numbers"),
    (COUNTS + 32768, ("gx", "gy", "gz"), "half of them and more beyond its rails"),
    (COUNTS + 32600, ("gx", "gy", "gz"), "1630 deg/s, by the board's scale, of a gyro of 300 deg/s"),
    (COUNTS, ("gx", "gy", "gw"), "a channel without a column"),
])  # fmt: skip
def test_columns_of_another_unit_are_not_a_board_s(triple, vgyro, values, names, why):
    outcome = vgyro("new-dataset", text_log(triple / "a.csv", values, names), "--name", "log", "--scale", "0.01")
    assert outcome.code == 0, why
    manifest = written(triple)
    assert manifest.board is None
    assert {gyro.scale for gyro in manifest.array.gyros} == {0.01}


@pytest.mark.parametrize(("beyond", "board"), [(0.49, "triple"), (0.51, None)])
def test_counts_may_be_clipped_in_half_the_rows_at_most(triple, vgyro, beyond, board):
    values = COUNTS.copy()
    values[: int(beyond * len(values))] = 32767
    vgyro("new-dataset", text_log(triple / "a.csv", values), "--name", "log", "--scale", "0.01", "--kind", "free")
    assert written(triple).board == board


@pytest.mark.parametrize(("level", "board"), [(8900, "triple"), (9100, None)])
def test_counts_may_exceed_the_range_by_half(triple, vgyro, level, board):
    # 300 deg/s are 6000 counts.
    values = COUNTS + level
    vgyro("new-dataset", text_log(triple / "a.csv", values), "--name", "log", "--scale", "0.01", "--kind", "free")
    assert written(triple).board == board


def test_uint16_around_the_middle_is_another_unit_and_asked_for(triple, vgyro):
    path = triple / "log.parquet"
    columns = {name: (COUNTS[:, place] + 32768).astype(np.uint16) for place, name in enumerate(("gx", "gy", "gz"))}
    pq.write_table(pa.table({"t": TIME, **columns}), path)
    outcome = vgyro("new-dataset", path, "--name", "log")
    assert outcome.code == 2
    assert "whole numbers: counts, whose scale the log does not tell" in outcome.err
    assert not (triple / "raw/log").exists()


def test_a_board_that_is_named_is_taken_whatever_the_columns_are_called(project, vgyro):
    path = project / "log.parquet"
    pq.write_table(pa.table({"t": TIME, "G1": COUNTS[:, 0], "gyro_2": COUNTS[:, 1], "other": COUNTS[:, 2]}), path)
    outcome = vgyro("new-dataset", path, "--name", "log", "--board", "tiny")
    assert (outcome.code, outcome.err) == (0, "")
    log = written(project).recordings[0].log
    assert (log.columns, log.time.column, log.values) == ({"g1": "G1", "g2": "gyro_2"}, "t", "counts")
    assert "#   t, G1, gyro_2, other\n" in (project / "raw/log/dataset.yaml").read_text()


def test_rates_of_a_board_are_not_calibrated_again(project, vgyro):
    folder = project / "archive/day=1"
    folder.mkdir(parents=True)
    pq.write_table(pa.table({"g1": NOISE[:, 0], "g2": NOISE[:, 1]}), folder / "part.parquet")
    outcome = vgyro("new-dataset", project / "archive", "--name", "log", "--board", "tiny", "--rate", "100")
    assert (outcome.code, outcome.err) == (0, "")
    recording = written(project).recordings[0]
    assert (recording.name, recording.files, recording.log.values) == ("archive", ("archive",), "rates")


def test_gyros_of_a_board_without_a_column_are_named(project, vgyro):
    path = project / "log.parquet"
    pq.write_table(pa.table({"t": TIME, "g1": COUNTS[:, 0], "x": COUNTS[:, 1]}), path)
    assert vgyro("new-dataset", path, "--name", "log", "--board", "tiny").code == 0
    assert "# g2: no column found" in (project / "raw/log/dataset.yaml").read_text()
    outcome = vgyro("check")
    assert outcome.code != 0
    assert "g2" in outcome.out + outcome.err


@pytest.mark.parametrize("place", ["lab/mine.yaml", "../outside.yaml"])
def test_a_board_by_its_path_is_found_again_by_check(triple, vgyro, place):
    path = triple / place
    path.parent.mkdir(parents=True, exist_ok=True)
    (triple / "config/boards/triple.yaml").rename(path)
    outcome = vgyro("new-dataset", text_log(triple / "a.csv", COUNTS), "--name", "log", "--board", path)
    assert (outcome.code, outcome.err) == (0, "")
    outcome = vgyro("check", "raw/log/dataset.yaml")
    assert outcome.code == 0, outcome.err + outcome.out
    assert "board triple" in outcome.out


def test_a_board_by_its_path_for_dumps(project, dumps, vgyro):
    (project / "config/boards/tiny.yaml").rename(project / "captures/tiny.yaml")
    outcome = vgyro("new-dataset", dumps / "second.bin", "--name", "bench", "--board", "captures/tiny.yaml")
    assert (outcome.code, outcome.err) == (0, "")
    assert written(project, "bench").board == "../../captures/tiny.yaml"
    assert vgyro("check").code == 0


@pytest.mark.parametrize(("given", "scale"), [
    ("1/131", 1 / 131), ("0.00875", 0.00875), ("1 / 16.4", 1 / 16.4), ("8.75e-3", 0.00875), ("2.5/100", 0.025),
])  # fmt: skip
def test_scale(project, vgyro, given, scale):
    outcome = vgyro("new-dataset", text_log(project / "a.csv", COUNTS), "--name", "log", "--scale", given)
    assert (outcome.code, outcome.err) == (0, "")
    assert [gyro.scale for gyro in written(project).array.gyros] == pytest.approx([scale] * 3)


@pytest.mark.parametrize("given", ["1/0", "0", "-1", "abc", "1/2/3", "", "1/", "nan", "inf", "1e400", "1/1e400"])
def test_a_scale_that_is_no_positive_number(project, vgyro, given):
    outcome = vgyro("new-dataset", text_log(project / "a.csv", COUNTS), "--name", "log", f"--scale={given}")
    assert outcome.code == 2
    assert "expected a number" in outcome.err
    assert not (project / "raw/log").exists()


def test_unit_axis_and_kind_as_they_are_given(project, vgyro):
    path = text_log(project / "a.csv", NOISE, ("g1", "g2", "gz"))
    outcome = vgyro("new-dataset", path, "--name", "log", "--unit", "mdps", "--axis", "yaw", "--kind", "thermal")
    assert (outcome.code, outcome.err) == (0, "")
    manifest = written(project)
    assert {(gyro.unit, gyro.axis) for gyro in manifest.array.gyros} == {("mdps", "yaw")}
    assert manifest.recordings[0].kind == "thermal"
    text = (project / "raw/log/dataset.yaml").read_text()
    assert text.count("as you say") == 2


@pytest.mark.parametrize("given", ["statc", "calibration", ""])
def test_a_kind_that_cannot_be_given(project, vgyro, given):
    outcome = vgyro("new-dataset", text_log(project / "a.csv", NOISE), "--name", "log", f"--kind={given}")
    assert outcome.code == 2
    assert "--kind" in outcome.err
    assert not (project / "raw/log").exists()


def test_the_kinds_are_those_of_a_manifest():
    assert {*KINDS, "calibration"} == set(get_args(Kind))


@pytest.fixture
def three_files(project):
    """A gyro on z in each of three files, turned by hand, on clocks of their own."""
    rng = np.random.default_rng(5)
    motion = np.interp(TIME, np.arange(0, 31, 0.25), 30 * rng.standard_normal(124))
    return [
        text_log(project / f"unit{place}.csv", (motion + 0.08 * rng.standard_normal(3000))[:, None], ["gz"])
        for place in range(3)
    ]


def test_files_with_a_gyro_each_are_together_or_separate(project, three_files, vgyro):
    assert vgyro("new-dataset", *three_files, "--name", "guess").code == 0
    assert vgyro("new-dataset", *three_files, "--name", "one", "--together").code == 0
    assert vgyro("new-dataset", *three_files, "--name", "many", "--separate").code == 0
    for name in ("guess", "one"):
        manifest = written(project, name)
        assert [len(recording.files) for recording in manifest.recordings] == [3]
        assert [gyro.name for gyro in manifest.array.gyros] == ["unit0_gz", "unit1_gz", "unit2_gz"]
    manifest = written(project, "many")
    assert [recording.name for recording in manifest.recordings] == ["unit0", "unit1", "unit2"]
    assert [gyro.name for gyro in manifest.array.gyros] == ["gz"]
    assert vgyro("check").code == 0


@pytest.mark.parametrize(("rows", "recordings"), [(2851, 1), (2849, 2)])
def test_files_are_one_array_where_they_are_about_as_long(project, three_files, vgyro, rows, recordings):
    lines = three_files[1].read_text().splitlines(keepends=True)
    three_files[1].write_text("".join(lines[: rows + 1]))
    assert vgyro("new-dataset", *three_files[:2], "--name", "log").code == 0
    assert len(written(project).recordings) == recordings


def test_scale_and_unit_exclude_each_other(project, vgyro):
    path = text_log(project / "a.csv", COUNTS)
    assert vgyro("new-dataset", path, "--scale", "1/131", "--unit", "deg/s").code == 2


def test_together_and_separate_exclude_each_other(three_files, vgyro):
    assert vgyro("new-dataset", *three_files, "--together", "--separate").code == 2


def test_every_key_of_an_array_is_explained_and_lines_are_not_too_wide(project, vgyro):
    names = [f"a_rather_long_name_of_a_column_{place}_gx" for place in range(12)]
    values = 0.08 * np.random.default_rng(1).standard_normal((3000, 12))
    assert vgyro("new-dataset", text_log(project / "a.csv", values, names), "--name", "log").code == 0
    text = (project / "raw/log/dataset.yaml").read_text()
    for model in (Manifest, Recording):
        for name, field in model.model_fields.items():
            assert f"{name}:" in text
            assert f"# {field.description}" in text or name == "name"
    for name, field in LogGyro.model_fields.items():
        assert f"#   {name}: {field.description}" in text or name == "name"
    for name, field in Log.model_fields.items():
        # `values` belongs to a board's columns.
        assert name == "values" or f"{name}:" in text
        assert name in ("family", "values") or f"# {field.description}" in text
    assert max(map(len, text.splitlines())) <= 120


def test_commented_keys_of_a_log_may_be_uncommented(project, vgyro):
    assert vgyro("new-dataset", text_log(project / "a.csv", NOISE), "--name", "log").code == 0
    text = (project / "raw/log/dataset.yaml").read_text()
    keys = [*Manifest.model_fields, *Recording.model_fields, *Log.model_fields]
    lines = [
        line.replace("# ", "", 1) if any(line.strip().startswith(f"# {key}: ") for key in keys) else line
        for line in text.splitlines()
    ]
    manifest = parse_manifest("\n".join(line for line in lines if not line.startswith("board:")), "f")
    assert {"title", "gyros", "latitude_deg", "notes"} <= manifest.model_fields_set
    assert {"rate_hz", "rest", "axis", "log"} <= manifest.recordings[0].model_fields_set
    assert {"family", "time", "columns", "clocks", "text"} <= manifest.recordings[0].log.model_fields_set
