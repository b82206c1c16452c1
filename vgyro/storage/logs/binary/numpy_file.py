"""NumPy files: .npy is one table, its columns c1, c2, … or the fields; .npz holds named arrays.

A .npy is mapped, not loaded. Arrays in a .npz are unpacked as they are read. No pickles: they could run any program.
"""

from __future__ import annotations

import math
import tokenize
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO, NamedTuple

import numpy as np

from vgyro.errors import DataError
from vgyro.storage.logs.binary.arrays import ArrayLeaf, Variable, blocks_of, stream, tables_of
from vgyro.storage.logs.binary.opened import WIDEST, OpenedLog, check_not_empty, reading, too_many
from vgyro.storage.logs.table import Account, LogRows, LogTable

ZIP = b"PK\x03\x04"
ERRORS = (zipfile.BadZipFile, zipfile.LargeZipFile, tokenize.TokenError)
MEMORY = 1 << 31
"""Most bytes of an array that must be unpacked whole, because it is stored column by column."""


def open_log(path: Path) -> OpenedLog:
    """Open a .npy or .npz; the arrays' headers are read.

    .npy : array [T] or [T, N] → columns c1 … cN; a structured one → its fields (name[0] …, name.field)
    .npz : vectors of one length and matrices with as many rows are the table ""; other matrices a table each, with the
           columns name[0], name[1], …; complex and object arrays and those of more axes are left out, with a note
    raises : DataError for a file that is neither, and for one that holds Python objects
    """
    check_not_empty(path)
    with open(path, "rb") as file:
        head = file.read(4)
    with reading("NumPy file", path, ERRORS):
        return _open_npz(path) if head == ZIP else _open_npy(path)


def _open_npy(path: Path) -> OpenedLog:
    with open(path, "rb") as file:
        shape, _, dtype = _header(file)
    _refuse_objects(dtype, path)
    if len(shape) not in (1, 2):
        remedy = "save it as [time, channel]"
        raise DataError(f"holds an array of {len(shape)} dimensions, not 1 or 2", str(path), remedy)
    if len(shape) == 2 and shape[1] > WIDEST:
        remedy = "save it transposed: time along the first axis"
        raise DataError(f"holds {shape[0]} rows of {shape[1]} columns", str(path), remedy)
    if dtype.kind == "c":
        raise DataError("holds complex numbers", str(path), "save their real part, or magnitude and phase")

    def blocks(size: int) -> Iterator[np.ndarray]:
        yield from blocks_of(np.load(path, mmap_mode="r", allow_pickle=False))(size)

    if 0 not in shape:
        np.load(path, mmap_mode="r", allow_pickle=False)  # a file that is cut short fails here, with what is missing
    made = tables_of([Variable("", shape, dtype, blocks)], path)
    if not made and shape[0] < 2:
        raise DataError(f"holds {shape[0]} rows", str(path), "check that the recording was saved whole")
    return _opened(path, made, [])


def _opened(path: Path, made: dict[str, tuple[LogTable, list[ArrayLeaf]]], notes: list[str]) -> OpenedLog:
    def rows(_: OpenedLog, table: LogTable, columns: Sequence[str]) -> Iterator[LogRows]:
        leaves = {leaf.column.name: leaf for leaf in made[table.name][1]}
        return stream([leaves[name] for name in columns])

    tables = tuple(table for table, _ in made.values())
    return OpenedLog(path, "numpy", tables, rows, Account(notes=notes), errors=ERRORS)


class _Header(NamedTuple):
    """What a .npy says of its array; by_column: is it stored column by column?"""

    shape: tuple[int, ...]
    by_column: bool
    dtype: np.dtype


def _header(file: IO[bytes]) -> _Header:
    version = np.lib.format.read_magic(file)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    return _Header(*read(file))


def _refuse_objects(dtype: np.dtype, path: Path, name: str = "") -> None:
    if dtype.hasobject:
        what = f"{f'array {name!r} ' if name else ''}holds Python objects (a pickle), which could run any program"
        raise DataError(what, str(path), "save plain arrays of numbers: np.save(…, allow_pickle=False)")


def _open_npz(path: Path) -> OpenedLog:
    variables, notes = [], []
    with zipfile.ZipFile(path) as archive:
        for info in archive.infolist():
            name = info.filename.removesuffix(".npy")
            if name == info.filename:
                continue
            with archive.open(info) as file:
                shape, by_column, dtype = _header(file)
            if too_many(shape, dtype.itemsize, info.file_size, 1) or too_many((info.file_size,), 1, info.compress_size):
                raise DataError(f"array {name!r} claims {shape} values and stores fewer", str(path), "copy it again")
            if dtype.hasobject:
                notes.append(f"{name} holds Python objects (a pickle): left out")
            elif dtype.kind == "c" or len(shape) > 2:
                notes.append(f"{name} is complex or has more than two axes: left out")
            elif shape:
                variables.append(_member(path, info.filename, _Header(shape, by_column, dtype)))
    return _opened(path, tables_of(variables, path), notes)


def _member(path: Path, member: str, header: _Header) -> Variable:
    """An array of a .npz, read piece by piece where it is stored row by row."""
    name, (shape, by_column, dtype) = member.removesuffix(".npy"), header
    row = dtype.itemsize * math.prod(shape[1:])

    def whole() -> np.ndarray:
        if row * shape[0] > MEMORY:
            remedy = "save it with time along the first axis, and C-contiguous: np.ascontiguousarray(…)"
            raise DataError(f"array {name!r} is stored column by column and too big for memory", str(path), remedy)
        with zipfile.ZipFile(path) as archive, archive.open(member) as file:
            return np.lib.format.read_array(file, allow_pickle=False)

    def pieces(size: int) -> Iterator[np.ndarray]:
        with zipfile.ZipFile(path) as archive, archive.open(member) as file:
            _header(file)
            for start in range(0, shape[0], size):
                count = min(size, shape[0] - start)
                data = file.read(count * row)
                full = len(data) // row if row else count
                yield np.frombuffer(data, dtype, full * math.prod(shape[1:])).reshape(full, *shape[1:])
                if full < count:
                    raise EOFError(f"array {name!r} is cut short")

    def loaded(size: int) -> Iterator[np.ndarray]:
        yield from blocks_of(whole())(size)

    def turned(size: int) -> Iterator[np.ndarray]:
        yield from blocks_of(whole().T)(size)

    matrix = len(shape) == 2
    return Variable(name, shape, dtype, loaded if by_column and matrix else pieces, turned if matrix else None)
