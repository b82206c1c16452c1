"""Make the recordings of a twin: dumps, logged reference, truth, and what the line did to them."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

from vgyro.board import Board
from vgyro.simulate import (
    Simulated,
    Twin,
    check_against_board,
    dump_name,
    dump_of,
    manifest_of,
    manifest_yaml,
    parse_twin,
    simulate_recording,
)
from vgyro.simulate.line import Damage
from vgyro.simulate.recording import truth_table
from vgyro.storage.inputs import BOARDS, read_board
from vgyro.storage.tables import Provenance, atomic_path, sha256_of_file, write_json, write_table, write_text
from vgyro.tasks.closure import code_hash
from vgyro.tasks.common import Task, run_task
from vgyro.validation import InvalidFile


def main(task: Task) -> None:
    """One recording.

    inputs  : twin, and board (a board file) unless it is among the options
    outputs : dump, truth, and where wanted reference (the true rate of every sample) and damage
    options : recording, and board (Board as JSON) if it is not an input
    """
    twin_file = task.input("twin")
    twin = parse_twin(twin_file.read_text(encoding="utf-8"), str(twin_file))
    if "board" in task.inputs:
        board = read_board(str(task.input("board").resolve()))
    else:
        board = Board.model_validate(task.options["board"])
    check(twin, board, str(twin_file))
    simulated = simulate_recording(twin, board, task.options["recording"])
    damage = write_dump(task.output("dump"), simulated, board, twin, None)
    write_truth(task.output("truth"), simulated, board, twin, damage, task.provenance())
    if "reference" in task.outputs:
        write_reference(task.output("reference"), simulated, task.provenance())
    if "damage" in task.outputs:
        write_json(task.output("damage"), {simulated.recording: [item.record() for item in damage]})


def simulate_dataset(twin_path: str | Path, folder: str | Path, seed: int | None = None, boards: Path = BOARDS) -> None:
    """Make the whole data set of a twin in `folder`.

    <recording>.bin, <recording>_reference.parquet of every recording that moves, truth/<recording>.parquet,
    truth/damage.json, and dataset.yaml last of all.  seed : instead of the twin's.
    raises : ConfigError if the twin or its board is wrong
    """
    path, target = Path(twin_path), Path(folder)
    twin = parse_twin(path.read_text(encoding="utf-8"), str(path))
    board = read_board(twin.board, path.parent, boards)
    check(twin, board, str(path))
    options = hashlib.sha256(json.dumps({"seed": seed}).encode()).hexdigest()
    provenance = Provenance({"twin": sha256_of_file(path)}, options, code_hash("vgyro.tasks.simulate"))
    write_twin(twin, board, target, provenance, seed)


def write_twin(twin: Twin, board: Board, folder: Path, provenance: Provenance, seed: int | None = None) -> None:
    """Write every recording of a twin, its truth and its manifest into `folder`; see simulate_dataset."""
    done: dict[str, list[dict[str, Any]]] = {}
    for recording in twin.recordings:
        simulated = simulate_recording(twin, board, recording.name, seed)
        damage = write_dump(folder / dump_name(recording.name), simulated, board, twin, seed)
        write_truth(folder / "truth" / f"{recording.name}.parquet", simulated, board, twin, damage, provenance)
        if recording.motion.kind != "rest":
            write_reference(folder / f"{recording.name}_reference.parquet", simulated, provenance)
        done[recording.name] = [item.record() for item in damage]
    write_json(folder / "truth" / "damage.json", done)
    write_text(folder / "dataset.yaml", manifest_yaml(manifest_of(twin)))


def check(twin: Twin, board: Board, source: str) -> None:
    """Refuse a twin that does not fit its board.  raises : InvalidFile"""
    problems = check_against_board(twin, board, source)
    if problems:
        raise InvalidFile(problems)


def write_dump(path: Path, simulated: Simulated, board: Board, twin: Twin, seed: int | None) -> list[Damage]:
    """Write the dump; return what the line did to it."""
    data, damage = dump_of(simulated, board, twin, seed)
    with atomic_path(path) as beside:
        beside.write_bytes(data)
    return damage


def write_truth(
    path: Path, simulated: Simulated, board: Board, twin: Twin, damage: list[Damage], provenance: Provenance
) -> None:
    """Write the truth, ten rows a second; the recording's part of the twin and the damage are in its metadata."""
    extra = {
        "twin": twin.name,
        "recording": twin.recording(simulated.recording).model_dump(mode="json", exclude_unset=True),
        "gyros": {name: truth.model_dump(mode="json") for name, truth in twin.gyros.items()},
        "damage": [item.record() for item in damage],
    }
    write_table(path, truth_table(simulated, board), "truth", provenance, extra)


def write_reference(path: Path, simulated: Simulated, provenance: Provenance) -> None:
    """Write the true rate of every sample, as a turntable's log."""
    write_table(path, {"time": simulated.time, "rate": simulated.reference}, "reference", provenance)


if __name__ == "__main__":
    run_task(main)
