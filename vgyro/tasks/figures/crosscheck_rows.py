"""A row of the cross-check: our figure, the other route's, and whether they agree."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from typing import NamedTuple

import numpy as np
import pyarrow as pa


@dataclass(frozen=True)
class CrosscheckRow:
    """A row of crosscheck.parquet; window -1: a whole recording."""

    check: str
    against: str
    window: int
    series: str
    ours: float
    theirs: float
    difference: float
    tolerance: float
    unit: str
    passed: bool


class Check(NamedTuple):
    """What is compared, against what, in which window (-1: a whole recording), of which series."""

    check: str
    against: str
    window: int
    series: str


def compare(
    about: Check, ours: np.ndarray | float, theirs: np.ndarray | float, tolerance: float, unit: str
) -> CrosscheckRow:
    """Compare two figures, or of two arrays the elements that differ most; a NaN on one side does not pass."""
    first, second = np.ravel(ours).astype(float), np.ravel(theirs).astype(float)
    distance = np.abs(first - second)
    worst = int(np.argmax(np.where(np.isnan(distance), np.inf, distance)))
    return _row(about, (first[worst], second[worst]), tolerance, unit, two_sided=True)


def compare_maximum(about: Check, ours: float, theirs: float, tolerance: float) -> CrosscheckRow:
    """Compare two maxima of one likelihood: ours may be greater, but not smaller by more than the tolerance."""
    return _row(about, (ours, theirs), tolerance, "1", two_sided=False)


def _row(about: Check, pair: tuple[float, float], tolerance: float, unit: str, *, two_sided: bool) -> CrosscheckRow:
    ours, theirs = float(pair[0]), float(pair[1])
    difference = ours - theirs
    passed = bool(abs(difference) <= tolerance if two_sided else difference >= -tolerance)
    return CrosscheckRow(*about, ours, theirs, difference, tolerance, unit, passed)


def columns_of(rows: list[CrosscheckRow]) -> pa.Table:
    """Rows → table; without rows, too, the columns have their types."""
    kinds = {"str": pa.string(), "int": pa.int64(), "float": pa.float64(), "bool": pa.bool_()}
    schema = pa.schema([(field.name, kinds[str(field.type)]) for field in fields(CrosscheckRow)])
    return pa.Table.from_pylist([asdict(row) for row in rows], schema=schema)
