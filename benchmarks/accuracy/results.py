"""Run tasks in two processes, a Parquet file each, and take up again where a run was broken off."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from benchmarks.accuracy.plan import Task
from benchmarks.accuracy.run import score_variants

Row = dict[str, Any]
DIGEST = b"digest"
CACHE = "scenarios"


def run_all(chosen: Sequence[Task], folder: Path, processes: int) -> list[Row]:
    """Rows of all tasks, in their order; those that are in the folder already are not run again."""
    (folder / CACHE).mkdir(parents=True, exist_ok=True)
    paths = [folder / CACHE / f"{task.label}.parquet" for task in chosen]
    left = [(task, path) for task, path in zip(chosen, paths, strict=True) if not _is_done(task, path)]
    begin, done = time.monotonic(), 0
    if processes == 1:
        finished: Iterable[str] = (_run(task, path) for task, path in left)
        for label in finished:
            done += 1
            _tell(label, done, len(left), begin)
    else:
        # A new interpreter each: the engine's threads and forks do not mix.
        with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
            for future in as_completed([pool.submit(_run, task, path) for task, path in left]):
                done += 1
                _tell(future.result(), done, len(left), begin)
    return [row for path in paths for row in read(path)]


def _run(task: Task, path: Path) -> str:
    """One task; its label."""
    variants = [frozenset(one) for one in task.variants]
    scored = [score_variants(task.scenario, seed, task.methods, variants) for seed in task.seeds]
    write(path, [row for rows in scored for row in rows], task.digest)
    return task.label


def _is_done(task: Task, path: Path) -> bool:
    if not path.is_file():
        return False
    return (pq.read_schema(path).metadata or {}).get(DIGEST) == task.digest.encode()


def write(path: Path, rows: Sequence[Row], digest: str = "") -> None:
    """Rows as Parquet, labelled as simulated; whole, or not at all."""
    table = pa.Table.from_pylist([_plain(row) for row in rows])
    table = table.replace_schema_metadata({DIGEST: digest.encode(), b"data": b"simulated"})
    part = path.with_suffix(".part")
    pq.write_table(table, part)
    part.replace(path)


def read(path: Path) -> list[Row]:
    """Rows of a file."""
    return pq.read_table(path).to_pylist()


def _plain(row: Row) -> Row:
    """NumPy's numbers as Python's."""
    return {name: value.item() if hasattr(value, "item") else value for name, value in row.items()}


def _tell(label: str, done: int, count: int, begin: float) -> None:
    print(f"{done}/{count}  {label}  {time.monotonic() - begin:.0f} s", file=sys.stderr, flush=True)
