"""Arrays of an HDF5 file, as MATLAB -v7.3 writes it: transposed, structs as groups; or as other programs do."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from vgyro.storage.logs.binary.arrays import Variable
from vgyro.storage.logs.binary.opened import Damaged, needed, reading, too_many

DEPTH = 16
MOST = 10_000
"""Most datasets that are looked at."""
CHUNK_BYTES = 1 << 28
SPARSE_RATIO = 5000
"""Most that values may outnumber stored bytes: deflate does 1032, and shuffled constants a little more."""
CELLS = ("cell", "char", "string", "function_handle")


def variables_of(path: Path, notes: list[str]) -> list[Variable]:
    """The arrays of numbers, by dots: imu.gyro. Links to other files are not followed.

    raises : DataError where the library h5py is missing, or the file cannot be read
    """
    with needed("h5py", "a MATLAB v7.3 or HDF5 file", path):
        import h5py

    variables: list[Variable] = []
    with reading("MATLAB v7.3 (HDF5) file", path), h5py.File(path, "r") as file:
        _walk(file, "", path, variables, notes, 0)
    return variables


def _walk(group: Any, prefix: str, path: Path, variables: list[Variable], notes: list[str], depth: int) -> None:
    import h5py

    if depth > DEPTH:
        raise Damaged(f"groups nested more than {DEPTH} deep")
    for key in group:
        if key.startswith("#") or not isinstance(group.get(key, getlink=True), h5py.HardLink):
            continue
        if len(variables) + len(notes) > MOST:
            raise Damaged(f"more than {MOST} arrays")
        item, name = group[key], f"{prefix}{key}"
        kind = _class(item)
        if "MATLAB_object_decode" in item.attrs or kind in (
            "table",
            "timetable",
            "datetime",
            "duration",
            "categorical",
        ):
            notes.append(f"{name} is an object of MATLAB ({kind or 'opaque'}): left out")
        elif isinstance(item, h5py.Group):
            _walk(item, f"{name}.", path, variables, notes, depth + 1)
        elif kind in CELLS or item.dtype.kind not in "biufV" or item.dtype.hasobject:
            notes.append(f"{name} is {'a ' + kind + ' array' if kind else 'no array of numbers'}: left out")
        elif item.shape and len(item.shape) <= 2 and "MATLAB_empty" not in item.attrs and 0 not in item.shape:
            variables += _dataset(item, name, path, kind)


def _class(item: Any) -> str:
    found = item.attrs.get("MATLAB_class", b"")
    return found.decode("ascii", "replace") if isinstance(found, bytes) else str(found)


def _dataset(item: Any, name: str, path: Path, kind: str) -> list[Variable]:
    """A dataset as variable.  raises : ValueError for one that claims more than is stored"""
    stored = item.id.get_storage_size()
    if item.external or item.is_virtual:
        return []
    if too_many(item.shape, item.dtype.itemsize, stored, SPARSE_RATIO if item.chunks else 1):
        raise Damaged(f"{name} claims {item.shape} values and stores {stored} bytes")
    if item.chunks and math.prod(item.chunks) * item.dtype.itemsize > CHUNK_BYTES:
        raise Damaged(f"{name} has chunks of more than {CHUNK_BYTES} bytes")
    place, shape = item.name, item.shape
    if len(shape) == 2 and 1 in shape:
        return [Variable(name, (max(shape),), item.dtype, _pieces(path, place, 0 if shape[1] == 1 else 1, True))]
    if len(shape) == 1:
        return [Variable(name, shape, item.dtype, _pieces(path, place, 0, False))]
    # MATLAB's rows are HDF5's columns.
    rows = 1 if kind else 0
    turned = _pieces(path, place, 1 - rows, False)
    return [Variable(name, shape[::-1] if rows else shape, item.dtype, _pieces(path, place, rows, False), turned)]


def _pieces(path: Path, place: str, axis: int, flat: bool) -> Callable[[int], Iterator[np.ndarray]]:
    """Blocks of a dataset along one of its axes, read from the file one by one; flat: as a vector."""

    def blocks(size: int) -> Iterator[np.ndarray]:
        import h5py

        with h5py.File(path, "r") as file:
            item = file[place]
            for start in range(0, item.shape[axis], size):
                block = item[start : start + size] if axis == 0 else item[:, start : start + size].T
                yield block.reshape(-1) if flat else block

    return blocks
