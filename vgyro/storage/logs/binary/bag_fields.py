"""Fields of a ROS message as columns: angular_velocity.x, orientation_covariance[0], header.stamp."""

from __future__ import annotations

import keyword
from collections.abc import Callable, Iterator, Mapping
from itertools import islice
from typing import Any, NamedTuple

import pyarrow as pa

from vgyro.storage.logs.binary.opened import Damaged, Unique
from vgyro.storage.logs.table import Kind, LogColumn

Take = Callable[[Any], Any]
Fields = Mapping[str, Any]
"""Message type → (constants, fields), as rosbags has it: a field is a name and what it holds."""

BASE, NAME, ARRAY = 1, 2, 3
TIME, DURATION = "builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration"
DEEPEST, LONGEST, MOST = 16, 256, 2048
"""Most levels of a message, values of an array that becomes columns (longer ones are pictures), columns of a topic."""
PLACEHOLDER = "structure_needs_at_least_one_member"
TYPES = {
    "bool": pa.uint8(), "byte": pa.int16(), "octet": pa.int16(), "char": pa.uint8(), "int8": pa.int8(),
    "uint8": pa.uint8(), "int16": pa.int16(), "uint16": pa.uint16(), "int32": pa.int32(), "uint32": pa.uint32(),
    "int64": pa.int64(), "uint64": pa.uint64(), "float32": pa.float32(), "float64": pa.float64(),
    "string": pa.string(), "wstring": pa.string(),
}  # fmt: skip
UNITS = {
    ("sensor_msgs/msg/Imu", "angular_velocity"): "rad/s",
    ("sensor_msgs/msg/Imu", "linear_acceleration"): "m/s²",
    ("sensor_msgs/msg/MagneticField", "magnetic_field"): "T",
    ("sensor_msgs/msg/Temperature", "temperature"): "°C",
    ("geometry_msgs/msg/Twist", "angular"): "rad/s",
    ("geometry_msgs/msg/Twist", "linear"): "m/s",
    ("geometry_msgs/msg/Accel", "angular"): "rad/s²",
    ("geometry_msgs/msg/Accel", "linear"): "m/s²",
}
"""Units that the messages' definitions state, of a field and all below it."""


class MessageLeaf(NamedTuple):
    """A column, how it is taken from a message (None where an array is too short), its Arrow type."""

    column: LogColumn
    take: Take
    type: pa.DataType


def leaves_of(msgtype: str, fields: Fields, example: Any) -> list[MessageLeaf]:
    """The columns of a message type, before them the receiver's "time".

    example : a message, which tells how long its arrays of any length are; None: they make no columns
    raises  : KeyError for a type that is not defined, ValueError for types that hold each other
    """
    unique = Unique({"time"})
    found = [
        MessageLeaf(LogColumn(unique(name), kind, unit), take, type_)
        for name, kind, unit, take, type_ in islice(_walk(msgtype, fields, "", example, "", 0), MOST)
    ]
    return found


def has_sequences(msgtype: str, fields: Fields, depth: int = 0) -> bool:
    """Does the type hold arrays of any length?"""
    if depth > DEEPEST:
        raise Damaged(f"message types nested more than {DEEPEST} deep")
    for _, (node, inner) in fields[msgtype][1]:
        if node == NAME:
            if has_sequences(inner, fields, depth + 1):
                return True
        elif node == ARRAY:
            if inner[0][0] == NAME and has_sequences(inner[0][1], fields, depth + 1):
                return True
        elif node != BASE:
            return True
    return False


class _Found(NamedTuple):
    """A column: its name, kind and unit, how it is taken from a message, and its Arrow type."""

    name: str
    kind: Kind
    unit: str
    take: Take
    type: pa.DataType


class _Place(NamedTuple):
    """Where a value stands in a message: its name, how it is taken, the unit above it, how deep it lies."""

    path: str
    take: Take
    unit: str
    depth: int


def _walk(msgtype: str, fields: Fields, prefix: str, example: Any, unit: str, depth: int) -> Iterator[_Found]:
    if depth > DEEPEST:
        raise Damaged(f"message types nested more than {DEEPEST} deep")
    for name, (node, inner) in fields[msgtype][1]:
        if name == PLACEHOLDER:
            continue
        attribute = f"{name}_" if keyword.iskeyword(name) else name
        path, said = f"{prefix}{name}", UNITS.get((msgtype, name), unit)
        below = getattr(example, attribute, None)
        if node in (BASE, NAME):
            single = (node, inner)
            yield from _item(single, fields, _Place(path, _attribute(attribute), said, depth), below)
            continue
        length = inner[1] if node == ARRAY else len(below) if below is not None else 0
        for index in range(length if length <= LONGEST else 0):
            one = below[index] if below is not None and index < len(below) else None
            place = _Place(f"{path}[{index}]", _element(attribute, index), said, depth)
            yield from _item(inner[0], fields, place, one)


def _item(desc: tuple[int, Any], fields: Fields, place: _Place, example: Any) -> Iterator[_Found]:
    (node, inner), (path, take, unit, depth) = desc, place
    if node == BASE:
        if (type_ := TYPES.get(inner[0])) is not None:
            yield _Found(path, "text" if type_ == pa.string() else "number", unit, take, type_)
    elif inner == TIME:
        yield _Found(path, "date", "", _then(take, _ns), pa.int64())
    elif inner == DURATION:
        yield _Found(path, "number", "ns", _then(take, _ns), pa.int64())
    else:
        for name, kind, said, deeper, type_ in _walk(inner, fields, f"{path}.", example, unit, depth + 1):
            yield _Found(name, kind, said, _then(take, deeper), type_)


def _attribute(name: str) -> Take:
    return lambda message: getattr(message, name)


def _element(name: str, index: int) -> Take:
    def take(message: Any) -> Any:
        held = getattr(message, name)
        return held[index] if index < len(held) else None

    return take


def _then(first: Take, second: Take) -> Take:
    def take(message: Any) -> Any:
        found = first(message)
        return None if found is None else second(found)

    return take


def _ns(stamp: Any) -> int:
    ns: int = stamp.sec * 10**9 + stamp.nanosec
    return ns
