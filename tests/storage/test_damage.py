"""Dumps that are damaged on purpose: what was sent is known, so every loss and every wrong frame shows."""

import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from storage_frames import BOARDS, dsp6_frame, dsp6_stream, dsp6_text_line, mimu_stream

from vgyro.config import IntegrityOptions
from vgyro.storage import decode_dump
from vgyro.storage.dumps.reader import DumpReader
from vgyro.storage.dumps.selection import CounterRule, select
from vgyro.storage.frames import gather
from vgyro.storage.inputs import read_board

CORRUPTIONS = 1000
LENIENT = IntegrityOptions(min_good_share=0)


def corrupt(frames: list[bytes], how_many: int, sync: bytes, seed: int) -> tuple[bytes, set[int]]:
    """Damage distinct frames, one way each; return the bytes and the frames that were hit."""
    rng = np.random.default_rng(seed)
    damaged = list(frames)
    hit = set(rng.choice(len(frames), how_many, replace=False).tolist())
    for index in hit:
        frame = bytearray(frames[index])
        place = int(rng.integers(len(frame)))
        kind = rng.integers(5)
        if kind == 0:
            frame[place] ^= 1 << int(rng.integers(8))
        elif kind == 1:
            del frame[place : place + int(rng.integers(1, 8))]
        elif kind == 2:
            frame[place:place] = rng.bytes(int(rng.integers(1, 8)))
        elif kind == 3:
            frame[place:place] = frame[place : place + 1]  # doubled
        else:
            # A sync pattern in the payload that was not there.
            place = min(max(place, len(sync)), len(frame) - 2 - len(sync))
            frame[place : place + len(sync)] = bytes(
                old ^ 0xFF if old == new else new for old, new in zip(frame[place:], sync, strict=False)
            )
        damaged[index] = bytes(frame)
    return b"".join(damaged), hit


def check(result, sent: np.ndarray, names: list[str], allowed_losses: int) -> None:
    got = np.column_stack([result.counts[name] for name in names])
    record = result.integrity
    # Every accepted frame is one that was sent, at its own counter; and none is missing but the damaged.
    assert np.array_equal(got, sent[result.counter])
    assert len(got) >= len(sent) - allowed_losses
    assert record.frames.good == len(got)
    first, last = result.counter[0], result.counter[-1]
    assert record.frames.good + record.frames.lost == last - first + 1
    assert sum(gap.frames_lost for gap in record.gaps) + record.gaps_not_listed["frames_lost"] == record.frames.lost
    inside = [entry for entry in record.damage if entry.cause != "truncated at the end"]
    assert sum(entry.frames_lost for entry in inside) + record.damage_not_listed["frames_lost"] >= record.frames.lost


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_thousand_corruptions_of_dsp6(dump, board, seed):
    frames, sent = dsp6_stream(8000, seed)
    data, hit = corrupt(frames, CORRUPTIONS, b"\xeb\x90", seed)
    result = decode_dump([dump(data)], board("dsp6"))
    check(result, sent, [f"g{k}" for k in range(1, 7)], len(hit))
    assert result.integrity.status == "suspect"


@pytest.mark.parametrize("seed", [1, 2])
def test_a_thousand_corruptions_of_mimu4444(dump, board, seed):
    frames, sent = mimu_stream(4000, seed)
    data, hit = corrupt(frames, CORRUPTIONS, b"\xaa", seed)
    result = decode_dump([dump(b"\xa0\x28\x00\xc8" + data)], board("mimu4444"))
    names = [f"imu{k}_{c}" for k in range(1, 9) for c in ("ax", "ay", "az", "gx", "gy", "gz")]
    check(result, sent, names, len(hit))
    assert result.integrity.measured_rate_hz == pytest.approx(62.5)
    # The clock knows where every frame belongs, gaps or not.
    assert result.time == pytest.approx((result.counter - result.counter[0]) * 0.016, abs=1e-9)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_thousand_corruptions_of_dsp6_text(dump, board, seed):
    rng = np.random.default_rng(seed)
    sent = rng.integers(-32000, 32000, (6000, 6))
    lines = [dsp6_text_line(i, row) for i, row in enumerate(sent)]
    damaged = list(lines)
    hit = rng.choice(len(lines), CORRUPTIONS, replace=False)
    for index in hit:
        line, place = bytearray(lines[index]), int(rng.integers(len(lines[index])))
        kind = rng.integers(3)
        if kind == 0:
            # One bit of one character: the XOR of 8 bits sees any single flip.
            line[place] ^= 1 << int(rng.integers(8))
        elif kind == 1:
            del line[place]
        else:
            line[place:place] = b"$VG,"
        damaged[index] = bytes(line)
    result = decode_dump([dump(b"".join(damaged))], board("dsp6-text"))
    # A character that is dropped can leave a line that still reads and whose XOR still fits by chance (1 in 256): the
    # checksum of this format is no stronger. Such a line shows here as a wrong one.
    got = np.column_stack([result.counts[f"g{k}"] for k in range(1, 7)])
    wrong = (got != sent[result.counter]).any(axis=1)
    assert wrong.sum() <= CORRUPTIONS // 3 / 256 * 4
    assert len(got) - wrong.sum() >= len(sent) - CORRUPTIONS


