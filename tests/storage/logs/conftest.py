"""Small valid logs of every family, and what reads them."""

import sys
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pytest

from vgyro.log import Log

# ulog_bytes.py, bag_bytes.py and mutations.py, beside this file, are no package.
sys.path.insert(0, str(Path(__file__).parent))


def read(log, table: str, *columns: str) -> pa.Table:
    """Columns of a table, all of them where none is named; their places must follow each other."""
    wanted = columns or tuple(column.name for one in log.tables if one.name == table for column in one.columns)
    batches, place = [], 1
    for rows in log.rows(table, wanted):
        assert rows.place == place
        assert rows.batch.schema.names == list(wanted)
        place += rows.batch.num_rows + len(rows.bad)
        batches.append(rows.batch)
    return pa.Table.from_batches(batches)


@pytest.fixture
def table():
    """The function `read`."""
    return read


@pytest.fixture
def open_any():
    """Open a file as the pipeline does, by its content."""
    from vgyro.storage.logs.families import open_log

    return lambda path: open_log(path, Log())


@pytest.fixture
def matlab_v73():
    """Write a .mat as MATLAB -v7.3 does: HDF5 after 512 bytes, arrays transposed, their class beside them."""

    def write(path: Path, objects=(), **arrays) -> Path:
        with h5py.File(path, "w", userblock_size=512) as file:
            _put(file, arrays)
            for name in objects:
                made = file.create_dataset(name, data=np.zeros(6, np.uint32))
                made.attrs["MATLAB_class"] = np.bytes_(b"timetable")
                made.attrs["MATLAB_object_decode"] = np.int32(3)
        with open(path, "r+b") as file:
            file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512, b" "))
        return path

    return write


CLASSES = {"f8": "double", "f4": "single", "i2": "int16", "i8": "int64", "u1": "logical"}


def _put(group, arrays) -> None:
    for name, values in arrays.items():
        if isinstance(values, dict):
            made = group.create_group(name)
            made.attrs["MATLAB_class"] = np.bytes_(b"struct")
            _put(made, values)
            continue
        values = np.atleast_2d(values)
        chunks = tuple(min(64, side) for side in values.T.shape) if values.size > 50 else None
        made = group.create_dataset(name, data=values.T, chunks=chunks, compression="gzip" if chunks else None)
        made.attrs["MATLAB_class"] = np.bytes_(CLASSES[values.dtype.str[1:]].encode())
