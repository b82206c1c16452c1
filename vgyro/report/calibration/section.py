"""Calibration: a certificate for each axis that was measured on a rate table; nominal values are marked."""

from __future__ import annotations

from collections.abc import Mapping

from markupsafe import Markup

from vgyro.dataset import values_of
from vgyro.log import Place
from vgyro.report.calibration.certificate import certificate
from vgyro.report.html import details, join, paragraph
from vgyro.report.model import DatasetPart, Record
from vgyro.report.numbers import MISSING, plain
from vgyro.report.tables import Cell, TableColumn, render_table

FEW = 8
NOMINAL_WORDS = (
    "Nominal scale: there is no calibration recording for these gyros, so the board's data-sheet values are used, and "
    "every figure below in deg/s, deg/h or deg/√h carries their error (several percent for most MEMS gyros)."
)
LOGGED_WORDS = (
    "Rates as logged: the log holds them in a unit of rate, so whoever wrote it chose the scale, and there is no "
    "calibration recording to check it by. Every figure below in deg/s, deg/h or deg/√h carries its error (several "
    "percent for most MEMS gyros)."
)
LOGGED_COLUMNS = (
    TableColumn("gyro", numeric=False),
    TableColumn("axis", numeric=False),
    TableColumn("column of the log", numeric=False),
    TableColumn("unit", numeric=False),
)
COLUMNS = (
    TableColumn("gyro", numeric=False),
    TableColumn("axis", numeric=False),
    TableColumn("scale from", numeric=False),
    TableColumn("scale", "deg/s a count"),
    TableColumn("bias", "counts"),
    TableColumn("remark", numeric=False),
)


def calibration_part(dataset: DatasetPart) -> Markup:
    """What could not be calibrated, then one certificate an axis."""
    gyros: Mapping[str, Record] = dataset.calibration.get("gyros", {})
    skipped = dataset.calibration.get("skipped") or {}
    parts = [paragraph(f"{name} gave no calibration: {reason}", "warn") for name, reason in skipped.items()]
    unmeasured = {name: gyros[name] for name in nominal(dataset)}
    if unmeasured and rates_as_logged(dataset):
        parts += [paragraph(LOGGED_WORDS, "warn"), _logged_table(dataset)]
    elif unmeasured:
        axes = {gyro.name: gyro.axis for gyro in dataset.board.gyros}
        rows = [_nominal_row(name, axes.get(name, MISSING), record) for name, record in unmeasured.items()]
        table = render_table(COLUMNS, rows)
        title = f"Nominal values of {len(unmeasured)} gyros"
        parts += [paragraph(NOMINAL_WORDS, "warn"), details(title, table) if len(unmeasured) > FEW else table]
    measured = [axis for axis in dataset.board.axes if _measured(dataset, axis)]
    parts += [certificate(dataset, axis, _measured(dataset, axis)) for axis in measured]
    return join(*parts)


def nominal(dataset: DatasetPart) -> list[str]:
    """Names of the gyros whose scale is the data sheet's."""
    return [name for name, record in dataset.calibration.get("gyros", {}).items() if record.get("source") == "nominal"]


def rates_as_logged(dataset: DatasetPart) -> bool:
    """Do all recordings hold rates, which nothing here scaled?"""
    manifest = dataset.manifest
    return all(values_of(manifest, recording) == "rates" for recording in manifest.recordings)


def _logged_table(dataset: DatasetPart) -> Markup:
    """Where each gyro stands in the log; empty where a board file says so."""
    array = dataset.manifest.array
    if array is None:
        return Markup("")
    log = dataset.manifest.recordings[0].log
    places = {gyro.name: None if log is None else log.place(gyro.name) for gyro in array.gyros}
    rows = [
        [
            Cell(gyro.name),
            Cell(gyro.axis),
            Cell(*_place(places[gyro.name], array.columns[gyro.name])),
            Cell(str(gyro.unit)),
        ]
        for gyro in array.gyros
    ]
    table = render_table(LOGGED_COLUMNS, rows)
    return details(f"Columns of {len(rows)} gyros", table) if len(rows) > FEW else table


def _place(place: Place | None, column: str) -> tuple[str, str]:
    """The column of a gyro, and what tells it from others of that name."""
    if place is None:
        return column, ""
    rows = [f"{name} {value}" for name, value in place.where.items()]
    return place.column, ", ".join(part for part in (place.file, place.table, *rows) if part)


def _measured(dataset: DatasetPart, axis: str) -> dict[str, Record]:
    """Records of the gyros of an axis that were measured."""
    gyros: Mapping[str, Record] = dataset.calibration.get("gyros", {})
    names = [gyro.name for gyro in dataset.board.array(axis)]
    return {name: gyros[name] for name in names if name in gyros and gyros[name].get("source") == "measured"}


def _nominal_row(name: str, axis: str, record: Record) -> list[Cell]:
    scale, bias = (Cell(plain(float(record[key]))) for key in ("scale", "bias"))
    return [Cell(name), Cell(axis), Cell("nominal", tone="warn"), scale, bias, Cell(str(record.get("note") or ""))]
