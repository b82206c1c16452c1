"""The task: frames and record for a good recording; an empty table and one message for one that is refused."""

import json
import struct
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from task_options import complete

from vgyro.dataset import Manifest
from vgyro.storage.inputs import read_board
from vgyro.storage.tables import read_json, read_metadata
from vgyro.tasks.common import run_task
from vgyro.tasks.rates.decode import main

BOARDS = Path(__file__).resolve().parents[2] / "config" / "boards"


def packet(index: int) -> bytes:
    body = b"\xaa" + struct.pack(">HBI48h", index, 0x64, 1_024_000 * index, *[(7 * index + k) % 90 for k in range(48)])
    return body + struct.pack(">H", sum(body) % 65536)


@pytest.fixture
def run(tmp_path):
    def go(files, board="mimu4444", integrity=None):
        manifest = Manifest.model_validate(
            {"board": board, "recordings": [{"name": "rest", "kind": "static", "files": ["x.bin"]}]}
        )
        options = {
            "manifest": manifest.model_dump(mode="json"),
            "board": read_board(board, boards=BOARDS).model_dump(mode="json"),
            "recording": "rest",
            "analysis": complete({"integrity": integrity or {}}),
        }
        arguments = ["--input", "files", *map(str, files), "--output", "frames", str(tmp_path / "frames.parquet")]
        arguments += ["--output", "integrity", str(tmp_path / "integrity.json"), "--options", json.dumps(options)]
        run_task(main, arguments)
        return pq.read_table(tmp_path / "frames.parquet"), read_json(tmp_path / "integrity.json")

    return go


def test_good_recording(run, tmp_path, capsys):
    path = tmp_path / "x.bin"
    path.write_bytes(b"".join(packet(i) for i in range(300)))
    table, record = run([path])
    assert table.num_rows == 300
    assert table.column_names[:4] == ["counter", "time", "segment", "ticks"]
    assert (record["status"], record["recording"], record["frames"]["good"]) == ("good", "rest", 300)
    assert record["duration_s"] == pytest.approx(4.8)
    metadata = read_metadata(tmp_path / "frames.parquet")
    assert (metadata["schema"], metadata["units"]["imu1_gx"]) == ("frames", "count")
    assert capsys.readouterr().err == ""
    first = (tmp_path / "frames.parquet").read_bytes()
    run([path])
    assert (tmp_path / "frames.parquet").read_bytes() == first


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "is empty: 0 bytes"),
        (b"nothing like a packet" * 50, "no good frame of board mimu4444"),
        (None, "no such file"),
    ],
)
def test_refused_recording_has_an_empty_table_with_the_same_columns(run, tmp_path, capsys, content, words):
    path = tmp_path / "x.bin"
    path.write_bytes(b"".join(packet(i) for i in range(300)))
    good, _ = run([path])
    path.unlink() if content is None else path.write_bytes(content)
    table, record = run([path])
    assert table.num_rows == 0
    assert table.schema.equals(good.schema)
    assert record["status"] == "refused"
    said = capsys.readouterr().err
    assert said.startswith(f"vgyro: {path}: ")
    assert said.count("\n") == 1
    assert words in said
    assert said.removeprefix("vgyro: ").strip() == record["reasons"][0]
    assert {"duration_s", "rate_hz", "reasons"} <= set(record)


def test_suspect_recording_is_used_and_named(run, tmp_path, capsys):
    path = tmp_path / "x.bin"
    path.write_bytes(b"".join(packet(i) for i in range(300) if i % 10))
    table, record = run([path])
    assert (table.num_rows, record["status"]) == (270, "suspect")
    assert capsys.readouterr().err.startswith("vgyro: rest: suspect: only 90")
