"""Parquet: values bit for bit, times in ns, lists and structs spread, streamed, damaged."""

import datetime

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from vgyro.errors import DataError
from vgyro.storage.logs.binary.parquet import open_log


@pytest.fixture
def written(tmp_path):
    def write(columns, **options):
        path = tmp_path / "log.parquet"
        pq.write_table(pa.table(columns), path, **options)
        return path

    return write


def test_numbers_come_back_bit_for_bit(written, table):
    rng = np.random.default_rng(1)
    columns = {
        "x": rng.normal(size=999),
        "y": np.float32(rng.normal(size=999)),
        "n": rng.integers(-(2**62), 2**62, 999),
    }
    log = open_log(written(columns, row_group_size=100))
    found = table(log, "")
    assert log.tables[0].rows == 999
    assert all(np.array_equal(found[name].to_numpy(), values) for name, values in columns.items())
    assert found["y"].type == pa.float32()
    assert table(log, "", "n", "x").column_names == ["n", "x"]


@pytest.mark.parametrize(("unit", "factor"), [("s", 10**9), ("ms", 10**6), ("us", 1000), ("ns", 1)])
def test_time_stamps_become_ns_exactly(written, table, unit, factor):
    ticks = [1_700_000_000_123_456_789 // factor, None, 0, -1]
    log = open_log(written({"t": pa.array(ticks, pa.timestamp(unit, "UTC")), "x": [1.0] * 4}))
    assert log.tables[0].columns[0].kind == "date"
    assert table(log, "", "t")["t"].to_pylist() == [tick if tick is None else tick * factor for tick in ticks]


def test_a_time_stamp_out_of_the_range_of_ns_is_refused(written, table):
    last = 9223372036
    fits = open_log(written({"t": pa.array([last], pa.timestamp("s")), "x": [1.0]}))
    assert table(fits, "", "t")["t"].to_pylist() == [last * 10**9]
    beyond = open_log(written({"t": pa.array([last + 1], pa.timestamp("s")), "x": [1.0]}))
    with pytest.raises(DataError, match="cannot be read"):
        table(beyond, "", "t")


def test_times_of_day_and_durations(written, table):
    columns = {
        "day": pa.array([datetime.time(1, 2, 3, 4000)], pa.time32("ms")),
        "fine": pa.array([12_345], pa.time64("ns")),
        "lasted": pa.array([7], pa.duration("ms")),
    }
    log = open_log(written(columns))
    assert [(one.kind, one.unit) for one in log.tables[0].columns] == [("day", ""), ("day", ""), ("number", "ns")]
    assert table(log, "").to_pylist() == [{"day": 3_723_004_000_000, "fine": 12_345, "lasted": 7_000_000}]


def test_lists_structs_texts_truth_and_units(written, table):
    columns = {
        "g": pa.array([[1, 2, 3], None, [4, 5, 6]], pa.list_(pa.float32(), 3)),
        "v": pa.array([[1, 2], [3], []]),
        "imu": pa.array([{"a": 1, "b": {"c": 2.0}}, None, {"a": 3, "b": None}]),
        "name": pa.array(["p", None, "p"]).dictionary_encode(),
        "on": [True, None, False],
        "raw": [b"1", b"2", b"3"],
    }
    made = pa.table(columns)
    schema = made.schema.set(4, pa.field("on", pa.bool_(), metadata={"unit": "1"}))
    log = open_log(written(made.cast(schema)))
    assert table(log, "").to_pydict() == {
        "g[0]": [1, None, 4], "g[1]": [2, None, 5], "g[2]": [3, None, 6], "v[0]": [1, 3, None],
        "v[1]": [2, None, None], "imu.a": [1, None, 3], "imu.b.c": [2.0, None, None], "name": ["p", None, "p"],
        "on": [1, None, 0],
    }  # fmt: skip
    assert {one.name: one.kind for one in log.tables[0].columns}["name"] == "text"
    assert {one.name: one.unit for one in log.tables[0].columns}["on"] == "1"


def test_two_columns_of_one_name_are_told_apart(tmp_path, table):
    path = tmp_path / "twice.parquet"
    pq.write_table(pa.Table.from_arrays([pa.array([1]), pa.array([2])], names=["x", "x"]), path)
    assert table(open_log(path), "").to_pylist() == [{"x": 1, "x#1": 2}]


def test_large_files_are_streamed(written):
    log = open_log(written({"x": np.zeros(600_000)}, row_group_size=1 << 20))
    assert [rows.batch.num_rows for rows in log.rows("", ["x"])] == [1 << 18, 1 << 18, 600_000 - (1 << 19)]
    assert log.account.rows == 600_000


def test_what_is_missing_is_said(written):
    log = open_log(written({"gyro_x": [1.0]}))
    with pytest.raises(DataError, match="did you mean 'gyro_x'"):
        log.rows("", ["gyro_y"])
    with pytest.raises(DataError, match="no table 'imu'"):
        log.rows("imu", ["gyro_x"])


def test_files_that_are_none(tmp_path, written):
    path = tmp_path / "empty.parquet"
    path.write_bytes(b"")
    with pytest.raises(DataError, match="empty: 0 bytes"):
        open_log(path)
    path.write_bytes(written({"x": [1.0]}).read_bytes()[:-10])
    with pytest.raises(DataError, match="not a readable Parquet file"):
        open_log(path)
    with pytest.raises(DataError, match="no table of numbers"):
        open_log(written({"x": ["a"]}))
    with pytest.raises(DataError, match="more than 4096 columns"):
        open_log(written({"x": pa.array([[0.0] * 4097], pa.list_(pa.float64(), 4097))}))
    assert (
        len(open_log(written({"x": pa.array([[0.0] * 4096], pa.list_(pa.float64(), 4096))})).tables[0].columns) == 4096
    )
