"""The calibration certificate of an axis: what was calibrated and how, every figure with its interval.

One line a figure, one column a gyro; what was not measured says why.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from markupsafe import Markup

from vgyro.figure import Figure
from vgyro.report.calibration.certificate_plots import certificate_plots
from vgyro.report.html import definitions, heading, join, macro, paragraph, print_button
from vgyro.report.model import DatasetPart, Record
from vgyro.report.numbers import count, duration, percent, plain, significant
from vgyro.report.tables import Cell, Notes, TableColumn, TableRow, number_cell, render_table

NAN = float("nan")
GYROS_A_TABLE = 6  # as many as a sheet of paper holds side by side
METHOD = "constant rates of a rate table; least-squares straight line through the mean outputs, residuals about it"
FLOOR_WORDS = (
    "Floor: what a gyro without the effect shows in half of such tests, by its noise alone. “Below the floor”: the "
    "test does not show that the effect exists; given is its upper limit, or for a figure with a sign both limits."
)
NOT_GIVEN = "not given"
SAID_ELSEWHERE = ("full scale", "the nonlinearity is")
MAIN = (
    ("scale", Figure("Scale factor", "deg/s a count", "slope of the table's rate over the output")),
    (
        "bias",
        Figure("Bias", "counts", "the straight line at zero rate; Earth rate removed if stated"),
    ),
)


def certificate(dataset: DatasetPart, axis: str, gyros: Mapping[str, Record]) -> Markup:
    """The certificate of one axis. gyros : records of the gyros that were measured, by name"""
    test: Record = (dataset.calibration.get("test") or {}).get(axis) or {}
    identifier = f"certificate-{axis}"
    blocks = [_table(dataset, dict(block), number) for number, block in enumerate(_blocks(list(gyros.items())))]
    html = join(
        join(heading(f"Calibration certificate, axis {axis}", 3), print_button("print", identifier)),
        definitions(_head(dataset, axis, gyros, test)),
        *blocks,
        paragraph(FLOOR_WORDS, "note"),
        heading("Applied in conversion", 4),
        *(paragraph(text) for text in applied(gyros)),
        certificate_plots(axis, gyros),
    )
    return macro("article", identifier=identifier, html=html)


def _blocks(items: list[tuple[str, Record]]) -> list[list[tuple[str, Record]]]:
    return [items[first : first + GYROS_A_TABLE] for first in range(0, len(items), GYROS_A_TABLE)]


def _head(dataset: DatasetPart, axis: str, gyros: Mapping[str, Record], test: Record) -> list[tuple[str, str]]:
    """What a certificate says before its figures."""
    board = dataset.board
    names = board.title if board.title else board.name
    whose = f"{len(gyros)} of {len(board.array(axis))} gyros" if len(gyros) > GYROS_A_TABLE else ", ".join(gyros)
    manifest = dataset.manifest
    twin = f" (twin {manifest.twin})" if manifest.twin else ""
    confidence = (dataset.options.get("calibration") or {}).get("confidence")
    pairs = [
        ("object", f"{names}, axis {axis}: {whose}"),
        ("data", f"SIMULATED{twin}: a model was calibrated, not a device" if manifest.simulated else "measured"),
        ("standard", str(test.get("standard") or NOT_GIVEN)),
        ("method", METHOD),
        ("recordings", _recordings(gyros, test)),
        ("rates", _rates(test)),
        ("temperature", _range(test["temperature_c"], "°C") if test.get("temperature_c") else "not logged"),
        ("Earth rate", _earth(test)),
        ("intervals", NOT_GIVEN if confidence is None else f"{percent(float(confidence))}, below each figure"),
    ]
    return [(name, text) for name, text in pairs if text]


def _recordings(gyros: Mapping[str, Record], test: Record) -> str:
    main = list(dict.fromkeys(str(record.get("recording") or NOT_GIVEN) for record in gyros.values()))
    others = [str(name) for name in test.get("recordings") or [] if name not in main]
    more = f"; for repeatability and temperature also {', '.join(others)}" if others else ""
    return ", ".join(main) + more


def _rates(test: Record) -> str:
    if not test:
        return NOT_GIVEN
    words = [f"{count(test['rates'])} rates"]
    if test.get("full_scale") is not None:
        words.append(f"full scale ±{plain(float(test['full_scale']))} deg/s")
    if test.get("seconds_a_point") is not None:
        words.append(f"{duration(float(test['seconds_a_point']))} a point")
    words.append("whole turns of the table" if test.get("whole_turns") else "not whole turns of the table")
    return ", ".join(words)


def _range(limits: Sequence[float], unit: str = "") -> str:
    low, high = (significant(float(limit)) for limit in limits)
    return f"{low} {unit}".strip() if low == high else f"{low} … {high} {unit}".strip()


def _earth(test: Record) -> str:
    rate = test.get("earth_rate_deg_s")
    if rate is None:
        return "not removed: no latitude is given"
    return f"{significant(float(rate), 4)} deg/s about the axis, removed"


def _table(dataset: DatasetPart, gyros: Mapping[str, Record], number: int) -> Markup:
    """Figures as rows, gyros as columns."""
    notes = Notes()
    columns = [
        TableColumn("figure", numeric=False),
        *(TableColumn(name) for name in gyros),
        TableColumn("floor", hint=FLOOR_WORDS),
    ]
    rows = []
    for key, figure in MAIN:
        cells = [_main_cell(record, key, notes) for record in gyros.values()]
        rows.append(TableRow((Cell(figure.title, figure.unit, hint=figure.meaning), *cells, Cell(""))))
    for name in dict.fromkeys(name for record in gyros.values() for name in record.get("figures") or {}):
        found = [(record.get("figures") or {}).get(name) for record in gyros.values()]
        rows.append(_figure_row(name, found, dataset.calibration_figures.get(name), notes))
    caption = "" if number else "Figures with their limits"
    return render_table(columns, rows, caption, notes.texts)


def _main_cell(record: Record, key: str, notes: Notes) -> Cell:
    value, low, high = (_number(record.get(name)) for name in (key, f"{key}_low", f"{key}_high"))
    clauses = str(record.get("note") or "").split("; ") if key == MAIN[0][0] else []
    note = "; ".join(clause for clause in clauses if not clause.startswith(SAID_ELSEWHERE))
    return number_cell(value, low, high, notes=notes.number(note))


def _figure_row(name: str, found: Sequence[Record | None], figure: Figure | None, notes: Notes) -> TableRow:
    unit = next((str(one["unit"]) for one in found if one), "")
    title, meaning = (figure.title, figure.meaning) if figure else (name.replace("_", " "), "")
    head = Cell(title, unit, hint=meaning)
    reasons = {str(one["note"]) for one in found if one and one["state"] == "not measured"}
    if len(reasons) == 1 and all(one is None or one["state"] == "not measured" for one in found):
        return TableRow((head, Cell(f"not measured: {reasons.pop()}", tone="muted", span=len(found) + 1)))
    floors = [float(one["floor"]) for one in found if one and one["floor"] is not None]
    floor = _range((min(floors), max(floors))) if floors else ""
    return TableRow((head, *(figure_cell(one, notes) for one in found), Cell(floor)))


def figure_cell(figure: Record | None, notes: Notes) -> Cell:
    """A figure of calibration.json: its value, an upper limit where the test's floor hides it, or why there is none."""
    if figure is None:
        return Cell("not measured", tone="muted")
    note = str(figure.get("note") or "")
    if figure["state"] == "not measured":
        return Cell("not measured", tone="muted", notes=notes.number(note), hint=note)
    value, low, high, floor = (_number(figure.get(name)) for name in ("value", "low", "high", "floor"))
    if figure["state"] == "below the floor":
        signed = low < 0
        text = f"{significant(low)} … {significant(high)}" if signed else f"< {significant(high)}"
        return Cell(text, f"below the floor of {significant(floor)}", "muted", notes=notes.number(note), hint=note)
    return number_cell(value, low, high, notes=notes.number(note), hint=note)


