"""The overview: every data set with its headline figures, mistakes in manifests, links to the papers' pages."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from vgyro.report.conclusions.best import FAIR
from vgyro.report.html import badge, join, link, paragraph
from vgyro.report.model import Record
from vgyro.report.numbers import MISSING, duration, significant
from vgyro.report.page import Section, render_page
from vgyro.report.tables import Cell, TableColumn, Tone, render_table

COLUMNS = (
    TableColumn("data set", numeric=False),
    TableColumn("board", numeric=False),
    TableColumn("gyros"),
    TableColumn("recordings"),
    TableColumn("length"),
    TableColumn("bad gyros", numeric=False, hint="more than twice the median of their array"),
    TableColumn("best method by 1σ, at equal bandwidth", numeric=False),
    TableColumn("improvement factor"),
    TableColumn("scale", numeric=False),
    TableColumn("status", numeric=False),
)
TONES: dict[str, Tone] = {"good": "good", "suspect": "warn", "refused": "bad"}
MOST_NAMED = 4
RECOMMENDED_FAILED = "recommended method failed"


def render_index(
    headlines: Sequence[Record], problems: Sequence[str] = (), papers: Sequence[tuple[str, str]] = ()
) -> str:
    """reports/index.html as text.

    headlines : records of dataset_page.headline;  problems : mistakes in config and manifests, one text each
    papers    : (title, path from the index) of the pages of published tables
    """
    parts = []
    if problems:
        parts.append(Section("problems", "Not run", join(*(paragraph(text, "bad") for text in problems))))
    if headlines:
        table = render_table(COLUMNS, [_row(record) for record in headlines])
        parts.append(Section("datasets", "Data sets", table))
    elif not problems:
        words = "No data set yet: put a dataset.yaml and its files into raw/<name>/ and run snakemake again."
        parts.append(Section("datasets", "Data sets", paragraph(words)))
    if papers:
        links = [join(paragraph(link(title, target))) for title, target in papers]
        parts.append(Section("papers", "Published tables, computed again", join(*links)))
    subtitle = "How good each gyro is, how good a virtual gyroscope made of them, and how sure that is"
    return render_page("vgyro", parts, subtitle=subtitle, home="", contents=False)


def _row(record: Record) -> list[Cell]:
    name = link(record["title"], f"{record['dataset']}.html")
    if record["simulated"]:
        name = join(name, badge("SIMULATED", "warn"))
    refused = record["refused"]
    recordings = str(record["recordings"])
    return [
        Cell(name),
        Cell(record["board"]),
        Cell(str(record["gyros"]), f"axes {', '.join(record['axes'])}"),
        Cell(recordings, f"{len(refused)} refused" if refused else ""),
        Cell(duration(record["duration_s"])),
        _bad(record["bad_gyros"]),
        *_best(record["best"]),
        Cell(record["scale"], tone="" if record["scale"] == "measured" else "warn"),
        Cell(record["status"], RECOMMENDED_FAILED if record.get("recommended_failed") else "", TONES[record["status"]]),
    ]


def _bad(bad: Sequence[Record]) -> Cell:
    if not bad:
        return Cell("none")
    names = ", ".join(f"{one['gyro']} ({significant(one['factor'], 2)}×)" for one in bad[:MOST_NAMED])
    more = f" and {len(bad) - MOST_NAMED} more" if len(bad) > MOST_NAMED else ""
    return Cell(names + more, tone="bad")


def _best(best: Any) -> tuple[Cell, Cell]:
    if best is None:
        why = "no array of gyros was analysed at rest"
        return Cell(MISSING, tone="muted", hint=why), Cell(MISSING, tone="muted", hint=why)
    limits = ""
    if best["low"] is not None and best["high"] is not None:
        limits = f"{significant(best['low'])} … {significant(best['high'])}"
    shown = best["low"] is None or best["low"] > 1
    factor = Cell(significant(best["value"]), limits, "" if shown else "muted", hint="" if shown else "not significant")
    raw = "" if best["figure"] == FAIR else ", raw 1σ of full bandwidth"
    return Cell(best["label"], f"axis {best['axis']}, {best['recording']}{raw}"), factor
