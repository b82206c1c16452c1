"""Which columns make a stream, and rows kept aside: bounds, types, and the folder on disk."""

import gc
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from vgyro.errors import DataError
from vgyro.log import Log, LogArray, board_of_log
from vgyro.storage.logs import spool as spools
from vgyro.storage.logs.families import open_log
from vgyro.storage.logs.spool import Spool
from vgyro.storage.logs.streams import streams_of, table_of

MIB = 1 << 20
ROWS = ("0,1,2,25", "0.01,1,2,25", "0.02,2,3,25")
TWO = [{"name": "g1", "axis": "z", "unit": "deg/s"}, {"name": "g2", "axis": "z", "unit": "deg/s"}]


def write(path: Path, header: str, *rows: str) -> Path:
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


def streams(paths, log: dict, array: dict):
    made = LogArray(**array)
    heads = {path: open_log(path, Log()) for path in paths}
    return streams_of(paths, Log(**log), board_of_log(made, "log", ""), made, heads)


def test_columns_of_one_table_are_one_stream(tmp_path):
    path = write(tmp_path / "a.csv", "t,g1,g2,near", *ROWS)
    (stream,) = streams([path], {"time": "t"}, {"gyros": TWO, "temperatures": [{"name": "near"}]})
    assert stream.columns == {"g1": "g1", "g2": "g2", "temp_near": "near"}
    assert (stream.files, stream.where, stream.name) == ((path,), (), "a.csv")


def test_files_and_ids_make_streams_in_the_order_of_the_gyros(tmp_path):
    paths = [write(tmp_path / f"{name}.csv", "t,id,g", *("0,1,2", "1,2,3", "2,1,4")) for name in "ab"]
    columns = {
        "g1": {"column": "g", "file": "b.csv", "where": {"id": 2}},
        "g2": {"column": "g", "file": "a.*", "where": {"id": 1}},
    }
    one, two = streams(paths, {"time": "t", "columns": columns}, {"gyros": TWO})
    assert (one.files, one.where, one.name) == ((paths[1],), (("id", 2),), "b.csv id = 2")
    assert (two.files, two.where, two.name) == ((paths[0],), (("id", 1),), "a.csv id = 1")


def test_a_thermometer_that_a_board_has_and_the_log_has_not_is_left_out(tmp_path):
    path = write(tmp_path / "a.csv", "t,g1,g2,x", *ROWS)
    board = board_of_log(LogArray(gyros=TWO, temperatures=[{"name": "near"}]), "log", "")
    (stream,) = streams_of([path], Log(time="t"), board, None, {path: open_log(path, Log())})
    assert set(stream.columns) == {"g1", "g2"}


@pytest.mark.parametrize(("array", "message"), [
    ({"gyros": [{"name": "g3", "axis": "z", "unit": "deg/s"}]}, "has no column 'g3'; known: t, g1, g2, near"),
    ({"gyros": TWO[:1], "temperatures": [{"name": "near", "column": "nere"}]},
     "has no column 'nere'; did you mean 'near'"),
])  # fmt: skip
def test_a_column_that_is_not_there(tmp_path, array, message):
    path = write(tmp_path / "a.csv", "t,g1,g2,near", *ROWS)
    with pytest.raises(DataError, match=message):
        streams([path], {"time": "t"}, array)


def test_text_may_tell_rows_apart_and_be_no_reading(tmp_path):
    path = write(tmp_path / "a.csv", "t,side,g1", "0,left,1.5", "1,right,2.5", "2,left,3.5")
    log = open_log(path, Log())
    assert table_of(log, None, ["t", "g1"], ["side"]).name == ""
    with pytest.raises(DataError, match="column 'side' holds text, not numbers"):
        table_of(log, None, ["t", "side"])


def test_a_column_of_several_tables_asks_for_one(tmp_path):
    path = write(tmp_path / "a.txt", "IMU,0,1.5", "MAG,0,2.5", "IMU,1,1.25", "MAG,1,2.25")
    with pytest.raises(DataError, match=r"has several tables with a column 'c2': IMU, MAG. Name one: `table`"):
        streams([path], {"time": "c1"}, {"gyros": [{"name": "g", "column": "c2", "axis": "z", "unit": "deg/s"}]})


@pytest.mark.parametrize(("rows", "on_disk"), [(1000, False), (1001, True)])
def test_rows_beyond_the_bound_go_to_disk_and_come_back(monkeypatch, tmp_path, rows, on_disk):
    monkeypatch.setattr(spools, "MOST_IN_MEMORY", 8000)
    monkeypatch.setattr(spools.tempfile, "tempdir", str(tmp_path))
    spool, values = Spool(), np.random.default_rng(1).standard_normal(rows)
    for start in range(0, rows, 100):
        spool.append({"a": values[start : start + 100]})
    assert spool.rows == rows
    assert bool(list(tmp_path.iterdir())) == on_disk
    for _ in range(2):
        assert np.array_equal(np.concatenate([block["a"] for block in spool.blocks(["a"])]), values)
    del spool
    gc.collect()
    assert not list(tmp_path.iterdir())


def test_the_folder_goes_where_reading_ends_by_an_error(monkeypatch, tmp_path):
    monkeypatch.setattr(spools, "MOST_IN_MEMORY", 0)
    monkeypatch.setattr(spools.tempfile, "tempdir", str(tmp_path))

    def fails():
        spool = Spool()
        spool.append({"a": np.arange(10)})
        assert len(list(tmp_path.iterdir())) == 1
        raise DataError("stops")

    with pytest.raises(DataError):
        fails()
    gc.collect()
    assert not list(tmp_path.iterdir())


def test_a_column_has_the_type_that_holds_all_its_blocks(monkeypatch):
    monkeypatch.setattr(spools, "MOST_IN_MEMORY", 30)
    spool = Spool()
    spool.append({"a": np.array([1, 2], np.int16), "b": np.array([1, 2], np.int64)})
    spool.append({"a": np.array([3, 70_000], np.int32), "b": np.array([0.5, np.nan])})
    spool.append({"a": np.array([], np.int32), "b": np.array([])})
    blocks = list(spool.blocks(["b", "a"]))
    assert [block["a"].dtype for block in blocks] == [np.int32] * 2
    assert [block["b"].dtype for block in blocks] == [np.float64] * 2
    assert np.concatenate([block["a"] for block in blocks]).tolist() == [1, 2, 3, 70_000]


def test_ten_million_rows_stay_below_the_bound(monkeypatch, tmp_path):
    monkeypatch.setattr(spools.tempfile, "tempdir", str(tmp_path))
    block, rows = 1 << 17, 0
    tracemalloc.start()
    try:
        spool = Spool()
        while rows < 10_000_000:
            spool.append({name: np.arange(rows, rows + block, dtype=np.float64) for name in "abc"})
            rows += block
        total = sum(float(part["b"].sum()) for part in spool.blocks(["b"]))
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert total == pytest.approx(rows * (rows - 1) / 2, rel=1e-12)
    # What stays in memory, and a few blocks on their way.
    assert peak < spools.MOST_IN_MEMORY + 10 * MIB
