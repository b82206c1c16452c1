"""Tables written in batches and read in parts."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from vgyro.storage.tables import Provenance, TableWriter, read_batches, read_columns, read_rows

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


def test_batches_are_the_whole_table_in_order(table):
    whole = read_columns(table)
    np.testing.assert_array_equal(whole["note"], STATUS)
    batches = list(read_batches(table, ["dc_gain", "note"]))
    np.testing.assert_array_equal(np.concatenate([batch["dc_gain"] for batch in batches]), GAIN)
    np.testing.assert_array_equal(np.concatenate([batch["note"] for batch in batches]), STATUS)


def test_numbers_are_stored_by_their_bytes_and_words_by_a_dictionary(table):
    group = pq.ParquetFile(table).metadata.row_group(0)
    encodings = {group.column(i).path_in_schema: group.column(i).encodings for i in range(group.num_columns)}
    assert "BYTE_STREAM_SPLIT" in encodings["dc_gain"]
    assert "RLE_DICTIONARY" in encodings["note"]
