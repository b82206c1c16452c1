"""The page with ranks: one self-contained HTML file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from benchmarks.accuracy.demands import CALLED, demands, figure
from benchmarks.accuracy.scenario import load
from benchmarks.accuracy.summary import JUDGED, RECOMMENDED, Line, ranked_on, ranks
from vgyro.report.colours import DARK, LIGHT

FOLDER = Path(__file__).parent


def page(lines: Sequence[Line]) -> str:
    """HTML of ranks, what must hold, and every method on every line."""
    environment = Environment(
        loader=FileSystemLoader(FOLDER),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    names = [one.method for one in ranks(lines, JUDGED[1])]
    return environment.get_template("page.html").render(
        ranks=[(CALLED[one], ranks(lines, one)) for one in reversed(JUDGED)],
        demands=demands(lines),
        matrices=[(CALLED[one], _matrix(lines, names, one)) for one in reversed(JUDGED)],
        names=names, lines=len(lines), ranked=len(ranked_on(lines)), seeds=max(line.seeds for line in lines),
       figure=figure,        recommended=RECOMMENDED, light=LIGHT, dark=DARK,
    )  # fmt: skip


def _matrix(lines: Sequence[Line], names: Sequence[str], kind: str) -> list[dict[str, object]]:
    """Rows of a matrix: label, what differs, and for each method its text and class."""
    rows = []
    for line in lines:
        ratio = [line.ratio(name, kind) for name in names]
        least = min(ratio)
        cells = [(_text(line, name, value), _shade(value, least)) for name, value in zip(names, ratio, strict=True)]
        rows.append({
            "label": line.label, "title": load(line.scenario).title, "cells": cells,
            "oracle": figure(line.yardstick(line.oracle, kind)), "exact": line.exact,
        })  # fmt: skip
    return rows


def _text(line: Line, name: str, value: float) -> str:
    if math.isfinite(value):
        return figure(value)
    return "failed" if name in line.cells and line.cells[name].state == "failed" else "-"


def _shade(value: float, least: float) -> str:
    """Class of a cell: as good as the best, worse than the average, or neither."""
    if not math.isfinite(value):
        return "none"
    if value <= 1.03 * least:
        return "good"
    return "bad" if value > 1.02 else ""
