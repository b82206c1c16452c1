"""python -m benchmarks: the native engine against the libraries, on one thread, interleaved.

Every contest is checked for its figures first, which also warms up caches and compilers, then all sides are timed in
turn (ours, first rival, second rival, ours, …) as CPU time. Exit code 1: a figure is wrong or a target is missed; with
--quick only the figures count, because so short a run times nothing well.
"""

from __future__ import annotations

import argparse
import os
import sys
from importlib import import_module
from pathlib import Path

FAMILIES = ("garch", "dcc", "weights", "kalman", "fusion", "allan", "spectrum", "decode", "logs", "imports")
ROUNDS, QUICK_ROUNDS = 5, 2
ONE_THREAD = (
    "VGYRO_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS",
)  # fmt: skip


def main(arguments: list[str] | None = None) -> int:
    """Run, print, return the exit code."""
    parser = argparse.ArgumentParser("python -m benchmarks", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="small sizes: the figures are checked, times are rough")
    parser.add_argument("--only", action="append", choices=FAMILIES, metavar="NAME", help=f"of {', '.join(FAMILIES)}")
    parser.add_argument("--json", type=Path, metavar="PATH", help="write the results there, too")
    given = parser.parse_args(arguments)
    for name in ONE_THREAD:
        os.environ[name] = "1"
    # After the threads are set: the libraries read them when they are loaded.
    from benchmarks.contest import play
    from benchmarks.tables import as_markdown, write_json

    results = []
    for name in given.only or FAMILIES:
        for contest in import_module(f"benchmarks.{name}").contests(given.quick):
            print(f"{contest.title} …", file=sys.stderr, flush=True)
            results.append(play(contest, QUICK_ROUNDS if given.quick else ROUNDS))
    print(as_markdown(results))
    if given.json:
        write_json(given.json, results, given.quick)
    wrong = sum(not result.accurate for result in results)
    missed = sum(not against.passed for result in results for against in result.against)
    print(f"{wrong} contests with a wrong figure, {missed} targets missed", file=sys.stderr)
    return 1 if wrong or (missed and not given.quick) else 0


if __name__ == "__main__":
    sys.exit(main())
