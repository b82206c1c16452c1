"""What is each column of a log? By its unit, its name and its values: time, gyros, thermometers, and what to ignore.

A guess for `vgyro new-dataset`, which prints it with the reason; the manifest that it writes decides.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from vgyro.log import RateUnit
from vgyro.storage.logs.intake import TIME_UNITS
from vgyro.storage.logs.table import LogColumn

Kind = Literal[
    "time", "gyro", "temperature", "id", "counter", "acceleration", "magnetic field", "pressure", "angle", "text",
    "other",
]  # fmt: skip

RATE_UNITS: dict[str, RateUnit] = {
    "deg/s": "deg/s", "°/s": "deg/s", "dps": "deg/s", "deg/sec": "deg/s", "degree/s": "deg/s", "degrees/s": "deg/s",
    "deg s-1": "deg/s", "deg.s-1": "deg/s", "º/s": "deg/s", "degps": "deg/s", "rad/s": "rad/s", "rad/sec": "rad/s",
    "rads": "rad/s", "radps": "rad/s", "rps": "rad/s", "rad s-1": "rad/s", "rad s^-1": "rad/s", "mdps": "mdps",
    "mdeg/s": "mdps", "m°/s": "mdps", "deg/h": "deg/h", "°/h": "deg/h", "deg/hr": "deg/h", "dph": "deg/h",
}  # fmt: skip
UNITS: dict[str, Kind] = {
    **dict.fromkeys(("g", "mg", "m/s2", "m/s^2", "m/s²", "m/s/s", "ms-2", "m s-2"), "acceleration"),
    **dict.fromkeys(("ut", "µt", "μt", "t", "gauss", "mgauss", "nt"), "magnetic field"),
    **dict.fromkeys(("pa", "hpa", "kpa", "mbar", "bar"), "pressure"),
    **dict.fromkeys(("c", "°c", "degc", "deg c", "celsius", "ºc"), "temperature"),
    **dict.fromkeys(("deg", "°", "rad"), "angle"),
}
NAMES: tuple[tuple[Kind, str], ...] = (
    ("acceleration", r"a(cc(el(eration|erometer)?)?|ccelero)?[xyz]?\d*|linear"),
    ("magnetic field", r"m(ag(n(etic|etometer)?)?|agneto)?[xyz]?\d*"),
    ("pressure", r"p(ress(ure)?)?\d*|baro(meter)?|alt(itude)?"),
    ("temperature", r"t\d+|te?mp\d*|temperature\d*|temperatur|therm\d*"),
    ("angle", r"q[0-3wxyz]?|quat(ernion)?|roll|pitch|yaw|heading|euler|orientation|angle[xyz]?"),
    ("id", r"id|sensor|sensorid|sensor_id|ch|chan|channel|dev|device|addr|address|node|unit|imu"),
    ("counter", r"n|no|nr|num|number|count|counter|cnt|seq|sequence|index|idx|i|k|sample|samples|frame|packet|row"),
    ("time", r"t|time|times|timestamp|timestamps|stamp|ts|zeit|uhrzeit|date|datetime|epoch|clock|uptime|tick|ticks|"
             r"s|sec|secs|seconds|ms|msec|millis|us|usec|micros|ns|nsec|utc|tow"),
    ("gyro", r"gyros?\w?\d*|gyr\d*|g[xyz]?\d*|w[xyz]?\d*|omega\w?\d*|om[xyz]\d*|(ang(ular)?_?)?(rate|vel(ocity)?)s?\w?\d*|"
             r"rot(ation)?\w?\d*|r[xyz]\d*"),
)  # fmt: skip
ACCELERATION_WORDS = ("acc", "accel", "acceleration", "accelerometer", "linear")
BETTER_TIMES = ("header.stamp", "timestamp_sample", "sample_time", "time_us")
"""Of several columns of time, those of the sensor come first."""

COVARIANCE = re.compile(r"covariance|variance|bias|clip|error|status|device|calib", re.IGNORECASE)
RAD_NOISE = 0.008
"""Noise of a sample below this is that of a MEMS gyro in rad/s; above, in deg/s: 0.004 to 0.03 deg/s/√Hz at 50 to
200 Hz make 0.02 to 0.3 deg/s, which is 0.0003 to 0.005 rad/s."""
AXES = ("x", "y", "z")
FEW_IDS = 64
STEADY = 0.95
CELSIUS = (-60.0, 150.0)


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


def roles_of(columns: Sequence[LogColumn], head: Mapping[str, np.ndarray], table: str = "") -> Roles:
    """Guess the roles of a table's columns.

    head : some rows of the table, column → values (text as objects);  table : its name, which says what is in it where
           the columns have no names of their own
    """
    kinds: dict[str, Kind] = {column.name: _kind_of(column, head[column.name]) for column in columns}
    axes: dict[str, str] = {}
    if not any(kind == "gyro" for kind in kinds.values()):
        about = _kind_of_table(table)
        if about in (None, "gyro"):
            _nameless(columns, head, kinds)
            guessed = [name for name, kind in kinds.items() if kind == "gyro"]
            if about == "gyro" and len(guessed) == len(AXES):
                axes = dict(zip(guessed, AXES, strict=True))
    times = [name for name, kind in kinds.items() if kind == "time"]
    time = min(times, key=lambda name: (_rank(name), list(kinds).index(name)), default=None)
    identity = next((name for name, kind in kinds.items() if kind == "id"), None)
    ids = _ids(head[identity]) if identity is not None else ()
    # Rows of one gyro follow each other only among those of one id.
    rows = slice(None) if identity is None else head[identity] == head[identity][0]
    gyros = tuple(
        GyroGuess(column.name, axes.get(column.name) or axis_of(column.name), *unit_of(column, head[column.name][rows]))
        for column in columns
        if kinds[column.name] == "gyro"
    )
    temperatures = tuple(name for name, kind in kinds.items() if kind == "temperature" and _celsius(head[name]))
    used = {time, identity, *(gyro.column for gyro in gyros), *temperatures}
    other = {name: _say(name, kind, head[name]) for name, kind in kinds.items() if name not in used}
    return Roles(time, gyros, temperatures, identity, ids, other)


def _kind_of_table(name: str) -> Kind | None:
    """What a table holds, by its name; None where that says nothing."""
    words = words_of(name)
    if any(word in ACCELERATION_WORDS for word in words):
        return "acceleration"
    of_sensors = ("gyro", "magnetic field", "pressure", "temperature", "angle")
    return next((kind for word in words for kind, form in NAMES if kind in of_sensors and re.fullmatch(form, word)), None)


def _say(name: str, kind: Kind, values: np.ndarray) -> str:
    if kind == "temperature" and not _celsius(values):
        return f"a temperature in counts (about {np.nanmedian(values):g}): give its scale and offset to use it"
    return "another time" if kind == "time" else kind


def _rank(name: str) -> int:
    return next((place for place, part in enumerate(BETTER_TIMES) if part in name), len(BETTER_TIMES))


def _kind_of(column: LogColumn, values: np.ndarray) -> Kind:
    if column.kind in ("date", "day"):
        return "time"
    words = words_of(column.name)
    by_name = next((kind for kind, pattern in NAMES for word in words if re.fullmatch(pattern, word)), None)
    if column.kind == "text":
        return "id" if by_name == "id" and len(_ids(values)) > 1 else "text"
    unit = column.unit.strip().lower()
    if COVARIANCE.search(column.name):
        return "other"
    if unit in RATE_UNITS:
        return "gyro"
    if unit in UNITS:
        return UNITS[unit]
    if unit in TIME_UNITS:
        return "time" if advances(values) else "other"
    if any(word in ACCELERATION_WORDS for word in words):
        return "acceleration"
    # Later words say more: imu1_gx is a gyro of imu1.
    found = [kind for word in reversed(words) for kind, pattern in NAMES if re.fullmatch(pattern, word)]
    return _fitting(found, values)


def _fitting(found: Sequence[Kind], values: np.ndarray) -> Kind:
    """The first kind that the values allow."""
    for kind in found:
        if kind == "time" and not advances(values):
            if _celsius(values) and np.nanstd(values) < 0.2 * CELSIUS[1]:
                return "temperature"
            continue
        if kind == "counter" and not counts_up(values):
            continue
        if kind == "id" and not 1 < len(_ids(values)) <= FEW_IDS:
            continue
        return kind
    return "other"


def _nameless(columns: Sequence[LogColumn], head: Mapping[str, np.ndarray], kinds: dict[str, Kind]) -> None:
    """No name says what is a gyro: the first column that advances is the time, all others that vary are gyros."""
    timed = any(kind == "time" for kind in kinds.values())
    for column in columns:
        values = head[column.name]
        if column.kind != "number" or kinds[column.name] not in ("other", "counter", "id", "pressure", "magnetic field"):
            continue
        if counts_up(values):
            kinds[column.name] = "counter"
        elif not timed and advances(values):
            kinds[column.name], timed = "time", True
        elif kinds[column.name] == "other" and np.nanstd(values) > 0 and not advances(values):
            kinds[column.name] = "gyro"


def bare_name(name: str) -> str:
    """A column's name without a unit in brackets."""
    return re.sub(r"\s*(\([^)]*\)|\[[^\]]*[^\]\d][^\]]*\])\s*$", "", name) or name


