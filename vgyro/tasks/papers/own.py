"""The part of a paper's page that the paper does not have: methods of vgyro's own beside its best rows."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from markupsafe import Markup

from vgyro.papers.beside import ComparedMethod, Standing
from vgyro.papers.compare import OWN
from vgyro.papers.published import PublishedTable
from vgyro.report import html, numbers, tables
from vgyro.report.figure_cells import BAND_LIMITED, remarks

TONES: dict[Standing, tables.Tone] = {
    "better": "good", "met": "good", "undecided": "warn", "worse": "bad", "missed": "bad", "none": "",
}  # fmt: skip
COUNTED: dict[Standing, str] = {
    "better": "better", "undecided": "undecided (the interval holds 1)", "worse": "worse",
}  # fmt: skip
# What a low-pass does by itself is no merit of the method.
TOLD = ("forward and back", BAND_LIMITED)
TARGETS: dict[Standing, str] = {"met": "met", "undecided": "undecided", "missed": "missed"}
LEGEND = (
    "Simulated, on the same recordings as above. The ratio is to the method of the paper with the least of that figure "
    "on this board, which is marked. Green: the whole interval of the ratio is below 1; amber: it holds 1, so that "
    "nothing is shown; red: it is above 1. A figure with a target is green where its whole interval is near enough. "
    "This is one twin of one seed; what eight seeds say is in docs/fusion.md."
)


def own_counts(beside: Mapping[int | str, Sequence[ComparedMethod]]) -> list[tuple[str, str]]:
    """(method of ours, how often it is better, undecided, worse), over all tables."""
    every = [one for part in beside.values() for one in part if one.own]
    found = []
    for method in dict.fromkeys(one.method for one in every):
        mine = [one for one in every if one.method == method]
        ratios: list[Standing] = [one.standing for one in mine if one.ratio.known]
        targets: list[Standing] = [one.standing for one in mine if one.standing != "none" and not one.ratio.known]
        said = f"{len(ratios)} ratios to the paper's best: "
        said += ", ".join(f"{ratios.count(name)} {words}" for name, words in COUNTED.items())
        if targets:
            counts = (f"{targets.count(name)} {words}" for name, words in TARGETS.items())
            said += f"; {len(targets)} targets: {', '.join(counts)}"
        found.append((method, said))
    return found


def own_methods(table: PublishedTable, compared: Sequence[ComparedMethod]) -> Markup:
    """Table of ours and of the paper's methods, case by case; nothing where none is asked for."""
    if not compared or table.beside is None:
        return Markup()
    notes = tables.Notes()
    figures = list(dict.fromkeys((one.figure, one.unit) for one in compared))
    columns = [tables.TableColumn("", numeric=False), *(tables.TableColumn(name, unit) for name, unit in figures)]
    best = {(one.case, one.over, one.figure) for one in compared if one.over}
    rows: list[tables.TableRow] = []
    for case in dict.fromkeys(one.case for one in compared):
        for own, title in ((True, "vgyro's own"), (False, "methods of the paper, on the same board")):
            part = [one for one in compared if one.case == case and one.own == own]
            rows.append(tables.TableRow(heading=", ".join(filter(None, (title, case)))))
            for method in dict.fromkeys(one.method for one in part):
                rows += _lines([one for one in part if one.method == method], notes, best)
    return html.join(
        html.heading(OWN),
        tables.render_table(
            columns, rows, f"Methods of vgyro beside {table.where} of the paper, simulated", notes.texts, compact=True
        ),
        html.paragraph(table.beside.note, "note") if table.beside.note else "",
        html.paragraph(LEGEND, "note"),
    )


def _lines(
    of_method: Sequence[ComparedMethod], notes: tables.Notes, best: Collection[tuple[str, str, str]]
) -> list[tables.TableRow]:
    """The figures of one method and, of ours, the ratios below them.  best : case, method, figure"""
    marked = [(one, (one.case, one.method, one.figure) in best and not one.own) for one in of_method]
    first = tables.TableRow((tables.Cell(of_method[0].method), *(_figure(one, least, notes) for one, least in marked)))
    if not any(one.over for one in of_method):
        return [first]
    return [
        first,
        tables.TableRow((tables.Cell("ratio to the paper's best"), *(_ratio(one, notes) for one in of_method))),
    ]


def _figure(one: ComparedMethod, least: bool, notes: tables.Notes) -> tables.Cell:
    if not one.value.known:
        return tables.Cell(numbers.MISSING, tone="muted", notes=notes.number(one.value.reason), hint=one.value.source)
    tone: tables.Tone = TONES[one.standing] if one.own and not one.over else "best" if least else ""
    value, note = one.value, "; ".join(one.value.notes)
    told = "; ".join(part for part in note.split("; ") if remarks(part) or part.startswith(TOLD))
    said = notes.number(told) if one.own else ()
    hint = "; ".join(filter(None, (value.source, note)))
    return tables.number_cell(value.value, value.low, value.high, tone=tone, notes=said, hint=hint)


def _ratio(one: ComparedMethod, notes: tables.Notes) -> tables.Cell:
    if not one.over:
        return tables.Cell("")
    if not one.ratio.known:
        return tables.Cell(numbers.MISSING, tone="muted", notes=notes.number(one.ratio.reason))
    ratio = one.ratio
    return tables.number_cell(ratio.value, ratio.low, ratio.high, tone=TONES[one.standing], hint=f"over {one.over}")
