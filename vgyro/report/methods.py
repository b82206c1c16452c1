"""Table of methods: what each gyro and each virtual gyro reaches, by how much it improves, and what the method is."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from markupsafe import Markup

from vgyro.report.html import join, paragraph
from vgyro.report.model import ArrayPart, DatasetPart, Figure, Value
from vgyro.report.numbers import MISSING, significant
from vgyro.report.tables import Cell, Column, Notes, Row, number_cell, render_table

REST = (
    ("if_sigma", "improvement factor"),
    ("if_arw_1s", "improvement factor"),
    ("if_bias_drift", "improvement factor"),
    ("sigma", "samples at rest"),
    ("noise_density", "white noise"),
    ("arw_1s", "white noise"),
    ("arw", "white noise"),
    ("bias_drift", "drift"),
    ("bias_drift_tau", "drift"),
    ("bias_instability", "drift"),
    ("rrw_read", "drift"),
    ("rrw", "drift"),
    ("mean", "samples at rest"),
    ("if_mean", "samples at rest"),
)
DYNAMIC = ("error_mean", "error_sigma", "error_sigma_aligned", "error_sigma_scaled", "amplitude", "delay")
HIGHER_IS_BETTER = ("if_sigma", "if_arw_1s", "if_bias_drift")
LOWER_IS_BETTER = ("sigma", "bias_drift", "error_sigma", "error_sigma_aligned", "error_sigma_scaled")
# Said of nearly every cell: a tooltip will do.
ROUTINE = (
    "bootstrap of blocks",
    "each pose's own mean",
    "two-sided,",
    "line through",
    "fitted from",
    "limits from the chi²",
    "one-sided ",
    "of the error",
)
NOT_SIGNIFICANT = "not significant"
NOT_SHOWN = "not shown to exist"
PROPERTIES = (
    ("dc_gain", Column("DC gain", "1", group="the method itself")),
    ("bandwidth_hz", Column("−3 dB bandwidth", "Hz", group="the method itself")),
    ("noise_bandwidth_hz", Column("noise bandwidth", "Hz", group="the method itself")),
    ("delay_s", Column("delay", "s", group="the method itself")),
)
LIMITS = "Below each figure: 95 % limits."
GENERAL = (
    "Improvement factor: mean of the figure over the single gyros / figure of the method (Liu et al. 2015, eq. 18). "
    "Grey: its 95 % interval holds 1, so no improvement is shown. Bold on green: the best of the methods. A filter "
    "that narrows the bandwidth lowers 1σ and the ARW read at 1 s by itself: compare methods of equal bandwidth. "
    f"{LIMITS}"
)


def rest_table(dataset: DatasetPart, array: ArrayPart) -> Markup:
    """Every figure of a recording at rest, gyros first, then methods; empty if only errors in motion are known."""
    groups = [(name, group) for name, group in REST if _has(array, name)] if _has(array, "sigma") else []
    order = list(dict.fromkeys(group for _, group in groups))
    groups.sort(key=lambda pair: order.index(pair[1]))
    if not groups and _has(array, "error_sigma"):
        return Markup("")
    if not groups:
        return paragraph("No figures at rest: the recording holds too little data at rest.", "note")
    caption = f"Gyros and methods at rest, axis {array.axis}, recording {array.recording}"
    return join(
        _table(dataset.figures, array, groups, caption), paragraph(GENERAL if array.methods() else LIMITS, "note")
    )


def dynamic_table(dataset: DatasetPart, array: ArrayPart) -> Markup:
    """Errors against the reference; empty where there is none."""
    present = [(name, "error against the reference") for name in DYNAMIC if _has(array, name)]
    if not present:
        return Markup("")
    if not _has(array, "sigma"):
        # Without rest these two are the factors of the errors.
        factors = [(name, "improvement factor of the error") for name in ("if_sigma", "if_mean") if _has(array, name)]
        present = [*factors, *present]
    caption = f"Errors against the reference rate, axis {array.axis}, recording {array.recording}"
    return join(
        _table(dataset.figures, array, present, caption), paragraph(GENERAL if array.methods() else LIMITS, "note")
    )


def _has(array: ArrayPart, metric: str) -> bool:
    return any(value.known for values in array.values().values() for name, value in values.items() if name == metric)


def _table(figures: Mapping[str, Figure], array: ArrayPart, groups: Sequence[tuple[str, str]], caption: str) -> Markup:
    values, notes = array.values(), Notes()
    metrics = [name for name, _ in groups]
    best = {name: _best(array, values, name) for name in metrics}
    methods = array.methods()
    columns = [Column("", numeric=False)]
    for name, group in groups:
        figure = figures.get(name) or Figure(name, _unit(values, name), "")
        columns.append(
            Column(figure.title, "" if figure.unit == "1" else figure.unit, hint=figure.meaning, group=group)
        )
    if methods:
        columns.append(Column("causal", numeric=False, group="the method itself"))
        columns += [column for _, column in PROPERTIES]
    rows: list[Row] = [Row(heading="Single gyros")]
    for gyro in array.gyros:
        known = values.get((gyro, ""), {})
        cells = [Cell(gyro), *(_cell(known.get(name), name, notes, gyro=True) for name in metrics)]
        rows.append(Row((*cells, *[Cell("")] * (len(columns) - len(cells)))))
    if methods:
        rows.append(Row(heading="Methods"))
    for method in methods:
        known = values.get((method["method"], method["definition"]), {})
        rows.append(_method_row(method, known, metrics, best, notes))
    return render_table(columns, rows, caption, notes.texts)


def _method_row(
    method: Mapping[str, Any],
    known: Mapping[str, Value],
    metrics: Sequence[str],
    best: Mapping[str, tuple[str, str] | None],
    notes: Notes,
) -> Row:
    name = (method["method"], method["definition"])
    first = Cell(method["title"], method["definition"], notes=notes.number(method["note"]), hint=method["source"])
    if not method["column"]:
        width = len(metrics) + 1 + len(PROPERTIES)
        return Row((first, *[Cell(MISSING, tone="muted", hint=f"not run: {method['note']}")] * width))
    cells = [first]
    for metric in metrics:
        cells.append(_cell(known.get(metric), metric, notes, best=best[metric] == name))
    cells.append(Cell("yes" if method["causal"] else "no, offline"))
    cells += [_property(float(method[name])) for name, _ in PROPERTIES]
    return Row(tuple(cells))


def _property(value: float) -> Cell:
    if math.isnan(value):
        return Cell("not limited", tone="muted", hint="the method itself does not limit it")
    return Cell(significant(value))


def _cell(value: Value | None, metric: str, notes: Notes, *, gyro: bool = False, best: bool = False) -> Cell:
    if value is None:
        hint = "compares a method with the single gyros" if gyro and metric.startswith("if_") else "not computed"
        return Cell("" if gyro and metric.startswith("if_") else MISSING, tone="muted", hint=hint)
    if not value.known:
        return Cell(MISSING, tone="muted", hint=value.note, notes=notes.number(value.note))
    if value.note.startswith(NOT_SHOWN):
        return Cell(f"< {significant(value.high, 2)}", tone="muted", hint=value.note)
    insignificant = value.note.startswith(NOT_SIGNIFICANT)
    routine = insignificant or all(clause.startswith(ROUTINE) for clause in value.note.split("; "))
    return number_cell(
        value.value,
        value.low,
        value.high,
        tone="muted" if insignificant else "best" if best else "",
        notes=() if routine else notes.number(value.note),
        hint=value.note,
    )


def _best(
    array: ArrayPart, values: Mapping[tuple[str, str], Mapping[str, Value]], metric: str
) -> tuple[str, str] | None:
    """Method with the best value of a figure that has a better side."""
    sign = 1 if metric in HIGHER_IS_BETTER else -1 if metric in LOWER_IS_BETTER else 0
    found = {
        name: sign * known[metric].value
        for name, known in values.items()
        if sign and name[0] not in array.gyros and metric in known and known[metric].known
    }
    return max(found, key=found.__getitem__) if found else None


def _unit(values: Mapping[tuple[str, str], Mapping[str, Value]], metric: str) -> str:
    return next(known[metric].unit for known in values.values() if metric in known)
