"""Wraps, restarts, repeats and gaps, on frames whose counters and time stamps are chosen by hand."""

import numpy as np
import pytest
from storage_frames import dsp6_frame, dsp6_stream, kvh, mimu_packet, vectornav

from vgyro.config import IntegrityOptions
from vgyro.dataset import Recording
from vgyro.storage import decode_dump, open_recording
from vgyro.storage.frames import gather

LENIENT = IntegrityOptions(min_good_share=0)
TICKS = 1_024_000  # of 64 MHz, 0.016 s


@pytest.fixture
def dsp6(dump, board):
    def run(counters, values=None):
        values = range(len(counters)) if values is None else values
        frames = [dsp6_frame(c, [v % 30_000] * 6) for c, v in zip(counters, values, strict=True)]
        return decode_dump([dump(b"".join(frames))], board("dsp6"))

    return run


@pytest.fixture
def mimu(dump, board):
    def run(counters, ticks):
        rng = np.random.default_rng(1)
        frames = [mimu_packet(c, t, rng.integers(-99, 99, 48).tolist()) for c, t in zip(counters, ticks, strict=True)]
        return decode_dump([dump(b"".join(frames))], board("mimu4444"), LENIENT)

    return run


def test_the_counter_wraps(dsp6):
    result = dsp6(range(65_500, 65_600))
    assert result.counter.tolist() == list(range(65_500, 65_600))
    assert result.time[-1] == pytest.approx(99 / 200)
    assert not result.integrity.gaps


def test_missing_frames_are_a_gap_in_time(dsp6):
    result = dsp6([*range(100), *range(150, 200)])
    (gap,) = result.integrity.gaps
    assert (gap.frames_lost, gap.cause) == (50, "not in the dump")
    assert gap.time == pytest.approx(100 / 200)
    assert gap.duration == pytest.approx(50 / 200)
    assert result.time[100] == pytest.approx(150 / 200)
    assert result.segment.tolist() == [0] * 100 + [1] * 50
    assert result.integrity.frames.lost == 50
    # Without time stamps 65536 frames more would look the same, and the record says so.
    assert gap.ambiguous
    assert any("whole wraps of the counter" in text for text in result.integrity.warnings)


def test_a_gap_across_the_wrap(dsp6):
    result = dsp6([*range(65_500, 65_530), *range(20, 60)])
    assert result.integrity.frames.lost == 65_536 - 65_530 + 20
    assert result.counter[-1] == 65_536 + 59


def test_a_restart_begins_a_segment_of_unknown_distance(dsp6):
    result = dsp6([*range(5_000, 5_100), *range(50)])
    record = result.integrity
    (gap,) = record.gaps
    assert (gap.duration, gap.frames_lost) == (None, None)
    assert (record.restarts, record.segments, record.frames.lost) == (1, 2, 0)
    assert record.status == "suspect"
    assert np.diff(result.time) == pytest.approx(1 / 200)


def test_repeated_frames_are_dropped_and_counted(dsp6):
    result = dsp6([0, 1, 2, 2, 3, 3, 3, 4], values=[0, 1, 2, 2, 3, 3, 3, 4])
    assert result.counter.tolist() == [0, 1, 2, 3, 4]
    assert result.integrity.frames.repeated == 3
    assert not result.integrity.damage


def test_a_block_that_was_sent_again_is_dropped(dsp6):
    counters = [*range(100), *range(60, 100), *range(100, 130)]
    result = dsp6(counters, values=counters)
    assert result.counter.tolist() == list(range(130))
    assert (result.integrity.frames.repeated, result.integrity.frames.lost) == (40, 0)


def test_equal_counter_with_other_bytes_is_no_repeat(dsp6):
    result = dsp6([0, 1, 2, 2, 3], values=[0, 1, 2, 9, 3])
    assert result.integrity.frames.repeated == 0
    assert result.counts["g1"].tolist() == [0, 1, 2, 9, 3]
    assert any("stood still" in text for text in result.integrity.warnings)


def test_time_stamps_wrap(mimu):
    count = 5000  # 80 s; the stamp wraps after 67.1 s
    result = mimu(range(count), [TICKS * i for i in range(count)])
    assert result.time == pytest.approx(np.arange(count) * 0.016, abs=1e-9)
    assert result.integrity.measured_rate_hz == pytest.approx(62.5)


def test_a_gap_longer_than_the_wrap_of_the_time_stamp(mimu):
    # 10 000 packets are 160 s: two wraps of the stamp; the counter tells.
    counters = [*range(200), *range(10_200, 10_400)]
    result = mimu(counters, [TICKS * c for c in counters])
    (gap,) = result.integrity.gaps
    assert gap.frames_lost == 10_000
    assert gap.duration == pytest.approx(160)
    assert not gap.ambiguous
    assert result.time[-1] == pytest.approx(10_399 * 0.016)


