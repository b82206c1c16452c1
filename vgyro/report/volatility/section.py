"""Conditional variance and correlation: ARCH-LM, GARCH, DCC, the test of constant correlation, weights over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from vgyro.report.html import details, heading, join, paragraph
from vgyro.report.model import ArrayPart, DccSummary, GarchSummary, Record, Table, VolatilityPart, WeightCurves, rows_of
from vgyro.report.numbers import MISSING, count, percent, probability, significant
from vgyro.report.plots import Axis, Curve, PlotFrame, curve_plot
from vgyro.report.tables import Cell, TableColumn, TableRow, render_table
from vgyro.report.volatility.arch import effects_table
from vgyro.report.volatility.bekk import bekk_part
from vgyro.report.volatility.fits import fits_map, shares

LEVEL_OF_TEST = 0.05
TIME = Axis("time, s")
SERIES = ("level", "detrended", "whitened", "standardised")
MEANING = {
    "level": "level: r is the output itself, its second moment about zero",
    "demeaned": "demeaned: the mean of each window is removed",
    "difference": "difference: r_t = y_t − y_(t−1)",
    "residual": "residual: the array's own first-pass estimate of the rate is removed",
}
ARCH_WORDS = (
    "Whitened: tones taken out, then the residuals of an autoregression. A drift of the level, memory of the noise or "
    "a tone rejects this test by itself, without any change of variance: only a rejection of the whitened series "
    "counts as ARCH. Where the standardised residuals still reject, GARCH(1,1) has not explained it. Kurtosis is 3 "
    "for a Gaussian."
)
TEST_WORDS = (
    "Engle and Sheppard's test, with one lag. Whitening by the sample's own correlation makes chi²(s + 1) reject too "
    "seldom (1.8 % at a nominal 5 % for 360 samples) and chi²(s) about as often as it should (5.5 %): both are given. "
    "Its power is low: at 360 samples it finds (a, b) = (0.03, 0.95) in 40 % of windows, so not rejecting says little."
)


def volatility_part(array: ArrayPart) -> Markup:
    """What the ARCH effects are, ARCH-LM of all definitions, then one part that opens for each definition."""
    if not array.volatility:
        return paragraph("The recording is too short at rest for a rolling window: no volatility analysis.", "note")
    parts = [_definition_part(array, name, part) for name, part in array.volatility.items()]
    return join(heading("Volatility", 4), effects_table(array), _arch_lm(array), bekk_part(array), *parts)


def _arch_lm(array: ArrayPart) -> Markup:
    columns = [TableColumn("gyro", numeric=False), TableColumn("samples")]
    for series in SERIES:
        columns += [
            TableColumn("LM", hint="Engle's statistic, chi² with as many degrees of freedom as lags", group=series),
            TableColumn("p", group=series),
            TableColumn("kurtosis", group=series),
        ]
    rows: list[TableRow | list[Cell]] = []
    for definition, part in array.volatility.items():
        if part.arch_lm is not None:
            rows.append(TableRow(heading=MEANING.get(definition, definition)))
            rows += _arch_rows(part.arch_lm)
    caption = "ARCH-LM test (Engle 1982) of the longest gap-free stretch at rest; rejections at 5 % are bold"
    return join(render_table(columns, rows, caption, compact=True), paragraph(ARCH_WORDS, "note"))


def _arch_rows(table: Table) -> list[list[Cell]]:
    found = {(row["gyro"], row["series"]): row for row in rows_of(table)}
    rows = []
    for gyro in dict.fromkeys(table["gyro"].tolist()):
        samples = next(int(row["samples"]) for (name, _), row in found.items() if name == gyro)
        cells = [Cell(gyro), Cell(str(samples))]
        for series in SERIES:
            cells += _arch_cells(found.get((gyro, series)))
        rows.append(cells)
    return rows


def _arch_cells(row: dict[str, Any] | None) -> list[Cell]:
    if row is None or row["status"] != "ok":
        why = "not tested" if row is None else str(row["status"])
        return [Cell(MISSING, tone="muted", hint=why)] * 3
    rejects = row["p_value"] < LEVEL_OF_TEST
    return [
        Cell(significant(float(row["statistic"])), tone="bad" if rejects else ""),
        Cell(probability(float(row["p_value"])), tone="bad" if rejects else ""),
        Cell(significant(float(row["kurtosis"]))),
    ]


def _definition_part(array: ArrayPart, definition: str, part: VolatilityPart) -> Markup:
    anchor = f"{array.anchor}-{definition}"
    parts = [_garch(part.garch)] if part.garch else []
    if part.dcc is not None:
        parts.append(_dcc(anchor, part.dcc))
    if part.fits is not None:
        parts.append(fits_map(anchor, array.gyros, part.fits))
    if part.weights:
        parts.append(_weights(anchor, array, part.weights))
    return details(f"GARCH, DCC and weights, definition “{definition}”", join(*parts))


def _garch(summaries: Sequence[GarchSummary]) -> Markup:
    columns = [
        TableColumn("gyro", numeric=False),
        TableColumn("windows", group="rolling windows"),
        TableColumn("median α", group="rolling windows"),
        TableColumn("median β", group="rolling windows"),
        TableColumn("ω", "(deg/s)²", group="whole record"),
        TableColumn("α", group="whole record"),
        TableColumn("β", group="whole record"),
        TableColumn("status", numeric=False, group="whole record"),
    ]
    rows = [
        [
            Cell(one.gyro),
            Cell(count(one.windows)),
            Cell(significant(one.alpha)),
            Cell(significant(one.beta)),
            *_whole_garch(one.whole),
        ]
        for one in summaries
    ]
    caption = "GARCH(1,1), h_t = ω + α e²_(t−1) + β h_(t−1); below α and β, one robust standard error either way"
    return render_table(columns, rows, caption, compact=True)


def _whole_garch(row: Record | None) -> list[Cell]:
    if row is None:
        return [Cell(MISSING, tone="muted", hint="not fitted")] * 4
    cells = [Cell(significant(float(row["omega"])))]
    for name in ("alpha", "beta"):
        cells.append(_with_error(float(row[name]), float(row[f"se_{name}"])))
    return [*cells, Cell(str(row["status"]))]


def _with_error(value: float, error: float) -> Cell:
    return Cell(significant(value), f"± {significant(error, 2)}" if np.isfinite(error) else "")


def _dcc(anchor: str, summary: DccSummary) -> Markup:
    whole = summary.whole
    drawn = summary.curves["time"]
    if not len(drawn) and (whole is None or not np.isfinite(whole["a"])):
        return paragraph(f"No DCC model: {shares(summary.statuses)}.", "note")
    parts = [_dcc_table(summary)]
    if len(drawn) > 1:
        curves = [
            Curve(name, name, drawn, summary.curves[name], colour=i, points=True) for i, name in enumerate(("a", "b"))
        ]
        some = "" if len(drawn) == summary.windows else f"{count(len(drawn))} of {count(summary.windows)} windows"
        title = "DCC parameters, each window at its end"
        parts.append(
            curve_plot(PlotFrame(f"dcc-{anchor}", title, TIME, Axis("a, b"), summary=some, height=240), curves)
        )
    return join(*parts, paragraph(TEST_WORDS, "note"))


def _dcc_table(summary: DccSummary) -> Markup:
    columns = [
        TableColumn("fitted to", numeric=False),
        TableColumn("a"),
        TableColumn("b"),
        TableColumn("χ²", hint="statistic of the test of constant correlation", group="constant correlation"),
        TableColumn("p, χ²(s + 1)", group="constant correlation"),
        TableColumn("p, χ²(s)", group="constant correlation"),
        TableColumn("status", numeric=False),
    ]
    rows: list[list[Cell]] = []
    if summary.windows:
        cells = [
            Cell(f"{count(summary.windows)} windows, median"),
            *map(Cell, map(significant, (summary.a, summary.b))),
        ]
        rejects = [Cell(f"{percent(summary.rejects[name])} reject") for name in ("p_value", "p_value_s")]
        rows.append([*cells, Cell(""), *rejects, Cell(shares(summary.statuses))])
    if summary.whole is not None:
        row = summary.whole
        cells = [
            Cell("whole record"),
            *(_with_error(float(row[name]), float(row[f"se_{name}"])) for name in ("a", "b")),
        ]
        cells.append(Cell(significant(float(row["statistic"]))))
        cells += [Cell(probability(float(row[name]))) for name in ("p_value", "p_value_s")]
        rows.append([*cells, Cell(str(row["status"]))])
    caption = "DCC(1,1) and the test of constant correlation; ± one two-step robust standard error"
    return render_table(columns, rows, caption, compact=True)


def _weights(anchor: str, array: ArrayPart, parts: Sequence[WeightCurves]) -> Markup:
    plots = [_deviations(anchor, array, parts[0])]
    for part in parts:
        time = part.curves["time"]
        curves = [Curve(name, name, time, part.curves[f"w_{name}"], colour=i) for i, name in enumerate(array.gyros)]
        identifier = f"weights-{anchor}-{part.model}-{part.mode}"
        title, axis = f"Weights, {_words(part)}", Axis("weight")
        plots.append(curve_plot(PlotFrame(identifier, title, TIME, axis, summary=_fallbacks(part), height=260), curves))
    return join(*plots)


def _words(part: WeightCurves) -> str:
    return f"{part.model.upper()}, {part.mode.replace('_', '-')}"


def _deviations(anchor: str, array: ArrayPart, part: WeightCurves) -> Markup:
    time = part.curves["time"]
    curves = [Curve(name, name, time, part.curves[f"sd_{name}"], colour=i) for i, name in enumerate(array.gyros)]
    curves.append(Curve("fused", "fused", time, part.curves["sigma"], ink=True, width=2))
    if not any(np.isfinite(curve.y).any() for curve in curves):
        return Markup("")
    title = f"Conditional standard deviation of each gyro and of the fused rate ({_words(part)})"
    return curve_plot(PlotFrame(f"sd-{anchor}", title, TIME, Axis("√h, deg/s"), height=260), curves)


def _fallbacks(part: WeightCurves) -> str:
    other = {status: number for status, number in part.statuses.items() if status != "ok"}
    if not other:
        return ""
    share = sum(other.values()) / sum(part.statuses.values())
    return f"{percent(share)} of the samples: {max(other, key=other.__getitem__)}"
