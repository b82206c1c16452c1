"""Logs → frames: files, folders, dates; counts and rates; gaps in the time column, rows and channels without values."""

import numpy as np
import pyarrow as pa
import pytest
from log_files import AXES, COUNT, counts, frames_of, stack, write

from vgyro.errors import DataError


@pytest.fixture
def values():
    return counts()


@pytest.fixture
def read(board):
    return lambda paths, options=None, **log: frames_of(paths, board("adis16405"), options, **log)


def test_one_file(read, values, tmp_path):
    frames = read(write(tmp_path / "a.parquet", values))
    assert np.array_equal(stack(frames), values)
    assert frames.time == pytest.approx(np.arange(COUNT) / 100)
    record = frames.integrity
    assert (record.status, record.frames.good, record.segments, record.values) == ("good", COUNT, 1, "counts")
    assert record.duration_s == pytest.approx(COUNT / 100)
    assert record.files[0].compression == "none"


@pytest.mark.parametrize(
    "names", [["a1.parquet", "a2.parquet", "a10.parquet"], [f"date=2024-01-{d:02}/x.parquet" for d in (1, 2, 3)]]
)
def test_folders_are_read_by_path(read, values, tmp_path, names):
    # In another order than they are written, so that the order on disk cannot be what is right by luck.
    for index in (2, 0, 1):
        write(tmp_path / "log" / names[index], values[index * 1000 : (index + 1) * 1000])
    frames = read(tmp_path / "log")
    assert np.array_equal(stack(frames), values[:3000])
    assert [file.name for file in frames.integrity.files] == names


def test_columns_are_mapped_by_channel_or_gyro(read, values, tmp_path):
    path = write(tmp_path / "a.parquet", values, names=("wx", "wy", "wz"))
    frames = read(path, columns={"gyro_x": "wx", "gyro_y": "wy", "gyro_z": "wz"})
    assert np.array_equal(stack(frames), values)
    assert set(frames.counts) == set(AXES)


def test_rates_stay_rates(read, values, tmp_path):
    path = write(tmp_path / "a.parquet", values * 0.05)
    frames = read(path, values="rates")
    assert frames.counts["gyro_x"] == pytest.approx(values[:, 0] * 0.05)
    assert frames.integrity.values == "rates"


@pytest.mark.parametrize("kind", ["seconds", "time stamps"])
def test_gaps_in_the_time_column(read, values, tmp_path, kind):
    seconds = 1000 + np.arange(COUNT) / 100
    seconds[2000:] += 5
    time = seconds if kind == "seconds" else pa.array((seconds * 1e6).round().astype(np.int64), pa.timestamp("us"))
    frames = read(write(tmp_path / "a.parquet", values, t=time), time="t")
    assert frames.time == pytest.approx(seconds - 1000, abs=1e-6)
    (gap,) = frames.integrity.gaps
    assert gap.frames_lost == 500
    assert gap.duration == pytest.approx(5, abs=1e-6)
    assert (frames.segment[1999], frames.segment[2000]) == (0, 1)
    assert frames.counter[-1] == COUNT - 1 + 500
    assert frames.integrity.measured_rate_hz == pytest.approx(100)


def test_time_that_goes_back_is_a_new_segment(read, values, tmp_path):
    seconds = np.concatenate([np.arange(3000), np.arange(2000)]) / 100
    frames = read(write(tmp_path / "a.parquet", values, t=seconds), time="t")
    record = frames.integrity
    assert (record.restarts, record.segments, record.frames.lost) == (1, 2, 0)
    assert np.diff(frames.time) == pytest.approx(0.01)


def test_repeated_rows_are_dropped(read, values, tmp_path):
    rows = np.insert(np.arange(COUNT), 100, 99)
    frames = read(write(tmp_path / "a.parquet", values[rows], t=rows / 100), time="t")
    assert (frames.integrity.frames.repeated, frames.integrity.frames.good) == (1, COUNT)


def test_rows_without_any_value_are_lost(read, values, tmp_path):
    holes = values.astype(float)
    holes[700:710] = np.nan
    frames = read(write(tmp_path / "a.parquet", holes))
    record = frames.integrity
    assert (record.frames.good, record.frames.bad, record.frames.lost) == (COUNT - 10, 10, 10)
    (gap,) = record.gaps
    assert (gap.time, gap.frames_lost) == (pytest.approx(7.0), 10)
    assert frames.time[700] == pytest.approx(7.10)
    assert (frames.segment[699], frames.segment[700]) == (0, 1)


def test_a_channel_has_gaps_of_its_own(read, values, tmp_path):
    holes = values.astype(float)
    holes[700:710, 1] = np.nan
    holes[5, 2] = np.inf
    frames = read(write(tmp_path / "a.parquet", holes))
    record = frames.integrity
    assert (record.frames.good, record.frames.bad, record.frames.lost) == (COUNT, 0, 0)
    assert [record.channels[name].missing for name in AXES] == [0, 10, 1]
    assert np.array_equal(frames.counts["gyro_x"], values[:, 0])
    assert np.isnan(frames.counts["gyro_y"][700:710]).all()
    assert "gyro_z is infinite in 1 sample: they count as missing" in record.warnings


def test_one_bad_file_of_three_is_named_and_the_others_are_read(read, values, tmp_path):
    paths = [write(tmp_path / f"{index}.parquet", values[index * 1000 : (index + 1) * 1000]) for index in range(3)]
    paths[1].write_bytes(paths[1].read_bytes()[:-100])
    frames = read(paths)
    assert frames.integrity.frames.good == 2000
    assert frames.integrity.status == "suspect"
    assert str(paths[1]) in frames.integrity.reasons[0]


def test_wrong_column_asks_whether_another_was_meant(read, values, tmp_path):
    path = write(tmp_path / "a.parquet", values, names=("gyro_x", "gyro_y", "gyroz"))
    with pytest.raises(DataError, match="has no column 'gyro_z'; did you mean 'gyroz'") as caught:
        read(path)
    assert str(caught.value).startswith(f"{path}: ")
    with pytest.raises(DataError, match="has no column 'tme'"):
        read(write(tmp_path / "b.parquet", values, time=np.arange(COUNT) / 100), time="tme")


def test_what_is_not_a_log(read, values, tmp_path):
    (tmp_path / "a.parquet").write_bytes(b"not parquet at all")
    (tmp_path / "b.parquet").write_bytes(b"")
    (tmp_path / "empty").mkdir()
    with pytest.raises(DataError, match="holds only a header: found 'not parquet at all'"):
        read(tmp_path / "a.parquet")
    with pytest.raises(DataError, match="is empty: 0 bytes"):
        read(tmp_path / "b.parquet")
    with pytest.raises(DataError, match="is an empty folder"):
        read(tmp_path / "empty")
    with pytest.raises(DataError, match="no such file"):
        read(tmp_path / "c.parquet")
    with pytest.raises(DataError, match="has no row"):
        read(write(tmp_path / "d.parquet", values[:0]))
    with pytest.raises(DataError, match="not numbers"):
        read(write(tmp_path / "e.parquet", values[:1], names=("gyro_x", "gyro_y", "g"), gyro_z=["a"]))
