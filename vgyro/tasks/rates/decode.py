"""Files of one recording → frames.parquet and integrity.json. A recording that cannot be used is refused."""

from __future__ import annotations

import logging
import sys
from pathlib import Path
from typing import Any

from vgyro.board import Board
from vgyro.config import IntegrityOptions
from vgyro.dataset import Manifest, Recording, values_of
from vgyro.errors import DataError
from vgyro.log import Values
from vgyro.storage.decode import ReaderOptions, open_recording
from vgyro.storage.frames import Frames, Reader, empty_frames
from vgyro.storage.integrity import Integrity, Refused
from vgyro.storage.tables import Provenance, TableWriter, write_json, write_table
from vgyro.storage.verdict import unreadable_record
from vgyro.tasks.common import Task, run_task

SECTIONS = ("manifest", "board", "integrity", "engine")


def main(task: Task) -> None:
    """inputs : files;  outputs : frames, integrity;  options : manifest, board, recording, analysis.{integrity, engine}

    A refused recording gets an empty table, a record that says why, and one message on stderr; the other recordings
    go on, and the last rule of the workflow fails.
    """
    manifest = task.section("manifest", Manifest)
    board = task.section("board", Board)
    recording = manifest.recording(task.option("recording"))
    options = task.section("integrity", IntegrityOptions)
    values = values_of(manifest, recording)
    provenance = _provenance(task)
    try:
        reader = open_recording(
            task.inputs["files"],
            recording,
            board,
            options,
            array=manifest.array,
            reading=ReaderOptions(engine=task.engine),
        )
        record = decode(reader, task.output("frames"), provenance, _extra(board, values))
        for reason in record.reasons:
            _say(f"{recording.name}: suspect: {reason}")
    except DataError as error:
        record = _record_of(error, board, recording)
        write_table(task.output("frames"), columns_of(empty_frames(board)), "frames", provenance, _extra(board, values))
        logging.exception("%s", error)
        _say(str(error))
    write_json(task.output("integrity"), {"recording": recording.name, **record.to_json()})


def decode(reader: Reader, output: Path, provenance: Provenance, extra: dict[str, str]) -> Integrity:
    """Stream a recording into a table of frames.  raises : DataError; then there is no table"""
    with TableWriter(output, "frames", provenance, extra) as writer:
        for frames in reader:
            writer.append(columns_of(frames))
    if reader.integrity is None:
        raise RuntimeError("the reader ended without a record")
    return reader.integrity


def columns_of(frames: Frames) -> dict[str, Any]:
    """Columns of frames.parquet."""
    return {"counter": frames.counter, "time": frames.time, "segment": frames.segment, **frames.counts}


def _record_of(error: DataError, board: Board, recording: Recording) -> Integrity:
    if isinstance(error, Refused):
        return error.integrity
    return unreadable_record(board, recording.rate_hz or board.rate_hz, error)


def _extra(board: Board, values: Values) -> dict[str, str]:
    return {"board": board.name, "values": values}


def _provenance(task: Task) -> Provenance:
    """Hashes of the files that are there: a missing one is a reason to refuse, not to fail; of a folder, its logs'."""
    files: list[Path] = []
    for path in task.inputs["files"]:
        files += sorted(one for one in path.rglob("*") if one.is_file()) if path.is_dir() else [path]
    present = {**task.inputs, "files": [path for path in files if path.is_file()]}
    return Task(present, task.outputs, task.options, task.code).provenance()


def _say(text: str) -> None:
    print(f"vgyro: {text}", file=sys.stderr)


if __name__ == "__main__":
    run_task(main)
