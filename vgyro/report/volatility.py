"""Conditional variance and correlation: ARCH-LM, GARCH, DCC, the test of constant correlation, weights over time."""

from __future__ import annotations

from collections import Counter

import numpy as np
from markupsafe import Markup

from vgyro.report.envelope import thin
from vgyro.report.html import details, heading, join, paragraph
from vgyro.report.model import ArrayPart, Table, chosen, rows_of
from vgyro.report.numbers import MISSING, percent, probability, significant
from vgyro.report.plots import Axis, Curve, curve_plot
from vgyro.report.tables import Cell, Column, Row, render_table

WHOLE = -1
LEVEL_OF_TEST = 0.05
WEIGHT_POINTS = 600
TIME = Axis("time, s")
SERIES = ("level", "detrended", "standardised")
MEANING = {
    "level": "level: r is the output itself, its second moment about zero",
    "demeaned": "demeaned: the mean of each window is removed",
    "difference": "difference: r_t = y_t − y_(t−1)",
    "residual": "residual: the array's own first-pass estimate of the rate is removed",
}
ARCH_WORDS = (
    "A slow drift of the level rejects this test by itself, without any change of variance: a rejection counts as ARCH "
    "only where the detrended series rejects too. Where the standardised residuals still reject, GARCH(1,1) has not "
    "explained it. Kurtosis is 3 for a Gaussian."
)
TEST_WORDS = (
    "Engle and Sheppard's test, with one lag. Whitening by the sample's own correlation makes chi²(s + 1) reject too "
    "seldom (1.8 % at a nominal 5 % for 360 samples) and chi²(s) about as often as it should (5.5 %): both are given. "
    "Its power is low: at 360 samples it finds (a, b) = (0.03, 0.95) in 40 % of windows, so not rejecting says little."
)


def volatility_part(array: ArrayPart) -> Markup:
    """ARCH-LM of all definitions, then one part that opens for each definition."""
    if not array.volatility:
        return paragraph("The recording is too short at rest for a rolling window: no volatility analysis.", "note")
    parts = [_definition_part(array, name, tables) for name, tables in array.volatility.items()]
    return join(heading("Volatility", 4), _arch_lm(array), *parts)


def _arch_lm(array: ArrayPart) -> Markup:
    columns = [Column("gyro", numeric=False), Column("samples")]
    for series in SERIES:
        columns += [
            Column("LM", hint="Engle's statistic, chi² with as many degrees of freedom as lags", group=series),
            Column("p", group=series),
            Column("kurtosis", group=series),
        ]
    rows: list[Row | list[Cell]] = []
    for definition, tables in array.volatility.items():
        if "arch_lm" in tables:
            rows.append(Row(heading=MEANING.get(definition, definition)))
            rows += _arch_rows(tables["arch_lm"])
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


def _arch_cells(row: dict | None) -> list[Cell]:
    if row is None or row["status"] != "ok":
        why = "not tested" if row is None else str(row["status"])
        return [Cell(MISSING, tone="muted", hint=why)] * 3
    rejects = row["p_value"] < LEVEL_OF_TEST
    return [
        Cell(significant(float(row["statistic"])), tone="bad" if rejects else ""),
        Cell(probability(float(row["p_value"])), tone="bad" if rejects else ""),
        Cell(significant(float(row["kurtosis"]))),
    ]


def _definition_part(array: ArrayPart, definition: str, tables: dict[str, Table] | object) -> Markup:
    assert isinstance(tables, dict)
    anchor = f"{array.anchor}-{definition}"
    parts = [_garch(tables["garch"]) if "garch" in tables else Markup("")]
    if "dcc" in tables:
        parts.append(_dcc(anchor, tables["dcc"]))
    if "weights" in tables:
        parts.append(_weights(anchor, array, tables["weights"]))
    return details(f"GARCH, DCC and weights, definition “{definition}”", join(*parts))


def _garch(table: Table) -> Markup:
    columns = [
        Column("gyro", numeric=False),
        Column("windows", group="rolling windows"),
        Column("median α", group="rolling windows"),
        Column("median β", group="rolling windows"),
        Column("status of the fits", numeric=False, group="rolling windows"),
        Column("ω", "(deg/s)²", group="whole record"),
        Column("α", group="whole record"),
        Column("β", group="whole record"),
        Column("status", numeric=False, group="whole record"),
    ]
    rows = []
    for gyro in dict.fromkeys(table["gyro"].tolist()):
        mine = chosen(table, table["gyro"] == gyro)
        windows, whole = chosen(mine, mine["window"] != WHOLE), chosen(mine, mine["window"] == WHOLE)
        fitted = np.isfinite(windows["alpha"])
        medians = [float(np.median(windows[name][fitted])) if fitted.any() else np.nan for name in ("alpha", "beta")]
        cells = [Cell(gyro), Cell(str(len(fitted))), *(Cell(significant(value)) for value in medians)]
        rows.append([*cells, Cell(_shares(windows["status"])), *_whole_garch(whole)])
    caption = "GARCH(1,1), h_t = ω + α e²_(t−1) + β h_(t−1); below α and β, one robust standard error either way"
    return render_table(columns, rows, caption, compact=True)


