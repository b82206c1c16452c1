"""What is each column of a log? By its unit, its name and its values: time, gyros, thermometers, and what to ignore.

A guess for `vgyro new-dataset`, which prints it with the reason; the manifest that it writes decides.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vgyro.arrays import Floats
from vgyro.log import RateUnit
from vgyro.storage.logs.intake import TIME_UNITS
from vgyro.storage.logs.names import (
    RATE_UNITS,
    UNITS,
    Kind,
    axis_of,
    says_time,
    sensor_of,
    short_kinds,
    unit_in,
    words_of,
)
from vgyro.storage.logs.table import LogColumn

BETTER_TIMES = ("header.stamp", "timestamp_sample", "sample_time", "time_us")
"""Of several columns of time, those of the sensor come first."""
RAD_NOISE = 0.008
"""Noise of a sample below this is that of a MEMS gyro in rad/s; above, in deg/s: 0.004 to 0.03 deg/s/√Hz at 50 to
200 Hz make 0.02 to 0.3 deg/s, which is 0.0003 to 0.005 rad/s."""
UNSURE: tuple[Kind, ...] = ("other", "counter", "id", "pressure", "magnetic field")
FEW_IDS = 64
STEADY = 0.95
CELSIUS = (-60.0, 150.0)
GRAVITY = (9.6, 10.0)
GRAVITY_G = (0.97, 1.03)
GRAVITY_COUNTS = (2048, 4096, 8192, 16384)
"""Length of three columns that are no gyros, whatever they are called: gravity in m/s², in g, and in counts ± 5 %."""


class GyroGuess(NamedTuple):
    """A column that is a gyro. unit: None for counts; why: how the unit is known."""

    column: str
    axis: str
    unit: RateUnit | None
    why: str


@dataclass(frozen=True)
class Roles:
    """What the columns of a table are taken for.

    time, id : names, None where there is none;  ids : values of the id column
    other    : column → what it is taken for, and that it is not used
    """

    time: str | None
    gyros: tuple[GyroGuess, ...]
    temperatures: tuple[str, ...]
    id: str | None
    ids: tuple[int | float | str, ...]
    other: Mapping[str, str]


def roles_of(columns: Sequence[LogColumn], head: Mapping[str, np.ndarray], about: str = "") -> Roles:
    """Guess the roles of a table's columns.

    head  : some rows of the table, column → values (text as objects)
    about : name of the table or file, which says what is in it where the columns have no names of their own
    A doubtful column is no gyro: to be asked is better than a wrong page.
    """
    kinds: dict[str, Kind] = {column.name: _kind_of(column, head[column.name]) for column in columns}
    axes = _sets(columns, head, kinds)
    if not any(kind == "gyro" for kind in kinds.values()):
        sensor = sensor_of(words_of(about))
        if sensor not in ("acceleration", "magnetic field"):
            _nameless(columns, head, kinds)
            guessed = [name for name, kind in kinds.items() if kind == "gyro"]
            if sensor == "gyro" and len(guessed) == 3 and {axis_of(name) for name in guessed} == {"z"}:
                axes |= dict(zip(guessed, "xyz", strict=True))
    times = [name for name, kind in kinds.items() if kind == "time"]
    time = min(times, key=lambda name: (_rank(name), list(kinds).index(name)), default=None)
    identity = next((name for name, kind in kinds.items() if kind == "id"), None)
    ids = _ids(head[identity]) if identity is not None else ()
    # Rows of one gyro follow each other only among those of one id.
    rows = slice(None) if identity is None else head[identity] == head[identity][0]
    found = [column for column in columns if kinds[column.name] == "gyro"]
    units = units_of(found, {column.name: head[column.name][rows] for column in found})
    gyros = tuple(
        GyroGuess(column.name, axes.get(column.name) or axis_of(column.name), *units[column.name]) for column in found
    )
    temperatures = tuple(name for name, kind in kinds.items() if kind == "temperature" and _celsius(head[name]))
    used = {time, identity, *(gyro.column for gyro in gyros), *temperatures}
    other = {name: _say(kind, head[name]) for name, kind in kinds.items() if name not in used}
    return Roles(time, gyros, temperatures, identity, ids, other)


def _say(kind: Kind, values: np.ndarray) -> str:
    if kind == "temperature" and not _celsius(values):
        return f"a temperature in counts (about {np.nanmedian(values):g}): give its scale and offset to use it"
    return "another time" if kind == "time" else kind


def _rank(name: str) -> int:
    return next((place for place, part in enumerate(BETTER_TIMES) if part in name), len(BETTER_TIMES))


def _kind_of(column: LogColumn, values: np.ndarray) -> Kind:
    if column.kind in ("date", "day"):
        return "time"
    words = words_of(column.name)
    if column.kind == "text":
        return "id" if "id" in short_kinds(words) and len(_ids(values)) > 1 else "text"
    sensor = sensor_of(words)
    if sensor == "other":
        return "other"
    unit = unit_in(column.name, column.unit)
    if unit in RATE_UNITS:
        return "gyro" if sensor != "acceleration" else "other"
    if unit in UNITS:
        return UNITS[unit]
    if unit in TIME_UNITS:
        return "time" if advances(values) else "other"
    if says_time(words):
        return _fitting(["time"], values)
    return sensor or _fitting(short_kinds(words), values)


def _fitting(found: Sequence[Kind], values: np.ndarray) -> Kind:
    """The first kind that the values allow."""
    for kind in found:
        if kind == "time" and not advances(values):
            if _celsius(values) and 0 < np.nanstd(values) < 0.2 * CELSIUS[1]:
                return "temperature"
            continue
        if kind == "counter" and not counts_up(values):
            continue
        if kind == "id" and not 1 < len(_ids(values)) <= FEW_IDS:
            continue
        return kind
    return "other"


def _sets(columns: Sequence[LogColumn], head: Mapping[str, np.ndarray], kinds: dict[str, Kind]) -> dict[str, str]:
    """Columns that only together say what they are; corrects their kinds.  returns : gyro → axis

    p, q and r are rates about x, y and z; w, x, y and z of length one are a quaternion.
    """
    numbers = {column.name.lower(): column.name for column in columns if column.kind == "number"}
    if set("wxyz") <= set(numbers):
        length = _length([head[numbers[sign]] for sign in "wxyz"])
        if np.isfinite(length) and abs(length - 1) < 0.01:
            kinds.update(dict.fromkeys((numbers[sign] for sign in "wxyz"), "angle"))
    if set("pqr") <= set(numbers):
        kinds.update(dict.fromkeys((numbers[sign] for sign in "pqr"), "gyro"))
        return {numbers["p"]: "x", numbers["q"]: "y", numbers["r"]: "z"}
    return {}


def _nameless(columns: Sequence[LogColumn], head: Mapping[str, np.ndarray], kinds: dict[str, Kind]) -> None:
    """No name says what is a gyro: the first column that advances is the time, all others that vary are gyros.

    But for three neighbours whose length is that of gravity.
    """
    timed = any(kind == "time" for kind in kinds.values())
    for column in columns:
        values = head[column.name]
        if column.kind != "number" or kinds[column.name] not in (
            "other",
            "counter",
            "id",
            "pressure",
            "magnetic field",
        ):
            continue
        if counts_up(values):
            kinds[column.name] = "counter"
        elif not timed and advances(values):
            kinds[column.name], timed = "time", True
        elif (
            kinds[column.name] == "other"
            and sensor_of(words_of(column.name)) is None
            and unit_in(column.name, column.unit) not in {*UNITS, *TIME_UNITS}
            and varies(values)
            and not advances(values)
        ):
            kinds[column.name] = "gyro"
    guessed = [name for name, kind in kinds.items() if kind == "gyro"]
    for three in (guessed[start : start + 3] for start in range(0, len(guessed) - 2, 3)):
        if is_gravity([head[name] for name in three]):
            kinds.update(dict.fromkeys(three, "acceleration"))


def is_gravity(columns: Sequence[np.ndarray]) -> bool:
    """Is the length of three columns that of gravity, in m/s², g or counts? So are no gyros', but by chance."""
    length = _length(columns)
    if any(low < length < high for low, high in (GRAVITY, GRAVITY_G)):
        return True
    return any(abs(length / counts - 1) < 0.05 for counts in GRAVITY_COUNTS)


