"""ULog, the log of PX4: a table a topic, "sensor_gyro", of its second instance "sensor_gyro#1", and so on.

Times are the autopilot's, µs since it started. The samples in a sensor's FIFO messages are unrolled.
"""

from __future__ import annotations

import contextlib
import io
import re
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vgyro.storage.logs.binary.arrays import arrow
from vgyro.storage.logs.binary.opened import (
    OpenedLog,
    batch_of,
    check_not_empty,
    needed,
    reading,
    rows_at_a_time,
)  # fmt: skip
from vgyro.storage.logs.binary.ulog_scan import Contents, copy_needed, fields_of, scan
from vgyro.storage.logs.table import Account, LogColumn, LogRows, LogTable

FIFO = {"sensor_gyro_fifo": "rad/s", "sensor_accel_fifo": "m/s²"}
FIFO_FIELDS = ("timestamp_sample", "dt", "scale", "samples", "x[0]", "y[0]", "z[0]")
UNITS = {
    "sensor_gyro": {"x": "rad/s", "y": "rad/s", "z": "rad/s", "temperature": "°C"},
    "sensor_accel": {"x": "m/s²", "y": "m/s²", "z": "m/s²", "temperature": "°C"},
    "sensor_combined": {"gyro_rad": "rad/s", "accelerometer_m_s2": "m/s²", "gyro_integral_dt": "us"},
    "vehicle_angular_velocity": {"xyz": "rad/s", "xyz_derivative": "rad/s²"},
    "vehicle_angular_velocity_groundtruth": {"xyz": "rad/s", "xyz_derivative": "rad/s²"},
    "vehicle_imu": {"delta_angle": "rad", "delta_velocity": "m/s", "delta_angle_dt": "us", "delta_velocity_dt": "us"},
    "vehicle_acceleration": {"xyz": "m/s²"},
    "sensor_mag": {"x": "G", "y": "G", "z": "G", "temperature": "°C"},
    "sensor_baro": {"pressure": "Pa", "temperature": "°C"},
}
"""Units that PX4's message definitions state, by topic and field."""


def open_log(path: Path) -> OpenedLog:
    """Open a ULog; the headers of its messages are walked through: two seconds a million.

    pyulog loads whole files: reading takes as much memory as the wanted topic's messages, and walks the file once more.
    columns : the message's fields, arrays as name[0] …, those within by dots; "timestamp" is µs since start.
    FIFO topics (sensor_gyro_fifo) have "timestamp" of each sample (µs, a double), x, y, z (scaled), device_id; the
    message's timestamp_sample is the time of its last sample.
    Damaged files: what pyulog reads is given, with a note.
    raises : DataError for a file that is no ULog, or where the library pyulog is missing
    """
    check_not_empty(path)
    with needed("pyulog", "a ULog", path):
        import pyulog  # noqa: F401
    with reading("ULog", path):
        found = scan(path)
    tables: dict[str, LogTable] = {}
    rows: dict[tuple[str, int], int] = {}
    for number, topic in found.topics.items():
        rows[topic] = rows.get(topic, 0) + found.counts.get(number, 0)
    for (name, instance), count in rows.items():
        fields = fields_of(name, found.formats)
        if "timestamp" in fields and len(set(fields)) == len(fields) and count:
            title = f"{name}#{instance}" if instance else name
            fifo = name in FIFO and set(FIFO_FIELDS) <= set(fields)
            columns = _fifo_columns(name, fields) if fifo else _columns(name, fields)
            tables[title] = LogTable(title, columns, None if fifo else count)

    def stream(opened: OpenedLog, table: LogTable, columns: Sequence[str]) -> Iterator[LogRows]:
        return _stream(path, found, table, columns, opened)

    return OpenedLog(path, "ulog", tuple(tables.values()), stream, Account(notes=_notes(found)))


