"""Bags of ROS 1 and ROS 2 (SQLite, MCAP): a table a topic, a row a message.

"time" is the receiver's, when the message was written down; "header.stamp" is the sender's. Both are ns since 1970.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa

from vgyro.storage.logs.binary.bag_fields import ARRAY, MessageLeaf, has_sequences, leaves_of
from vgyro.storage.logs.binary.bag_files import MCAP, ROS1, check_profile, kind_of, readable, whole_mcap
from vgyro.storage.logs.binary.opened import (  # fmt: skip
    DAMAGE,
    Damaged,
    Errors,
    OpenedLog,
    Unique,
    batch_of,
    check_not_empty,
    needed,
    reading,
    reason,
    until_damage,
)
from vgyro.storage.logs.table import Account, BadLine, LogColumn, LogRows, LogTable

MESSAGES = 1 << 15
MOST_BAD = 1000
LONGEST_ARRAY = 1 << 16
TIME = LogColumn("time", "date")


@dataclass(frozen=True)
class Topic:
    """A topic of one message type: numbers of its connections, what reads its messages, and its columns."""

    msgtype: str
    connections: frozenset[int]
    store: Any
    leaves: dict[str, MessageLeaf]


def open_log(path: Path) -> OpenedLog:
    """Open a .bag, a folder of a ROS 2 bag, an .mcap or a .db3; rosbags reads its index.

    columns : "time", then the message's fields by dots; arrays as name[0] …, those of any length as long as in the
              first message, and null where a later one is shorter; stamps as ns since 1970; units where ROS fixes them
    Message types come with the bag; where an old SQLite bag has none, those of ROS itself are known. Topics without
    numbers are left out; so are pictures and other long arrays. Messages are streamed by "time"; the index of a ROS 1
    bag is in memory, about 150 bytes a message. An MCAP that breaks off is read up to its last whole chunk.
    raises : DataError for a file that is no bag, whose index is damaged, or where the library rosbags is missing
    """
    check_not_empty(path)
    kind = kind_of(path)
    if kind == MCAP:
        check_profile(path)
    with needed("rosbags", "a ROS bag", path):
        errors = _errors()
    notes: list[str] = []
    topics: dict[str, Topic] = {}
    tables: list[LogTable] = []
    what = "ROS bag; `rosbag reindex` mends one that was not closed" if kind == ROS1 else "ROS bag"
    with reading(what, path, errors), _reader(path, kind) as reader:
        unique = Unique()
        for name, group in _grouped(reader.connections).items():
            topic = _topic(name[0], group, reader, kind == ROS1, notes, errors)
            if topic and any(leaf.column.kind == "number" for leaf in topic.leaves.values()):
                table = LogTable(
                    unique(name[0]), (TIME, *(leaf.column for leaf in topic.leaves.values())), _count(group)
                )
                topics[table.name] = topic
                tables.append(table)

    def stream(opened: OpenedLog, table: LogTable, columns: Sequence[str]) -> Iterator[LogRows]:
        return _stream(path, kind, topics[table.name], columns, opened)

    if kind == MCAP and whole_mcap(path) is not None:
        notes.append("the file breaks off: it is read up to its last whole chunk")
    return OpenedLog(path, "bag", tuple(tables), stream, Account(notes=notes), errors=errors)


def _errors() -> Errors:
    """What rosbags and the libraries under it raise."""
    import apsw
    from rosbags.rosbag1 import ReaderError as Error1
    from rosbags.rosbag2 import ReaderError as Error2
    from rosbags.serde import SerdeError
    from rosbags.typesys import TypesysError
    from ruamel.yaml.error import YAMLError

    if sys.version_info >= (3, 14):
        from compression.zstd import ZstdError
    else:
        from backports.zstd import ZstdError
    return (Error1, Error2, SerdeError, TypesysError, apsw.Error, YAMLError, ZstdError)


@contextmanager
def _reader(path: Path, kind: bytes) -> Iterator[Any]:
    if kind == ROS1:
        from rosbags.rosbag1 import Reader
    else:
        from rosbags.rosbag2 import Reader
    with readable(path, kind) as named, Reader(named) as reader:
        yield reader


def _grouped(connections: Sequence[Any]) -> dict[tuple[str, str, str], list[Any]]:
    groups: dict[tuple[str, str, str], list[Any]] = {}
    for one in connections:
        groups.setdefault((one.topic, one.msgtype, one.msgdef.data), []).append(one)
    return groups


def _count(group: Sequence[Any]) -> int:
    return sum(one.msgcount for one in group)


def _topic(name: str, group: Sequence[Any], reader: Any, ros1: bool, notes: list[str], errors: Errors) -> Topic | None:
    """What is needed to read a topic; None, and a note, where its type is not known or damaged."""
    first = group[0]
    encoding = "ros1" if ros1 else first.ext.serialization_format
    if encoding not in ("ros1", "cdr"):
        notes.append(f"{name} is in {encoding}, not CDR: left out")
        return None
    try:
        store = _store(first, ros1)
        example = None
        if has_sequences(first.msgtype, store.fielddefs):
            _, _, data = next(reader.messages(group), (None, 0, None))
            example = None if data is None else _message(store, data, first.msgtype, ros1)
        leaves = leaves_of(first.msgtype, store.fielddefs, example)
    except (*DAMAGE, *errors) as error:
        notes.append(f"{name} ({first.msgtype}) cannot be read: left out ({reason(error)})")
        return None
    return Topic(first.msgtype, frozenset(one.id for one in group), store, {leaf.column.name: leaf for leaf in leaves})


def _store(connection: Any, ros1: bool) -> Any:
    """The message types of a connection.

    raises : what rosbags raises on a damaged definition; ValueError for one that does not fit its checksum
    """
    from rosbags.interfaces import MessageDefinitionFormat as Format
    from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

    definition, msgtype = connection.msgdef, connection.msgtype
    if definition.format == Format.NONE:
        store = get_typestore(Stores.LATEST)
        if msgtype not in store.fielddefs:
            raise Damaged("the bag does not say what the message holds")
        return store
    types: dict[str, Any] = {}
    if definition.format == Format.MSG:
        types.update(get_types_from_msg(definition.data, msgtype))
    else:
        mark = "=" * 80 + "\nIDL: "
        for part in (
            definition.data.removeprefix(mark).split(mark) if mark in definition.data else [f"\n{definition.data}"]
        ):
            types.update(get_types_from_idl(part.partition("\n")[2]))
    for _, fields in types.values():
        for _, (node, inner) in fields:
            if node == ARRAY and inner[1] > LONGEST_ARRAY:
                raise Damaged(f"an array of {inner[1]} values in every message")
    store = get_typestore(Stores.EMPTY)
    store.register(types)
    has_sequences(msgtype, store.fielddefs)
    digest = connection.digest
    if digest and digest != "*":
        found = store.generate_msgdef(msgtype)[1] if ros1 else store.hash_rihs01(msgtype)
        if found != digest:
            raise Damaged("its definition does not fit its checksum")
    return store


def _message(store: Any, data: bytes, msgtype: str, ros1: bool) -> Any:
    return store.deserialize_ros1(data, msgtype) if ros1 else store.deserialize_cdr(data, msgtype)


def _stream(path: Path, kind: bytes, topic: Topic, columns: Sequence[str], opened: OpenedLog) -> Iterator[LogRows]:
    leaves = [topic.leaves.get(name) for name in columns]
    types = [pa.int64() if leaf is None else leaf.type for leaf in leaves]
    held: list[list[Any]] = [[] for _ in columns]
    bad: list[BadLine] = []
    place, known = 1, 0

    def block() -> LogRows:
        arrays = [pa.array(values, type_) for values, type_ in zip(held, types, strict=True)]
        return LogRows(batch_of(columns, arrays), place, tuple(bad))

    with _reader(path, kind) as reader:
        group = [one for one in reader.connections if one.id in topic.connections]
        count = 0
        for _, time, data in until_damage(reader.messages(group), opened.errors, opened.broken):
            try:
                message = _message(topic.store, data, topic.msgtype, kind == ROS1)
                row = [_checked(time) if leaf is None else leaf.take(message) for leaf in leaves]
            except (*DAMAGE, *opened.errors) as error:
                known += 1
                if known <= MOST_BAD:
                    bad.append(BadLine(place + count, f"{len(data)} bytes ({reason(error)})", topic.msgtype))
                else:
                    opened.account.bad += 1
                count += 1
                continue
            for values, value in zip(held, row, strict=True):
                values.append(value)
            count += 1
            if count == MESSAGES:
                yield block()
                place, count, bad = place + count, 0, []
                held = [[] for _ in columns]
        if count:
            yield block()


def _checked(time: int) -> int:
    if not 0 <= time < 1 << 63:
        raise Damaged(f"a time of {time} ns")
    return time
