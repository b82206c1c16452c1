"""Make the recordings of a twin: dumps, logged reference, truth, and what the line did to them."""

from __future__ import annotations

import hashlib
import json
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vgyro.board import Board
from vgyro.simulate import (
    DamageDone,
    Dump,
    Twin,
    check_against_board,
    dump_name,
    lasting,
    manifest_of,
    manifest_yaml,
    parse_twin,
    simulate_pieces,
)
from vgyro.simulate.recording import truth_table
from vgyro.storage.inputs import BOARDS, read_board
from vgyro.storage.tables import (
    Provenance,
    TableWriter,
    atomic_path,
    sha256_of_file,
    write_json,
    write_table,
    write_text,
)
from vgyro.tasks.closure import code_hash
from vgyro.tasks.common import Task, run_task
from vgyro.validation import InvalidFile

SECTIONS = ("board",)


@dataclass(frozen=True)
class Outputs:
    """Files of one recording; reference: None where none is wanted."""

    dump: Path
    truth: Path
    reference: Path | None


def main(task: Task) -> None:
    """One recording.

    inputs  : twin, and board (a board file) unless it is among the options
    outputs : dump, truth, and where wanted reference (the true rate of every sample) and damage
    options : recording, and board (Board as JSON) if it is not an input
    """
    twin_file = task.input("twin")
    twin = parse_twin(twin_file.read_text(encoding="utf-8"), str(twin_file))
    given = "board" in task.inputs
    board = read_board(str(task.input("board").resolve())) if given else task.section("board", Board)
    check(twin, board, str(twin_file))
    outputs = Outputs(
        task.output("dump"), task.output("truth"), task.output("reference") if "reference" in task.outputs else None
    )
    damage = write_recording(outputs, twin, board, task.option("recording"), None, task.provenance())
    if "damage" in task.outputs:
        write_json(task.output("damage"), {task.option("recording"): [item.record() for item in damage]})


def simulate_dataset(
    twin_path: str | Path,
    folder: str | Path,
    seed: int | None = None,
    boards: Path = BOARDS,
    hours: float | None = None,
) -> None:
    """Make the whole data set of a twin in `folder`.

    <recording>.bin, <recording>_reference.parquet of every recording that moves, truth/<recording>.parquet,
    truth/damage.json, and dataset.yaml last of all.
    seed   : instead of the twin's;  hours : length of the recordings at rest, instead of the twin's
    raises : ConfigError if the twin or its board is wrong
    """
    path, target = Path(twin_path), Path(folder)
    twin = parse_twin(path.read_text(encoding="utf-8"), str(path))
    twin = twin if hours is None else lasting(twin, hours)
    board = read_board(twin.board, path.parent, boards)
    check(twin, board, str(path))
    given = {"seed": seed} if hours is None else {"seed": seed, "hours": hours}
    options = hashlib.sha256(json.dumps(given).encode()).hexdigest()
    provenance = Provenance({"twin": sha256_of_file(path)}, options, code_hash("vgyro.tasks.simulate"))
    write_twin(twin, board, target, provenance, seed)


def write_twin(twin: Twin, board: Board, folder: Path, provenance: Provenance, seed: int | None = None) -> None:
    """Write every recording of a twin, its truth and its manifest into `folder`; see simulate_dataset."""
    done: dict[str, list[dict[str, Any]]] = {}
    for recording in twin.recordings:
        name = recording.name
        reference = folder / f"{name}_reference.parquet" if recording.motion.kind != "rest" else None
        outputs = Outputs(folder / dump_name(name), folder / "truth" / f"{name}.parquet", reference)
        done[name] = [item.record() for item in write_recording(outputs, twin, board, name, seed, provenance)]
    write_json(folder / "truth" / "damage.json", done)
    write_text(folder / "dataset.yaml", manifest_yaml(manifest_of(twin)))


def check(twin: Twin, board: Board, source: str) -> None:
    """Refuse a twin that does not fit its board.  raises : InvalidFile"""
    problems = check_against_board(twin, board, source)
    if problems:
        raise InvalidFile(problems)


def write_recording(
    outputs: Outputs, twin: Twin, board: Board, recording: str, seed: int | None, provenance: Provenance
) -> list[DamageDone]:
    """Write dump, truth (ten rows a second) and, where wanted, the true rate of every sample, as a turntable's log.

    The recording's part of the twin and the damage are in the metadata of the truth.  returns : what the line did
    """
    dump = Dump(twin, board, recording, lambda: simulate_pieces(twin, board, recording, seed), seed)
    truth: list[dict[str, np.ndarray]] = []
    with ExitStack() as stack:
        sink = stack.enter_context(stack.enter_context(atomic_path(outputs.dump)).open("wb"))
        log = None
        if outputs.reference is not None:
            log = stack.enter_context(TableWriter(outputs.reference, "reference", provenance))
        for piece in simulate_pieces(twin, board, recording, seed):
            sink.write(dump.feed(piece))
            truth.append(truth_table(piece, board))
            if log is not None:
                log.append({"time": piece.time, "rate": piece.reference})
    damage = dump.damage
    extra = {
        "twin": twin.name,
        "recording": twin.recording(recording).model_dump(mode="json", exclude_unset=True),
        "gyros": {name: gyro.model_dump(mode="json") for name, gyro in twin.gyros.items()},
        "damage": [item.record() for item in damage],
    }
    columns = {name: np.concatenate([table[name] for table in truth]) for name in truth[0]}
    write_table(outputs.truth, columns, "truth", provenance, extra)
    return damage


if __name__ == "__main__":
    run_task(main)
