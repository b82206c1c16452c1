"""NumPy: .npy mapped, fields, .npz streamed; no pickles."""

import tracemalloc
import zipfile

import numpy as np
import pytest

from vgyro.errors import DataError
from vgyro.storage.logs.binary.numpy_file import open_log

RNG = np.random.default_rng(1)


def test_a_matrix_has_the_columns_c1_to_cn(tmp_path, table):
    values = RNG.normal(size=(1000, 3))
    for name, made in (("c", values), ("f", np.asfortranarray(values)), ("big", values.astype(">f8"))):
        np.save(tmp_path / f"{name}.npy", made)
        log = open_log(tmp_path / f"{name}.npy")
        found = table(log, "")
        assert found.column_names == ["c1", "c2", "c3"]
        assert log.tables[0].rows == 1000
        assert np.array_equal(np.stack([found[name].to_numpy() for name in found.column_names], 1), values)


def test_a_vector_is_c1(tmp_path, table):
    np.save(tmp_path / "v.npy", np.arange(5, dtype=np.int16))
    assert table(open_log(tmp_path / "v.npy"), "").to_pydict() == {"c1": [0, 1, 2, 3, 4]}


def test_fields_dates_and_truth(tmp_path, table):
    kind = [("t", "M8[ms]"), ("gyro", "<i2", 2), ("at", [("x", "f2")]), ("on", "?"), ("who", "S3"), ("d", "m8[us]")]
    np.save(
        tmp_path / "s.npy",
        np.array([(1, (2, 3), (0.5,), True, b"ab", 7), ("NaT", (4, 5), (1.5,), False, b"c", 8)], kind),
    )
    log = open_log(tmp_path / "s.npy")
    assert table(log, "").to_pydict() == {
        "t": [1_000_000, None], "gyro[0]": [2, 4], "gyro[1]": [3, 5], "at.x": [0.5, 1.5], "on": [1, 0],
        "who": ["ab", "c"], "d": [7000, 8000],
    }  # fmt: skip
    kinds = {one.name: (one.kind, one.unit) for one in log.tables[0].columns}
    assert (kinds["t"], kinds["who"], kinds["d"]) == (("date", ""), ("text", ""), ("number", "ns"))


def test_dates_beyond_ns_are_refused(tmp_path, table):
    np.save(tmp_path / "in.npy", np.array(["1677-09-22", "2262-04-10"], "M8[D]"))
    np.save(tmp_path / "out.npy", np.array(["1677-09-22", "2262-04-12"], "M8[D]"))
    for name in ("in", "out"):
        with pytest.raises(DataError, match="no table of numbers"):
            open_log(tmp_path / f"{name}.npy")
    for last, refused in (("2262-04-10", False), ("2262-04-12", True)):
        np.savez(tmp_path / "d.npz", t=np.array(["2000-01-01", last], "M8[D]"), x=np.zeros(2))
        log = open_log(tmp_path / "d.npz")
        if refused:
            with pytest.raises(DataError, match="1678 to 2262"):
                table(log, "", "t")
        else:
            assert table(log, "", "t")["t"][1].as_py() == np.datetime64(last, "ns").astype(int)


def test_arrays_of_a_npz_together_and_alone(tmp_path, table):
    time, gyro, other = np.arange(70_000) / 100, RNG.normal(size=(70_000, 3)), np.ones((7, 2), np.int8)
    np.savez_compressed(
        tmp_path / "a.npz", t=time, gyro=gyro, turned=gyro.T, fortran=np.asfortranarray(gyro), other=other, rate=100.0,
        short=np.arange(3), bad=np.array([None]), z=np.ones(4, complex),
    )  # fmt: skip
    log = open_log(tmp_path / "a.npz")
    assert [one.name for one in log.tables] == ["", "other", "short"]
    found = table(log, "")
    for name in ("gyro", "turned", "fortran"):
        assert np.array_equal(np.stack([found[f"{name}[{k}]"].to_numpy() for k in range(3)], 1), gyro)
    assert np.array_equal(found["t"].to_numpy(), time)
    assert table(log, "other").to_pydict() == {"other[0]": [1] * 7, "other[1]": [1] * 7}
    assert [note.split(" ")[0] for note in log.account.notes] == ["bad", "z"]


def test_neither_is_loaded_whole(tmp_path):
    np.save(tmp_path / "a.npy", np.zeros((4_000_000, 3), np.float32))
    np.savez_compressed(tmp_path / "a.npz", x=np.zeros(8_000_000))
    for name, column in (("a.npy", "c1"), ("a.npz", "x")):
        tracemalloc.start()
        rows = sum(one.batch.num_rows for one in open_log(tmp_path / name).rows("", [column]))
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert rows == (4_000_000 if name == "a.npy" else 8_000_000)
        assert peak < 20e6


def test_pickles_are_refused(tmp_path):
    np.save(tmp_path / "o.npy", np.array([{}, 1], dtype=object), allow_pickle=True)
    with pytest.raises(DataError, match="could run any program"):
        open_log(tmp_path / "o.npy")
    np.savez(tmp_path / "o.npz", o=np.array([{}, 1], dtype=object))
    with pytest.raises(DataError, match="o holds Python objects"):
        open_log(tmp_path / "o.npz")


def test_shapes_that_are_no_table(tmp_path):
    for shape, said in (
        ((2, 2, 2), "3 dimensions"),
        ((), "0 dimensions"),
        ((3, 4097), "3 rows of 4097 columns"),
        ((0, 3), "0 rows"),
    ):
        np.save(tmp_path / "a.npy", np.zeros(shape))
        with pytest.raises(DataError, match=said):
            open_log(tmp_path / "a.npy")
    np.save(tmp_path / "a.npy", np.zeros((3, 4096)))
    assert len(open_log(tmp_path / "a.npy").tables[0].columns) == 4096
    np.save(tmp_path / "a.npy", np.zeros((3, 2), complex))
    with pytest.raises(DataError, match="complex"):
        open_log(tmp_path / "a.npy")


def test_files_that_are_cut(tmp_path):
    np.save(tmp_path / "a.npy", np.zeros((100, 3)))
    whole = (tmp_path / "a.npy").read_bytes()
    for length in (0, 5, 60, len(whole) - 1):
        (tmp_path / "b.npy").write_bytes(whole[:length])
        with pytest.raises(DataError):
            open_log(tmp_path / "b.npy")


def test_an_array_of_a_npz_that_claims_too_much(tmp_path):
    np.save(tmp_path / "a.npy", np.zeros(1000))
    lie = (tmp_path / "a.npy").read_bytes().replace(b"(1000,)", b"(9999999,)", 1)
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("x.npy", lie)
    with pytest.raises(DataError):
        open_log(tmp_path / "a.npz")
