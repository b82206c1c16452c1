"""What `vgyro check` reads of the data: mistakes of manifest and board that only the recordings show."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vgyro.board import BinaryFrame, Board
from vgyro.calibration import average_plateaus, find_moves, gyro_windows, window_length
from vgyro.calibration.suspicions import (
    Suspicion,
    outside_recording,
    plateau_shift,
    rate_suspicion,
    relative_scales,
    same_columns,
    scale_suspicions,
    shared_channels,
    unsteady_plateaus,
)
from vgyro.config import CalibrationOptions, IntegrityOptions, RestOptions
from vgyro.dataset import AT_REST, FileReference, Manifest, PlateauReference, Recording, values_of
from vgyro.errors import VgyroError
from vgyro.log import LogArray
from vgyro.storage.decode import ReaderOptions, open_recording
from vgyro.storage.dumps.diagnose import diagnose
from vgyro.storage.dumps.sniff import probe
from vgyro.storage.inputs import data_files
from vgyro.storage.integrity import Integrity
from vgyro.storage.sources import open_sources
from vgyro.tasks.calibration.tables import RecordingSource, plateaus_of
from vgyro.tasks.inputs_check import MANIFEST, Dataset, reference_file
from vgyro.validation import Problem, locate

MOST_VALUES = 12_000_000  # of all gyros of a recording together; what comes after is not read
FEWEST_ROWS = 100_000
MOVING = 0.01  # share of a recording at rest in which the board may move without a word


@dataclass(frozen=True)
class DataHead:
    """The beginning of a recording, or all of it.

    values : [T, N], of the gyros, as sent;  time : [T] s;  whole : nothing was left out
    integrity : the record, where all was read
    """

    values: np.ndarray
    time: np.ndarray
    whole: bool
    integrity: Integrity | None


@dataclass(frozen=True)
class DataFinding:
    """Where in a manifest something seems wrong, and what."""

    key: str
    suspicion: Suspicion


def check_data(dataset: Dataset, boards: Path) -> tuple[list[Problem], list[Problem]]:
    """Mistakes and warnings of one data set, each located in its manifest."""
    manifest, board, folder = dataset
    source = folder / MANIFEST
    findings = [
        finding
        for index, recording in enumerate(manifest.recordings)
        for finding in _of_recording(f"recordings.{index}", recording, manifest, board, folder, boards)
    ]
    text = source.read_text(encoding="utf-8")
    mistakes, warnings = (
        locate(
            [Problem(str(source), 1, one.key, one.suspicion.message) for one in findings if one.suspicion.sure is sure],
            text,
        )
        for sure in (True, False)
    )
    return mistakes, warnings


def _of_recording(
    key: str, recording: Recording, manifest: Manifest, board: Board, folder: Path, boards: Path
) -> Iterator[DataFinding]:
    paths = data_files(manifest, recording.name, folder)
    try:
        head = read_head(paths, recording, board, boards, manifest.array)
        advice = (
            []
            if recording.log or not isinstance(board.frame, BinaryFrame)
            else diagnose(probe(open_sources(paths), board).head, board)
        )
    except VgyroError as error:
        yield DataFinding(f"{key}.files", Suspicion(str(error), True))
        return
    yield from (DataFinding(f"{key}.files", Suspicion(text, True)) for text in advice)
    if not len(head.time):
        return
    names = [gyro.name for gyro in board.gyros]
    # Identical numbers of one channel are named by the board alone.
    yield from (
        DataFinding(key, one)
        for one in [*shared_channels(names, [gyro.field for gyro in board.gyros]), *_same(head, board, names)]
    )
    yield from (DataFinding(_rate_key(key, recording), one) for one in _rate(head, recording, board))
    yield from _times(key, head, recording)
    yield from (DataFinding(key, one) for one in _moves(head, recording, board))
    if recording.kind == "calibration" and values_of(manifest, recording) == "counts":
        yield from _table(key, head, recording, board, folder, manifest)


def read_head(
    paths: list[Path], recording: Recording, board: Board, boards: Path, array: LogArray | None = None
) -> DataHead:
    """Read a recording, up to MOST_VALUES.  raises : DataError, ConfigError"""
    reader = open_recording(
        paths, recording, board, IntegrityOptions(), array=array, reading=ReaderOptions(boards=boards)
    )
    most = max(FEWEST_ROWS, MOST_VALUES // len(board.gyros))
    columns, times, rows = [], [], 0
    fields = [gyro.field for gyro in board.gyros]
    for chunk in reader:
        columns.append(np.column_stack([chunk.counts[field] for field in fields]))
        times.append(chunk.time)
        rows += len(chunk.time)
        if rows > most:
            break
    if not columns:
        return DataHead(np.empty((0, len(fields))), np.empty(0), reader.integrity is not None, reader.integrity)
    return DataHead(np.concatenate(columns), np.concatenate(times), reader.integrity is not None, reader.integrity)


def _same(head: DataHead, board: Board, names: list[str]) -> list[Suspicion]:
    first = [
        place for place, gyro in enumerate(board.gyros) if gyro.field not in [g.field for g in board.gyros[:place]]
    ]
    return same_columns(head.values[:, first], [names[place] for place in first])


def _rate_key(key: str, recording: Recording) -> str:
    return f"{key}.rate_hz" if recording.rate_hz is not None else key


def _rate(head: DataHead, recording: Recording, board: Board) -> list[Suspicion]:
    declared = recording.rate_hz or board.rate_hz
    measured = head.integrity.measured_rate_hz if head.integrity else None
    if declared is None or measured is None:
        return []
    found = rate_suspicion(float(declared), measured)
    return [found] if found else []


def _times(key: str, head: DataHead, recording: Recording) -> Iterator[DataFinding]:
    """Plateaus and rests after the end of the recording."""
    if not head.whole or head.integrity is None:
        return
    end = head.integrity.duration_s
    if recording.rest != "auto":
        for number, one in outside_recording("rest", list(recording.rest), end):
            yield DataFinding(f"{key}.rest.{number}", one)
    if isinstance(recording.reference, PlateauReference):
        spans = [(plateau.start, plateau.stop) for plateau in recording.reference.plateaus]
        for number, one in outside_recording("plateau", spans, end):
            yield DataFinding(f"{key}.reference.plateaus.{number}", one)


def _moves(head: DataHead, recording: Recording, board: Board) -> list[Suspicion]:
    """A recording that is declared to be at rest, and is not."""
    if recording.kind not in AT_REST or recording.rest != "auto" or len(head.time) < 2:
        return []
    options = RestOptions()
    rate = 1 / max(float(np.median(np.diff(head.time))), 1e-9)
    length = window_length(rate, options)
    windows = [gyro_windows(column, length) for column in head.values.T]
    scales = [gyro.sign * gyro.scale for gyro in board.gyros]
    moving = find_moves(windows, [gyro.axis for gyro in board.gyros], scales, options)
    if not len(moving) or moving.mean() <= MOVING:
        return []
    first = float(head.time[int(np.argmax(moving)) * length])
    text = f"declared {recording.kind}, but the board moves in {moving.mean():.0%} of it, first at {first:.4g} s"
    return [Suspicion(f"{text}: set `rest` to where it stands still, or `kind: free`", False)]


def _table(
    key: str, head: DataHead, recording: Recording, board: Board, folder: Path, manifest: Manifest
) -> Iterator[DataFinding]:
    """A rate-table recording: are the plateaus where they are said to be, and the rates in deg/s?"""
    log = reference_file(manifest, recording.name, folder) if isinstance(recording.reference, FileReference) else None
    try:
        plateaus = list(plateaus_of(RecordingSource(recording, folder, math.nan, log), CalibrationOptions()))
    except VgyroError as error:
        yield DataFinding(f"{key}.reference", Suspicion(str(error), True))
        return
    axis = recording.axis or board.axes[0]
    chosen = [place for place, gyro in enumerate(board.gyros) if gyro.axis == axis]
    values, gyros = head.values[:, chosen].astype(float), [board.gyros[place] for place in chosen]
    where = f"{key}.reference"
    shift = plateau_shift(values, head.time, plateaus)
    if shift is not None:
        text = f"the gyros are not steady on the plateaus: moving all plateaus by {shift:+.1f} s makes them steady"
        yield DataFinding(where, Suspicion(text, True))
        plateaus = [(start + shift, stop + shift, rate) for start, stop, rate in plateaus]
    inside = [plateau for plateau in plateaus if plateau[0] >= 0 and plateau[1] <= head.time[-1] + 1.0]
    yield from (DataFinding(where, one) for one in unsteady_plateaus(values, head.time, inside))
    rails = (board.adc.low, board.adc.high) if board.adc else None
    means = average_plateaus(values, head.time, inside, rails, whole_turns=False)
    relative = relative_scales(means.mean, means.rate, [g.sign for g in gyros], [g.scale for g in gyros])
    yield from (DataFinding(where, one) for one in scale_suspicions([gyro.name for gyro in gyros], relative))
