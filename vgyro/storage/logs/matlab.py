"""MATLAB files: -v7 and older 5.0 files through SciPy, -v7.3 (which are HDF5) through h5py."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vgyro.errors import DataError
from vgyro.storage.logs.arrays import Variable, blocks_of, stream, tables_of
from vgyro.storage.logs.opened import OpenedLog, check_not_empty, needed, reading, too_many
from vgyro.storage.logs.table import Account, LogTable, Rows

HDF5 = b"\x89HDF\r\n\x1a\n"
USER_BLOCKS = (0, 512, 1024, 2048, 4096)
NUMBERS = ("double", "single", "logical", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64")
DEPTH = 16
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
    and complex numbers are left out, with a note. A 5.0 file's variables are loaded whole when they are read, its
    structs when it is opened; a -v7.3 file is streamed.
    raises : DataError for a file that is not MATLAB's, or whose tables MATLAB alone can read (timetable)
    """
    check_not_empty(path)
    notes: list[str] = []
    if is_hdf5(path):
        from vgyro.storage.logs.hdf5 import variables_of

        variables = variables_of(path, notes)
    else:
        variables = _variables_v5(path, notes)
    made = tables_of(variables, path)
    if not made:
        what = "; ".join(["holds no vector or matrix of numbers", *notes])
        objects = any("object" in note for note in notes)
        raise DataError(what, str(path), AS_STRUCT if objects else "save vectors and matrices of numbers")

    def rows(_: OpenedLog, table: LogTable, columns: Sequence[str]) -> Iterator[Rows]:
        leaves = {leaf.column.name: leaf for leaf in made[table.name][1]}
        return stream([leaves[name] for name in columns])

    return OpenedLog(path, "matlab", tuple(table for table, _ in made.values()), rows, Account(notes=notes))


def _variables_v5(path: Path, notes: list[str]) -> list[Variable]:
    with needed("scipy", "a MATLAB file", path):
        from scipy.io import whosmat
    from vgyro.storage.logs.mat5 import check_structure

    variables: list[Variable] = []
    with reading("MATLAB file", path):
        flags = check_structure(path)
        for (name, shape, kind), is_complex in zip(whosmat(str(path)), flags, strict=True):
            if is_complex:
                notes.append(f"{name} is complex: left out")
            elif kind in NUMBERS:
                variables += _numeric(path, name, shape, kind)
            elif kind == "struct":
                _fields(name, _load(path, name), variables, notes, 0)
            elif kind in ("object", "opaque", "function", "unknown"):
                notes.append(f"{name} is an object of MATLAB (a table, timetable, datetime …): left out")
            else:
                notes.append(f"{name} is a {kind} array: left out")
    return variables


def _numeric(path: Path, name: str, shape: tuple[int, ...], kind: str) -> list[Variable]:
    """A vector or matrix that is loaded when it is read."""
    if len(shape) > 2 or 0 in shape or too_many(shape, 1, path.stat().st_size):
        return []
    dtype = np.dtype({"double": "f8", "single": "f4", "logical": "u1"}.get(kind, kind))

    def whole() -> np.ndarray:
        found = _load(path, name)
        if found.shape != shape:
            raise ValueError(f"{name} is {found.shape}, not {shape}")
        return found

    return [_matrix(name, shape, dtype, whole)]


def _matrix(name: str, shape: tuple[int, ...], dtype: np.dtype, whole: Any) -> Variable:
    """A MATLAB array [rows, columns]; whole() gives it. One row, or one column, is a vector."""
    if 1 in shape:
        return Variable(name, (max(shape),), dtype, lambda size: blocks_of(whole().reshape(-1))(size))
    return Variable(
        name, shape, dtype, lambda size: blocks_of(whole())(size), lambda size: blocks_of(whole().T)(size)
    )  # fmt: skip


def _load(path: Path, name: str) -> np.ndarray:
    from scipy.io import loadmat

    return np.asarray(loadmat(str(path), variable_names=[name], mat_dtype=True)[name])


def _fields(name: str, found: np.ndarray, variables: list[Variable], notes: list[str], depth: int) -> None:
    """The numbers in a struct, by dots."""
    if found.dtype.names is not None:
        if found.size != 1 or depth > DEPTH:
            notes.append(f"{name} is an array of structs: left out")
            return
        for part in found.dtype.names:
            _fields(f"{name}.{part}", np.asarray(found.reshape(-1)[0][part]), variables, notes, depth + 1)
    elif found.dtype.kind in "biuf" and found.ndim <= 2 and found.size:
        values = np.atleast_2d(found)
        variables.append(_matrix(name, values.shape, values.dtype, lambda: values))
    elif found.size:
        kind = "text" if found.dtype.kind in "US" else "a cell or an object"
        notes.append(f"{name} is {kind}: left out")
