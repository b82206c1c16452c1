"""Runs mutants, each against the tests that call what it changes, in copies of the repository."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from queue import SimpleQueue

from benchmarks.mutation.modules import copy_tree
from benchmarks.mutation.sites import Mutant

PASSED, FAILED, INTERRUPTED, MISUSED, NONE = 0, 1, 2, 4, 5
"""Exit codes of pytest."""
TIMES, START_S = 10.0, 60.0
"""A mutant is killed by time that runs so many times as long as its tests' CPU time by the record, and this beside."""


@dataclass(frozen=True)
class Outcome:
    """Of one mutant of the sample. how : killed, timeout, survived, untested;  by : the test that failed"""

    mutant: int
    how: str
    tests: int
    by: str = ""

    @property
    def killed(self) -> bool:
        """Whether a test told it from the original."""
        return self.how in ("killed", "timeout")


def run_mutant(tree: Path, number: int, mutant: Mutant, tests: Sequence[str], seconds: float) -> Outcome:
    """Change the module in this copy, run the tests until one fails, put the module back."""
    if not tests:
        return Outcome(number, "untested", 0)
    with _changed(tree / mutant.module, mutant):
        code, output = _pytest(tree, tests, TIMES * seconds + START_S)
        if code == MISUSED:
            # A test that is named after what was changed: its whole file.
            code, output = _pytest(tree, sorted({test.split("::")[0] for test in tests}), TIMES * seconds + START_S)
    how = {PASSED: "survived", NONE: "untested", None: "timeout"}.get(code, "killed")
    failed = re.search(r"^(?:FAILED|ERROR) (\S+\.py\S*.*?)(?: - .*)?$", output, re.MULTILINE)
    return Outcome(number, how, len(tests), failed[1] if failed and how == "killed" else "")


def run_all(
    root: Path,
    work: Iterable[tuple[int, Mutant, Sequence[str], float]],
    processes: int,
    done: Callable[[Outcome], None],
) -> None:
    """Run many, several at a time, each process in its own copy; `done` is called with each outcome."""
    with tempfile.TemporaryDirectory(prefix="mutation-") as folder:
        trees: SimpleQueue[Path] = SimpleQueue()
        for number in range(processes):
            copy_tree(root, Path(folder) / str(number))
            trees.put(Path(folder) / str(number))

        def one(task: tuple[int, Mutant, Sequence[str], float]) -> Outcome:
            tree = trees.get()
            try:
                return run_mutant(tree, *task)
            finally:
                trees.put(tree)

        with ThreadPoolExecutor(processes) as pool:
            for outcome in pool.map(one, work):
                done(outcome)


@contextmanager
def _changed(path: Path, mutant: Mutant) -> Iterator[None]:
    original = path.read_text(encoding="utf-8")
    try:
        _put(path, mutant.applied(original))
        yield
    finally:
        _put(path, original)


def _put(path: Path, source: str) -> None:
    """Without byte code: that of a file of the same size and second would be taken for its own."""
    path.write_text(source, encoding="utf-8")
    for compiled in (path.parent / "__pycache__").glob(f"{path.stem}.*.pyc"):
        compiled.unlink()


def _pytest(tree: Path, tests: Sequence[str], timeout_s: float) -> tuple[int | None, str]:
    """Exit code, None for a timeout, and what was printed."""
    asked = tree / ".tests"
    asked.write_text("\n".join(tests), encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-m", "not full", f"@{asked}"]
    with subprocess.Popen(
        command, cwd=tree, env=environment(tree), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        start_new_session=True,
    ) as process:  # fmt: skip
        try:
            output, _ = process.communicate(timeout=timeout_s)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
            return None, ""
    return process.returncode, output


def environment(tree: Path) -> dict[str, str]:
    """Of a process that is to import from that copy; one thread, so that several mutants may run beside each other."""
    return os.environ | {"PYTHONPATH": str(tree), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


def write_outcomes(path: Path, outcomes: Iterable[Outcome]) -> None:
    """One JSON object a line."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("".join(json.dumps(asdict(one)) + "\n" for one in outcomes), encoding="utf-8")


def read_outcomes(path: Path) -> dict[int, Outcome]:
    """By the number in the sample; nothing if there is no such file."""
    if not path.is_file():
        return {}
    found = [Outcome(**json.loads(line)) for line in path.read_text(encoding="utf-8").splitlines()]
    return {one.mutant: one for one in found}
