"""The figures at rest again with a constant rate added: weights that shrink toward zero look perfect at rest only."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from markupsafe import Markup

from vgyro.figure import Figure
from vgyro.report.figure_cells import figure_cell
from vgyro.report.html import join, paragraph
from vgyro.report.model import MOVED_KINDS, ArrayPart, DatasetPart, Value, Values
from vgyro.report.numbers import plain
from vgyro.report.tables import Cell, Notes, TableColumn, TableRow, render_table

MOVED_FIGURES = ("mean", "sigma", "arw", "bias_drift")
MOST_OF_RATE = 0.1
MOST_TIMES = 1.5
MOVED_RULE = (
    f"A method fails at the added rate where its mean moves by more than {MOST_OF_RATE:g} of that rate, or where its "
    f"1σ, N or bias drift is more than {MOST_TIMES:g} times that at rest and the limits of the two lie apart."
)


def moved_table(dataset: DatasetPart, array: ArrayPart) -> Markup:
    """Figures at rest and at the added rate side by side; methods for which nothing changes are named in one line.

    Nothing for a recording that is not at rest: no rate was added to it.
    """
    moved, still, rate = array.moved_values(), array.values(), array.added_rate
    if array.kind not in MOVED_KINDS:
        return Markup("")
    methods = [method for method in array.methods() if method["column"]]
    answering = [method for method in methods if _key(method) in moved]
    unchanged = _unchanged(method for method in methods if _key(method) not in moved)
    if not answering:
        return join(*unchanged)
    notes = Notes()
    names = [name for name in MOVED_FIGURES if any(name in known for known in moved.values())]
    columns = [TableColumn("", numeric=False)]
    for name in names:
        figure = dataset.figures.get(name) or Figure(name, "", "")
        group = f"{figure.title}, {figure.unit}"
        heads = ("at rest", f"at {plain(rate)} deg/s")
        columns += [TableColumn(head, hint=figure.meaning, group=group) for head in heads]
    rows = [
        TableRow((
            Cell(method["title"], method["definition"], hint=method["source"]),
            *(cell for name in names for cell in _pair(still, moved, _key(method), name, rate, notes)),
        ))
        for method in answering
    ]  # fmt: skip
    caption = (
        f"The same at {plain(rate)} deg/s: the rate is added to every gyro and taken off the result, axis "
        f"{array.axis}, recording {array.recording}"
    )
    return join(
        render_table(columns, rows, caption, notes.texts, compact=True),
        paragraph(f"Red: it fails. {MOVED_RULE}", "note"),
        *unchanged,
    )  # fmt: skip


def _key(method: Mapping[str, Any]) -> tuple[str, str]:
    return str(method["method"]), str(method["definition"])


def _unchanged(methods: Any) -> list[Markup]:
    """One line for each reason why a constant rate changes nothing."""
    reasons: dict[str, list[str]] = {}
    for method in methods:
        reason = str(method.get("moved") or "")
        if reason and reason != method["column"]:
            title = f"{method['title']} ({method['definition']})" if method["definition"] else method["title"]
            reasons.setdefault(reason, []).append(title)
    return [paragraph(f"{'; '.join(titles)}: {reason}.", "note") for reason, titles in reasons.items()]


def _pair(
    still: Values, moved: Values, key: tuple[str, str], name: str, rate: float, notes: Notes
) -> tuple[Cell, Cell]:
    before, after = still.get(key, {}).get(name), moved[key].get(name)
    first, second = figure_cell(before, name, notes), figure_cell(after, name, notes)
    if fails(before, after, name, rate):
        second = Cell(second.text, second.below, "bad", notes=second.notes, hint=second.hint, mark=second.mark)
    return first, second


def fails(before: Value | None, after: Value | None, name: str, rate: float) -> bool:
    """MOVED_RULE for one figure."""
    if before is None or after is None or not (before.known and after.known):
        return False
    if name == "mean":
        return abs(after.value - before.value) > MOST_OF_RATE * abs(rate)
    # A limit that is not known (NaN) keeps nothing apart.
    return after.value > MOST_TIMES * before.value and not after.low <= before.high


def failing(array: ArrayPart) -> dict[tuple[str, str], dict[str, tuple[Value, Value]]]:
    """Methods that fail at the added rate → the figures that fail → (at rest, at the rate)."""
    still, moved, rate = array.values(), array.moved_values(), array.added_rate
    found: dict[tuple[str, str], dict[str, tuple[Value, Value]]] = {}
    for key, known in moved.items():
        for name in MOVED_FIGURES:
            before = still.get(key, {}).get(name)
            if name in known and before is not None and fails(before, known[name], name, rate):
                found.setdefault(key, {})[name] = before, known[name]
    return found
