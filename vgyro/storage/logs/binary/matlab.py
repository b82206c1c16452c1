"""MATLAB files: 5.0 files (save -v6, -v7), and -v7.3, which are HDF5, through h5py."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from vgyro.errors import DataError
from vgyro.storage.logs.binary.arrays import Variable, blocks_of, stream, tables_of
from vgyro.storage.logs.binary.opened import OpenedLog, check_not_empty, reading
from vgyro.storage.logs.table import Account, LogRows, LogTable

if TYPE_CHECKING:
    from vgyro.storage.logs.binary.mat5 import Array

HDF5 = b"\x89HDF\r\n\x1a\n"
USER_BLOCKS = (0, 512, 1024, 2048, 4096)
AS_STRUCT = "save it as a struct (table2struct, or timetable2table first) or as CSV (writetimetable)"


def is_hdf5(path: Path) -> bool:
    """Does HDF5 begin at one of the places where it may?"""
    with open(path, "rb") as file:
        for place in USER_BLOCKS:
            file.seek(place)
            if file.read(8) == HDF5:
                return True
    return False


def open_log(path: Path) -> OpenedLog:
    """Open a .mat.

    Vectors of one length, and matrices with as many rows or columns, are the table "", with columns name, or name[0],
    name[1], … Matrices of other lengths are a table each. The fields of structs are name.field. Cells, texts, objects
    and complex numbers are left out, with a note. Compressed variables of a 5.0 file are unpacked whole when they are
    read, structs when it is opened; other ones, and those of a -v7.3 file, are streamed.
    raises : DataError for a file that is not MATLAB's, or whose tables MATLAB alone can read (timetable)
    """
    check_not_empty(path)
    notes: list[str] = []
    if is_hdf5(path):
        from vgyro.storage.logs.binary.hdf5 import variables_of

        variables = variables_of(path, notes)
    else:
        variables = _variables_v5(path, notes)
    made = tables_of(variables, path)
    if not made:
        what = "; ".join(["holds no vector or matrix of numbers", *notes])
        objects = any("object" in note for note in notes)
        raise DataError(what, str(path), AS_STRUCT if objects else "save vectors and matrices of numbers")

    def rows(_: OpenedLog, table: LogTable, columns: Sequence[str]) -> Iterator[LogRows]:
        leaves = {leaf.column.name: leaf for leaf in made[table.name][1]}
        return stream([leaves[name] for name in columns])

    return OpenedLog(path, "matlab", tuple(table for table, _ in made.values()), rows, Account(notes=notes))


def _variables_v5(path: Path, notes: list[str]) -> list[Variable]:
    from vgyro.storage.logs.binary.mat5 import arrays_of

    variables: list[Variable] = []
    with reading("MATLAB file", path):
        for array in arrays_of(path):
            _flatten(array, array.name, variables, notes)
    return variables


def _flatten(array: Array, name: str, variables: list[Variable], notes: list[str]) -> None:
    """The numbers in a variable, those in a struct by dots; a note on anything else."""
    for part in array.fields:
        _flatten(part, f"{name}.{part.name}", variables, notes)
    if array.fields or 0 in array.shape:
        return
    if array.is_complex:
        notes.append(f"{name} is complex: left out")
    elif array.kind in ("object", "opaque", "function", "unknown"):
        notes.append(f"{name} is an object of MATLAB (a table, timetable, datetime …): left out")
    elif array.load is None:
        notes.append(f"{name} is a {array.kind} array: left out")
    elif len(array.shape) == 2:
        variables.append(_matrix(name, array.shape, np.dtype(array.kind), array.load))


def _matrix(name: str, shape: tuple[int, ...], dtype: np.dtype, load: Callable[[], np.ndarray]) -> Variable:
    """A MATLAB array [rows, columns]. One row, or one column, is a vector."""

    def straight(size: int) -> Iterator[np.ndarray]:
        yield from blocks_of(load())(size)

    def turned(size: int) -> Iterator[np.ndarray]:
        yield from blocks_of(load().T)(size)

    def flat(size: int) -> Iterator[np.ndarray]:
        yield from blocks_of(load().reshape(-1))(size)

    if 1 in shape:
        return Variable(name, (max(shape),), dtype, flat)
    return Variable(name, shape, dtype, straight, turned)
