"""Report: the page of a data set and its line in the overview, laid out from the artefacts."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import NamedTuple

from vgyro.board import Board
from vgyro.calibration.figures import FIGURES as CALIBRATION_FIGURES
from vgyro.config import DEFINITIONS
from vgyro.dataset import Manifest
from vgyro.metrics.figures import FIGURES
from vgyro.report.dataset_page import headline, render_dataset
from vgyro.report.model import ArrayPart, DatasetPart, RatesPart, Record, RecordingPart, Table
from vgyro.storage.tables import read_columns, read_json, read_metadata, write_json, write_text
from vgyro.tasks.common import Task, run_task
from vgyro.tasks.pages.rates import read_rates
from vgyro.tasks.pages.volatility import read_volatility

SECTIONS = ("manifest", "board", "integrity", "rest", "calibration", "volatility", "fusion", "metrics", "crosscheck")

# Long, and drawn nowhere: what is told of them is in allan, spectrum, metrics and arch_lm.
NOT_READ = ("fused", "moved", "series")
RESULTS = "results"


class ArtefactPlace(NamedTuple):
    """Where an artefact belongs. axis, definition : empty where the artefact is above them;  table : rates, garch, …"""

    recording: str
    axis: str
    definition: str
    table: str


def place_of(path: Path, dataset: str) -> ArtefactPlace:
    """Read results/<dataset>/<recording>[/<axis>[/<definition>]]/<table>.parquet.  raises : ValueError"""
    folders = inside(path, dataset).parts[:-1]
    if not 1 <= len(folders) <= 3:
        raise ValueError(f"{path} is not at results/<dataset>/<recording>[/<axis>[/<definition>]]")
    recording, axis, definition = (*folders, "", "")[:3]
    return ArtefactPlace(recording, axis, definition, path.stem)


def inside(path: Path, dataset: str) -> Path:
    """The path from results/<dataset> on.  raises : ValueError if it does not lie there"""
    pairs = list(itertools.pairwise(path.parts))
    if (RESULTS, dataset) not in pairs:
        raise ValueError(f"{path} is not in {RESULTS}/{dataset}")
    return Path(*path.parts[pairs.index((RESULTS, dataset)) + 2 :])


def main(task: Task) -> None:
    """Read all artefacts of a data set, write page (HTML) and headline (JSON).

    inputs  : calibration; integrity, one a recording in the manifest's order; noise; artefacts, every table
    options : dataset, manifest, board, analysis
    """
    dataset = read_dataset_part(task)
    write_text(task.output("page"), render_dataset(dataset))
    write_json(task.output("headline"), headline(dataset))


def read_dataset_part(task: Task) -> DatasetPart:
    """All artefacts of a data set, each in its place."""
    name = task.option("dataset")
    manifest = task.section("manifest", Manifest)
    board = task.section("board", Board)
    placed = {place_of(path, name): path for path in task.inputs.get("artefacts", [])}
    recordings = tuple(
        RecordingPart(
            recording.name,
            recording.kind,
            read_json(path),
            rates_of(placed, recording.name, board),
            read_arrays(placed, recording.name, recording.kind, board),
        )
        for recording, path in zip(manifest.recordings, task.inputs["integrity"], strict=True)
    )
    return DatasetPart(
        name,
        manifest,
        board,
        recordings,
        read_json(task.input("calibration")),
        {path.stem: read_json(path) for path in task.inputs.get("noise", [])},
        FIGURES,
        CALIBRATION_FIGURES,
        task.option("analysis"),
        read_sources(task, placed),
    )


def rates_of(placed: dict[ArtefactPlace, Path], recording: str, board: Board) -> RatesPart | None:
    """Rates of a recording; None where it has none."""
    path = placed.get(ArtefactPlace(recording, "", "", "rates"))
    return None if path is None else read_rates(path, [gyro.name for gyro in board.gyros])


def read_arrays(placed: dict[ArtefactPlace, Path], recording: str, kind: str, board: Board) -> tuple[ArrayPart, ...]:
    """The arrays of a recording that have artefacts, in the board's order."""
    arrays = []
    for axis in board.axes:
        tables: dict[str, Table] = {}
        volatility: dict[str, dict[str, Path]] = {}
        for place, path in placed.items():
            if (place.recording, place.axis) != (recording, axis) or place.table in NOT_READ:
                continue
            if place.definition:
                volatility.setdefault(place.definition, {})[place.table] = path
            else:
                tables[place.table] = read_columns(path)
        if tables:
            gyros = tuple(gyro.name for gyro in board.array(axis))
            parts = {str(name): read_volatility(volatility[name], gyros) for name in DEFINITIONS if name in volatility}
            arrays.append(ArrayPart(recording, axis, gyros, tables, parts, kind))
    return tuple(arrays)


def read_sources(task: Task, placed: dict[ArtefactPlace, Path]) -> dict[str, Record]:
    """Path from the data set's folder → metadata of each artefact."""
    dataset = task.option("dataset")
    sources: dict[str, Record] = {}
    for path in placed.values():
        sources[inside(path, dataset).as_posix()] = read_metadata(path)
    return sources


if __name__ == "__main__":
    run_task(main)
