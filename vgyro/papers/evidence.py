"""Our figures as plain rows, one list an artefact, and how one of them is found."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from vgyro.errors import DataError

Row = Mapping[str, Any]
_READING = ("artefact", "value", "low", "high", "unit")


@dataclass(frozen=True)
class PaperEvidence:
    """rows : artefact → its rows, each a mapping of column to value;  gyros : names in the order of the array"""

    rows: Mapping[str, Sequence[Row]]
    gyros: Sequence[str] = ()

    def find(self, artefact: str, wanted: Mapping[str, Any]) -> list[Row]:
        """Rows of the artefact whose columns equal `wanted`."""
        rows = self.rows.get(artefact, ())
        return [row for row in rows if all(row.get(key) == value for key, value in wanted.items())]


@dataclass(frozen=True)
class Ours:
    """A figure of ours with its 95 % limits (NaN where none is known), or the reason why there is none (value NaN)."""

    value: float
    low: float = math.nan
    high: float = math.nan
    unit: str = ""
    source: str = ""
    reason: str = ""
    notes: tuple[str, ...] = field(default=())

    @property
    def known(self) -> bool:
        """True if there is a figure."""
        return not math.isnan(self.value)


def look_up(evidence: PaperEvidence, select: Mapping[str, Any]) -> Ours:
    """Find the figure that a selection names.

    select : `artefact`; `value`, `low`, `high` = columns to read (default those names); `unit` where the artefact
             has no such column; `absolute` = true for the magnitude; every other key is a column that must be equal
    raises : DataError if several rows fit
    """
    wanted = {key: _named(value, evidence.gyros) for key, value in select.items()}
    absolute = bool(wanted.pop("absolute", False))
    artefact, column, low, high, unit = (wanted.pop(key, key) for key in _READING)
    source = f"{artefact}: " + ", ".join(f"{key} {value}" for key, value in wanted.items()) + f" → {column}"
    missing = [str(value) for value in wanted.values() if str(value).startswith("$")]
    if missing:
        return Ours(math.nan, source=source, reason=f"the array has no {missing[0].removeprefix('$')}")
    rows = evidence.find(artefact, wanted)
    if not rows:
        reason = f"no such row in {artefact}" if artefact in evidence.rows else f"no {artefact} was made"
        return Ours(math.nan, source=source, reason=reason)
    if len(rows) > 1:
        raise DataError(f"{len(rows)} rows fit where one was expected", source, "name the row by more of its columns")
    row = rows[0]
    value, below, above = (_number(row.get(name)) for name in (column, low, high))
    note = str(row.get("note") or row.get("status") or "")
    unit = str(row["unit"]) if "unit" in row and unit == "unit" else ("" if unit == "unit" else str(unit))
    if math.isnan(value):
        return Ours(math.nan, source=source, reason=_why_undefined(column, note))
    if absolute:
        value, below, above = _magnitude(value, below, above)
    return Ours(value, below, above, unit, source, notes=(note,) if note and note != "ok" else ())


def with_single(rows: Iterable[dict[str, Any]], gyros: Sequence[str]) -> list[dict[str, Any]]:
    """Add rows of the method `single`: the mean over the gyros of each metric of each recording.

    rows : rows of metrics. The limits take the gyros' intervals as independent: half-widths add in quadrature.
    A metric that one gyro lacks gets no such row. The metric `mean` is averaged as a magnitude (L, Table 3).
    """
    rows = list(rows)
    groups: dict[tuple[Any, ...], dict[str, Row]] = {}
    for row in rows:
        if row["method"] in gyros:
            key = tuple(row.get(name) for name in ("recording", "axis", "metric", "unit"))
            groups.setdefault(key, {})[row["method"]] = row
    for (recording, axis, metric, unit), of_gyro in groups.items():
        if len(of_gyro) < len(gyros):
            continue
        figures = [tuple(_number(of_gyro[gyro].get(name)) for name in ("value", "low", "high")) for gyro in gyros]
        if metric == "mean" and recording in _AT_REST:
            figures = [_magnitude(*figure) for figure in figures]
        value = sum(figure[0] for figure in figures) / len(figures)
        below = math.sqrt(sum((figure[0] - figure[1]) ** 2 for figure in figures)) / len(figures)
        above = math.sqrt(sum((figure[2] - figure[0]) ** 2 for figure in figures)) / len(figures)
        rows.append({
            "recording": recording, "axis": axis, "method": "single", "definition": "", "metric": metric,
            "value": value, "low": value - below, "high": value + above, "unit": unit,
            "note": f"mean over the {len(gyros)} gyros",
        })  # fmt: skip
    return rows


_AT_REST = ("static",)


def _why_undefined(column: str, note: str) -> str:
    if note.startswith("boundary"):
        return f"{column} is not defined: the estimate lies on the boundary of its range"
    return f"{column} is not defined: {note}" if note else f"{column} is not defined"


def _named(value: Any, gyros: Sequence[str]) -> Any:
    if isinstance(value, str) and value.startswith("$gyro"):
        index = int(value.removeprefix("$gyro")) - 1
        return gyros[index] if index < len(gyros) else value
    return value


def _number(value: Any) -> float:
    return math.nan if value is None else float(value)


def _magnitude(value: float, low: float, high: float) -> tuple[float, float, float]:
    """|x| of a figure with limits; where the limits hold 0 the lower one is 0."""
    if math.isnan(low) or math.isnan(high):
        return abs(value), math.nan, math.nan
    inner = 0.0 if low <= 0.0 <= high else min(abs(low), abs(high))
    return abs(value), inner, max(abs(low), abs(high))
