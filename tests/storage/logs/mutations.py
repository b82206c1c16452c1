"""Damage for valid files, and what reading a damaged one may do: a DataError or rows, soon and in little memory."""

import resource
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from vgyro.errors import DataError

SECONDS = 10
MEGABYTES = 600
MAGIC = 8


class HangsError(BaseException):
    """Reading took too long. No Exception, so that nothing on the way can catch it."""


def mutants(content: bytes, count: int, seed: int, keep: int = MAGIC) -> Iterator[bytes]:
    """Damaged copies: bits flipped, bytes and words replaced, cut, spliced, doubled; the first `keep` bytes stay."""
    rng = np.random.default_rng(seed)
    for number in range(count):
        made = bytearray(content)
        for _ in range(int(rng.choice([1, 1, 2, 4, 16]))):
            place = int(rng.integers(keep, max(len(made), keep + 1)))
            length = int(rng.choice([1, 2, 4, 8, 64, 512]))
            match (number + int(rng.integers(2))) % 8:
                case 0 | 1:
                    if place < len(made):
                        made[place] ^= 1 << int(rng.integers(8))
                case 2:
                    made[place : place + length] = rng.bytes(length)
                case 3:
                    made[place : place + length] = bytes([int(rng.choice([0, 255, 127, 128]))]) * length
                case 4:
                    del made[place:]
                case 5:
                    del made[place : place + length]
                case 6:
                    source = int(rng.integers(0, max(len(made) - length, 1)))
                    made[place:place] = made[source : source + length]
                case 7:
                    source = int(rng.integers(0, max(len(made) - length, 1)))
                    made[place : place + length] = made[source : source + length]
        yield bytes(made)


def _stop(*_) -> None:
    raise HangsError


def survive(open_log: Callable, path: Path) -> str:
    """Read all that a file holds. Gives "read" or "refused"; any other exception goes on."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    handler = signal.signal(signal.SIGALRM, _stop)
    signal.setitimer(signal.ITIMER_REAL, SECONDS)
    started = time.monotonic()
    try:
        log = open_log(path)
        for table in log.tables:
            names = [column.name for column in table.columns]
            assert len(set(names)) == len(names)
            place = 1
            for rows in log.rows(table.name, names):
                assert rows.place >= place
                place = rows.place + rows.batch.num_rows
                rows.batch.validate(full=True)
                assert rows.batch.num_rows <= 1 << 18
        outcome = "read"
    except DataError:
        outcome = "refused"
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, handler)
    assert time.monotonic() - started < SECONDS
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    assert grown < MEGABYTES, f"{path.name}: {grown} MB"
    return outcome