def _notes(found: Contents) -> list[str]:
    notes = []
    if found.dropout_ms:
        total, longest = sum(found.dropout_ms), max(found.dropout_ms)
        times = "once" if len(found.dropout_ms) == 1 else f"{len(found.dropout_ms)} times"
        notes.append(f"the logger dropped messages {times}, {total} ms in all, {longest} ms at the longest")
    if found.cut:
        notes.append("the file ends within a message: what is before is taken")
    if found.damaged:
        notes.append(f"{found.damaged} bytes are damaged: what can be read is taken")
    return notes


def _columns(topic: str, fields: Sequence[str]) -> tuple[LogColumn, ...]:
    units = UNITS.get(topic, {})
    stamps = {name: "us" for name in fields if name in ("timestamp", "timestamp_sample")}
    return tuple(
        LogColumn(name, "number", stamps.get(name) or units.get(re.sub(r"\[\d+\]$", "", name), "")) for name in fields
    )


def _fifo_columns(topic: str, fields: Sequence[str]) -> tuple[LogColumn, ...]:
    axes = tuple(LogColumn(axis, "number", FIFO[topic]) for axis in "xyz")
    device = (LogColumn("device_id"),) if "device_id" in fields else ()
    return (LogColumn("timestamp", "number", "us"), *axes, *device)


def _stream(
    path: Path, found: Contents, table: LogTable, columns: Sequence[str], opened: OpenedLog
) -> Iterator[LogRows]:
    topic, _, instance = table.name.partition("#")
    data = _loaded(path, found, topic, int(instance or 0), found.sound)
    expected = sum(
        found.counts.get(number, 0) for number, one in found.topics.items() if one == (topic, int(instance or 0))
    )
    if found.sound and _messages(data) < expected:
        # pyulog stops without a word at some messages: what it needs is copied out from between them.
        data = _loaded(path, found, topic, int(instance or 0), False)
    if missing := expected - _messages(data):
        opened.account.notes.append(f"{table.name}: {missing} of {expected} messages do not fit their type: left out")
    place = 1
    for fields in data:
        held = _unrolled(fields) if topic in FIFO and set(FIFO_FIELDS) <= set(fields) else fields
        count, size = len(held["timestamp"]), rows_at_a_time(len(columns))
        for start in range(0, count, size):
            stop = min(start + size, count)
            yield LogRows(batch_of(columns, [arrow(held[name][start:stop]) for name in columns]), place + start)
        place += count


def _messages(data: Sequence[dict[str, Any]]) -> int:
    return sum(len(fields["timestamp"]) for fields in data)


def _loaded(path: Path, found: Contents, topic: str, instance: int, whole: bool) -> list[dict[str, Any]]:
    """What pyulog reads of a topic: fields by name. whole: of the file as it is, or of what it needs of it."""
    from pyulog import ULog

    # pyulog prints its warnings; ours are notes.
    with contextlib.redirect_stdout(io.StringIO()), tempfile.TemporaryFile() as copy:
        if not whole:
            copy_needed(path, found, copy)
            copy.seek(0)
        log = ULog(str(path) if whole else copy, message_name_filter_list=[topic])
    return [one.data for one in log.data_list if one.name == topic and one.multi_id == instance]


def _unrolled(fields: dict[str, Any]) -> dict[str, np.ndarray]:
    """The samples of FIFO messages one by one: time in µs, values scaled."""
    room = sum(1 for name in fields if re.fullmatch(r"x\[\d+\]", name))
    samples = np.minimum(fields["samples"].astype(np.int64), room)
    message = np.repeat(np.arange(len(samples)), samples)
    index = np.arange(len(message)) - np.repeat(np.cumsum(samples) - samples, samples)
    before = (samples[message] - 1 - index) * fields["dt"].astype(np.float64)[message]
    made = {"timestamp": fields["timestamp_sample"].astype(np.float64)[message] - before}
    scale = fields["scale"].astype(np.float64)[message]
    for axis in "xyz":
        block = np.stack([fields[f"{axis}[{place}]"] for place in range(room)], axis=1)
        made[axis] = block[message, index] * scale
    if "device_id" in fields:
        made["device_id"] = fields["device_id"][message]
    return made