def _length(columns: Sequence[np.ndarray]) -> float:
    """Median length of the vector that columns make; NaN where they have no row in common."""
    length = np.sqrt(sum(column.astype(np.float64) ** 2 for column in columns))
    known = length[np.isfinite(length)]
    return float(np.median(known)) if known.size else np.nan


def units_of(columns: Sequence[LogColumn], values: Mapping[str, np.ndarray]) -> dict[str, tuple[RateUnit | None, str]]:
    """Unit of each gyro's column, None for counts, and why. Those whose unit is not written share one guess."""
    units: dict[str, tuple[RateUnit | None, str]] = {}
    silent = []
    for column in columns:
        if (said := _said_unit(column)) is not None:
            units[column.name] = said
        else:
            silent.append(column.name)
    if not silent:
        return units
    if all(_whole(values[name]) for name in silent):
        return units | dict.fromkeys(silent, (None, "whole numbers: counts"))
    noises = [noise for name in silent if (noise := noise_of(values[name])) > 0]
    noise = float(np.median(noises)) if noises else 0.0
    if noise < RAD_NOISE:
        guess: tuple[RateUnit, str] = "rad/s", f"a guess: the noise is {noise:.2g} a sample, too small for deg/s"
    else:
        guess = "deg/s", f"a guess: the noise is {noise:.2g} a sample, too large for rad/s"
    return units | dict.fromkeys(silent, guess)


