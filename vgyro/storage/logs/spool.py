"""Rows of a stream, kept aside between the reading and the placing in time: in memory, on disk where they are many."""

from __future__ import annotations

import shutil
import tempfile
import weakref
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

MOST_IN_MEMORY = 1 << 26
"""Bytes of a spool that stay in memory; blocks that come later go to disk."""


class Stored(NamedTuple):
    """A block on disk: column → offset in bytes, type and length."""

    path: Path
    places: dict[str, tuple[int, np.dtype, int]]

    def read(self, name: str) -> np.ndarray:
        """One column."""
        offset, kind, count = self.places[name]
        return np.fromfile(self.path, dtype=kind, count=count, offset=offset)


class Spool:
    """Blocks of columns, read back in order as often as wanted.

    The folder on disk goes with the spool. A column's type is the one that holds all its blocks: whole numbers stay so
    where no value is missing.
    """

    def __init__(self) -> None:
        self.rows = 0
        self.types: dict[str, np.dtype] = {}
        self._blocks: list[dict[str, np.ndarray] | Stored] = []
        self._bytes = 0
        self._folder: Path | None = None

    def append(self, columns: dict[str, np.ndarray]) -> None:
        """Keep a block; all columns are of one length."""
        count = len(next(iter(columns.values())))
        if not count:
            return
        for name, values in columns.items():
            self.types[name] = np.result_type(self.types.get(name, values.dtype), values.dtype)
        self.rows += count
        self._bytes += sum(values.nbytes for values in columns.values())
        self._blocks.append(columns if self._bytes <= MOST_IN_MEMORY else self._store(columns))

    def blocks(self, names: Sequence[str]) -> Iterator[dict[str, np.ndarray]]:
        """Some columns, block by block, in their types."""
        for block in self._blocks:
            found = {name: block.read(name) if isinstance(block, Stored) else block[name] for name in names}
            yield {name: values.astype(self.types[name], copy=False) for name, values in found.items()}

    def _store(self, columns: dict[str, np.ndarray]) -> Stored:
        if self._folder is None:
            self._folder = Path(tempfile.mkdtemp(prefix="vgyro-"))
            weakref.finalize(self, shutil.rmtree, self._folder, ignore_errors=True)
        path = self._folder / str(len(self._blocks))
        places, offset = {}, 0
        with open(path, "wb") as stream:
            for name, values in columns.items():
                np.ascontiguousarray(values).tofile(stream)
                places[name] = offset, values.dtype, len(values)
                offset += values.nbytes
        return Stored(path, places)
