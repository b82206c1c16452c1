"""What is in a log? Its tables, columns and their roles, and from them the array and the recordings of a manifest."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vgyro.cli.drafts.manifest_text import ArrayDraft, LogDraft
from vgyro.errors import DataError, UsageError
from vgyro.log import Log
from vgyro.storage.logs.families import open_log
from vgyro.storage.logs.names import bare_name
from vgyro.storage.logs.roles import GyroGuess, Roles, roles_of
from vgyro.storage.logs.table import LogFile, LogTable

HEAD_ROWS = 20_000
FEWEST_ROWS = 10
"""With fewer rows nothing can be told from values."""
SAME_LENGTH = 0.05
NOT_RAW = re.compile(r"combined|vehicle|estimat|setpoint|status|control|fused|filtered|odom", re.IGNORECASE)


class Choices(NamedTuple):
    """What the command line says in place of a guess; None: guess."""

    rate_hz: float | None = None
    scale: float | None = None
    unit: str | None = None
    axis: str | None = None
    together: bool | None = None


class LogSource(NamedTuple):
    """Gyros that are sampled together: one table of a file, or its rows of one id."""

    table: LogTable
    roles: Roles
    id: int | float | str | None


@dataclass(frozen=True)
class LogLook:
    """One log: what it holds. unused: tables with gyros that were not taken."""

    path: Path
    opened: LogFile
    sources: tuple[LogSource, ...]
    unused: tuple[str, ...] = ()


def look_at(path: Path) -> LogLook:
    """Open a log and guess the role of every column.  raises : DataError if it is no log, or holds no gyro"""
    opened = open_log(path, Log())
    gyros: list[tuple[LogTable, Roles]] = []
    fewest = {}
    for table in opened.tables:
        head = head_of(opened, table)
        if (rows := len(head[table.columns[0].name])) < FEWEST_ROWS:
            fewest[table.name] = rows
            continue
        roles = roles_of(table.columns, head, table.name or path.stem)
        if roles.gyros:
            gyros.append((table, roles))
    if not gyros and len(fewest) == len(opened.tables):
        rows = max(fewest.values())
        what = f"holds {rows} row{'s' * (rows != 1)} of numbers, too few to tell its columns apart"
        raise DataError(what, str(path), f"give a log of {FEWEST_ROWS} rows or more")
    if not gyros:
        there = "; ".join(_columns(table) for table in opened.tables)
        remedy = "name its columns in the manifest, under `array` (docs/logs.md)"
        raise DataError(f"no column looks like a gyro's: {there or 'no columns of numbers'}", str(path), remedy)
    chosen = _alike(gyros)
    _check_values(path, opened, chosen)
    sources = [LogSource(table, roles, one) for table, roles in chosen for one in (roles.ids or (None,))]
    taken = {table.name for table, _ in chosen}
    return LogLook(path, opened, tuple(sources), tuple(table.name for table, _ in gyros if table.name not in taken))


def _check_values(path: Path, opened: LogFile, chosen: Sequence[tuple[LogTable, Roles]]) -> None:
    """raises : DataError if no gyro has a value in the first rows"""
    for table, roles in chosen:
        head = head_of(opened, table)
        if any(np.isfinite(head[gyro.column].astype(np.float64)).any() for gyro in roles.gyros):
            return
    names = ", ".join(gyro.column for gyro in chosen[0][1].gyros)
    rows = len(head[table.columns[0].name])
    what = f"its gyros ({names}) have no value in the first {rows} rows: empty, NaN or infinite"
    raise DataError(what, str(path), "check what the logger wrote, or cut these rows off")


def _columns(table: LogTable) -> str:
    names = ", ".join(column.name for column in table.columns)
    return f"{table.name}: {names}" if table.name else names


def head_of(opened: LogFile, table: LogTable) -> dict[str, np.ndarray]:
    """The first rows of a table, column by column."""
    names = [column.name for column in table.columns]
    parts: list[dict[str, np.ndarray]] = []
    count = 0
    for rows in opened.rows(table.name, names):
        batch = rows.batch.slice(0, HEAD_ROWS - count)
        parts.append({name: batch.column(name).to_numpy(zero_copy_only=False) for name in names})
        count += batch.num_rows
        if count >= HEAD_ROWS:
            break
    return {name: np.concatenate([part[name] for part in parts]) if parts else np.empty(0) for name in names}


def _alike(found: Sequence[tuple[LogTable, Roles]]) -> list[tuple[LogTable, Roles]]:
    """The tables whose gyros have the same columns as those of the best one: raw before computed, then the most."""
    groups: dict[tuple[str, ...], list[tuple[LogTable, Roles]]] = {}
    for table, roles in found:
        groups.setdefault(tuple(gyro.column for gyro in roles.gyros), []).append((table, roles))
    return max(groups.values(), key=lambda group: (not NOT_RAW.search(group[0][0].name), len(group)))


def are_one_array(looks: Sequence[LogLook], rows: Sequence[int]) -> bool:
    """Do several files hold one array, a file a gyro? One gyro an axis each, and about as many rows in each."""
    axes = [[gyro.axis for gyro in look.sources[0].roles.gyros] for look in looks]
    single = all(len(look.sources) == 1 for look in looks) and all(len(set(one)) == len(one) for one in axes)
    same = len({tuple(gyro.column for gyro in look.sources[0].roles.gyros) for look in looks}) == 1
    return len(looks) > 1 and single and same and max(rows) - min(rows) <= SAME_LENGTH * max(rows)


def array_of(looks: Sequence[LogLook], choices: Choices, several_files: bool) -> ArrayDraft:
    """The gyros and thermometers of a manifest, with where each stands.

    several_files : the looks are of one array, a file each; else the first speaks for all
    raises        : UsageError if counts have no scale
    """
    sources = [(look, source) for look in (looks if several_files else looks[:1]) for source in look.sources]
    draft = ArrayDraft()
    names: set[str] = set()
    for look, source in sources:
        place = _place(look, source, sources, several_files)
        prefix = _prefix(look, source, sources, several_files)
        for guess in source.roles.gyros:
            name = _unique(_name(prefix, bare_name(guess.column)), names)
            draft.gyros.append(_gyro(name, guess, choices, look.path, bool(place)))
            if place:
                draft.places[name] = {"column": guess.column, **place}
            draft.why[name] = guess.why if choices.unit is None and choices.scale is None else "as you say"
        for column in source.roles.temperatures:
            name = _unique(_name(prefix, bare_name(column)), names)
            draft.temperatures.append({"name": name} if place else {"name": name, "column": column})
            if place:
                draft.places[f"temp_{name}"] = {"column": column, **place}
    draft.other = dict(sources[0][1].roles.other)
    return draft


def _gyro(name: str, guess: GyroGuess, choices: Choices, path: Path, placed: bool) -> dict[str, Any]:
    entry: dict[str, Any] = {"name": name} if placed else {"name": name, "column": guess.column}
    entry["axis"] = choices.axis or guess.axis
    unit = choices.unit if choices.unit is not None else guess.unit
    if choices.scale is not None:
        entry["scale"] = choices.scale
    elif unit is not None:
        entry["unit"] = unit
    else:
        what = f"column {guess.column!r} holds whole numbers: counts, whose scale the log does not tell"
        remedy = (
            "give it by --scale, deg/s a count, such as --scale 1/131, 1/65.5, 1/32.8 or 1/16.4 (MPU-6050 and alike at"
            " ±250, 500, 1000, 2000 deg/s) or 0.00875 (L3GD20, LSM6DS at ±245); or by --unit if they are in deg/s"
        )
        raise UsageError(what, str(path), remedy)
    return entry


def _place(
    look: LogLook, source: LogSource, sources: Sequence[tuple[LogLook, LogSource]], several_files: bool
) -> dict[str, Any]:
    """What tells the columns of a source from those of the others; empty where there is one source."""
    place: dict[str, Any] = {}
    if len({one.table.name for _, one in sources}) > 1:
        place["table"] = source.table.name
    if several_files:
        place["file"] = look.path.name
    if source.id is not None:
        place["where"] = {source.roles.id: source.id}
    return place


def _prefix(look: LogLook, source: LogSource, sources: Sequence[tuple[LogLook, LogSource]], several_files: bool) -> str:
    parts = []
    if several_files:
        parts.append(re.sub(r"\..*$", "", look.path.name))
    if len({one.table.name for _, one in sources}) > 1:
        parts.append(source.table.name.strip("/"))
    if source.id is not None:
        parts.append(f"{source.roles.id}{source.id}")
    return "_".join(parts)


def _name(prefix: str, column: str) -> str:
    text = re.sub(r"\W+", "_", f"{prefix}_{column}" if prefix else column, flags=re.ASCII).strip("_")
    return text if re.match(r"[A-Za-z_]", text) else f"g{text}"


def _unique(name: str, names: set[str]) -> str:
    number, chosen = 1, name
    while chosen in names:
        number += 1
        chosen = f"{name}_{number}"
    names.add(chosen)
    return chosen


def log_of(look: LogLook, array: ArrayDraft) -> LogDraft:
    """How the log is to be read."""
    first = look.sources[0]
    tables = {source.table.name for source in look.sources}
    named = len(tables) == 1 and len(look.opened.tables) > 1
    return LogDraft(
        family=look.opened.family,
        table=first.table.name if named else None,
        time=first.roles.time,
        places=dict(array.places),
        there=[_described(column.name, column.unit) for column in first.table.columns],
        form=list(first.table.text),
        unused=list(look.unused),
    )


def _described(name: str, unit: str) -> str:
    return name if not unit or unit in name else f"{name} [{unit}]"
