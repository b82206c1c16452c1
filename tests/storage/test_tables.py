"""Tables written in batches and read in parts."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from vgyro.storage.tables import Provenance, RowStream, TableWriter, read_columns, read_rows, row_groups, words

GAIN = np.arange(25) / 8
STATUS = np.array(["ok", "too short"], dtype=object)[np.arange(25) % 3 // 2]


@pytest.fixture
def table(tmp_path):
    """Three row groups of 10, 10 and 5 rows."""
    path = tmp_path / "methods.parquet"
    with TableWriter(path, "methods", Provenance({}, "", "")) as writer:
        for start in (0, 10, 20):
            codes = (np.arange(25) % 3 // 2).astype(np.int32)[start : start + 10]
            status = pa.DictionaryArray.from_arrays(codes, ["ok", "too short"])
            writer.append({"dc_gain": GAIN[start : start + 10], "note": status})
    return path


@pytest.mark.parametrize(("start", "stop"), [(0, 25), (3, 7), (9, 11), (10, 20), (4, 23), (24, 25), (7, 7), (20, 99)])
def test_rows_are_those_of_the_whole_table(table, start, stop):
    rows = read_rows(table, ["note", "dc_gain"], start, stop)
    np.testing.assert_array_equal(rows["dc_gain"], GAIN[start:stop])
    np.testing.assert_array_equal(rows["note"], STATUS[start:stop])


def test_row_groups_and_streams_are_the_whole_table_in_order(table):
    whole = read_columns(table)
    np.testing.assert_array_equal(whole["note"], STATUS)
    parts = [part.column("dc_gain").to_numpy() for part in row_groups(table, ["dc_gain"])]
    assert [len(part) for part in parts] == [10, 10, 5]
    np.testing.assert_array_equal(np.concatenate(parts), GAIN)
    assert [part.num_rows for part in row_groups(table, first=1, every=2)] == [10]
    stream = RowStream(row_groups(table))
    taken = [stream.take(count) for count in (3, 0, 12, 50, 4)]
    assert [part.num_rows for part in taken] == [3, 0, 12, 10, 0]
    np.testing.assert_array_equal(pa.concat_tables(taken).column("dc_gain").to_numpy(), GAIN)
    with pytest.raises(ValueError, match="no table"):
        RowStream([]).take(1)


def test_words_hold_only_what_occurs():
    column = words(np.array([3, 1, 3, 3]), ["ok", "no model yet", "failed", "alone"])
    assert column.to_pylist() == ["alone", "no model yet", "alone", "alone"]
    assert column.dictionary.to_pylist() == ["alone", "no model yet"]
    twice = words(np.array([0, 2]), ["ok", "x", "ok"])
    assert twice.dictionary.to_pylist() == ["ok"]
    assert words(np.empty(0, dtype=np.uint8), ["ok"]).to_pylist() == []


def test_numbers_are_stored_by_their_bytes_and_words_by_a_dictionary(table):
    group = pq.ParquetFile(table).metadata.row_group(0)
    encodings = {group.column(i).path_in_schema: group.column(i).encodings for i in range(group.num_columns)}
    assert "BYTE_STREAM_SPLIT" in encodings["dc_gain"]
    assert "RLE_DICTIONARY" in encodings["note"]
