"""python -m benchmarks.accuracy: every fusion method on simulated recordings with known truth.

Exit code 1: with --quick, a line is worse than its bound, which is then named.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from benchmarks.accuracy.plan import Task
    from benchmarks.accuracy.results import Row
    from benchmarks.accuracy.summary import Line

ONE_THREAD = ("VGYRO_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
OUT = Path(__file__).parent / ".results"
DOCS = Path(__file__).resolve().parents[2] / "docs" / "accuracy.md"
SEEDS, PARTS_SEEDS = 8, 2


def parsed(arguments: Sequence[str] | None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser("python -m benchmarks.accuracy", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one seed, short recordings; bounds on every line")
    parser.add_argument("--set-bounds", action="store_true", help="with --quick: keep this run's figures as bounds")
    parser.add_argument("--parts", nargs="?", const="all", metavar="NAME,…", help="leave out each part of recommended")
    parser.add_argument("--compare", type=Path, metavar="OLD.parquet", help="before and after, on the same seeds")
    parser.add_argument("--only", action="append", default=[], metavar="NAME,…", help="scenarios; all if left out")
    parser.add_argument("--methods", default="", metavar="NAME,…", help="methods; all if left out")
    parser.add_argument("--without", default="", metavar="NAME,…", help="parts of recommended that are left out")
    parser.add_argument("--seeds", type=int, metavar="N", help=f"seeds 1 … N; {SEEDS}, with --parts {PARTS_SEEDS}")
    parser.add_argument("--first", type=int, default=1, metavar="SEED", help="the first seed")
    parser.add_argument("--processes", type=int, default=2, metavar="N", help="at a time; 2")
    parser.add_argument("--out", type=Path, default=OUT, metavar="FOLDER", help="results; %(default)s")
    parser.add_argument("--docs", action="store_true", help="write docs/accuracy.md from what is in the folder")
    return parser.parse_args(arguments)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, print, return the exit code."""
    given = parsed(arguments)
    for name in ONE_THREAD:
        os.environ[name] = "1"
    # After the threads are set: the libraries read them when they are loaded.
    from benchmarks.accuracy.results import read, run_all, write
    from benchmarks.accuracy.summary import summarised

    folder = given.out / "quick" if given.quick else given.out
    name = "parts" if given.parts else "results"
    rows = run_all(_tasks(given), folder, given.processes)
    write(folder / f"{name}.parquet", rows)
    lines = summarised([row for row in rows if row["without"] == _usual(given)])
    _print(lines)
    compared = read(given.compare) if given.compare else []
    _write_pages(folder, lines, rows, compared, given)
    if given.quick:
        return _judge(lines, given)
    return 0


def _usual(given: argparse.Namespace) -> str:
    """The variant that the tables show."""
    return "" if given.parts else " ".join(sorted(_split(given.without)))


def _split(text: str) -> list[str]:
    return [one for one in text.split(",") if one]


def _tasks(given: argparse.Namespace) -> list[Task]:
    from benchmarks.accuracy import plan
    from vgyro.fusion.parts import PARTS

    variants: list[tuple[str, ...]] = [tuple(_split(given.without))]
    methods = _split(given.methods)
    if given.parts:
        chosen = list(PARTS) if given.parts == "all" else _split(given.parts)
        variants = [(), *((part,) for part in chosen)]
        methods = methods or list(plan.OURS)
    count = given.seeds or (PARTS_SEEDS if given.parts else SEEDS)
    seeds = range(given.first, given.first + count)
    return plan.tasks([one for text in given.only for one in _split(text)], seeds, methods, variants, given.quick)


def _print(lines: Sequence[Line]) -> None:
    """A line each, as the run goes by."""
    from benchmarks.accuracy.demands import figure

    for line in lines:
        faults = f"faults {line.faults['found']}/{line.faults['true']} invented {line.faults['invented']}"
        oracle = [figure(line.yardstick(line.oracle, kind)) for kind in ("full", "means")]
        print(f"{line.label}: oracle {oracle[0]} 1 s {oracle[1]}; {faults}")
        for name, cell in line.cells.items():
            told = f"{cell.state}: {cell.note[:90]}"
            if cell.ran:
                over = [
                    f"{figure(line.interval(cell, kind, who).value):>6}"
                    for who in ("average", "oracle")
                    for kind in ("full", "means")
                ]
                told = (
                    f"/average {over[0]} 1 s {over[1]}  /oracle {over[2]} 1 s {over[3]}"
                    f"  NEES {figure(cell.nees.value):>6} within 95 % {cell.coverage:6.1%}  CPU {cell.cpu_s:6.2f} s"
                    f"{'' if cell.whole else f'  {cell.seeds - cell.ran} of {cell.seeds} did not run'}"
                )
            print(f"    {name:26s} {told}")


def _write_pages(
    folder: Path, lines: Sequence[Line], rows: Sequence[Row], before: Sequence[Row], given: argparse.Namespace
) -> None:
    """accuracy.md and accuracy.html in the folder; docs/accuracy.md if wanted."""
    from benchmarks.accuracy.ablation import by_part, changes
    from benchmarks.accuracy.compare import differences
    from benchmarks.accuracy.markdown import ablation, comparison, document
    from benchmarks.accuracy.page import page
    from benchmarks.accuracy.results import read

    known = rows if given.parts else read(folder / "parts.parquet") if (folder / "parts.parquet").is_file() else []
    usual = [row for row in known if row["without"] == ""]
    parts = by_part(changes(usual, [row for row in known if row["without"]]))
    compared = differences(before, [row for row in rows if row["without"] == _usual(given)])
    if given.parts:
        print(ablation(parts))
        (folder / "parts.md").write_text(ablation(parts) + "\n", encoding="utf-8")
        return
    if compared:
        print(comparison(compared))
    text = document(lines, parts, compared)
    (folder / "accuracy.md").write_text(text, encoding="utf-8")
    (folder / "accuracy.html").write_text(page(lines), encoding="utf-8")
    if given.docs:
        DOCS.write_text(text, encoding="utf-8")


def _judge(lines: Sequence[Line], given: argparse.Namespace) -> int:
    """Bounds: keep, or compare."""
    from benchmarks.accuracy import bounds

    if given.set_bounds:
        bounds.write(bounds.of_lines(lines))
        return 0
    found = bounds.broken(lines, bounds.read())
    for sentence in found:
        print(sentence, file=sys.stderr)
    print(f"{len(lines)} lines, {len(found)} bounds broken", file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
