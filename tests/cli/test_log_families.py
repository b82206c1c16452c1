"""Logs of every family through `vgyro new-dataset` and the reader: values bit for bit, rates within 0.02 %."""

import gzip
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from scipy.io import savemat

from vgyro.config import IntegrityOptions
from vgyro.storage import open_recording
from vgyro.storage.frames import gather
from vgyro.storage.inputs import data_files, read_dataset

# bag_bytes.py and ulog_bytes.py write the files for the readers' own tests, too.
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "storage" / "logs"))

from bag_bytes import write_bag
from ulog_bytes import GYRO, gyro, head, subscribed

ROWS = 1500
RNG = np.random.default_rng(12)
RATES = (0.02 + 0.0015 * RNG.standard_normal((ROWS, 3))).astype(np.float64)
"""Three axes at rest, rad/s."""
TIME = np.arange(ROWS) / 100
TO_DEG = 180 / np.pi


class Found:
    """What was written, and what the reader makes of it."""

    def __init__(self, outcome, manifest, board, frames, record):
        self.outcome, self.manifest, self.board = outcome, manifest, board
        self.frames, self.record = frames, record

    @property
    def axes(self):
        """Axis → gyros."""
        found = {}
        for one in self.board.gyros:
            found.setdefault(one.axis, []).append(one.name)
        return found

    def values(self):
        """Values of each gyro, deg/s."""
        return [self.frames.counts[one.field] for one in self.board.gyros]


@pytest.fixture
def read(project, vgyro):
    def run(*files, options=()):
        outcome = vgyro("new-dataset", *files, "--name", "case", *options)
        assert outcome.code == 0, outcome.err
        checked = vgyro("check")
        assert checked.code == 0, checked.out + checked.err
        manifest, board = read_dataset(project / "raw/case/dataset.yaml", project / "config/boards")
        (recording,) = manifest.recordings
        paths = data_files(manifest, recording.name, project / "raw/case")
        reader = open_recording(paths, recording, board, IntegrityOptions(), array=manifest.array)
        return Found(outcome, manifest, board, gather(reader, board), reader.integrity)

    return run


def is_whole(found, rate_hz=100.0):
    record = found.record
    assert (record.frames.good, record.frames.lost, record.frames.bad, record.segments) == (ROWS, 0, 0, 1)
    assert record.rate_hz == pytest.approx(rate_hz, rel=2e-4)
    assert record.status == "good"
    return True


@pytest.mark.parametrize(("kind", "name"), [("ros1", "imu.bag"), ("sqlite", "imu2"), ("mcap", "imu3")])
def test_two_topics_of_a_bag_are_two_gyros_an_axis(read, project, kind, name):
    write_bag(project / name, kind, RATES)
    found = read(project / name)
    assert is_whole(found)
    assert {axis: len(gyros) for axis, gyros in found.axes.items()} == {"x": 2, "y": 2, "z": 2}
    assert {one.unit for one in found.manifest.array.gyros} == {"rad/s"}
    expected = [*(RATES.T * TO_DEG), *(-RATES.T * TO_DEG)]
    for values, truth in zip(found.values(), expected, strict=True):
        assert np.array_equal(values, truth)
    assert {clock["meaning"] for clock in found.record.clocks} == {"sampled"}
    assert found.record.clocks[1]["alignment"]["by"] == "stamps"


def test_an_mcap_file_alone(read, project):
    write_bag(project / "imu3", "mcap", RATES)
    (inside,) = (project / "imu3").glob("*.mcap")
    alone = inside.rename(project / "alone.mcap")
    found = read(alone)
    assert is_whole(found)
    assert np.array_equal(found.values()[0], RATES[:, 0] * TO_DEG)


