"""Calibration: the fit of each gyro (Liu et al. 2015, fig. 2), residuals, figures; nominal values are marked."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from markupsafe import Markup

from vgyro.report.html import details, join, paragraph
from vgyro.report.model import DatasetPart
from vgyro.report.numbers import MISSING, significant
from vgyro.report.plots import Axis, Curve, curve_plot
from vgyro.report.tables import Cell, Column, number_cell, render_table

NAN = float("nan")
FEW = 8
NOMINAL_WORDS = (
    "Nominal scale: there is no calibration recording for these gyros, so the board's data-sheet values are used, and "
    "every figure below in deg/s, deg/h or deg/√h carries their error (several percent for most MEMS gyros)."
)
FLOOR_WORDS = (
    "Floor of the test: the nonlinearity that a perfectly linear gyro would show by its noise alone. A nonlinearity "
    "below it is not shown to exist."
)
COLUMNS = (
    Column("gyro", numeric=False),
    Column("axis", numeric=False),
    Column("scale from", numeric=False),
    Column("scale", "deg/s a count"),
    Column("zero-rate output", "counts"),
    Column("nonlinearity", "ppm of full scale"),
    Column("floor of the test", "ppm of full scale"),
    Column("remark", numeric=False),
)


def calibration_part(dataset: DatasetPart) -> Markup:
    """Table of all gyros; figures of the fit and of its residuals where there was a rate table."""
    gyros: Mapping[str, Any] = dataset.calibration.get("gyros", {})
    axes = {gyro.name: gyro.axis for gyro in dataset.board.gyros}
    warning = paragraph(NOMINAL_WORDS, "warn") if nominal(dataset) else Markup("")
    table = render_table(COLUMNS, [_row(name, axes.get(name, MISSING), record) for name, record in gyros.items()])
    skipped = dataset.calibration.get("skipped") or {}
    remarks = [paragraph(f"{name} gave no calibration: {reason}", "warn") for name, reason in skipped.items()]
    warning = join(warning, *remarks)
    measured = {name: record for name, record in gyros.items() if record.get("points")}
    if not measured:
        return join(warning, details(f"Nominal values of {len(gyros)} gyros", table) if len(gyros) > FEW else table)
    return join(warning, table, paragraph(FLOOR_WORDS, "note"), _plots(measured))


def nominal(dataset: DatasetPart) -> list[str]:
    """Names of the gyros whose scale is the data sheet's."""
    return [name for name, record in dataset.calibration.get("gyros", {}).items() if record.get("source") == "nominal"]


def _row(name: str, axis: str, record: Mapping[str, Any]) -> list[Cell]:
    is_nominal = record.get("source") == "nominal"
    source = Cell("nominal", tone="warn") if is_nominal else Cell(str(record.get("source", MISSING)), tone="good")
    why = "not measured" if is_nominal else "not given"
    return [
        Cell(name),
        Cell(axis),
        source,
        number_cell(*(_number(record.get(key)) for key in ("scale", "scale_low", "scale_high"))),
        number_cell(*(_number(record.get(key)) for key in ("bias", "bias_low", "bias_high"))),
        Cell(significant(_number(record.get("nonlinearity_ppm"))), hint=why),
        Cell(significant(_number(record.get("floor_ppm"))), hint=why),
        Cell(str(record.get("note") or "")),
    ]


def _number(value: Any) -> float:
    return NAN if value is None else float(value)


def _plots(measured: Mapping[str, Any]) -> Markup:
    counts, residuals = [], []
    for index, (name, record) in enumerate(measured.items()):
        points = sorted(record["points"], key=lambda point: point["rate"])
        rate, mean, residual = (
            np.array([_number(point.get(key)) for point in points]) for key in ("rate", "mean_count", "residual_deg_s")
        )
        counts.append(Curve(name, name, rate, mean, colour=index, points=True))
        residuals.append(Curve(name, name, rate, residual, colour=index, points=True, width=1))
    table_rate = Axis("rate of the table, deg/s")
    return join(
        curve_plot("scale-factor", "Scale factor", counts, table_rate, Axis("mean output, counts"), height=300),
        curve_plot(
            "scale-residuals",
            "Residuals of the straight line",
            residuals,
            table_rate,
            Axis("output − table, deg/s"),
            levels=(0.0,),
            height=260,
        ),
    )
