"""Rate-table recordings → plateau means and fits of the gyros, one column in memory at a time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from vgyro.board import Board, Gyro
from vgyro.calibration import (
    Finding,
    GyroNominal,
    PlateauMeans,
    ScaleFit,
    average_plateaus,
    cross_axis,
    find_plateaus,
    fit_scale_factor,
    not_measured,
)
from vgyro.config import CalibrationOptions
from vgyro.dataset import FileReference, PlateauReference, Recording
from vgyro.errors import TooShort
from vgyro.storage.tables import read_column
from vgyro.tasks.rates.block_means import thermometer_of
from vgyro.tasks.rates.reference_log import read_reference


@dataclass(frozen=True)
class RecordingSource:
    """A recording that the calibration may use, its frames, its sample rate, its logged reference if it has one."""

    recording: Recording
    frames: Path
    rate_hz: float
    reference: Path | None = None


@dataclass(frozen=True)
class TableTest:
    """One recording on a rate table, analysed for the gyros of its axis; means in their order."""

    source: RecordingSource
    axis: str
    means: PlateauMeans
    fits: list[ScaleFit]

    @property
    def name(self) -> str:
        """Of the recording."""
        return self.source.recording.name

    def fit(self, gyro: str) -> ScaleFit:
        """The fit of one gyro."""
        return next(fit for fit in self.fits if fit.gyro == gyro)


def fit_tests(
    sources: list[RecordingSource], board: Board, latitude_deg: float | None, options: CalibrationOptions
) -> tuple[list[TableTest], dict[str, str]]:
    """Every calibration recording that allows a fit, in order, and the others with the reason.

    raises : DataError if a gyro turns against its sign
    """
    tests, problems = [], {}
    for source in sources:
        axis = source.recording.axis or board.axes[0]
        array = board.array(axis)
        try:
            means = read_means(source, board, array, options)
            fits = fit_scale_factor(
                means,
                nominal_of(array),
                latitude_deg,
                options.confidence,
                where=f"{source.recording.name}, board {board.name}",
            )
        except TooShort as error:
            problems[source.recording.name] = error.what
            continue
        tests.append(TableTest(source, axis, means, fits))
    return tests, problems


def nominal_of(array: list[Gyro]) -> list[GyroNominal]:
    """What the board file says of some gyros."""
    return [GyroNominal(g.name, g.scale, g.bias, g.sign, g.range_deg_s) for g in array]


def read_means(source: RecordingSource, board: Board, array: list[Gyro], options: CalibrationOptions) -> PlateauMeans:
    """Plateau means of some gyros of one recording.  raises : TooShort, DataError"""
    plateaus = list(plateaus_of(source, options))
    if not plateaus:
        raise TooShort("no plateau in the logged reference", source.recording.name)
    time = read_column(source.frames, "time")
    rails = (board.adc.low, board.adc.high) if board.adc else None
    means = []
    for gyro in array:
        thermometer = thermometer_of(board, gyro.name)
        celsius = None
        if thermometer is not None:
            celsius = read_column(source.frames, thermometer.field) * thermometer.scale + thermometer.offset
        column = read_column(source.frames, gyro.field)[:, None]
        means.append(
            average_plateaus(
                column, time, plateaus, rails, whole_turns=options.whole_turns, temperature=celsius
            )
        )  # fmt: skip
    together = {
        name: np.column_stack([getattr(one, name) for one in means])
        for name in ("mean", "standard_error", "temperature")
    }
    return replace(means[0], **together)


def plateaus_of(source: RecordingSource, options: CalibrationOptions) -> Iterator[tuple[float, float, float]]:
    """(start s, stop s, rate deg/s): as the manifest lists them, or found in the logged reference."""
    reference = source.recording.reference
    if isinstance(reference, PlateauReference):
        listed = sorted(reference.plateaus, key=lambda plateau: plateau.start)
        yield from ((plateau.start, plateau.stop, plateau.rate) for plateau in listed)
    elif isinstance(reference, FileReference) and source.reference is not None:
        time, rate = read_reference(source.reference, reference)
        yield from find_plateaus(rate, time, settle_s=options.settle_s)


def cross_axes(
    tests: list[TableTest], board: Board, known: dict[str, ScaleFit], options: CalibrationOptions
) -> dict[str, Finding]:
    """Gyro → response to rotation about other axes; the larger one where two axes were turned about.

    known : the fit of each gyro, whose scale is used
    """
    found: dict[str, Finding] = {}
    for axis in board.axes:
        test = next((test for test in tests if test.axis == axis), None)
        others = [gyro for gyro in board.gyros if gyro.axis != axis]
        if test is None or not others:
            continue
        nominal = [replace(gyro, scale=known[gyro.name].scale) for gyro in nominal_of(others)]
        means = read_means(test.source, board, others, options)
        for gyro, finding in zip(others, cross_axis(means, nominal, options.confidence), strict=True):
            about = replace(finding, note="; ".join(filter(None, [finding.note, f"about {axis}"])))
            before = found.get(gyro.name)
            if before is None or _size(about) > _size(before):
                found[gyro.name] = about
    reason = "one axis only" if len(board.axes) == 1 else "no recording about another axis"
    return {gyro.name: found.get(gyro.name, not_measured(reason)) for gyro in board.gyros}


def _size(finding: Finding) -> float:
    return abs(finding.low + finding.high) / 2 if np.isfinite(finding.low) else -1.0
