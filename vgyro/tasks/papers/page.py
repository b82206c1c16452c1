"""The page of one paper: published, ours and implied side by side, the claims, the twin, what could not be had."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from markupsafe import Markup

from vgyro.dataset import Manifest
from vgyro.papers import Claim, Comparison, Paper, Verdict
from vgyro.papers.beside import ComparedMethod
from vgyro.papers.compare import Agreement, ComparedCell
from vgyro.papers.published import Heading
from vgyro.report import html, numbers, tables
from vgyro.report.page import Section, render_page
from vgyro.tasks.papers.own import own_counts, own_methods

TONES: dict[Agreement, tables.Tone] = {"within interval": "good", "within 10 %": "warn", "differs": "bad", "none": ""}
VERDICT_TONES = {"holds": "good", "does not hold": "bad", "cannot be decided": "warn"}
COUNTED: dict[Agreement, str] = {
    "within interval": "within our interval",
    "within 10 %": "within 10\N{NO-BREAK SPACE}%",
    "differs": "differ",
    "none": "without a figure of ours",
}
OUTCOMES = {"holds": "hold", "does not hold": "do not hold", "cannot be decided": "cannot be decided"}
LEGEND = (
    "Simulated: the same method on the twin; the limits are 95 %, where a method gives them. The colour compares it "
    "with the published figure: green, that lies within our limits (or rounding); amber, within 10 %; red, it differs. "
    "A difference is a finding. Implied: what the equations give from the paper's own numbers, without any simulation."
)
EXTRA = "not in the paper"


def paper_page(
    paper: Paper,
    manifest: Manifest,
    comparisons: Sequence[Comparison],
    verdicts: Sequence[tuple[Claim, Verdict]],
    plots: Markup,
    beside: Mapping[int | str, Sequence[ComparedMethod]],
) -> str:
    """A whole page as text; the same inputs give the same bytes.

    plots : vgyro.tasks.papers.plots.figures;  beside : number of a table → methods of ours beside the paper's
    """
    sections = [
        Section("what", "What this is", _what(paper, comparisons, verdicts, beside)),
        *(
            Section(f"table-{part.table.number}", _title(part), html.join(_table(part), _beside(part, beside)))
            for part in comparisons
        ),
        Section("claims", "Claims", _claims(verdicts)),
        *([Section("figures", "Figures", plots)] if plots else []),
        Section("twin", "How the twin was built", _twin(paper, manifest)),
        Section("limits", "What could not be reproduced, and why", _limits(paper, comparisons)),
    ]
    maker = f"twin {manifest.twin}" if manifest.twin else True
    return render_page(
        paper.title, sections, simulated=maker, subtitle=paper.citation, home="../index.html", contents=True
    )


def _title(comparison: Comparison) -> str:
    table = comparison.table
    return table.title if table.number == "text" else f"Table {table.number}: {table.title}"


def _beside(part: Comparison, beside: Mapping[int | str, Sequence[ComparedMethod]]) -> Markup:
    return own_methods(part.table, beside.get(part.table.number, ()))


def _what(
    paper: Paper,
    comparisons: Sequence[Comparison],
    verdicts: Sequence[tuple[Claim, Verdict]],
    beside: Mapping[int | str, Sequence[ComparedMethod]],
) -> Markup:
    firsts = [
        readings[0]
        for part in comparisons
        for row in part.table.rows
        for column in part.table.columns
        if (readings := part.at(row.name, column.name))
    ]
    counted = [(word, sum(cell.agreement == name for cell in firsts)) for name, word in COUNTED.items()]
    outcomes = [(word, sum(verdict.outcome == name for _, verdict in verdicts)) for name, word in OUTCOMES.items()]
    return html.join(
        html.paragraph(
            "The published tables again: a simulated board, built from the figures that the paper gives, was recorded "
            "down to the bytes of its serial dump and went through the whole pipeline with the paper's settings."
        ),
        html.definitions((
            (f"{len(firsts)} published numbers", ", ".join(f"{count} {name}" for name, count in counted)),
            (f"{len(verdicts)} claims", ", ".join(f"{count} {name}" for name, count in outcomes)),
            *own_counts(beside),
        )),
        html.paragraph(LEGEND, "note"),
        tables.render_table(
            [tables.TableColumn(title, numeric=False) for title in ("setting", "printed", "twin")],
            [[entry.name, entry.printed, entry.twin] for entry in paper.settings],
            "Settings",
        ),
    )  # fmt: skip


def _table(comparison: Comparison) -> Markup:
    """One block of lines a printed row: published, ours in each reading, implied."""
    table, notes = comparison.table, tables.Notes()
    columns = (*table.columns, *table.extra_columns)
    rows: list[tables.TableRow] = []
    for row in (*table.rows, *table.extra_rows):
        rows.append(
            tables.TableRow(heading=f"{row.name}{_unit(row.unit)}{f' ({EXTRA})' if row in table.extra_rows else ''}")
        )
        rows += _lines(comparison, row, columns, notes)
    heads = (
        tables.TableColumn("", numeric=False),
        *(
            tables.TableColumn(column.name, _unit(column.unit or table.unit).removeprefix(", "))
            for column in table.columns
        ),
        *(tables.TableColumn(column.name, EXTRA) for column in table.extra_columns),
    )
    parts = [tables.render_table(heads, rows, f"{table.where} of the paper", notes.texts, compact=True)]
    return html.join(*parts, html.paragraph(table.note, "note") if table.note else "")


def _lines(
    comparison: Comparison, row: Heading, columns: Sequence[Heading], notes: tables.Notes
) -> list[tables.TableRow]:
    readings = [comparison.at(row.name, column.name) for column in columns]
    lines = []
    if any(cells and cells[0].published is not None for cells in readings):
        printed = [tables.Cell(cells[0].published or "") if cells else tables.Cell("") for cells in readings]
        lines.append(tables.TableRow((tables.Cell("published"), *printed)))
    for variant in dict.fromkeys(cell.variant for cells in readings for cell in cells):
        ours = [_ours(cells, variant, notes) for cells in readings]
        lines.append(tables.TableRow((tables.Cell("simulated", variant), *ours)))
    if any(cells and cells[0].implied and cells[0].implied.value is not None for cells in readings):
        lines.append(tables.TableRow((tables.Cell("implied"), *(_implied(cells, notes) for cells in readings))))
    return lines


def _ours(cells: Sequence[ComparedCell], variant: str, notes: tables.Notes) -> tables.Cell:
    cell = next((cell for cell in cells if cell.variant == variant), None)
    if cell is None:
        return tables.Cell("")
    if cell.reason:
        return tables.Cell(numbers.MISSING, tone="muted", notes=notes.number(cell.reason), hint=cell.ours.source)
    hint = "; ".join((cell.ours.source, *cell.ours.notes))
    if _is_probability(cell):
        return tables.Cell(numbers.probability(cell.ours.value), tone=TONES[cell.agreement], hint=hint)
    return tables.number_cell(cell.ours.value, cell.ours.low, cell.ours.high, tone=TONES[cell.agreement], hint=hint)


def _implied(cells: Sequence[ComparedCell], notes: tables.Notes) -> tables.Cell:
    if not cells or cells[0].implied is None:
        return tables.Cell("")
    value, how = cells[0].implied.value, cells[0].implied.how
    if value is None:
        return tables.Cell(numbers.MISSING, tone="muted", hint=how)
    text = numbers.probability(value) if _is_probability(cells[0]) else numbers.significant(value, 4)
    return tables.Cell(text, notes=notes.number(how))


def _is_probability(cell: ComparedCell) -> bool:
    return "P-" in cell.column or "P-" in cell.row


def _unit(unit: str | None) -> str:
    return f", {unit}" if unit and unit != "1" else ""


def _claims(verdicts: Sequence[tuple[Claim, Verdict]]) -> Markup:
    titles = ("claim", "where", "verdict", "reason")
    rows: list[list[tables.Cell | str]] = [
        [
            claim.text,
            claim.where,
            tables.Cell(html.badge(verdict.outcome, VERDICT_TONES[verdict.outcome])),
            verdict.reason,
        ]
        for claim, verdict in verdicts
    ]
    return html.join(
        html.paragraph(
            "Each claim is decided by a rule on figures. A figure with limits decides only if both lie on one side of "
            "the bound. A verdict says what the equations and the simulated board show, not what the real board did."
        ),
        tables.render_table(
            [tables.TableColumn(title, numeric=False, wide=title == "reason") for title in titles], rows
        ),
    )


def _twin(paper: Paper, manifest: Manifest) -> Markup:
    columns = [tables.TableColumn(title, numeric=False) for title in ("recording", "kind", "rate")]
    rows = [
        [recording.name, recording.kind, f"{recording.rate_hz:g} Hz" if recording.rate_hz else "the board's"]
        for recording in manifest.recordings
    ]
    overrides = manifest.analysis.model_dump(exclude_unset=True) if manifest.analysis else {}
    settings = [
        (f"{section}.{key}", str(value)) for section, chosen in overrides.items() if isinstance(chosen, dict)
        for key, value in chosen.items()
    ]  # fmt: skip
    return html.join(
        html.paragraph(f"The model and its seed: config/twins/{paper.name}.yaml; what was true lies beside the dumps."),
        html.paragraph(manifest.notes) if manifest.notes else "",
        tables.render_table(columns, rows, f"Recordings of board {manifest.board}"),
        html.heading("Analysis options of this twin") if settings else "",
        html.definitions(settings) if settings else "",
    )  # fmt: skip


def _limits(paper: Paper, comparisons: Sequence[Comparison]) -> Markup:
    missing = [
        f"{_title(part)}: {cell.row} / {cell.column} ({cell.variant}): {cell.reason}"
        for part in comparisons
        for cell in part.cells
        if cell.published is not None and cell.reason
    ]
    return html.join(
        html.bullets(paper.limits),
        html.heading("Cells without a figure of ours") if missing else "",
        html.bullets(missing),
    )