def _number(value: float | None) -> float:
    return NAN if value is None else float(value)


def applied(gyros: Mapping[str, Record]) -> list[str]:
    """What the conversion of the recordings does with this calibration, in sentences."""
    found = ["rate = sign · (count − bias) · scale factor, both as above."]
    compensated: dict[str, dict[str, list[str]]] = {}
    plain_ones: dict[str, list[str]] = {}
    for name, record in gyros.items():
        temperature = record.get("temperature")
        if not temperature:
            plain_ones.setdefault("no temperature test", []).append(name)
        elif temperature["applied"]:
            reference = significant(float(temperature["reference_c"]))
            limits = _range((temperature["low_c"], temperature["high_c"]), "°C")
            note = f"; {temperature['note']}" if temperature.get("note") else ""
            compensated.setdefault(
                f"reference {reference} °C, valid {limits}, outside held at the nearer end{note}", {}
            ).setdefault(str(temperature["sensor"]), []).append(name)
        else:
            plain_ones.setdefault(str(temperature.get("note") or "switched off"), []).append(name)
    for words, sensors in compensated.items():
        names = [name for members in sensors.values() for name in members]
        by = ", ".join(sensors)
        found.append(
            f"Compensated for temperature by {by}: bias by its polynomial, scale factor by its slope, for "
            f"{_names(names, gyros)} ({words})."
        )
    found += [
        f"Not compensated for temperature: {_names(names, gyros)} ({reason})." for reason, names in plain_ones.items()
    ]
    return found


def _names(names: Sequence[str], gyros: Mapping[str, Record]) -> str:
    return "all gyros" if len(names) == len(gyros) and len(names) > 1 else ", ".join(names)
