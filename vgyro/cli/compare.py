"""Compare the figures of two runs: which changed, by how much, and whether beyond their intervals.

A and B are results folders (results/<dataset>, or any folder below or above it) or two metrics.parquet files. Figures
are matched by recording, axis, method, definition, true rate and metric. A figure counts as different when |B - A| is
more than the tolerance times the larger of |A| and |B|, or when only one run has it.
"""

from __future__ import annotations

import argparse
import json
import math
from dataclasses import asdict, dataclass
from pathlib import Path

EPILOG = """\
examples:
  vgyro compare results/bench /archive/2026-02-07/results/bench
  vgyro compare results-reference results-native --tolerance 1e-6
  vgyro compare A B --significant      only what lies beyond the intervals counts

exit codes:
  0  no figure differs by more than the tolerance
  1  at least one does, or is missing in one run
  4  A or B holds no figures
"""
KEY = ("recording", "axis", "method", "definition", "metric")
SAME, WITHIN, BEYOND, ONLY_A, ONLY_B = "same", "within the intervals", "beyond the intervals", "only in A", "only in B"


@dataclass(frozen=True)
class ComparedFigure:
    """A figure with its 95 % interval; NaN where none is given."""

    value: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class FigureChange:
    """One figure in both runs; a value is None where a run lacks it or could not compute it."""

    figure: str
    a: float | None
    b: float | None
    difference: float | None
    relative: float | None
    unit: str
    verdict: str


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("a", metavar="A", type=Path, help="the run to compare with")
    parser.add_argument("b", metavar="B", type=Path, help="the run to judge")
    parser.add_argument("--tolerance", type=float, default=1e-9, help="relative; default: %(default)g")
    parser.add_argument("--significant", action="store_true", help="count only figures beyond their intervals")
    parser.add_argument("--json", action="store_true", help="print every figure as JSON")


def run(options: argparse.Namespace) -> int:
    """Compare, print, return the exit code."""
    changes = compare(read_figures(options.a), read_figures(options.b), options.tolerance)
    quiet = {SAME, WITHIN} if options.significant else {SAME}
    different = [change for change in changes if change.verdict not in quiet]
    if options.json:
        record = {"differs": bool(different), "figures": [asdict(change) for change in changes]}
        print(json.dumps(record, indent=1, ensure_ascii=False, allow_nan=False))
        return int(bool(different))
    for change in different:
        print(_line(change))
    counts = {verdict: sum(c.verdict == verdict for c in changes) for verdict in (SAME, WITHIN, BEYOND, ONLY_A, ONLY_B)}
    print(f"{len(changes)} figures: " + ", ".join(f"{count} {verdict}" for verdict, count in counts.items() if count))
    return int(bool(different))


def compare(a: dict[str, ComparedFigure], b: dict[str, ComparedFigure], tolerance: float) -> list[FigureChange]:
    """Match two sets of figures by name, in the order of A, then what only B has."""
    changes = []
    for name in dict.fromkeys([*a, *b]):
        first, second = a.get(name), b.get(name)
        if first is None or second is None:
            known = first or second
            assert known is not None
            verdict = ONLY_A if second is None else ONLY_B
            changes.append(
                FigureChange(name, _number(first), _number(second), None, None, known.unit, verdict),
            )
            continue
        difference = second.value - first.value
        size = max(abs(first.value), abs(second.value))
        relative = 0.0 if size == 0 else difference / size
        verdict = _verdict(first, second, tolerance)
        changes.append(
            FigureChange(
                name, _number(first), _number(second), _finite(difference), _finite(relative), second.unit, verdict
            )
        )
    return changes


def read_figures(path: Path) -> dict[str, ComparedFigure]:
    """All figures below a folder, or of one metrics.parquet.

    Several data sets in one folder are told apart by the name of their folder.
    raises : DataError if there are none, or a file is not a table of figures
    """
    from vgyro.errors import DataError
    from vgyro.storage.tables import read_columns, read_metadata

    files = [path] if path.is_file() else sorted(path.glob("**/metrics.parquet"))
    if not files:
        what = "no metrics.parquet in it" if path.is_dir() else "no such file or folder"
        raise DataError(what, str(path), "give a folder below results/, or a metrics.parquet")
    figures = {}
    for file in files:
        if read_metadata(file)["schema"] != "metrics":
            raise DataError("not a table of figures", str(file), "give a metrics.parquet")
        table = read_columns(file)
        # <dataset>/<recording>/<axis>/metrics.parquet: what stands before the recording tells data sets apart.
        prefix = [] if path.is_file() else list(file.relative_to(path).parts[:-3])
        for row in range(len(table["value"])):
            names = [*prefix, *(str(table[column][row] or "") for column in KEY)]
            # A table of an older release knows the recording as it is alone.
            rate = float(table["true_rate"][row]) if "true_rate" in table else 0.0
            names += [f"at {rate:g} deg/s"] if rate else []
            name = " ".join(part for part in names if part)
            value, low, high = (float(table[column][row]) for column in ("value", "low", "high"))
            figures[name] = ComparedFigure(value, low, high, str(table["unit"][row]))
    return figures


def _verdict(a: ComparedFigure, b: ComparedFigure, tolerance: float) -> str:
    if math.isnan(a.value) and math.isnan(b.value):
        return SAME
    if a.unit == b.unit and (
        a.value == b.value or abs(b.value - a.value) <= tolerance * max(abs(a.value), abs(b.value))
    ):
        return SAME
    inside = a.low <= b.value <= a.high and b.low <= a.value <= b.high
    return WITHIN if inside and a.unit == b.unit else BEYOND


def _line(change: FigureChange) -> str:
    def text(value: float | None) -> str:
        return "–" if value is None else f"{value:.6g}"

    share = "" if change.relative is None else f" ({change.relative:+.2%})"
    return f"{change.figure}: {text(change.a)} → {text(change.b)} {change.unit}{share}, {change.verdict}"


def _number(figure: ComparedFigure | None) -> float | None:
    return None if figure is None else _finite(figure.value)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
