"""MATLAB: 5.0 files (SciPy writes them, and is asked), v7.3 by h5py; structs by dots; objects, cells … with a note."""

import struct
import tracemalloc

import numpy as np
import pyarrow as pa
import pytest
from scipy.io import loadmat, savemat

from vgyro.errors import DataError
from vgyro.storage.logs.binary.matlab import open_log

T = 1000
RNG = np.random.default_rng(1)
GYRO = RNG.normal(size=(T, 3))
VALUES = {
    "t": np.arange(T) / 100, "gyro": GYRO, "acc": np.float32(GYRO.T), "rate": 100.0, "other": np.ones((7, 2)),
    "imu": {"count": np.arange(T, dtype=np.int16), "deep": {"temp": GYRO[:, :2]}},
}  # fmt: skip


@pytest.fixture(params=["plain", "compressed", "v7.3"])
def written(request, tmp_path, matlab_v73):
    def write(**arrays):
        path = tmp_path / "log.mat"
        if request.param == "v7.3":
            return matlab_v73(path, **arrays)
        savemat(path, arrays, do_compression=request.param == "compressed", oned_as="column")
        return path

    return write


def test_vectors_and_matrices_of_one_length_are_one_table(written, table):
    log = open_log(written(**VALUES))
    assert sorted(one.name for one in log.tables) == ["", "other"]
    found = table(log, "")
    assert log.tables[0].rows == T
    wide = [f"{name}[{k}]" for name in ("gyro", "acc") for k in range(3)]
    assert sorted(found.column_names) == sorted([*wide, "t", "imu.count", "imu.deep.temp[0]", "imu.deep.temp[1]"])
    assert np.array_equal(found["t"].to_numpy(), VALUES["t"])
    assert np.array_equal(found["imu.count"].to_numpy(), np.arange(T))
    assert np.array_equal(found["imu.deep.temp[1]"].to_numpy(), GYRO[:, 1])
    for k in range(3):
        assert np.array_equal(found[f"gyro[{k}]"].to_numpy(), GYRO[:, k])
        assert np.array_equal(found[f"acc[{k}]"].to_numpy(), np.float32(GYRO[:, k]))
    assert table(log, "other").to_pydict() == {"other[0]": [1.0] * 7, "other[1]": [1.0] * 7}


def test_matrices_alone_are_a_table_each(written, table):
    log = open_log(written(a=GYRO, b=GYRO[:10]))
    assert [(one.name, one.rows) for one in log.tables] == [("a", T), ("b", 10)]
    assert np.array_equal(table(log, "b", "b[2]")["b[2]"].to_numpy(), GYRO[:10, 2])


def test_large_matrices_come_in_blocks(written):
    log = open_log(written(x=np.arange(600_000.0)))
    assert [rows.batch.num_rows for rows in log.rows("", ["x"])] == [1 << 18, 1 << 18, 600_000 - (1 << 19)]


def test_a_file_that_is_cut(written, tmp_path):
    whole = written(**VALUES).read_bytes()
    for length in (0, 4, 130, len(whole) // 2, len(whole) - 1):
        path = tmp_path / "cut.mat"
        path.write_bytes(whole[:length])
        with pytest.raises(DataError):
            open_log(path)


def test_what_is_no_number_is_noted(tmp_path, table):
    path = tmp_path / "log.mat"
    cell = np.array([1, "x"], dtype=object)
    structs = np.array([(1,), (2,)], dtype=[("a", object)])
    savemat(path, {"x": np.arange(3), "c": cell, "s": "text", "z": np.ones(3) * 1j, "many": structs})
    log = open_log(path)
    assert table(log, "").to_pydict() == {"x": [0, 1, 2]}
    assert log.account.notes == [
        "c is a cell array: left out", "s is a char array: left out", "z is complex: left out",
        "many is a struct array: left out",
    ]  # fmt: skip


@pytest.mark.parametrize("compressed", [False, True])
def test_every_type_of_number_is_read_as_scipy_does(tmp_path, table, compressed):
    path = tmp_path / "log.mat"
    kinds = ["f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "?"]
    savemat(
        path,
        {f"v{kind.strip('?')}": RNG.integers(0, 100, 50).astype(kind) for kind in kinds},
        do_compression=compressed,
    )
    found, expected = table(open_log(path), ""), loadmat(path, mat_dtype=True)
    for name in found.column_names:
        assert np.array_equal(found[name].to_numpy(), expected[name][0])
        assert found[name].to_numpy().dtype == np.uint8 if name == "v" else expected[name].dtype
    assert len(found.column_names) == len(kinds)


def test_doubles_stored_as_whole_numbers_and_big_endian(tmp_path, table):
    """As MATLAB saves doubles that are whole, and as it did on a SPARC: neither does SciPy write."""
    for order, mark in (("<", b"IM"), (">", b"MI")):

        def element(kind, content, order=order):
            return struct.pack(f"{order}II", kind, len(content)) + content + bytes(-len(content) % 8)

        flags, shape = struct.pack(f"{order}II", 6, 0), struct.pack(f"{order}ii", 1, 3)
        values = struct.pack(f"{order}3h", 1, -2, 300)
        name = (struct.pack("<HH", 1, 1) if order == "<" else struct.pack(">HH", 1, 1)) + b"x\0\0\0"
        array = element(14, element(6, flags) + element(5, shape) + name + element(3, values))
        path = tmp_path / "log.mat"
        path.write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + (b"\0\1" if order == "<" else b"\1\0") + mark + array)
        assert loadmat(path)["x"].tolist() == [[1, -2, 300]]
        found = table(open_log(path), "")["x"]
        assert (found.to_pylist(), found.type) == ([1.0, -2.0, 300.0], pa.float64())


def test_what_is_not_compressed_is_not_loaded(tmp_path):
    path = tmp_path / "log.mat"
    savemat(path, {"g": np.zeros((2_000_000, 3))})
    tracemalloc.start()
    rows = sum(one.batch.num_rows for one in open_log(path).rows("g", ["g[1]"]))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert rows == 2_000_000
    assert peak < 10e6


def test_a_timetable_is_told_how_to_be_saved(tmp_path, matlab_v73, table):
    path = matlab_v73(tmp_path / "log.mat", objects=["tt"])
    with pytest.raises(DataError, match=r"tt is an object of MATLAB \(timetable\).*Save it as a struct"):
        open_log(path)
    log = open_log(matlab_v73(tmp_path / "both.mat", objects=["tt"], x=np.arange(4.0)))
    assert table(log, "").to_pydict() == {"x": [0, 1, 2, 3]}
    assert log.account.notes == ["tt is an object of MATLAB (timetable): left out"]


def test_hdf5_of_other_programs_is_not_transposed(tmp_path, table):
    import h5py

    path = tmp_path / "log.h5"
    with h5py.File(path, "w") as file:
        file["t"], file["imu/gyro"] = np.arange(T), GYRO
        file["far"] = h5py.ExternalLink("other.h5", "/x")
    log = open_log(path)
    found = table(log, "")
    assert found.column_names == ["imu.gyro[0]", "imu.gyro[1]", "imu.gyro[2]", "t"]
    assert np.array_equal(found["imu.gyro[2]"].to_numpy(), GYRO[:, 2])


def test_hdf5_that_claims_more_than_it_stores(tmp_path):
    import h5py

    path = tmp_path / "log.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("x", shape=(1 << 40,), dtype="f8", chunks=(1024,))
    with pytest.raises(DataError, match="claims"):
        open_log(path)
