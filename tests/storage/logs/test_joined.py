"""Streams of several clocks → one array: skew undone, rates of their own, gaps of their own, clocks found by motion."""

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from vgyro.config import IntegrityOptions
from vgyro.dataset import Recording
from vgyro.errors import DataError
from vgyro.log import Log, LogArray, board_of_log
from vgyro.storage import open_recording
from vgyro.storage.frames import gather
from vgyro.storage.logs.joined import SAME_RATE, nearest

CASES = Path(__file__).resolve().parents[2] / "cases" / "logs"
NOISE = 0.08
EPOCH = 1_700_000_000
RNG = np.random.default_rng(20)
TONES = [(RNG.uniform(0.05, 4.0), RNG.uniform(0, 2 * np.pi), RNG.uniform(2, 15)) for _ in range(24)]


def motion(time):
    """True rate of the assembly, deg/s: 24 tones up to 4 Hz, turned by hand."""
    return sum(size * np.sin(2 * np.pi * hz * time + phase) for hz, phase, size in TONES)


def sampled(time, seed, bias=0.0):
    """A gyro's readings at true times, s."""
    return motion(time) + bias + NOISE * np.random.default_rng(seed).standard_normal(len(time))


@pytest.fixture
def read(tmp_path):
    """Tables {file: columns} → the array's frames, with one gyro on z for each place."""

    def run(tables, places, kind="free", names=None, **log):
        paths = []
        for name, columns in tables.items():
            path = tmp_path / f"{name}.parquet"
            pq.write_table(pa.table(columns), path)
            paths.append(path)
        gyros = [{"name": name, "axis": "z", "unit": "deg/s"} for name in names or places]
        array = LogArray(gyros=gyros)
        board = board_of_log(array, "log", "")
        log = {"time": "t", "columns": places, **log}
        recording = Recording(name="a", kind=kind, files=("x",), log=Log(**log), rate_hz=log.pop("rate_hz", None))
        reader = open_recording(paths, recording, board, IntegrityOptions(), array=array)
        frames = gather(reader, board)
        return frames._replace(integrity=reader.integrity)

    return run


def stack(frames):
    return np.column_stack(list(frames.counts.values()))


def by_file(count):
    return {f"g{k}": {"column": "g", "file": f"f{k}.parquet"} for k in range(count)}


def by_id(count):
    return {f"g{k}": {"column": "g", "where": {"id": k}} for k in range(count)}


def with_ids(times, seeds, **more):
    """One table of several ids, in order of time."""
    time, identity = np.concatenate(times), np.concatenate([np.full(len(t), k) for k, t in enumerate(times)])
    rate = np.concatenate([sampled(t, seed) for t, seed in zip(times, seeds, strict=True)])
    order = np.argsort(time, kind="stable")
    return {"t": time[order], "id": identity[order], "g": rate[order], **more}


SKEWS = (0.0, 0.0007, 0.0014)


def error_of_mean(frames, time):
    """R.m.s. error of the average against the true motion, where all three gyros are."""
    average = stack(frames).mean(axis=1)
    known = np.isfinite(average)
    assert known.mean() > 0.98
    return float(np.sqrt(np.mean((average - motion(time))[known] ** 2)))


def test_the_skew_of_ids_in_motion_is_undone(read):
    grid = np.arange(20_000) / 100
    frames = read({"a": with_ids([grid + skew for skew in SKEWS], (1, 2, 3))}, by_id(3))
    assert frames.time == pytest.approx(grid, abs=1e-9)
    joined = [clock["alignment"] for clock in frames.integrity.clocks[1:]]
    assert [one["offset_s"] for one in joined] == pytest.approx(SKEWS[1:], abs=1e-9)
    assert all(one["interpolated"] and one["by"] == "stamps" for one in joined)
    assert error_of_mean(frames, grid) <= 1.05 * NOISE / np.sqrt(3)


def test_left_alone_the_skew_would_show(read):
    grid = np.arange(20_000) / 100
    frames = read({"a": with_ids([grid + skew for skew in SKEWS], (1, 2, 3))}, by_id(3), kind="static")
    assert not frames.integrity.clocks[1]["alignment"]["interpolated"]
    assert error_of_mean(frames, grid) > 1.5 * NOISE / np.sqrt(3)


