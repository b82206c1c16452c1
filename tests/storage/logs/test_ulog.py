"""ULog: topics, instances, units, FIFO samples, dropouts, damage; bytes written by hand and checked by pyulog."""

import struct

import numpy as np
import pytest
from pyulog import ULog
from ulog_bytes import COMBINED, FIFO, GYRO, SYNC, data, dropout, fifo, gyro, head, message, subscribed

from vgyro.errors import DataError
from vgyro.storage.logs.binary.ulog import open_log

RATES = np.float32(np.random.default_rng(1).normal(size=(200, 3)))
START = head(GYRO, COMBINED, FIFO) + subscribed(0, "sensor_gyro") + subscribed(1, "sensor_gyro", 1)


def body(rates=RATES) -> list[bytes]:
    return [gyro(index % 2, 1000 + 500 * index, *rate) for index, rate in enumerate(rates.tolist())]


@pytest.fixture
def written(tmp_path):
    def write(content: bytes):
        path = tmp_path / "log.ulg"
        path.write_bytes(content)
        return path

    return write


def test_two_instances_come_back_as_pyulog_has_them(written, table):
    path = written(START + b"".join(body()))
    log = open_log(path)
    assert [(one.name, one.rows) for one in log.tables] == [("sensor_gyro", 100), ("sensor_gyro#1", 100)]
    oracle = ULog(str(path))
    assert not oracle.file_corruption
    for instance, name in enumerate(("sensor_gyro", "sensor_gyro#1")):
        found, expected = table(log, name), oracle.get_dataset("sensor_gyro", instance).data
        assert found.column_names == list(expected)
        assert all(np.array_equal(found[field].to_numpy(), expected[field]) for field in expected)
        assert np.array_equal(found["x"].to_numpy(), RATES[instance::2, 0])
    units = {column.name: column.unit for column in log.tables[0].columns}
    assert units == {"timestamp": "us", "device_id": "", "x": "rad/s", "y": "rad/s", "z": "rad/s"}


def test_arrays_have_a_unit_each(written, table):
    log = open_log(written(head(COMBINED) + subscribed(0, "sensor_combined") + data(0, "Qfff", 5, 1.0, 2.0, 3.0)))
    assert [column.unit for column in log.tables[0].columns] == ["us", "rad/s", "rad/s", "rad/s"]
    assert table(log, "sensor_combined").to_pylist() == [
        {"timestamp": 5, "gyro_rad[0]": 1.0, "gyro_rad[1]": 2.0, "gyro_rad[2]": 3.0}
    ]


def test_fifo_messages_are_unrolled(written, table):
    scale = float(np.float32(0.001))
    log = open_log(
        written(
            head(FIFO) + subscribed(0, "sensor_gyro_fifo")
            + fifo(0, 10_000, 250.0, 0.001, [1, -2, 3, 4]) + fifo(0, 10_500, 250.0, 0.001, [5, 6])
        )
    )  # fmt: skip
    found = table(log, "sensor_gyro_fifo")
    assert found["timestamp"].to_pylist() == [9250.0, 9500.0, 9750.0, 10_000.0, 10_250.0, 10_500.0]
    assert found["x"].to_pylist() == [value * scale for value in (1, -2, 3, 4, 5, 6)]
    assert found["device_id"].to_pylist() == [9] * 6
    assert [column.unit for column in log.tables[0].columns] == ["us", "rad/s", "rad/s", "rad/s", ""]


@pytest.mark.parametrize(("claimed", "taken"), [(32, 32), (33, 32), (255, 32), (0, 0)])
def test_a_fifo_message_holds_32_samples_at_most(written, table, claimed, taken):
    whole = bytearray(fifo(0, 10_000, 250.0, 0.001, [1] * 32) + fifo(0, 20_000, 250.0, 0.001, [1]))
    whole[len(fifo(0, 0, 0, 0, [])) - 1] = claimed
    log = open_log(written(head(FIFO) + subscribed(0, "sensor_gyro_fifo") + bytes(whole)))
    assert table(log, "sensor_gyro_fifo").num_rows == taken + 1


def test_dropouts_are_noted(written):
    log = open_log(written(START + b"".join(body()[:4]) + dropout(20) + dropout(150) + b"".join(body()[4:])))
    assert log.account.notes == ["the logger dropped messages 2 times, 170 ms in all, 150 ms at the longest"]


def test_a_log_that_is_cut(written, table):
    log = open_log(written(START + b"".join(body())[:-1]))
    assert log.account.notes == ["the file ends within a message: what is before is taken"]
    assert table(log, "sensor_gyro#1").num_rows == 99
    assert table(log, "sensor_gyro").num_rows == 100


def test_damage_in_the_middle_costs_what_it_covers(written, table):
    parts = body()
    content = bytearray(START + b"".join(parts[:100]) + b"\xff" * 50 + SYNC + b"".join(parts[100:]))
    log = open_log(written(bytes(content)))
    assert table(log, "sensor_gyro").num_rows == table(log, "sensor_gyro#1").num_rows == 100
    assert log.account.notes == ["50 bytes are damaged: what can be read is taken"]


def test_damage_before_the_data_does_not_turn_in_circles(written, table):
    """pyulog goes back by a message's claimed length, though the file ended before: it would never end."""
    trap = struct.pack("<HB", 60_000, ord("?")) + b"x" * 20
    log = open_log(written(head(GYRO) + trap + subscribed(0, "sensor_gyro") + b"".join(body()[::2])))
    assert table(log, "sensor_gyro").num_rows == 100


def test_a_message_that_stops_pyulog_does_not_stop_us(written, table):
    parts = body()
    wrong = message("O", b"\1\2\3")
    path = written(START + b"".join(parts[:100]) + wrong + b"".join(parts[100:]))
    assert len(ULog(str(path)).get_dataset("sensor_gyro").data["x"]) == 50
    assert table(open_log(path), "sensor_gyro").num_rows == 100


def test_messages_that_do_not_fit_their_type_are_left_out(written, table):
    log = open_log(written(START + b"".join(body()) + message("D", b"\0\0" + b"x" * 10)))
    assert table(log, "sensor_gyro").num_rows == 100
    assert log.account.notes == ["sensor_gyro: 1 of 101 messages do not fit their type: left out"]


def test_types_that_hold_each_other_or_too_much(written):
    for formats in (
        ("a:uint64_t timestamp;b x;", "b:a y;"),
        ("a:uint64_t timestamp;b[60000] x;", "b:float[60000] y;"),
        ("a:uint64_t timestamp;float[99999999] x;",),
    ):
        with pytest.raises(DataError, match="claims"):
            open_log(written(head(*formats) + subscribed(0, "a") + data(0, "Q", 1)))


def test_files_that_are_none(written):
    for content, said in (
        (b"", "empty"), (b"ULog", "not a readable ULog"), (head()[:10], "not a readable ULog"),
        (head(GYRO), "no table of numbers"),
        (head(GYRO, flags=bytes(8) + b"\2" + bytes(31)), "newer logger"),
    ):  # fmt: skip
        with pytest.raises(DataError, match=said):
            open_log(written(content))
    assert open_log(
        written(head(GYRO, flags=bytes(8) + b"\1" + bytes(31)) + START[len(head(GYRO, COMBINED, FIFO)) :] + body()[0])
    )
