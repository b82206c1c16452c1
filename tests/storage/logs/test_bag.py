"""Bags: ROS 1, ROS 2 in SQLite and MCAP, compressed or not; two IMUs, types of the bag's own, damage."""

import shutil
import sqlite3
import struct
import tracemalloc

import numpy as np
import pytest
from bag_bytes import CUSTOM, EPOCH, store, write_bag

from vgyro.errors import DataError
from vgyro.storage.logs.binary.bag import open_log

RATES = np.random.default_rng(1).normal(size=(200, 3))
AXES = [f"angular_velocity.{axis}" for axis in "xyz"]
KINDS = [
    ("ros1", ""), ("ros1", "bz2"), ("ros1", "lz4"), ("sqlite", ""), ("sqlite", "message"), ("sqlite", "file"),
    ("mcap", ""), ("mcap", "storage"), ("mcap", "message"),
]  # fmt: skip


@pytest.fixture
def bag(tmp_path):
    def write(kind, rates=RATES, **options):
        return write_bag(tmp_path / ("log.bag" if kind == "ros1" else "log"), kind, rates, **options)

    return write


@pytest.mark.parametrize(("kind", "compression"), KINDS)
def test_two_imus_come_back_bit_for_bit(bag, table, kind, compression):
    log = open_log(bag(kind, compression=compression))
    assert [(one.name, one.rows) for one in log.tables] == [("/imu0", 200), ("/imu1", 200)]
    for name, sign, late in (("/imu0", 1, 0), ("/imu1", -1, 1000)):
        found = table(log, name, "time", "header.stamp", *AXES, "linear_acceleration.z", "orientation_covariance[8]")
        rates = np.stack([found[axis].to_numpy() for axis in AXES], axis=1)
        assert np.array_equal(rates, sign * RATES)
        assert found["time"].to_pylist() == [EPOCH + late + index * 10**7 for index in range(200)]
        assert found["header.stamp"].to_pylist() == [EPOCH + 3 + index * 10**7 for index in range(200)]
        assert found["orientation_covariance[8]"].to_pylist() == [8.0 + index for index in range(200)]
    columns = {one.name: one for one in log.tables[0].columns}
    assert columns["time"].kind == columns["header.stamp"].kind == "date"
    assert columns["angular_velocity.y"].unit == "rad/s"
    assert columns["linear_acceleration.x"].unit == "m/s²"
    assert columns["header.frame_id"].kind == "text"
    assert log.account.notes == []


@pytest.mark.parametrize("kind", ["ros1", "sqlite", "mcap"])
def test_types_that_the_bag_brings(bag, table, kind):
    log = open_log(bag(kind, RATES[:3], custom=True))
    found = table(log, "/array").to_pylist()[2]
    assert [found[f"rates[{k}]"] for k in range(4)] == [2, 1, 2, 3]
    assert [found[f"counts[{k}]"] for k in range(3)] == [2, -2, 7]
    assert (found["note"], found["imu.angular_velocity.x"]) == ("x", RATES[2, 0])
    assert {one.name: one.unit for one in log.tables[2].columns}["imu.angular_velocity.x"] == "rad/s"


def test_arrays_that_get_shorter_or_longer(tmp_path, table):
    from rosbags.rosbag1 import Writer

    types = store(ros1=True)
    name = "std_msgs/msg/Float64MultiArray"
    layout = types.types["std_msgs/msg/MultiArrayLayout"]([], 0)
    with Writer(tmp_path / "log.bag") as writer:
        topic = writer.add_connection("/a", name, typestore=types)
        for index, values in enumerate(([1.0, 2.0], [3.0], [4.0, 5.0, 6.0])):
            message = types.types[name](layout, np.array(values))
            writer.write(topic, EPOCH + index, types.serialize_ros1(message, name))
    found = table(open_log(tmp_path / "log.bag"), "/a", "data[0]", "data[1]")
    assert found.to_pydict() == {"data[0]": [1.0, 3.0, 4.0], "data[1]": [2.0, None, 5.0]}


def test_arrays_of_256_values_are_columns_and_longer_ones_are_not(tmp_path):
    from rosbags.rosbag1 import Writer

    types = store(ros1=True)
    name = "std_msgs/msg/UInt8MultiArray"
    layout = types.types["std_msgs/msg/MultiArrayLayout"]([], 0)
    for length, columns in ((256, 256), (257, 0)):
        path = tmp_path / f"{length}.bag"
        with Writer(path) as writer:
            topic = writer.add_connection("/a", name, typestore=types)
            writer.write(
                topic, EPOCH, types.serialize_ros1(types.types[name](layout, np.zeros(length, np.uint8)), name)
            )
        names = [one.name for one in open_log(path).tables[0].columns]
        assert sum(name.startswith("data[") for name in names) == columns


def test_files_are_known_by_content_whatever_their_name(bag, tmp_path, table):
    folder = bag("sqlite")
    shutil.copy(folder / "log.db3", tmp_path / "a.bin")
    assert table(open_log(tmp_path / "a.bin"), "/imu1", "time").num_rows == 200
    assert table(open_log(folder / "log.db3"), "/imu1", "time").num_rows == 200


