"""Damaged files of every family: a DataError or rows, never another exception, no hang, bounded memory.

About 100 examples a family; 10,000 with the long tests. A failure leaves its file in tmp_path.
"""

import gzip

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from bag_bytes import write_bag
from mutations import mutants, survive
from scipy.io import savemat
from ulog_bytes import FIFO, GYRO, SYNC, dropout, fifo, gyro, head, subscribed

from vgyro.log import Log
from vgyro.storage.logs.binary import bag, matlab, numpy_file, parquet, ulog
from vgyro.storage.logs.families import open_log

RNG = np.random.default_rng(1)
GYRO_RATES = RNG.normal(size=(60, 3))


def write_parquet(path, compression="snappy"):
    columns = {
        "t": pa.array(range(60), pa.timestamp("ms")), "x": GYRO_RATES[:, 0], "name": pa.array(["a", "b"] * 30),
        "g": pa.FixedSizeListArray.from_arrays(pa.array(GYRO_RATES.ravel()), 3), "v": pa.array([[1, 2], [3]] * 30),
    }  # fmt: skip
    pq.write_table(pa.table(columns), path, row_group_size=20, compression=compression)
    return path


def write_ulog(path):
    parts = [
        head(GYRO, FIFO),
        subscribed(0, "sensor_gyro"),
        subscribed(1, "sensor_gyro", 1),
        subscribed(2, "sensor_gyro_fifo"),
    ]
    for index in range(20):
        parts += [gyro(index % 2, index * 100, 1, 2, 3), fifo(2, 1000 * index, 250, 0.001, [1, 2, 3])]
        parts += [SYNC, dropout(3)] if index % 7 == 0 else []
    path.write_bytes(b"".join(parts))
    return path


def write_npy(path):
    with open(path, "wb") as file:
        np.save(file, GYRO_RATES)
    return path


def write_npz(path):
    with open(path, "wb") as file:
        np.savez_compressed(
            file, t=np.arange(60), g=GYRO_RATES, d=np.arange(60).astype("M8[ms]"), f=np.asfortranarray(GYRO_RATES)
        )
    return path


def write_fields(path):
    with open(path, "wb") as file:
        np.save(file, np.zeros(60, [("t", "M8[us]"), ("g", "f4", 3), ("n", "S4"), ("k", [("a", "u2")])]))
    return path


def write_mat(path, compressed=False):
    cell = np.array([1.0, "x"], dtype=object)
    arrays = {
        "t": np.arange(60.0),
        "g": GYRO_RATES,
        "imu": {"a": np.arange(60), "deep": {"b": GYRO_RATES[:, :2]}},
        "c": cell,
    }
    savemat(path, arrays, do_compression=compressed, appendmat=False)
    return path


BAGS = (("ros1", ""), ("ros1", "bz2"), ("ros1", "lz4"), ("sqlite", ""), ("mcap", ""), ("mcap", "storage"))
SOURCES = {
    "parquet": (parquet.open_log, [write_parquet, lambda path: write_parquet(path, "gzip")]),
    "ulog": (ulog.open_log, [write_ulog]),
    "numpy": (numpy_file.open_log, [write_npy, write_npz, write_fields]),
    "matlab": (matlab.open_log, [write_mat, lambda path: write_mat(path, True), None]),
    "bag": (
        bag.open_log,
        [
            lambda path, kind=kind, compression=compression: write_bag(path, kind, GYRO_RATES[:8], True, compression)
            for kind, compression in BAGS
        ],
    ),
}  # fmt: skip


@pytest.fixture
def valid(tmp_path, matlab_v73):
    """The valid files of a family, as (content, first bytes that stay)."""

    def make(family):
        for number, write in enumerate(SOURCES[family][1]):
            path = tmp_path / f"{family}{number}"
            if write is None:
                matlab_v73(path, t=np.arange(60.0), g=GYRO_RATES, imu={"a": np.arange(60.0), "b": np.int16(GYRO_RATES)})
            else:
                path = write(path)
            if path.is_dir():
                path = next(one for one in path.iterdir() if one.suffix in (".db3", ".mcap"))
            yield path.read_bytes()

    return make


def run(family, valid, folder, count, seed):
    contents = list(valid(family))
    outcomes = {"read": 0, "refused": 0}
    path = folder / "damaged"
    for number, content in enumerate(contents):
        path.write_bytes(content)
        assert survive(SOURCES[family][0], path) == "read"
        for damaged in mutants(content, max(1, count // len(contents)), seed + number):
            path.write_bytes(damaged)
            outcomes[survive(SOURCES[family][0], path)] += 1
    assert min(outcomes.values()) > 0, outcomes
    return outcomes


@pytest.mark.parametrize("family", SOURCES)
def test_damaged_files(family, valid, tmp_path):
    run(family, valid, tmp_path, 100, 1)


@pytest.mark.full
@pytest.mark.timeout(7200)
@pytest.mark.parametrize("family", SOURCES)
def test_many_damaged_files(family, valid, tmp_path):
    run(family, valid, tmp_path, 10_000, 1000)


def test_damaged_folders_of_bags(tmp_path):
    folder = write_bag(tmp_path / "log", "mcap", GYRO_RATES[:8])
    described = folder / "metadata.yaml"
    for damaged in mutants(described.read_bytes(), 40, 3, keep=0):
        described.write_bytes(damaged)
        survive(bag.open_log, folder)


def test_damaged_compressed_files(tmp_path):
    content = gzip.compress(write_ulog(tmp_path / "log").read_bytes())
    path = tmp_path / "damaged.gz"
    for damaged in mutants(content, 40, 4, keep=3):
        path.write_bytes(damaged)
        survive(lambda one: open_log(one, Log(family="ulog")), path)


def test_the_magic_alone_and_magic_of_others(tmp_path, valid):
    """First bytes of one family, the rest of another: each reader refuses, or reads what is there."""
    contents = {family: next(valid(family)) for family in SOURCES}
    for family, (read, _) in SOURCES.items():
        for other, content in contents.items():
            path = tmp_path / "mixed"
            path.write_bytes(contents[family][:16] + content[16:])
            outcome = survive(read, path)
            assert outcome == "read" if family == other else outcome in ("read", "refused")
        path.write_bytes(contents[family][:16])
        assert survive(read, path) == "refused"