def words_of(name: str) -> list[str]:
    """Words of a column's name, in lower case: "GyroA (deg/s)" → gyroa; "imu1_gx" → imu1, gx."""
    bare = re.sub(r"[(\[][^)\]]*[)\]]", " ", name)
    bare = re.sub(r"(?<=[a-z])(?=[A-Z][a-z])", " ", bare)
    return [word for word in re.split(r"[^A-Za-z0-9µμ]+", bare.lower()) if word]


def axis_of(name: str) -> str:
    """x, y or z where the name ends so or has an index 0, 1, 2; else z: gyros without an axis are one array."""
    index = re.search(r"\[([012])\]$", name)
    if index:
        return "xyz"[int(index.group(1))]
    for word in reversed(words_of(name)):
        if match := re.fullmatch(r"(?:\w*[^a-z])?(?:g|w|om|r|ar|gyro|gyr|rate|omega|rot|vel|velocity)?([xyz])\d*", word):
            return match.group(1)
    return "z"


def unit_of(column: LogColumn, values: np.ndarray) -> tuple[RateUnit | None, str]:
    """Unit of a gyro's column, None for counts, and why."""
    said = RATE_UNITS.get(column.unit.strip().lower())
    if said is not None:
        return said, f"the log says {column.unit}"
    words = words_of(column.name)
    for word in words:
        if word in RATE_UNITS or word in ("deg", "rad"):
            return RATE_UNITS.get(word, "rad/s" if word == "rad" else "deg/s"), f"its name says {word}"
    known = values[np.isfinite(values)]
    if known.size and np.all(known == np.rint(known)):
        return None, "whole numbers: counts"
    steps = np.diff(known)
    noise = float(np.median(np.abs(steps))) / (0.6745 * np.sqrt(2.0)) if steps.size else 0.0
    if noise < RAD_NOISE:
        return "rad/s", f"a guess: its noise is {noise:.2g} from sample to sample, too small for deg/s"
    return "deg/s", f"a guess: its noise is {noise:.2g} from sample to sample, too large for rad/s"


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