def test_an_old_bag_without_definitions_has_those_of_ros(bag, table):
    folder = bag("sqlite", RATES[:5], custom=True)
    with sqlite3.connect(folder / "log.db3") as base:
        base.execute("DROP TABLE schema")
        base.execute("DROP TABLE message_definitions")
    log = open_log(folder / "log.db3")
    assert [one.name for one in log.tables] == ["/imu0", "/imu1"]
    assert np.array_equal(table(log, "/imu0", AXES[0])[AXES[0]].to_numpy(), RATES[:5, 0])
    assert log.account.notes == [
        f"/array ({CUSTOM}) cannot be read: left out (the bag does not say what the message holds)"
    ]


def test_a_definition_that_does_not_fit_its_checksum(bag):
    path = bag("ros1")
    content = path.read_bytes()
    path.write_bytes(content.replace(b"Vector3 angular_velocity\n", b"Vector3 Angular_velocity\n"))
    with pytest.raises(DataError, match="does not fit its checksum"):
        open_log(path)


@pytest.mark.parametrize("compression", ["", "storage"])
def test_an_mcap_that_breaks_off_is_read_to_its_last_chunk(tmp_path, table, compression):
    rates = np.random.default_rng(2).normal(size=(5000, 3))
    folder = write_bag(tmp_path / "log", "mcap", rates, compression=compression)
    content = (folder / "log.mcap").read_bytes()
    path = tmp_path / "cut.mcap"
    path.write_bytes(content[: len(content) * 6 // 10])
    log = open_log(path)
    assert log.account.notes == ["the file breaks off: it is read up to its last whole chunk"]
    found = table(log, "/imu0", AXES[0])[AXES[0]].to_numpy()
    assert 1000 < len(found) < 5000
    assert np.array_equal(found, rates[: len(found), 0])


def test_a_sqlite_bag_that_breaks_off(bag, tmp_path, table):
    folder = bag("sqlite", np.random.default_rng(2).normal(size=(5000, 3)))
    content = (folder / "log.db3").read_bytes()
    (tmp_path / "cut.db3").write_bytes(content[: len(content) // 2])
    with pytest.raises(DataError):
        table(open_log(tmp_path / "cut.db3"), "/imu0")


def test_a_ros1_bag_without_index_names_the_cure(bag, tmp_path):
    content = bag("ros1").read_bytes()
    (tmp_path / "cut.bag").write_bytes(content[:-2000])
    with pytest.raises(DataError, match="rosbag reindex"):
        open_log(tmp_path / "cut.bag")


def test_a_damaged_message_is_a_bad_row(bag):
    folder = bag("sqlite")
    with sqlite3.connect(folder / "log.db3") as base:
        base.execute(
            "UPDATE messages SET data = substr(data, 1, 40) WHERE topic_id = 1 AND timestamp = ?", [EPOCH + 10**7]
        )
    log = open_log(folder)
    (rows,) = log.rows("/imu0", [AXES[0]])
    assert np.array_equal(rows.batch.column(0).to_numpy(), np.delete(RATES[:, 0], 1))
    assert [(one.place, one.expected) for one in rows.bad] == [(2, "sensor_msgs/msg/Imu")]
    assert (log.account.rows, log.account.bad) == (199, 1)


def test_long_bags_are_streamed(tmp_path, monkeypatch):
    monkeypatch.setattr("vgyro.storage.logs.binary.bag.MESSAGES", 500)
    folder = write_bag(tmp_path / "log", "mcap", np.zeros((4000, 3)))
    log = open_log(folder)
    tracemalloc.start()
    counts = [rows.batch.num_rows for rows in log.rows("/imu0", [one.name for one in log.tables[0].columns])]
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert counts == [500] * 8
    assert peak < 30e6


def mcap(profile: bytes, *records: tuple[int, bytes]) -> bytes:
    magic = b"\x89MCAP0\r\n"
    content = struct.pack("<I", len(profile)) + profile + struct.pack("<I", 0)
    parts = [(1, content), *records, (2, bytes(20))]
    return magic + b"".join(struct.pack("<BQ", kind, len(part)) + part for kind, part in parts) + magic


def test_an_mcap_that_is_no_ros2_bag(tmp_path):
    path = tmp_path / "log.mcap"
    for profile, said in ((b"", "profile: none"), (b"ros1", "profile: 'ros1'")):
        path.write_bytes(mcap(profile))
        with pytest.raises(DataError, match=f"{said}.*CSV"):
            open_log(path)


def test_messages_in_json_are_left_out(tmp_path):
    def text(value: bytes) -> bytes:
        return struct.pack("<I", len(value)) + value

    schema = struct.pack("<H", 1) + text(b"gyro") + text(b"") + text(b"{}")
    channel = struct.pack("<HH", 1, 1) + text(b"/gyro") + text(b"json") + text(b"")
    message = struct.pack("<HIQQ", 1, 0, EPOCH, EPOCH) + b'{"x": 1}'
    path = tmp_path / "log.mcap"
    path.write_bytes(mcap(b"ros2", (3, schema), (4, channel), (5, message)))
    with pytest.raises(DataError, match=r"/gyro is in json, not CDR"):
        open_log(path)


def test_files_that_are_none(tmp_path):
    path = tmp_path / "a.bag"
    for content, said in ((b"", "empty"), (b"hello", "no ROS bag"), (b"#ROSBAG V2.0\n", "not a readable ROS bag")):
        path.write_bytes(content)
        with pytest.raises(DataError, match=said):
            open_log(path)
    with pytest.raises(DataError, match=r"without metadata\.yaml"):
        open_log(tmp_path)
