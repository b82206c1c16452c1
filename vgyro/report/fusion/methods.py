"""Tables of methods: what each gyro and each virtual gyro reaches, by how much it improves, and what the method is."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any

from markupsafe import Markup

from vgyro.figure import Figure
from vgyro.report.figure_cells import BAND_LIMITED, figure_cell, figure_column, says_limited
from vgyro.report.html import join, paragraph
from vgyro.report.model import ArrayPart, DatasetPart, Record, Value, Values
from vgyro.report.numbers import MISSING, count, significant
from vgyro.report.tables import Cell, Notes, TableColumn, TableRow, render_table

FAIR, RAW = "fair: free of the bandwidth", "raw, as the papers"
SAMPLES, READ, WHITE, SLOW, ANGLE = (
    "samples",
    "read off the Allan curve, as the papers",
    "white noise",
    "slow noise",
    "angle",
)
IMPROVEMENT = (
    ("if_sigma_equal", FAIR),
    ("if_arw", FAIR),
    ("if_bias_drift", FAIR),
    ("if_sigma", RAW),
    ("if_arw_1s", RAW),
    ("if_mean", RAW),
)
ACCURACY = (
    ("sigma_equal", SAMPLES),
    ("sigma", SAMPLES),
    ("mean", SAMPLES),
    ("arw_1s", READ),
    ("bias_drift", READ),
    ("bias_drift_tau", READ),
    ("rrw_read", READ),
)
COEFFICIENTS = (
    ("noise_density", WHITE),
    ("arw", WHITE),
    ("density_ratio", WHITE),
    ("quantisation", WHITE),
    ("bias_instability", SLOW),
    ("rrw", SLOW),
    ("rate_ramp", SLOW),
    ("angle_drift_60s", ANGLE),
    ("angle_bound_60s", ANGLE),
)
# What any low-pass lowers by itself; of a reading at 1 s the note says whether it does.
RAW_FIGURES = ("sigma", "if_sigma")
COUNTS = ("missing", "outliers", "clipped")
DYNAMIC = (
    "error_mean",
    "error_sigma",
    "error_sigma_aligned",
    "error_sigma_scaled",
    "nees",
    "amplitude",
    "phase",
    "delay",
    "angle_drift_60s",
    "angle_bound_60s",
)
HIGHER_IS_BETTER = ("if_sigma_equal", "if_sigma", "if_arw", "if_arw_1s", "if_bias_drift")
LOWER_IS_BETTER = (
    "sigma_equal",
    "sigma",
    "arw",
    "bias_drift",
    "error_sigma",
    "error_sigma_aligned",
    "error_sigma_scaled",
    "angle_drift_60s",
)
NEEDS = {"arw": "ARW", "rrw": "RRW", "correlation": "ρ", "scales": "C(τ)", "weights": "H_t"}
NEEDS_HINT = (
    "what it takes beside the rates; ρ: correlation of the noise; C(τ): Allan covariances at rest; H_t: weights of the "
    "volatility analysis"
)
METHOD, RESPONSE = "the method", "response of the method"
PROPERTIES = (
    TableColumn(
        "runs", numeric=False, hint="causal: sample t uses nothing later than t; offline: it does", group=METHOD
    ),
    TableColumn("needs", numeric=False, hint=NEEDS_HINT, group=METHOD),
    TableColumn("cost", "op/sample", hint="operations a sample, all passes, counted from the equations", group=METHOD),
    TableColumn("delay", "s", hint="at low frequency", group=RESPONSE),
    TableColumn("DC gain", "1", hint="gain for a constant rate", group=RESPONSE),
    TableColumn("−3 dB bandwidth", "Hz", group=RESPONSE),
    TableColumn("noise bandwidth", "Hz", hint="noise-equivalent, one-sided", group=RESPONSE),
    TableColumn("known", numeric=False, hint="how the four are known", group=RESPONSE),
)
# The recommended rows first: of some forty they are the ones to look for.
FAMILIES = {
    "ours": "Methods of vgyro",
    "baseline": "Baselines",
    "paper": "Methods of the papers",
    "other": "Methods of other packages",
}
FIRST = {"recommended": 0, "recommended_unsmoothed": 1}
MOST_WIDE = 7
LIMITS = "Below each figure: its limits."
FACTOR_WORDS = (
    "Improvement factor: mean of the figure over the single gyros / figure of the method (Liu et al. 2015, eq. 18). "
    "Grey: its interval holds 1, so no improvement is shown. Bold on green: the best of the methods. A filter that "
    "narrows the bandwidth lowers 1σ and the ARW read at 1 s by itself; the fair factors compare 1σ with every series "
    f"low-passed to one bandwidth, the fitted N, and the floor of the Allan curve. {LIMITS}"
)
BAND_WORDS = (
    f"Marked “{BAND_LIMITED}”: the method's low-pass changes this reading by itself, it is no measure of its noise and "
    "never the best. N is fitted with the filter's shape and may be compared."
)
NEES_WORDS = (
    "NEES: mean of (error / posterior standard deviation)², 1 where the method knows its own error; the tooltip tells "
    "the share of the samples within ±2 standard deviations. The delay of the gyros themselves, and a bias or a scale "
    "error that all of them share, are errors, too, and cannot be seen in the array."
)
RESPONSE_WORDS = (
    "Cost: additions, multiplications, divisions and roots of one sample of the recording, all passes together; what "
    "is done once a recording is left out. Bandwidth and delay are the method's own, without the gyro's; “not limited” "
    "passes what the gyro passes."
)

FAILED = "failed"
"""State of a method that ended with an error; its note says so."""

MakeCells = Callable[[Mapping[str, Any]], list[Cell]]


def rest_tables(dataset: DatasetPart, array: ArrayPart) -> Markup:
    """Figures of a recording at rest, gyros first, then methods; empty if only errors in motion are known."""
    values = array.values()
    if not _known(values, "sigma"):
        if _known(values, "error_sigma"):
            return Markup("")
        return paragraph("No figures at rest: the recording holds too little data at rest.", "note")
    where = f"at rest, axis {array.axis}, recording {array.recording}"
    parts: list[Markup] = []
    if array.methods() and any(_known(values, name) for name, _ in IMPROVEMENT):
        factors = _figures(dataset, array, values, IMPROVEMENT, f"Improvement {where}", gyros=False)
        parts = [factors, paragraph(FACTOR_WORDS, "note")]
    marked = any(map(_narrow, array.methods()))
    return join(
        *parts,
        _figures(dataset, array, values, ACCURACY, f"Accuracy {where}"),
        paragraph(BAND_WORDS if marked else LIMITS, "note"),
        _figures(dataset, array, values, COEFFICIENTS, f"Noise coefficients {where}"),
    )


def dynamic_table(dataset: DatasetPart, array: ArrayPart) -> Markup:
    """Errors against the reference; empty where there is none."""
    values = array.values()
    present = [(name, "error against the reference") for name in DYNAMIC if _known(values, name)]
    if not _known(values, "error_sigma"):
        return Markup("")
    if not _known(values, "sigma"):
        # Without rest these two are the factors of the errors.
        present = [*((name, "improvement factor of the error") for name in ("if_sigma", "if_mean")), *present]
    else:
        present = [(name, group) for name, group in present if not name.startswith("angle_")]
    caption = f"Errors against the reference rate, axis {array.axis}, recording {array.recording}"
    table = _figures(dataset, array, values, present, caption)
    words = [] if _known(values, "sigma") else [FACTOR_WORDS if array.methods() else LIMITS]
    words += [NEES_WORDS] if _known(values, "nees") else []
    return join(table, *(paragraph(text, "note") for text in words))


def _known(values: Values, metric: str) -> bool:
    return any(known[metric].known for known in values.values() if metric in known)


def _figures(
    dataset: DatasetPart,
    array: ArrayPart,
    values: Values,
    groups: Sequence[tuple[str, str]],
    caption: str,
    gyros: bool = True,
) -> Markup:
    """One table: gyros, unless they are left out, then methods; columns the figures of `groups` that are known."""
    notes = Notes()
    metrics = [(name, group) for name, group in groups if _known(values, name)]
    best = {name: _best(array, values, name) for name, _ in metrics}
    columns = [TableColumn("", numeric=False)]
    columns += [figure_column(dataset.figures.get(name) or _unnamed(values, name), group) for name, group in metrics]

    def of_gyro(gyro: str) -> list[Cell]:
        known = values.get((gyro, ""), {})
        return [figure_cell(known.get(name), name, notes, gyro=True) for name, _ in metrics]

    def of_method(method: Mapping[str, Any]) -> list[Cell]:
        name = (method["method"], method["definition"])
        known, narrow = values.get(name, {}), _narrow(method)
        return [
            figure_cell(
                known.get(metric), metric, notes, best=best[metric] == name, limited=narrow and metric in RAW_FIGURES
            )
            for metric, _ in metrics
        ]

    rows = _rows(array, of_gyro if gyros else None, of_method, len(metrics))
    return render_table(columns, rows, caption, notes.texts, compact=len(metrics) > MOST_WIDE)


def _rows(
    array: ArrayPart,
    of_gyro: Callable[[str], list[Cell]] | None,
    of_method: MakeCells,
    width: int,
    notes: Notes | None = None,
) -> list[TableRow]:
    """Gyros and methods under their headings, by family; a method that did not run has one cell that says why.

    notes : takes the remarks on the methods, which one table of a recording gives
    """
    methods = array.methods()
    rows: list[TableRow] = []
    if of_gyro is not None:
        rows += [TableRow(heading="Single gyros"), *(TableRow((Cell(gyro), *of_gyro(gyro))) for gyro in array.gyros)]
    for family, heading in FAMILIES.items():
        mine = [method for method in methods if method["family"] == family]
        mine.sort(key=lambda method: FIRST.get(str(method["method"]), len(FIRST)))
        rows += [TableRow(heading=heading)] if mine else []
        rows += [_method_row(method, of_method, width, notes) for method in _together(mine)]
    return rows


def _together(methods: Sequence[Record]) -> Iterator[Record]:
    """The methods; the forms of one method that did not run, all for one reason, as one."""
    for _, group in groupby(methods, key=lambda method: (method["column"], method["title"], method["note"])):
        forms = list(group)
        yield {**forms[0], "definition": ", ".join(form["definition"] for form in forms if form["definition"])}


def _method_row(method: Mapping[str, Any], of_method: MakeCells, width: int, notes: Notes | None) -> TableRow:
    remarks: tuple[int, ...] = ()
    if notes is not None and method["inferred"]:
        remarks += notes.number(f"inferred: {method['inferred']}")
    if notes is not None and method["column"]:
        remarks += notes.number(method["note"])
    first = Cell(method["title"], method["definition"], notes=remarks, hint=method["source"])
    if method["column"]:
        return TableRow((first, *of_method(method)))
    if method.get("state") == FAILED:
        return TableRow((first, Cell(str(method["note"]), tone="bad", span=width)))
    return TableRow((first, Cell(f"not run: {method['note']}", tone="muted", span=width)))


def response_table(dataset: DatasetPart, array: ArrayPart) -> Markup:
    """What was left out of each series, and how each method answers to a motion."""
    notes, values, methods = Notes(), array.values(), array.methods()
    counted = [name for name in COUNTS if _known(values, name)]
    if not counted and not methods:
        return Markup("")
    properties = PROPERTIES if methods else ()
    columns = [TableColumn("", numeric=False)]
    for name in counted:
        figure = dataset.figures.get(name) or _unnamed(values, name)
        columns.append(TableColumn(figure.title, "samples", hint=figure.meaning, group="data of the series"))
    columns += properties

    def counts(series: tuple[str, str]) -> list[Cell]:
        known = values.get(series, {})
        return [_count(known.get(name)) for name in counted]

    def of_method(method: Mapping[str, Any]) -> list[Cell]:
        return [*counts((method["method"], method["definition"])), *_answers(method)]

    def of_gyro(gyro: str) -> list[Cell]:
        return [*counts((gyro, "")), *([Cell("", span=len(properties))] if properties else [])]

    caption = f"Data and response, axis {array.axis}, recording {array.recording}"
    rows = _rows(array, of_gyro, of_method, len(columns) - 1, notes)
    return join(render_table(columns, rows, caption, notes.texts), paragraph(RESPONSE_WORDS, "note") if methods else "")


def _count(value: Value | None) -> Cell:
    if value is None or not value.known:
        return Cell(MISSING, tone="muted", hint=value.note if value else "not counted")
    return Cell(count(value.value), tone="warn" if value.value else "", hint=value.note)


def _answers(method: Mapping[str, Any]) -> list[Cell]:
    limited = [_property(float(method[name])) for name in ("bandwidth_hz", "noise_bandwidth_hz")]
    return [
        Cell("causal" if method["causal"] else "offline"),
        Cell(", ".join(NEEDS.get(word, word) for word in str(method["needs"]).split(", ")) or MISSING),
        _cost(float(method["operations"])),
        Cell(significant(float(method["delay_s"]))),
        Cell(significant(float(method["dc_gain"]))),
        *limited,
        Cell(str(method.get("response") or MISSING)),
    ]


def _cost(operations: float) -> Cell:
    if math.isnan(operations):
        return Cell(MISSING, tone="muted", hint="not counted")
    return Cell(significant(float(f"{operations:.1e}"), 2), hint=f"counted from the equations: {operations:.0f}")


def _property(value: float) -> Cell:
    if math.isnan(value):
        return Cell("not limited", tone="muted", hint="the method itself does not limit it")
    return Cell(significant(value))


def _narrow(method: Mapping[str, Any]) -> bool:
    """True if the method itself limits the bandwidth."""
    return math.isfinite(float(method["bandwidth_hz"]))


def _best(array: ArrayPart, values: Values, metric: str) -> tuple[str, str] | None:
    """Method with the best value of a figure that has a better side; a value that a low-pass lowers does not count."""
    sign = 1 if metric in HIGHER_IS_BETTER else -1 if metric in LOWER_IS_BETTER else 0
    narrow = {(method["method"], method["definition"]) for method in array.methods() if _narrow(method)}
    found = {
        name: sign * known[metric].value
        for name, known in values.items()
        if sign and name[0] not in array.gyros and metric in known and known[metric].known
        if not says_limited(known[metric]) and not (name in narrow and metric in RAW_FIGURES)
    }
    return max(found, key=found.__getitem__) if found else None


def _unnamed(values: Values, metric: str) -> Figure:
    return Figure(metric, next(known[metric].unit for known in values.values() if metric in known), "")
