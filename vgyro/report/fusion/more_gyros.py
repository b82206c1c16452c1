"""How many more gyros would help: the factor over one gyro against their number, for several correlations."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from vgyro.report.html import heading, join, paragraph
from vgyro.report.model import ArrayPart, DatasetPart, Record, Table
from vgyro.report.numbers import percent, plain, rounded, significant, with_interval
from vgyro.report.plots import Axis, Curve, PlotFrame, PlotMarks, curve_plot
from vgyro.report.tables import Cell, TableColumn, TableRow, render_table

TITLE = "How many more gyros would help"
RULE = (
    "Jiang et al. (2012), eq. 21: N alike gyros, every pair with the correlation ρ, have √(N/(1 + (N − 1)ρ)) times "
    "less white noise than one. Their variance is the mean of this array's; the point is this array itself, with the "
    "weights of its own covariance: off the curve where its gyros are not alike. ρ is the mean of all "
    "pairs, its limits those of the pairs together. Drift and faults are not in this."
)


def more_gyros_part(dataset: DatasetPart, array: ArrayPart) -> Markup:
    """Plot, sentence and table; nothing for the recordings from which the noise was not taken, or one gyro."""
    table = array.tables.get("more_gyros")
    source = dataset.sources.get(f"{array.recording}/{array.axis}/more_gyros.parquet")
    if table is None or source is None or len(array.gyros) < 2:
        return Markup("")
    summary: Record = source["summary"]
    return join(
        heading(TITLE, 4),
        _plot(array, table, summary),
        paragraph(sentence(summary)),
        _wanted(summary),
        paragraph(RULE, "note"),
    )


def _plot(array: ArrayPart, table: Table, summary: Record) -> Markup:
    correlation = summary["correlation"]
    assumed = sorted(set(table["correlation"].tolist()) - set(correlation or ()))
    curves = []
    if correlation is not None:
        number, measured = _curve(table, correlation[0])
        low, high = (_along(number, *_curve(table, rho)) for rho in (correlation[2], correlation[1]))
        label = f"ρ = {rounded(correlation[0], 3)}, measured"
        curves.append(Curve("measured", label, number, measured, low, high, points=True, width=2))
    for place, rho in enumerate(assumed):
        number, values = _curve(table, rho)
        label = f"ρ = {plain(rho)}"
        curves.append(Curve(label, label, number, values, colour=place + 1))
    if summary["present_factor"] is not None:
        here = np.array([float(summary["gyros"])]), np.array([float(summary["present_factor"])])
        curves.append(Curve("this array", "this array", *here, ink=True, points=True, line=False, marker="triangle"))
    axes = Axis("number of gyros"), Axis("factor over one gyro")
    lines = [float(summary["gyros"])]
    return curve_plot(
        PlotFrame(f"more-{array.anchor}", "White noise against the number of gyros", *axes),
        curves,
        PlotMarks(lines=lines),
    )


def _curve(table: Table, correlation: float) -> tuple[np.ndarray, np.ndarray]:
    rows = table["correlation"] == correlation
    # The measured correlation may be one of the assumed ones, too.
    number, first = np.unique(table["gyros"][rows], return_index=True)
    return number.astype(float), table["factor"][rows][first]


def _along(number: np.ndarray, known: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values at the numbers of another curve; NaN where so many gyros cannot have that correlation."""
    found = dict(zip(known.tolist(), values.tolist(), strict=True))
    return np.array([found.get(one, math.nan) for one in number.tolist()])


def sentence(summary: Record) -> str:
    """What the analysis says, in words."""
    gyros = int(summary["gyros"])
    if summary["correlation"] is None:
        return f"The correlation of the {gyros} gyros is not known: the curves are of assumed ones."
    rho = summary["correlation"]
    first = f"{gyros} gyros with ρ = {_told(rho)} give {_told(summary['factor'])} over one of them"
    second = f"{2 * gyros} would give {_told(summary['twice'])}" if summary["twice"][0] is not None else (
        f"{2 * gyros} cannot all have so negative a correlation"
    )  # fmt: skip
    return f"{first}; {second}. {_itself(summary)}{_beyond(summary)}"


def _itself(summary: Record) -> str:
    if summary["present_factor"] is None:
        return ""
    return f"This array itself, weighted by its own covariance, has {significant(summary['present_factor'])}. "


def _beyond(summary: Record) -> str:
    rho = summary["correlation"]
    little = percent(float(summary["little"]), 2)
    adds = f"from {summary['little_from']} gyros on each further one adds less than {little}"
    if rho[0] > 0:
        most = f"and no number of them gives more than {_told(summary['limit'])}"
        return f"With this correlation {adds}, {most}."
    if rho[2] >= 0:
        return f"The correlation is not told from none; with none, {adds}."
    return (
        f"The correlation is negative, which no more than {plain(summary['most'])} gyros can have: it is a property of "
        f"this array, and not one of gyros that are added. With none, {adds}."
    )


def _told(limits: Sequence[float | None]) -> str:
    """Value and limits, as many digits as they deserve; a limit that is not known is without bound."""
    value, low, high = (math.inf if one is None else float(one) for one in limits)
    if math.isfinite(low) and math.isfinite(high) and high > low:
        text, interval = with_interval(value, low, high)
        return f"{text} ({interval})"
    if high <= low:
        return significant(value)
    return f"{significant(value)} ({significant(low)} … {significant(high)})"


def _wanted(summary: Record) -> Markup:
    """Number of gyros for some factors."""
    if summary["correlation"] is None:
        return Markup("")
    wanted: list[list[Any]] = list(summary["wanted"])
    columns = [TableColumn("factor wanted", numeric=False), *(TableColumn(plain(float(row[0]))) for row in wanted)]
    cells = [Cell("gyros"), *(_number_cell(*row[1:]) for row in wanted)]
    return render_table(columns, [TableRow(tuple(cells))], "Gyros for a wanted factor over one of them", compact=True)


def _number_cell(value: int | None, low: int | None, high: int | None) -> Cell:
    """A number of gyros; below it those for the limits of the correlation."""
    texts = ["no number" if one is None else plain(one) for one in (value, low, high)]
    below = texts[1] if texts[1] == texts[2] else f"{texts[1]} … {texts[2]}"
    return Cell(texts[0], "" if below == texts[0] else below, "muted" if value is None else "")