def test_sync_patterns_in_good_payloads_cost_nothing(dump, board):
    sync = int.from_bytes(b"\xeb\x90", "big", signed=True)
    frames = [dsp6_frame(i, [sync] * 6, [sync] * 6) for i in range(500)]
    record = decode_dump([dump(b"".join(frames))], board("dsp6")).integrity
    assert (record.frames.good, record.frames.lost, record.damage) == (500, 0, [])


def test_a_whole_frame_inside_a_payload_yields_to_the_longer_chain(dump, board):
    # 24 payload bytes cannot hold a frame of 30, so one is forged across the border of two frames.
    frames = [bytearray(dsp6_frame(i, [7 * i] * 6)) for i in range(40)]
    forged = dsp6_frame(30_000, [1] * 6)
    stream = bytearray(b"".join(frames))
    at = 20 * 30 + 15
    stream[at : at + 30] = forged
    # Now frames 20 and 21 are damaged and a forged frame stands there, out of step with all others.
    result = decode_dump([dump(bytes(stream))], board("dsp6"))
    assert 30_000 not in result.counter
    assert np.array_equal(np.delete(np.arange(40), [20, 21]), result.counter)


def test_overlap_goes_to_the_greater_number_of_frames():
    rule = CounterRule(1, 65536)
    # 0, 30 and 60 are a chain; 15 and 45 overlap them and would be only two.
    start = np.array([0, 15, 30, 45, 60])
    assert select(start, 30, np.array([5, 6, 6, 7, 7]), rule).tolist() == [True, False, True, False, True]
    # One against one: the candidate in step with both neighbours wins.
    start = np.array([0, 30, 45, 75])
    assert select(start, 30, np.array([5, 6, 900, 7]), rule).tolist() == [True, True, False, True]
    start = np.array([0, 30, 45, 75])
    assert select(start, 30, np.array([5, 900, 6, 7]), rule).tolist() == [True, False, True, True]


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000), chunk=st.integers(3, 4000), hits=st.integers(0, 60))
def test_the_size_of_the_chunks_changes_nothing_dsp6(tmp_path_factory, seed, chunk, hits):
    board = read_board("dsp6", boards=BOARDS)
    frames, _ = dsp6_stream(150, seed, first=65_450)
    data, _ = corrupt(frames, hits, b"\xeb\x90", seed)
    rng = np.random.default_rng(seed)
    cut = int(rng.integers(len(data)))
    data = data[int(rng.integers(29)) :] + data[cut : cut + 300] + rng.bytes(int(rng.integers(200)))
    same_result(tmp_path_factory, data, board, chunk)


@settings(max_examples=12, deadline=None)
@given(seed=st.integers(0, 10_000), chunk=st.integers(3, 3000), hits=st.integers(0, 40))
def test_the_size_of_the_chunks_changes_nothing_ahrs400(tmp_path_factory, seed, chunk, hits):
    # Sync of one byte and a sum of 8 bits: overlapping candidates all over the place.
    board = read_board("ahrs400", boards=BOARDS)
    rng = np.random.default_rng(seed)
    frames = []
    for index in range(150):
        body = struct.pack(">10hH", *rng.integers(-5, 5, 10).tolist(), index)
        frames.append(b"\xff" + body + bytes([sum(body) % 256]))
    data, _ = corrupt(frames, hits, b"\xff", seed)
    same_result(tmp_path_factory, data, board, chunk)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000), chunk=st.integers(3, 3000), name=st.sampled_from(["dsp6-text", "kvh-dsp3000"]))
def test_the_size_of_the_chunks_changes_nothing_text(tmp_path_factory, seed, chunk, name):
    board = read_board(name, boards=BOARDS)
    rng = np.random.default_rng(seed)
    if name == "dsp6-text":
        frames = [dsp6_text_line(i, rng.integers(-999, 999, 6)) for i in range(80)]
    else:
        frames = [b"%.6f %d\r\n" % (value, value < 2) for value in rng.normal(0, 1, 80)]
    data = bytearray(b"".join(frames))
    for _ in range(int(rng.integers(0, 15))):
        place = int(rng.integers(len(data)))
        data[place : place + int(rng.integers(3))] = rng.bytes(int(rng.integers(3)))
    data = data[int(rng.integers(40)) :]
    if rng.integers(2):
        data[200:200] = rng.bytes(900)
    same_result(tmp_path_factory, bytes(data), board, chunk)


def same_result(tmp_path_factory, data, board, chunk):
    path = tmp_path_factory.mktemp("chunks") / "dump.bin"
    path.write_bytes(data)
    results = []
    for size in (chunk, 1 << 22):
        reader = DumpReader([path], board, board.rate_hz, LENIENT, size)
        frames = gather(reader, board)
        results.append((frames, reader.integrity))
    (one, first), (other, second) = results
    assert first == second
    for name in one.counts:
        assert np.array_equal(one.counts[name], other.counts[name])
    for part in ("counter", "time", "segment"):
        assert np.array_equal(getattr(one, part), getattr(other, part))
