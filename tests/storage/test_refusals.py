"""What is not a usable dump: one clear message each, with file, byte and what to do."""

import gzip
import json
import pickle

import numpy as np
import pyarrow as pa
import pytest
from storage_frames import dsp6_stream, mimu_stream

from vgyro.config import IntegrityOptions
from vgyro.dataset import Recording
from vgyro.errors import ConfigError, DataError
from vgyro.storage import Refused, decode_dump, open_recording
from vgyro.storage.decode import ReaderOptions
from vgyro.storage.sources import open_sources

DSP6 = b"".join(dsp6_stream(300)[0])


def refused(paths, board) -> str:
    with pytest.raises(DataError) as caught:
        decode_dump(paths, board)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)
    return str(caught.value)


def test_empty_file(dump, board):
    path = dump(b"", "nothing.bin")
    message = refused([path], board("dsp6"))
    assert message.startswith(f"{path}: is empty: 0 bytes")


def test_missing_file_lists_what_is_there(dump, board, tmp_path):
    dump(DSP6, "static1.bin")
    message = refused([tmp_path / "statik1.bin"], board("dsp6"))
    assert "did you mean 'static1.bin'?" in message
    assert f"{tmp_path} holds static1.bin" in message
    assert "its folder does not exist" in refused([tmp_path / "no" / "x.bin"], board("dsp6"))


def test_a_file_of_another_board_names_that_board(dump, board, boards):
    path = dump(b"".join(mimu_stream(100)[0]))
    recording = Recording(name="a", kind="static", files=("x",))
    reader = open_recording([path], recording, board("dsp6"), IntegrityOptions(), reading=ReaderOptions(boards=boards))
    with pytest.raises(Refused) as caught:
        list(reader)
    message = str(caught.value)
    assert message.startswith(f"{path}: no good frame of board dsp6 in 10600 bytes")
    assert "reads as board mimu4444" in message
    assert caught.value.integrity.status == "refused"
    assert message in caught.value.integrity.reasons


def test_noise_is_no_board(dump, board):
    path = dump(np.random.default_rng(1).bytes(50_000))
    assert "no good frame of board dsp6 in 50000 bytes" in refused([path], board("dsp6"))


def test_too_few_good_frames(dump, board):
    frames, _ = dsp6_stream(300)
    data = bytearray(b"".join(frames))
    for index in range(0, 300, 3):
        data[30 * index + 9] ^= 1
        data[30 * index + 39] ^= 1
    message = refused([dump(bytes(data))], board("dsp6"))
    assert "only 33" in message
    assert "min_good_share = 50 %" in message
    assert "from byte 0 of dump.bin on" in message


def test_a_few_frames_in_much_noise_are_refused(dump, board):
    data = DSP6[:300] + np.random.default_rng(1).bytes(100_000)
    assert "of the frames are good" in refused([dump(data)], board("dsp6"))


def test_one_long_gap_is_named_in_the_remedy(dump, board):
    frames, _ = dsp6_stream(600)
    message = refused([dump(b"".join(frames[:100] + frames[500:]))], board("dsp6"))
    assert "ost are missing in one gap at 0.5 s: make two recordings of it" in message


def test_truncated_file_keeps_what_is_whole(dump, board):
    record = decode_dump([dump(DSP6[:-13])], board("dsp6")).integrity
    assert record.frames.good == 299
    (entry,) = record.damage
    assert (entry.start, entry.stop, entry.cause) == (299 * 30, 300 * 30 - 13, "truncated at the end")


def test_boot_text_and_a_start_in_mid_frame(dump, board):
    record = decode_dump([dump(b"BOOT v1.2 OK\r\n" + DSP6[17:])], board("dsp6")).integrity
    assert (record.frames.good, record.status) == (299, "good")
    assert record.damage[0].cause == "leading bytes"


def test_parquet_file_and_folder_are_no_dumps(board, tmp_path):
    import pyarrow.parquet as pq

    pq.write_table(pa.table({"x": [1]}), tmp_path / "a.parquet")
    assert "is a Parquet file, not a dump" in refused([tmp_path / "a.parquet"], board("dsp6"))
    assert "is a folder" in refused([tmp_path], board("dsp6"))


def test_board_without_frame(dump, board):
    with pytest.raises(ConfigError, match="only as logs"):
        decode_dump([dump(DSP6)], board("adis16405"))


@pytest.mark.parametrize("kind", ["gzip", "zstd", "two members"])
def test_compressed_dumps_are_told_by_their_content(dump, board, kind):
    packed = {
        "gzip": lambda: gzip.compress(DSP6),
        "zstd": lambda: pa.Codec("zstd").compress(DSP6).to_pybytes(),
        "two members": lambda: gzip.compress(DSP6[:1000]) + gzip.compress(DSP6[1000:]),
    }[kind]()
    result = decode_dump([dump(packed, "no_extension")], board("dsp6"))
    assert np.array_equal(result.counts["g1"], decode_dump([dump(DSP6)], board("dsp6")).counts["g1"])
    file = result.integrity.files[0]
    assert (file.bytes, file.content_bytes) == (len(packed), len(DSP6))
    assert result.integrity.warnings == []


@pytest.mark.parametrize("kind", ["gzip", "zstd"])
def test_a_compressed_dump_that_breaks_off(dump, board, kind):
    data = b"".join(dsp6_stream(20_000)[0])
    packed = gzip.compress(data) if kind == "gzip" else pa.Codec("zstd").compress(data).to_pybytes()
    result = decode_dump([dump(packed[: len(packed) * 2 // 3])], board("dsp6"))
    assert result.integrity.frames.good > 5_000
    assert any("break off" in text for text in result.integrity.warnings)


def test_large_blocks_of_gzip_are_unpacked_in_pieces(dump):
    # A megabyte of zeros is 1 kB packed: one read of it must not fill the memory.
    path = dump(gzip.compress(bytes(1 << 20)))
    blocks = list(open_sources([path]).chunks(1 << 12))
    assert max(map(len, blocks)) <= 1 << 12
    assert sum(map(len, blocks)) == 1 << 20


def test_the_record_is_json_and_caps_its_lists(dump, board):
    frames, _ = dsp6_stream(6000)
    data = bytearray(b"".join(frames))
    for index in range(2, 6000, 4):
        data[30 * index + 9] ^= 1
    record = decode_dump([dump(bytes(data))], board("dsp6")).integrity
    plain = json.loads(json.dumps(record.to_json(), allow_nan=False))
    assert len(plain["damage"]) == len(plain["gaps"]) == 1000
    assert plain["damage_not_listed"] == {"entries": 500, "bytes": 500 * 30, "frames_lost": 500}
    assert plain["gaps_not_listed"] == {"entries": 500, "frames_lost": 500}
    assert plain["frames"]["lost"] == 1500


@pytest.mark.parametrize("damaged", ["missing", "empty"])
def test_one_bad_file_of_three_is_named_and_the_others_are_read(tmp_path, board, damaged):
    half = len(DSP6) // 2 // 30 * 30
    parts = [tmp_path / name for name in ("a.bin", "b.bin", "c.bin")]
    parts[0].write_bytes(DSP6[:half])
    parts[2].write_bytes(DSP6[half:])
    if damaged == "empty":
        parts[1].write_bytes(b"")
    frames = decode_dump(parts, board("dsp6"))
    assert len(frames.time) == len(decode_dump([parts[0]], board("dsp6")).time) + len(
        decode_dump([parts[2]], board("dsp6")).time
    )
    assert frames.integrity.status == "suspect"
    assert "b.bin" in frames.integrity.reasons[0]
    assert frames.integrity.reasons[0].startswith("left out: ")
