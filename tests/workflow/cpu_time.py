"""CPU time of a pipeline as a multiple of a fixed piece of work, so that neither machine nor load matters much."""

from __future__ import annotations

import csv
import os
import resource
import statistics
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

WORK = """
import numpy as np
rng = np.random.default_rng(3)
series = rng.standard_normal(2_000_000)
for _ in range(3):
    np.sort(series)
    np.abs(np.fft.rfft(series)) ** 2
    np.add.accumulate(series)
matrices = rng.standard_normal((8, 4, 4)) + 8.0 * np.eye(4)
for _ in range(25_000):
    np.linalg.solve(matrices, matrices)
sum(str(place).count("1") for place in range(1_500_000))
"""
"""Long columns, many small matrices and plain Python, about a third of the time each, as in the pipeline."""


def of_children(run: Callable[[], object]) -> float:
    """CPU seconds, user and system, of all processes that `run` starts and waits for."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    run()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def of_fixed_work() -> float:
    """CPU seconds of WORK in one thread, the median of three interpreters."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}

    def work() -> None:
        subprocess.run([sys.executable, "-c", WORK], env=environment, check=True)

    return statistics.median(of_children(work) for _ in range(3))


def longest_jobs(folder: Path, count: int = 12) -> str:
    """The jobs of results/benchmarks that took the most CPU time, a line each; Snakemake samples it, so about."""
    jobs = []
    for path in folder.rglob("*.tsv"):
        with path.open(encoding="utf-8") as file:
            row = next(csv.DictReader(file, delimiter="\t"))
        jobs.append((float(row["cpu_time"]), str(path.relative_to(folder).with_suffix(""))))
    total = sum(time for time, _ in jobs)
    return "\n".join(f"{time / total:6.1%} {name}" for time, name in sorted(jobs, reverse=True)[:count])