def _whole_garch(whole: Table) -> list[Cell]:
    if not len(whole["window"]):
        return [Cell(MISSING, tone="muted", hint="not fitted")] * 4
    row = next(rows_of(whole))
    cells = [Cell(significant(float(row["omega"])))]
    for name in ("alpha", "beta"):
        value, error = float(row[name]), float(row[f"se_{name}"])
        cells.append(Cell(significant(value), f"± {significant(error, 2)}" if np.isfinite(error) else ""))
    return [*cells, Cell(str(row["status"]))]


def _shares(statuses: np.ndarray) -> str:
    counts = Counter(statuses.tolist())
    total = sum(counts.values())
    return ", ".join(f"{name} {percent(number / total)}" for name, number in counts.most_common())


def _dcc(anchor: str, table: Table) -> Markup:
    windows, whole = chosen(table, table["window"] != WHOLE), chosen(table, table["window"] == WHOLE)
    fitted = np.isfinite(windows["a"])
    if not fitted.any() and not np.isfinite(whole["a"]).any():
        reasons = _shares(table["status"])
        return join(paragraph(f"No DCC model: {reasons}.", "note"))
    parts = [_dcc_table(windows, whole)]
    if fitted.sum() > 1:
        curves = [
            Curve(name, name, windows["time_stop"][fitted], windows[name][fitted], colour=i, points=True)
            for i, name in enumerate(("a", "b"))
        ]
        title = "DCC parameters, each window at its end"
        parts.append(curve_plot(f"dcc-{anchor}", title, curves, TIME, Axis("a, b"), height=240))
    return join(*parts, paragraph(TEST_WORDS, "note"))


def _dcc_table(windows: Table, whole: Table) -> Markup:
    columns = [
        Column("fitted to", numeric=False),
        Column("a"),
        Column("b"),
        Column("χ²", hint="statistic of the test of constant correlation", group="constant correlation"),
        Column("p, χ²(s + 1)", group="constant correlation"),
        Column("p, χ²(s)", group="constant correlation"),
        Column("status", numeric=False),
    ]
    rows: list[list[Cell]] = []
    tested = np.isfinite(windows["p_value"])
    if len(tested):
        shares = [
            percent(float(np.mean(windows[name][tested] < LEVEL_OF_TEST))) if tested.any() else MISSING
            for name in ("p_value", "p_value_s")
        ]
        medians = [float(np.nanmedian(windows[n])) if np.isfinite(windows[n]).any() else np.nan for n in ("a", "b")]
        cells = [Cell(f"{len(tested)} windows, median"), *(Cell(significant(value)) for value in medians), Cell("")]
        rows.append([*cells, *(Cell(f"{share} reject") for share in shares), Cell(_shares(windows["status"]))])
    for row in rows_of(whole):
        cells = [Cell("whole record")]
        for name in ("a", "b"):
            error = float(row[f"se_{name}"])
            cells.append(
                Cell(significant(float(row[name])), f"± {significant(error, 2)}" if np.isfinite(error) else "")
            )
        cells += [Cell(significant(float(row["statistic"])))]
        cells += [Cell(probability(float(row[name]))) for name in ("p_value", "p_value_s")]
        rows.append([*cells, Cell(str(row["status"]))])
    caption = "DCC(1,1) and the test of constant correlation; ± one two-step robust standard error"
    return render_table(columns, rows, caption, compact=True)


def _weights(anchor: str, array: ArrayPart, table: Table) -> Markup:
    parts = []
    pairs = dict.fromkeys(zip(table["model"].tolist(), table["mode"].tolist(), strict=True))
    for number, (model, mode) in enumerate(pairs):
        mine = chosen(table, (table["model"] == model) & (table["mode"] == mode))
        words = f"{model.upper()}, {mode.replace('_', '-')}"
        if number == 0:
            parts.append(_deviations(anchor, array, mine, words))
        time, values = thin(mine["time"], np.column_stack([mine[f"w_{name}"] for name in array.gyros]), WEIGHT_POINTS)
        curves = [Curve(name, name, time, values[:, i], colour=i) for i, name in enumerate(array.gyros)]
        summary = _fallbacks(mine)
        identifier = f"weights-{anchor}-{model}-{mode}"
        parts.append(
            curve_plot(identifier, f"Weights, {words}", curves, TIME, Axis("weight"), summary=summary, height=260)
        )
    return join(*parts)


def _deviations(anchor: str, array: ArrayPart, table: Table, words: str) -> Markup:
    names = [f"sd_{name}" for name in array.gyros]
    time, values = thin(table["time"], np.column_stack([table[name] for name in [*names, "sigma"]]), WEIGHT_POINTS)
    curves = [Curve(name, name, time, values[:, i], colour=i) for i, name in enumerate(array.gyros)]
    curves.append(Curve("fused", "fused", time, values[:, -1], ink=True, width=2))
    if not np.isfinite(values).any():
        return Markup("")
    title = f"Conditional standard deviation of each gyro and of the fused rate ({words})"
    return curve_plot(f"sd-{anchor}", title, curves, TIME, Axis("√h, deg/s"), height=260)


def _fallbacks(table: Table) -> str:
    other = [status for status in table["status"].tolist() if status != "ok"]
    if not other:
        return ""
    return f"{percent(len(other) / len(table['status']))} of the samples: {Counter(other).most_common(1)[0][0]}"
