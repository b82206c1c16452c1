"""Named arrays of a file (NumPy, MATLAB) as tables: those with the same number of rows are one table."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from vgyro.errors import DataError
from vgyro.storage.logs.binary.opened import WIDEST, Damaged, Unique, batch_of, rows_at_a_time
from vgyro.storage.logs.table import Kind, LogColumn, LogRows, LogTable

Take = Callable[[np.ndarray], np.ndarray]
DAYS = (np.datetime64("1677-09-22"), np.datetime64("2262-04-10"))
"""Days that ns since 1970 can hold in 64 bits."""


@dataclass(frozen=True)
class Variable:
    """An array of a file, not loaded yet.

    shape  : rows, then values a row (none or one more axis)
    blocks : number of rows → blocks of so many rows [n] or [n, M], in order; the last one may be shorter
    turned : the same, for the array taken as columns × rows; None where it cannot be told apart
    """

    name: str
    shape: tuple[int, ...]
    dtype: np.dtype
    blocks: Callable[[int], Iterator[np.ndarray]]
    turned: Callable[[int], Iterator[np.ndarray]] | None = None


class ArrayLeaf(NamedTuple):
    """A column, the variable it is of, and how it is taken from one of its blocks."""

    column: LogColumn
    variable: Variable
    take: Take


def blocks_of(array: np.ndarray) -> Callable[[int], Iterator[np.ndarray]]:
    """Blocks of an array that is in memory, or mapped."""
    return lambda size: (array[start : start + size] for start in range(0, len(array), size))


def tables_of(variables: Sequence[Variable], path: Path) -> dict[str, tuple[LogTable, list[ArrayLeaf]]]:
    """Tables by name, each with its columns.

    Vectors of one length, and matrices with as many rows (or, turned, columns), are the table "". What is left over
    makes tables of its own; a single value makes none.
    """
    together = _together(variables)
    tables = {"": _table("", together, path)} if together else {}
    taken = {variable.name for variable in together}
    for variable in variables:
        if variable.name not in taken and variable.shape[0] > 1:
            tables[variable.name] = _table(variable.name, [variable], path)
    return {name: made for name, made in tables.items() if any(one.kind == "number" for one in made[0].columns)}


def _together(variables: Sequence[Variable]) -> list[Variable]:
    """The variables of the most common length of vectors (the longest of equally common ones)."""
    lengths = Counter(one.shape[0] for one in variables if len(one.shape) == 1 and one.shape[0] > 1)
    if not lengths:
        return []
    length = max(lengths, key=lambda rows: (lengths[rows], rows))
    found = []
    for one in variables:
        if one.shape[0] == length:
            found.append(one)
        elif one.turned is not None and one.shape[1:] == (length,) and one.shape[0] <= WIDEST:
            found.append(Variable(one.name, (length, one.shape[0]), one.dtype, one.turned))
    return found


def _table(name: str, variables: Sequence[Variable], path: Path) -> tuple[LogTable, list[ArrayLeaf]]:
    unique, leaves = Unique(), list[ArrayLeaf]()
    for variable in variables:
        for column, kind, unit, take in islice(_spread(variable.name, variable.dtype, variable.shape[1:]), WIDEST + 1):
            leaves.append(ArrayLeaf(LogColumn(unique(column), kind, unit), variable, take))
        if len(leaves) > WIDEST:
            remedy = "save it so that time runs along the first axis"
            raise DataError(f"{variable.name} has more than {WIDEST} columns", str(path), remedy)
    return LogTable(name, tuple(leaf.column for leaf in leaves), variables[0].shape[0]), leaves


class _Found(NamedTuple):
    """A column: its name, kind and unit, and how it is taken."""

    name: str
    kind: Kind
    unit: str
    take: Take


def _spread(name: str, dtype: np.dtype, inner: tuple[int, ...]) -> Iterator[_Found]:
    """The columns of blocks [n, *inner]: name, name[0] …, name.field; those of an array without a name: c1, c2, …"""
    if len(inner) > 1:
        return
    if dtype.names is not None:
        for part in dtype.names if not inner else ():
            kind, *_ = dtype.fields[part]  # type: ignore[index]
            shape = kind.shape
            for found, value, unit, take in _spread(f"{name}.{part}" if name else part, kind.base, shape):
                yield _Found(found, value, unit, partial(_within, part, take))
        return
    if dtype.kind not in "biufMmSU":
        return
    kind_of: Kind = "date" if dtype.kind == "M" else "text" if dtype.kind in "SU" else "number"
    unit = "ns" if dtype.kind == "m" else ""
    if not inner:
        yield _Found(name or "c1", kind_of, unit, lambda block: block)
    for index in range(inner[0] if inner else 0):
        label = f"{name}[{index}]" if name else f"c{index + 1}"
        yield _Found(label, kind_of, unit, partial(_column, index))


def _within(part: str, take: Take, block: np.ndarray) -> np.ndarray:
    return take(block[part])


def _column(index: int, block: np.ndarray) -> np.ndarray:
    return block[:, index]


def stream(leaves: Sequence[ArrayLeaf]) -> Iterator[LogRows]:
    """Rows of the wanted columns, block by block; only their variables are read."""
    if not leaves:
        return
    variables = {leaf.variable.name: leaf.variable for leaf in leaves}
    size = rows_at_a_time(sum(int(np.prod(one.shape[1:], dtype=np.int64)) or 1 for one in variables.values()))
    names = [leaf.column.name for leaf in leaves]
    place = 1
    for blocks in zip(*(one.blocks(size) for one in variables.values()), strict=True):
        whole = min(map(len, blocks))  # of one that is cut short, and then ends in an error
        held = {name: block[:whole] for name, block in zip(variables, blocks, strict=True)}
        batch = batch_of(names, [arrow(leaf.take(held[leaf.variable.name])) for leaf in leaves])
        yield LogRows(batch, place)
        place += batch.num_rows


def arrow(values: np.ndarray) -> pa.Array:
    """A column [n] as Arrow: dates and durations as ns, truth as 0 and 1, long doubles as doubles.

    raises : Damaged for a date that ns since 1970 cannot hold, and for complex numbers
    """
    kind = values.dtype.kind
    if kind in "Mm":
        return _ns(values)
    if kind == "b":
        values = values.astype(np.uint8)
    elif kind == "S":
        return pa.array([text.decode("utf-8", "replace") for text in values.tolist()], pa.string())
    elif kind == "U":
        return pa.array(values.tolist(), pa.string())
    elif kind == "f" and values.dtype.itemsize not in (4, 8):
        values = values.astype(np.float32 if values.dtype.itemsize == 2 else np.float64)
    elif kind not in "iuf":
        raise Damaged(f"{values.dtype} are no plain numbers")
    return pa.array(np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("=")), from_pandas=False)


def _ns(values: np.ndarray) -> pa.Array:
    missing = np.isnat(values)
    unit, _ = np.datetime_data(values.dtype)
    if unit == "generic":
        raise Damaged("times without a unit")
    if values.dtype.kind == "M":
        days = values[~missing].astype("M8[D]")
        if len(days) and (days.min() < DAYS[0] or days.max() > DAYS[1]):
            raise Damaged("dates outside the years 1678 to 2262")
        values = values.astype("M8[ns]")
    else:
        seconds = values[~missing].astype("m8[s]").astype(np.int64)
        if len(seconds) and np.abs(seconds).max() > 9 * 10**9:
            raise Damaged("durations of more than 285 years")
        values = values.astype("m8[ns]")
    return pa.array(values.astype(np.int64), mask=missing)