def test_a_gap_longer_than_the_wrap_of_the_counter_is_told_by_the_time_stamp(dump, board):

    # VectorNav: no counter, 64 bit nanoseconds. KVH: counter of 128, no stamp.
    frames = [vectornav(i, [0.1, 0.2, 0.3]) for i in [*range(100), *range(100_100, 100_200)]]
    result = decode_dump([dump(b"".join(frames), "vn.bin")], board("vectornav-imu"), LENIENT)
    assert result.integrity.frames.lost == 100_000
    assert result.time[100] == pytest.approx(1001)
    frames = [kvh(i, [0.1 * i, 0.2, 0.3]) for i in [*range(100), *range(100 + 128 + 20, 400)]]
    result = decode_dump([dump(b"".join(frames), "kvh.bin")], board("kvh1750"))
    assert result.integrity.frames.lost == 20  # the shortest that fits …
    assert result.integrity.gaps[0].ambiguous  # … and the record says that it may be more


def test_power_cycle_with_counter_and_stamp(mimu):
    counters = [*range(3000, 3200), *range(100)]
    ticks = [TICKS * c + 777 for c in range(3000, 3200)] + [TICKS * c + 5_000_000 for c in range(100)]
    result = mimu(counters, ticks)
    record = result.integrity
    assert (record.restarts, record.frames.lost, record.segments) == (1, 0, 2)
    assert record.gaps[0].duration is None
    assert np.diff(result.time).min() > 0


def test_a_pause_with_the_counter_in_step(mimu):
    ticks = [TICKS * i for i in range(100)] + [TICKS * (i + 500) for i in range(100, 200)]
    result = mimu(range(200), ticks)
    (gap,) = result.integrity.gaps
    assert (gap.frames_lost, gap.duration) == (0, pytest.approx(8.0))
    assert result.time[-1] == pytest.approx(699 * 0.016)
    assert result.segment[-1] == 1


def test_measured_rate_against_declared(dump, board):
    frames = [mimu_packet(i, TICKS * i, [i % 50] * 48) for i in range(500)]
    path = dump(b"".join(frames))
    recording = Recording(name="a", kind="static", files=("x",), rate_hz=100)
    reader = open_recording([path], recording, board("mimu4444"), IntegrityOptions())
    frames = gather(reader, board("mimu4444"))
    record = reader.integrity
    assert record.status == "suspect"
    assert "measured 62.5 Hz, declared 100 Hz" in record.reasons[0]
    assert record.rate_hz == pytest.approx(62.5)
    assert not record.gaps
    assert frames.time[-1] == pytest.approx(499 * 0.016)


def test_the_rate_of_a_board_without_time_stamp_cannot_be_checked(dsp6):
    record = dsp6(range(100)).integrity
    assert record.measured_rate_hz is None
    assert "cannot be checked" in record.rate_note


def test_a_wrong_counter_step_is_hinted_at(dsp6):
    record = dsp6(range(0, 400, 2)).integrity
    assert record.frames.lost == 199
    assert any("counter.step: 2" in text for text in record.warnings)


def test_two_files_are_one_recording_and_a_frame_may_straddle_them(dump, board):
    frames, sent = dsp6_stream(200)
    data = b"".join(frames)
    paths = [dump(data[:3011], "a.bin"), dump(data[3011:], "b.bin")]
    result = decode_dump(paths, board("dsp6"))
    assert np.array_equal(result.counts["g3"], sent[:, 2])
    assert not result.integrity.damage
    assert [file.content_bytes for file in result.integrity.files] == [3011, 6000 - 3011]


def test_damage_is_placed_in_its_file(dump, board):
    frames, _ = dsp6_stream(200)
    second = bytearray(b"".join(frames[100:]))
    second[30 * 50 + 7] ^= 4
    paths = [dump(b"".join(frames[:100]), "a.bin"), dump(bytes(second), "b.bin")]
    (entry,) = decode_dump(paths, board("dsp6")).integrity.damage
    assert (entry.file, entry.start, entry.stop) == ("b.bin", 1500, 1530)
    assert (entry.frames_lost, entry.cause) == (1, "checksum")


def test_frames_lost_between_two_files(dump, board):
    frames, _ = dsp6_stream(200)
    paths = [dump(b"".join(frames[:90]), "a.bin"), dump(b"hello\r\n" + b"".join(frames[100:]), "b.bin")]
    record = decode_dump(paths, board("dsp6")).integrity
    assert (record.gaps[0].cause, record.gaps[0].frames_lost) == ("between two files", 10)
    assert (record.damage[0].file, record.damage[0].cause) == ("b.bin", "leading bytes")


def test_clipped_and_stuck_channels(dump, board):
    rng = np.random.default_rng(2)
    values = rng.integers(-100, 100, (2000, 6))
    values[:, 0] = np.where(np.arange(2000) % 50 == 0, 32767, values[:, 0])
    values[500:1100, 1] = 33  # 3 s
    frames = [dsp6_frame(i, row.tolist(), row.tolist()) for i, row in enumerate(values)]
    record = decode_dump([dump(b"".join(frames))], board("dsp6")).integrity
    assert (record.channels["g1"].clipped, record.channels["g1"].clipped_share) == (40, 0.02)
    assert record.channels["g2"].stuck_start == pytest.approx(2.5)
    assert record.channels["g2"].stuck_duration == pytest.approx(599 / 200)
    assert record.status == "suspect"
    assert any("clipped on g1" in text for text in record.reasons)
    assert any("g2 repeats one value" in text for text in record.reasons)
    assert not any("g3" in text for text in record.reasons)