def test_at_rest_on_one_clock_readings_stay_as_they_are(read):
    grid = np.arange(2000) / 100
    table = with_ids([grid + skew for skew in SKEWS], (1, 2, 3))
    frames = read({"a": table}, by_id(3), kind="static")
    for k in range(3):
        assert np.array_equal(frames.counts[f"g{k}"], table["g"][table["id"] == k])


def test_the_slowest_stream_is_the_grid(read):
    fast, slow = np.arange(40_000) / 200, np.arange(20_000) / 100 + 0.003
    frames = read({"a": with_ids([fast, slow], (4, 5))}, by_id(2))
    record = frames.integrity
    assert record.rate_hz == record.measured_rate_hz == pytest.approx(100, rel=1e-6)
    assert record.frames.good == 20_000
    assert record.clocks[0]["channels"] == ["g1"]
    assert np.array_equal(frames.counts["g1"], sampled(slow, 5))
    error = frames.counts["g0"] - motion(slow)
    assert np.nanstd(error) < 1.02 * NOISE


@pytest.mark.parametrize(("rate", "grid"), [(100 * (1 - 0.9 * SAME_RATE), "g0"), (100 * (1 - 1.1 * SAME_RATE), "g1")])
def test_rates_as_near_as_clocks_are_one_rate(read, rate, grid):
    times = [np.arange(6000) / 100, np.arange(6000) / rate]
    frames = read({"a": with_ids(times, (1, 2))}, by_id(2))
    assert frames.integrity.clocks[0]["channels"] == [grid]


@pytest.mark.parametrize("unit", ["s", "ns"])
def test_stamps_since_1970_in_two_files_are_one_clock(read, unit):
    times = [np.arange(9000) / 100, np.arange(9000) / 100 + 0.404]
    stamps = [EPOCH + time if unit == "s" else EPOCH * 10**9 + np.rint(1e9 * time).astype(np.int64) for time in times]
    tables = {f"f{k}": {"t": stamps[k], "g": sampled(times[k], k)} for k in range(2)}
    frames = read(tables, by_file(2))
    (_, two) = frames.integrity.clocks
    assert two["alignment"]["by"] == "stamps"
    assert two["alignment"]["offset_s"] == pytest.approx(0.404, abs=1e-6)
    # The second one begins later: 40.4 periods of the first have no reading of it.
    assert np.isnan(frames.counts["g1"]).nonzero()[0].tolist() == list(range(41))
    assert np.nanstd(frames.counts["g1"] - motion(frames.time)) < 1.02 * NOISE


def test_stamps_that_count_from_each_file_s_start_are_not_one_clock(read):
    times = [np.arange(9000) / 100, np.arange(9000) / 100 + 0.404]
    tables = {f"f{k}": {"t": times[k] - times[k][0], "g": sampled(times[k], k)} for k in range(2)}
    (_, two) = read(tables, by_file(2)).integrity.clocks
    assert two["alignment"]["by"] == "common motion"
    assert two["alignment"]["offset_s"] == pytest.approx(0.404, abs=0.002)


def test_one_clock_may_be_set(read):
    time = np.arange(3000) / 100
    tables = {f"f{k}": {"t": time + 0.25 * k, "g": sampled(time + 0.25 * k, k)} for k in range(2)}
    frames = read(tables, by_file(2), clocks="one")
    assert frames.integrity.clocks[1]["alignment"]["by"] == "stamps"
    assert np.nanstd(frames.counts["g1"] - motion(time)) < 1.02 * NOISE
    # And each its own, though they are of one file.
    table = with_ids([time, time + 0.25], (0, 1))
    assert read({"a": table}, by_id(2), clocks="own").integrity.clocks[1]["alignment"]["by"] == "common motion"


def test_the_lateness_of_arrival_stamps_is_not_an_offset(read):
    rng = np.random.default_rng(3)
    times = [np.arange(9000) / 100, np.arange(9000) / 100 + 0.003]
    # Up to 30 ms late, the first line by 25 ms; a few are nearly in time.
    tables = {}
    for k, time in enumerate(times):
        late = 0.03 * rng.random(9000) ** 2
        late[0] = 0.025 if k else 0.0
        stamps = EPOCH + np.maximum.accumulate(time + late)
        tables[f"f{k}"] = {"t": stamps, "g": sampled(time, k)}
    frames = read(tables, by_file(2), time={"column": "t", "unit": "s", "meaning": "arrival"})
    assert frames.integrity.clocks[1]["alignment"]["offset_s"] == pytest.approx(0.003, abs=0.002)


