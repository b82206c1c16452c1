"""Real recordings: the decoded packets equal the table that others made of the same capture."""

import numpy as np
import pyarrow.parquet as pq
import pytest

from vgyro.config import IntegrityOptions
from vgyro.dataset import Recording
from vgyro.log import Log
from vgyro.storage import decode_dump, open_recording
from vgyro.storage.dumps.sniff import all_boards, sniff
from vgyro.storage.frames import gather


@pytest.mark.parametrize(("name", "packets"), [("exp_1", 37_439), ("exp_2", 39_301)])
def test_mimu_captures_equal_the_parquet_beside_them(shared_data, board, name, packets):
    folder = shared_data / "mimu4444-array"
    result = decode_dump([folder / f"{name}_data.bin"], board("mimu4444"))
    table = pq.read_table(folder / f"{name}.parquet")
    assert table.num_rows == packets == len(result.counter)
    assert np.array_equal(result.counter % 65536, table["packet"].to_numpy())
    assert np.array_equal(result.counts["ticks"], table["t_ticks"].to_numpy())
    for column in table.column_names[2:]:
        assert np.array_equal(result.counts[column], table[column].to_numpy())
    record = result.integrity
    assert (record.gaps, record.frames.lost, record.segments) == ([], 0, 1)
    # The acknowledgement A0 28 00 C8 stands before the first packet.
    assert (record.damage[0].start, record.damage[0].stop, record.damage[0].cause) == (0, 4, "leading bytes")
    assert record.measured_rate_hz == pytest.approx(62.5, rel=1e-6)


def test_sniff_knows_the_mimu(shared_data, boards):
    best = sniff(shared_data / "mimu4444-array" / "exp_1_data.bin", all_boards(boards))[0]
    assert best.board == "mimu4444"
    assert best.rate_hz == pytest.approx(62.5, rel=1e-5)


def test_adis_log(shared_data, board):
    path = shared_data / "adis16405-static" / "rec4.parquet"
    recording = Recording(name="rec4", kind="static", files=("rec4.parquet",), log=Log())
    reader = open_recording([path], recording, board("adis16405"), IntegrityOptions())
    frames = gather(reader, board("adis16405"))
    table = pq.read_table(path)
    for column in table.column_names:
        assert np.array_equal(frames.counts[column], table[column].to_numpy())
    assert reader.integrity.duration_s == pytest.approx(10_000)
    assert reader.integrity.frames.good == 1_000_000