def _said_unit(column: LogColumn) -> tuple[RateUnit, str] | None:
    unit = unit_in(column.name, column.unit)
    if unit in RATE_UNITS:
        return RATE_UNITS[unit], f"the log says {column.unit.strip() or column.name.split()[-1]}"
    for word in words_of(column.name):
        if word in RATE_UNITS or word in ("deg", "rad"):
            return RATE_UNITS.get(word, "rad/s" if word == "rad" else "deg/s"), f"its name says {word}"
    return None


def _whole(values: np.ndarray) -> bool:
    known = values[np.isfinite(values)]
    return bool(known.size and np.all(known == np.rint(known)))


def noise_of(values: Floats) -> float:
    """Noise of a sample, one sigma, by the steps from sample to sample; of coarse or held values by their r.m.s."""
    steps = np.abs(np.diff(values[np.isfinite(values)].astype(np.float64)))
    if not steps.size:
        return 0.0
    usual = float(np.median(steps)) / 0.6745
    noise: float = (usual or float(np.sqrt(np.mean(steps**2)))) / np.sqrt(2.0)
    return noise


def varies(values: np.ndarray) -> bool:
    """Are not all the values one?"""
    known = values[np.isfinite(values)]
    return bool(known.size and known.max() > known.min())


def advances(values: np.ndarray) -> bool:
    """Do the values go up, but for wraps and restarts?"""
    known = values[np.isfinite(values)] if values.dtype.kind == "f" else values
    if known.size < 2 or known.dtype.kind not in "iuf":
        return False
    up = np.diff(known.astype(np.float64))
    return bool((up >= 0).mean() >= STEADY and (up > 0).any())


def counts_up(values: np.ndarray) -> bool:
    """Do the values go up by one from row to row, but for a few?"""
    if values.dtype.kind not in "iuf" or values.size < 3:
        return False
    return bool((np.diff(values.astype(np.float64)) == 1).mean() >= STEADY)


def _celsius(values: np.ndarray) -> bool:
    if values.dtype.kind not in "iuf" or not np.isfinite(values).any():
        return False
    return CELSIUS[0] <= float(np.nanmin(values)) and float(np.nanmax(values)) <= CELSIUS[1]


def _ids(values: np.ndarray) -> tuple[int | float | str, ...]:
    if values.dtype.kind == "f":
        values = values[np.isfinite(values)]
        if np.all(values == np.rint(values)):
            values = values.astype(np.int64)
    found = np.unique(values.astype(str)) if values.dtype.kind == "O" else np.unique(values)
    return tuple(found[: FEW_IDS + 1].tolist())
