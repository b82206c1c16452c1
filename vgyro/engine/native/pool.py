"""One pool of threads for all kernels. Work is cut into pieces that do not depend on the number of threads."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache


def threads() -> int:
    """Threads that kernels use: VGYRO_THREADS, or else one for each core that this process may run on."""
    wanted = os.environ.get("VGYRO_THREADS", "")
    return max(1, int(wanted)) if wanted else len(os.sched_getaffinity(0))


@cache
def _pool(workers: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(workers, thread_name_prefix="vgyro")


def run(kernel: Callable[[int, int], None], count: int, piece: int) -> None:
    """Call kernel(start, stop) for pieces of range(count), each `piece` long but the last.

    kernel releases the GIL and writes only what belongs to its range. An exception in one of them is raised here.
    """
    ranges = [(start, min(start + piece, count)) for start in range(0, count, piece)]
    workers = min(threads(), len(ranges))
    if workers <= 1:
        for start, stop in ranges:
            kernel(start, stop)
        return
    for done in [_pool(workers).submit(kernel, start, stop) for start, stop in ranges]:
        done.result()
