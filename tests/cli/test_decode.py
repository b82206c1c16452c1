"""vgyro decode: dumps built here frame by frame; checksums by the standard library (binascii.crc_hqx)."""

import binascii
import gzip
import json
import struct

import pyarrow.parquet as pq
import pytest

from vgyro.storage.tables import read_metadata


def frame(counter, first=0, second=0):
    body = struct.pack(">HHhh", 0xEB90, counter % 65536, first, second)
    return body + struct.pack(">H", binascii.crc_hqx(body, 0xFFFF))


def dump(frames=200):
    return b"".join(frame(k, k % 50, -(k % 50)) for k in range(frames))


@pytest.fixture
def capture(project):
    path = project / "capture.bin"
    path.write_bytes(dump())
    return path


def test_a_whole_dump(capture, vgyro):
    outcome = vgyro("decode", capture, "--board", "tiny")
    assert (outcome.code, outcome.err) == (0, "")
    lines = outcome.out.splitlines()
    assert lines[0] == "capture.bin: board tiny, good"
    assert lines[1] == "frames    200 good, 0 lost, 0 damaged, 0 repeated"
    assert lines[2].endswith("s in 1 gap-free stretch")


def test_the_board_is_found_if_it_is_not_given(capture, vgyro):
    assert vgyro("decode", capture).out.startswith("capture.bin: board tiny, good\n")


def test_frames_are_written(capture, project, vgyro):
    out = project / "frames.parquet"
    assert vgyro("decode", capture, "--board", "tiny", "--out", out).code == 0
    table = pq.read_table(out)
    assert table.column("g1").to_pylist() == [k % 50 for k in range(200)]
    assert table.column("g2").to_pylist() == [-(k % 50) for k in range(200)]
    assert table.column("counter").to_pylist() == list(range(200))
    assert table.column("time").to_numpy()[-1] == pytest.approx(1.99)
    record = read_metadata(out)
    assert record["schema"] == "frames"
    assert record["units"]["g1"] == "count"
    assert list(record["provenance"]["inputs"]) == ["capture.bin"]


def test_two_files_are_one_recording(capture, project, vgyro):
    data = capture.read_bytes()
    (project / "a.bin.gz").write_bytes(gzip.compress(data[:1003]))
    (project / "b.bin").write_bytes(data[1003:])
    lines = vgyro("decode", "a.bin.gz", "b.bin", "--board", "tiny").out.splitlines()
    assert lines[:2] == ["a.bin.gz, b.bin: board tiny, good", "frames    200 good, 0 lost, 0 damaged, 0 repeated"]


def test_damage_and_gaps_are_named_with_their_place(capture, vgyro):
    data = capture.read_bytes()
    capture.write_bytes(data[:505] + b"\xff" + data[506:])
    lines = vgyro("decode", capture, "--board", "tiny").out.splitlines()
    assert lines[1] == "frames    199 good, 1 lost, 1 damaged, 0 repeated"
    assert any(line.startswith("gap       at 0.500 s: 1 frame, ") for line in lines)
    assert any(line.startswith("damage    bytes 500-510 of capture.bin: 1 frame lost, ") for line in lines)


def test_json_is_the_integrity_record(capture, vgyro):
    record = json.loads(vgyro("decode", capture, "--board", "tiny", "--json").out)
    assert record["frames"]["good"] == 200
    assert record["files"][0]["bytes"] == 2000


def test_a_file_of_another_board_is_refused(project, vgyro):
    path = project / "noise.bin"
    path.write_bytes(bytes(range(256)) * 20)
    outcome = vgyro("decode", path, "--board", "tiny", "--out", project / "frames.parquet")
    assert outcome.code == 4
    assert "noise.bin: no good frame of board tiny" in outcome.err
    assert outcome.err.count("\n") == 1
    assert outcome.out.startswith("noise.bin: board tiny, refused\n")
    assert not (project / "frames.parquet").exists()
    assert vgyro("decode", path).code == 4


@pytest.mark.parametrize(("data", "message"), [(b"", "empty"), (None, "no such file")])
def test_an_empty_or_missing_file_is_refused(project, vgyro, data, message):
    path = project / "x.bin"
    if data is not None:
        path.write_bytes(data)
    outcome = vgyro("decode", path, "--board", "tiny")
    assert outcome.code == 4
    assert message in outcome.err
    assert "Traceback" not in outcome.err


def test_an_unknown_board_gets_the_nearest(capture, vgyro):
    outcome = vgyro("decode", capture, "--board", "tinny")
    assert (outcome.code, outcome.out) == (3, "")
    assert outcome.err == "vgyro: no board 'tinny' in config/boards; did you mean 'tiny'?\n"
