"""vgyro new-dataset: what it writes must pass vgyro check, and explain every key."""

import json
import struct
from binascii import crc_hqx

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml

from vgyro.cli.manifest_text import LogDraft, RecordingDraft, manifest_text
from vgyro.dataset import Manifest, Recording, parse_manifest


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


def test_a_parquet_log_gets_a_skeleton_of_its_columns(project, vgyro):
    path = project / "log.parquet"
    table = {"t": [0.0, 0.01], "G1": [1, 2], "gyro_2": [3, 4], "other": [0, 0]}
    pq.write_table(pa.table(table), path)
    assert vgyro("new-dataset", path, "--name", "log").code == 4
    outcome = vgyro("new-dataset", path, "--name", "log", "--board", "tiny")
    assert outcome.code == 0
    text = (project / "raw/log/dataset.yaml").read_text()
    log = parse_manifest(text, "f").recordings[0].parquet
    assert (log.columns, log.time, log.values) == ({"g1": "G1", "g2": "gyro_2"}, "t", "counts")
    assert "#   t, G1, gyro_2, other\n" in text


def test_a_folder_of_parquet_files_is_one_recording(project, vgyro):
    folder = project / "archive/day=1"
    folder.mkdir(parents=True)
    pq.write_table(pa.table({"g1": [0.5, 0.25], "g2": [1.0, 2.0]}), folder / "part.parquet")
    outcome = vgyro("new-dataset", project / "archive", "--name", "log")
    assert outcome.code == 0
    recording = parse_manifest((project / "raw/log/dataset.yaml").read_text(), "f").recordings[0]
    assert (recording.name, recording.files, recording.parquet.values) == ("archive", ("archive",), "rates")


def test_gyros_without_a_column_are_named():
    log = LogDraft({"g1": "g1"}, ["g2"], ["g1", "x"], None)
    text = manifest_text("tiny", [], ".", [RecordingDraft("a", "a.parquet", log=log)])
    assert "# g2: no column found" in text
    assert parse_manifest(text, "f").recordings[0].parquet.columns == {}


def test_json_says_what_was_found(dumps, vgyro):
    record = json.loads(vgyro("new-dataset", dumps / "second.bin", "--name", "bench", "--json").out)
    assert record["manifest"] == "raw/bench/dataset.yaml"
    assert record["board"] == "tiny"
    assert record["recordings"] == [{"name": "second", "file": "second.bin", "rate_hz": None}]
