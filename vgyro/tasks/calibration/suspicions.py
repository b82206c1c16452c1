"""Mistakes of the manifest or the board that the rate-table recordings show: for the top of the report."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vgyro.board import Board, Gyro
from vgyro.calibration.suspicions import (
    Plateau,
    Suspicion,
    outside_recording,
    plateau_shift,
    scale_suspicions,
    shared_channels,
)
from vgyro.config import CalibrationOptions
from vgyro.storage.tables import read_column
from vgyro.tasks.calibration.tables import RecordingSource, TableTest, plateaus_of

BIN_S = 0.1


def suspicions_of(
    sources: Sequence[RecordingSource], tests: Sequence[TableTest], board: Board, options: CalibrationOptions
) -> list[str]:
    """Sentences on what is surely wrong, one a mistake.

    sources : the rate-table recordings that decode accepted;  tests : those of them that allowed a fit
    """
    found = shared_channels([gyro.name for gyro in board.gyros], [gyro.field for gyro in board.gyros])
    sentences = [one.message for one in found if one.sure]
    for source in sources:
        axis = source.recording.axis or board.axes[0]
        fitted = next((test for test in tests if test.source is source), None)
        scales = [] if fitted is None else _of_scales(fitted, board.array(axis))
        plateaus = list(plateaus_of(source, options))
        # A shift explains odd scales; the other way round it does not.
        times = _of_times(source, board.array(axis), plateaus) if plateaus else []
        sentences += [f"{source.recording.name}: {one.message}" for one in times or scales if one.sure]
    return sentences


def _of_scales(test: TableTest, gyros: Sequence[Gyro]) -> list[Suspicion]:
    relative = [
        test.fit(gyro.name).scale / gyro.scale if test.fit(gyro.name).source == "measured" else np.nan for gyro in gyros
    ]
    return scale_suspicions([gyro.name for gyro in gyros], np.array(relative))


def _of_times(source: RecordingSource, gyros: Sequence[Gyro], plateaus: Sequence[Plateau]) -> list[Suspicion]:
    """Plateaus after the end of the recording, or at other times than the table's."""
    time = read_column(source.frames, "time")
    if not len(time):
        return []
    spans = [(start, stop) for start, stop, _ in plateaus]
    late = [one for _, one in outside_recording("plateau", spans, float(time[-1])) if one.sure]
    # Means of a tenth of a second: one column in memory at a time.
    bins = np.floor(time / BIN_S).astype(np.int64)
    filled, counts = np.unique(bins, return_counts=True)
    place = np.searchsorted(filled, bins)
    means = [np.bincount(place, read_column(source.frames, gyro.field), len(filled)) / counts for gyro in gyros]
    shift = plateau_shift(np.column_stack(means), (filled + 0.5) * BIN_S, plateaus)
    if shift is None:
        return late
    text = f"the gyros are not steady on the plateaus: moving all plateaus by {shift:+.1f} s makes them steady"
    return [Suspicion(text, True), *late]