def test_two_instances_of_a_ulog_are_two_gyros_an_axis(read, project):
    rates = RATES.astype(np.float32)
    content = head(GYRO) + subscribed(0, "sensor_gyro") + subscribed(1, "sensor_gyro", 1)
    for k, row in enumerate(rates):
        content += gyro(0, 10_000_000 + 10_000 * k, *row) + gyro(1, 10_000_300 + 10_000 * k, *-row)
    path = project / "flight.ulg"
    path.write_bytes(content)
    found = read(path)
    assert is_whole(found)
    assert {axis: len(gyros) for axis, gyros in found.axes.items()} == {"x": 2, "y": 2, "z": 2}
    expected = [*(rates.T * TO_DEG), *(-rates.T * TO_DEG)]
    for values, truth in zip(found.values(), expected, strict=True):
        assert values == pytest.approx(truth, rel=1e-7)
    assert found.record.clocks[1]["alignment"]["offset_s"] == pytest.approx(300e-6, abs=1e-9)


DEG = np.round(RATES * TO_DEG, 4)


def same(found, values=DEG):
    for one, truth in zip(found.values(), values.T, strict=True):
        assert np.array_equal(one, truth)
    return True


def test_an_array_of_numpy_needs_its_rate(read, project, vgyro):
    np.save(project / "rates.npy", DEG)
    outcome = vgyro("new-dataset", project / "rates.npy", "--name", "case")
    assert outcome.code == 2
    assert "--rate HZ" in outcome.err
    found = read(project / "rates.npy", options=["--rate", "100"])
    assert is_whole(found)
    assert same(found)
    assert found.record.clocks[0]["meaning"] == "none"


def test_arrays_of_numpy_with_a_time(read, project):
    np.savez(project / "rates.npz", t=TIME, gyro=DEG)
    found = read(project / "rates.npz")
    assert is_whole(found)
    assert same(found)
    assert set(found.axes) == {"x", "y", "z"}


def test_arrays_of_matlab(read, project):
    savemat(project / "rates.mat", {"t": TIME[:, None], "gyro": DEG, "note": "bench"})
    found = read(project / "rates.mat")
    assert is_whole(found)
    assert same(found)


@pytest.mark.parametrize("unit", ["us", "ns", "ms"])
def test_parquet_with_time_stamps(read, project, unit):
    stamps = 1_700_000_000_000_000_000 + np.arange(ROWS) * 10_000_000
    table = {"ts": pa.array(stamps, pa.timestamp("ns")).cast(pa.timestamp(unit))}
    table |= {f"gyro_{axis}": DEG[:, place] for place, axis in enumerate("xyz")}
    pq.write_table(pa.table(table), project / "a.parquet")
    found = read(project / "a.parquet")
    assert is_whole(found)
    assert same(found)


def text(header="t,gx,gy,gz"):
    rows = [f"{t:.2f}," + ",".join(f"{value:.4f}" for value in row) for t, row in zip(TIME, DEG, strict=True)]
    return "\n".join([header, *rows, ""]).encode()


@pytest.mark.parametrize("ending", ["csv", "csv.gz", "csv.zst"])
def test_packed_text(read, project, ending):
    path = project / f"a.{ending}"
    packed = {"csv": bytes, "csv.gz": gzip.compress, "csv.zst": lambda raw: pa.Codec("zstd").compress(raw).to_pybytes()}
    path.write_bytes(packed[ending](text()))
    found = read(path)
    assert is_whole(found)
    assert same(found)


def test_a_folder_by_date(read, project):
    for place in range(3):
        rows = slice(place * 500, (place + 1) * 500)
        folder = project / f"archive/year=2026/day={place + 9}"
        folder.mkdir(parents=True)
        columns = {"t": TIME[rows], **{f"g{axis}": DEG[rows, k] for k, axis in enumerate("xyz")}}
        pq.write_table(pa.table(columns), folder / "part.parquet")
    found = read(project / "archive")
    assert is_whole(found)
    assert same(found)
    assert [one.name for one in found.record.files] == [f"day={day}/part.parquet" for day in (9, 10, 11)]


def test_a_phone_s_accelerometer_is_refused(project, vgyro):
    path = project / "Accelerometer.csv"
    rows = [f"{t:.2f},{9.81 + x:.4f},{y:.4f},{z:.4f}" for t, (x, y, z) in zip(TIME, RATES, strict=True)]
    path.write_text("\n".join(["seconds_elapsed,z,y,x", *rows, ""]))
    outcome = vgyro("new-dataset", path, "--name", "case")
    assert outcome.code == 4
    assert "no column looks like a gyro's: seconds_elapsed, z, y, x" in outcome.err