def test_two_clocks_without_common_motion_are_refused_with_what_to_record(read):
    time = np.arange(6000) / 100
    rng = np.random.default_rng(1)
    tables = {f"f{k}": {"t": time, "g": NOISE * rng.standard_normal(6000)} for k in range(2)}
    with pytest.raises(DataError) as caught:
        read(tables, by_file(2))
    message = str(caught.value)
    assert message.startswith("f0.parquet and f1.parquet: the two streams show no motion in common")
    assert "turn the whole assembly back and forth by hand" in message.lower()


def test_outside_a_stream_there_is_no_value(read):
    whole, part = np.arange(6000) / 100, np.arange(1000, 5000) / 100 + 0.004
    frames = read({"a": with_ids([whole, part], (1, 2))}, by_id(2))
    missing = np.isnan(frames.counts["g1"])
    assert missing.nonzero()[0].tolist() == [*range(1001), *range(5000, 6000)]
    assert frames.integrity.channels["g1"].missing == 2001
    assert frames.integrity.frames.lost == 0
    assert not np.isnan(frames.counts["g0"]).any()


def test_each_stream_has_gaps_of_its_own(read):
    one, two = np.arange(6000) / 100, np.arange(6000) / 100 + 0.002
    one, two = np.delete(one, np.s_[1000:1100]), np.delete(two, np.s_[3000:3050])
    frames = read({"a": with_ids([one, two], (1, 2))}, by_id(2))
    record = frames.integrity
    # The grid's own gap is one of the recording, the other stream's one of its channel.
    assert (record.frames.good, record.frames.lost, record.segments) == (5900, 100, 2)
    assert record.channels["g1"].missing == pytest.approx(51, abs=1)
    gone = frames.time[np.isnan(frames.counts["g1"])]
    assert gone[0] == 0
    assert np.all((gone[1:] >= 30.0) & (gone[1:] <= 30.5))


def test_rows_without_a_value_of_the_grid_s_stream_are_lost(read):
    grid = np.arange(3000) / 100
    table = with_ids([grid, grid + 0.002], (1, 2))
    table["g"][np.flatnonzero(table["id"] == 0)[500:510]] = np.nan
    record = read({"a": table}, by_id(2)).integrity
    assert (record.frames.good, record.frames.lost, record.frames.bad) == (2990, 10, 10)


def test_own_clocks_of_the_cases():
    expected = json.loads((CASES / "EXPECTED.json").read_text())["own_clock_*.csv"]
    paths = [CASES / name for name in expected["files"]]
    names = [path.stem for path in paths]
    array = LogArray(gyros=[{"name": name, "axis": "z", "unit": "deg/s"} for name in names])
    places = {name: {"column": "gz", "file": path.name} for name, path in zip(names, paths, strict=True)}
    log = Log(columns=places)
    board = board_of_log(array, "log", "")
    recording = Recording(name="a", kind="free", files=("x",), log=log, rate_hz=expected["rate_hz"])
    reader = open_recording(paths, recording, board, IntegrityOptions(), array=array)
    frames = gather(reader, board)
    clocks = {clock["stream"]: clock["alignment"] for clock in reader.integrity.clocks}
    assert clocks["own_clock_0.csv"] == {}
    for name, truth in list(expected["files"].items())[1:]:
        found = clocks[name]
        assert found["by"] == "common motion"
        assert found["offset_s"] == pytest.approx(truth["offset_s"], abs=0.002)
        assert found["drift_ppm"] == pytest.approx(truth["ppm"], abs=15)
        assert found["offset_low_s"] <= found["offset_s"] <= found["offset_high_s"]
    # The gyros agree, but for their noise and biases.
    rates = np.column_stack([frames.counts[name] for name in names])
    rates = rates[np.isfinite(rates).all(axis=1)]
    for k in (1, 2):
        assert np.std(rates[:, k] - rates[:, 0]) < 1.05 * np.sqrt(2) * expected["noise_sd"]


@pytest.mark.parametrize(("reading", "place"), [(0.0, 0), (1.49, 1), (1.51, 2), (4.49, 4), (4.51, None), (-0.51, None)])
def test_the_nearest_sample_within_half_a_step(reading, place):
    found = nearest(np.arange(5.0), np.array([reading]))[0]
    assert (None if np.isnan(found) else found) == place


def test_no_nearest_sample_of_one():
    assert np.isnan(nearest(np.array([1.0]), np.array([1.0]))).all()
