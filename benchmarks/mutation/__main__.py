"""python -m benchmarks.mutation: do the tests hold the rules by which vgyro decides?

record  which functions each test calls: once, and of the tests that are new (`record tests/fusion/test_x.py`)
run     the sample of mutants, each in a copy of the repository, against the tests that call what it changes
table   the share that was killed and the survivors, as Markdown; `run` ends with it, too
sample  draw the sample again: what is still there stays, another of its kind takes the place of what is lost
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from benchmarks.mutation.modules import ROOT, copy_tree
from benchmarks.mutation.run import Outcome, environment, read_outcomes, run_all, write_outcomes
from benchmarks.mutation.sample import SAMPLE, SEED, Entry, all_mutants, drawn, read_sample, write_sample
from benchmarks.mutation.selection import Calls, chosen_tests
from benchmarks.mutation.table import as_markdown

OUT = Path(__file__).parent / ".results"
LEFT_OUT = ("workflow", "browser", "benchmarks", "cli", "engine")
"""Folders of tests that are recorded by name only: they run whole pipelines, or none of these modules."""
BUDGET_S = 15.0


def parsed(arguments: Sequence[str] | None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        "python -m benchmarks.mutation", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("action", choices=("record", "run", "table", "sample"))
    parser.add_argument("tests", nargs="*", help="of record: folders, files; all that could matter if left out")
    parser.add_argument("--first", type=int, metavar="N", help="no more than the first N of the sample")
    parser.add_argument("--only", metavar="N,…", help="mutants by number")
    parser.add_argument("--survivors", action="store_true", help="again those that survived")
    parser.add_argument("--budget", type=float, default=BUDGET_S, metavar="S", help="tests of a mutant; %(default)s s")
    parser.add_argument("--processes", type=int, default=1, metavar="N", help="at a time; 1")
    parser.add_argument("--sample", type=Path, default=SAMPLE, metavar="PATH", help="another sample; its --out apart")
    parser.add_argument("--seed", type=int, default=SEED, metavar="N", help="of a sample that is not there yet")
    parser.add_argument("--out", type=Path, default=OUT, metavar="FOLDER", help="results; %(default)s")
    return parser.parse_args(arguments)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, print, return the exit code."""
    given = parsed(arguments)
    if given.action == "sample":
        old = read_sample(given.sample) if given.sample.is_file() else ()
        write_sample(drawn(all_mutants(ROOT), old, seed=given.seed), given.sample)
        return 0
    if given.action == "record":
        return record(given.out / "calls", given.tests)
    path = given.out / "outcomes.jsonl"
    if given.action == "run" and run(given, path):
        return 1
    print(as_markdown(read_sample(given.sample), read_outcomes(path)))
    return 0


def record(folder: Path, tests: Sequence[str]) -> int:
    """Run tests in a copy of the repository and keep what each one calls; the exit code."""
    folder.mkdir(parents=True, exist_ok=True)
    if not tests:
        tests = sorted(f"tests/{one.name}" for one in (ROOT / "tests").iterdir() if _is_recorded(one))
    with tempfile.TemporaryDirectory(prefix="mutation-") as copy:
        copy_tree(ROOT, Path(copy))
        for one in tests:
            out = folder.absolute() / f"{one.strip('/').replace('/', '.')}.json"
            command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-m", "not full", one]
            recorder = ["-p", "benchmarks.mutation.recorder", "--calls-to", str(out)]
            if subprocess.run([*command, *recorder], cwd=copy, env=environment(Path(copy))).returncode not in (0, 5):
                print(f"tests of {one} fail; those that pass are recorded", file=sys.stderr)
    return 0


def _is_recorded(path: Path) -> bool:
    return path.name not in LEFT_OUT and (path.is_dir() or path.name.startswith("test_")) and path.name[0] not in "_."


def run(given: argparse.Namespace, path: Path) -> int:
    """Run mutants of the sample that have no outcome yet, or the survivors; keep each outcome at once."""
    calls = Calls.read(given.out / "calls")
    if not calls.functions:
        print("no record of what the tests call: python -m benchmarks.mutation record", file=sys.stderr)
        return 1
    outcomes = read_outcomes(path)
    known = {one.name: one for one in all_mutants(ROOT)}
    asked = [one for one in read_sample(given.sample) if one.name in known and _is_asked(one, given, outcomes)]
    tests = [chosen_tests(known[one.name], calls, ROOT, given.budget) for one in asked]
    work = [
        (one.mutant, known[one.name], chosen, sum(calls.seconds[test] for test in chosen))
        for one, chosen in zip(asked, tests, strict=True)
    ]

    def done(outcome: Outcome) -> None:
        outcomes[outcome.mutant] = outcome
        write_outcomes(path, [outcomes[number] for number in sorted(outcomes)])
        print(f"{outcome.mutant}: {outcome.how} {outcome.by}", file=sys.stderr, flush=True)

    run_all(ROOT, work, given.processes, done)
    return 0


def _is_asked(one: Entry, given: argparse.Namespace, outcomes: dict[int, Outcome]) -> bool:
    if given.only:
        return str(one.mutant) in given.only.split(",")
    if one.equivalent or (given.first and one.mutant > given.first):
        return False
    before = outcomes.get(one.mutant)
    return before is None or (given.survivors and not before.killed)


if __name__ == "__main__":
    sys.exit(main())
