"""Which family a file is of, by its content; compressed ones; what is none of them."""

import builtins
import gzip
import pickle
import struct
import subprocess
import zipfile
from typing import get_args

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from bag_bytes import write_bag
from scipy.io import savemat
from ulog_bytes import GYRO, gyro, head, subscribed

import vgyro.log
from vgyro.errors import DataError
from vgyro.log import Log
from vgyro.storage.logs import families
from vgyro.storage.logs.families import FAMILIES, family_of, open_log

ULOG = head(GYRO) + subscribed(0, "sensor_gyro") + b"".join(gyro(0, 100 * k, k, 2, 3) for k in range(50))


@pytest.fixture
def made(tmp_path, matlab_v73):
    """A file of each family, under a name that says nothing."""
    files = {name: tmp_path / f"{name}.x" for name in ("parquet", "ulog", "numpy", "npz", "matlab", "text")}
    pq.write_table(pa.table({"x": [1.0, 2.0]}), files["parquet"])
    files["ulog"].write_bytes(ULOG)
    with open(files["numpy"], "wb") as file:
        np.save(file, np.zeros((5, 2)))
    with open(files["npz"], "wb") as file:
        np.savez(file, x=np.zeros(5))
    with open(files["matlab"], "wb") as file:
        savemat(file, {"x": np.zeros(5)})
    files["text"].write_text("t,x\n0,1\n1,2\n")
    files["v73"] = matlab_v73(tmp_path / "v73.x", x=np.zeros(5))
    files["ros1"] = write_bag(tmp_path / "ros1.x", "ros1", np.ones((5, 3)))
    files["folder"] = write_bag(tmp_path / "bag", "mcap", np.ones((5, 3)))
    files["mcap"] = files["folder"] / "bag.mcap"
    files["db3"] = write_bag(tmp_path / "lite", "sqlite", np.ones((5, 3))) / "lite.db3"
    return files


KIND = {
    "parquet": "parquet", "ulog": "ulog", "numpy": "numpy", "npz": "numpy", "matlab": "matlab", "v73": "matlab",
    "ros1": "bag", "folder": "bag", "mcap": "bag", "db3": "bag",
}  # fmt: skip


def test_every_family_of_a_manifest_is_entered():
    assert sorted(FAMILIES) == sorted(get_args(vgyro.log.Family))


def test_each_is_known_by_its_content(made):
    for name, family in KIND.items():
        assert family_of(made[name]) == family, name
        log = open_log(made[name], Log())
        assert log.family == family
        first = log.tables[0]
        assert sum(rows.batch.num_rows for rows in log.rows(first.name, [first.columns[0].name])) > 1


def test_texts_are_known_whatever_their_name(made, tmp_path):
    pytest.importorskip("vgyro.storage.logs.text")
    path = tmp_path / "log.mat"
    path.write_bytes(made["text"].read_bytes())
    assert family_of(path) == family_of(made["text"]) == "text"
    (tmp_path / "log.gz").write_bytes(gzip.compress(made["text"].read_bytes()))
    assert family_of(tmp_path / "log.gz") == "text"


def zstd(content: bytes) -> bytes:
    return pa.compress(content, "zstd", asbytes=True)


@pytest.mark.parametrize(("pack", "name"), [(gzip.compress, "gzip"), (zstd, "zstd")])
def test_compressed_ones_are_unpacked_and_cleared_away(made, tmp_path, monkeypatch, pack, name):
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(scratch))
    for kind in ("ulog", "parquet", "matlab", "ros1", "mcap", "db3"):
        path = tmp_path / f"{kind}.packed"
        path.write_bytes(pack(made[kind].read_bytes()))
        log = open_log(path, Log())
        assert (log.path, log.family, log.account.compression) == (path, KIND[kind], name)
        assert log.account.content_bytes == made[kind].stat().st_size
        first = log.tables[0]
        assert sum(rows.batch.num_rows for rows in log.rows(first.name, [first.columns[0].name])) > 1
        del log
    assert list(scratch.iterdir()) == []


def test_one_that_unpacks_to_too_much_is_to_be_unpacked_first(tmp_path, monkeypatch):
    path = tmp_path / "log.ulg.gz"
    path.write_bytes(gzip.compress(ULOG))
    monkeypatch.setattr(families, "UNPACKED_MOST", len(ULOG))
    assert open_log(path, Log()).family == "ulog"
    monkeypatch.setattr(families, "UNPACKED_MOST", len(ULOG) - 1)
    with pytest.raises(DataError, match=r"unpacks to more than.*gunzip"):
        open_log(path, Log())


def test_a_compressed_one_that_is_cut_is_read_as_far_as_it_goes(tmp_path):
    path = tmp_path / "log.ulg.gz"
    noise = np.random.default_rng(1).normal(size=(3000, 3)).tolist()
    whole = head(GYRO) + subscribed(0, "sensor_gyro") + b"".join(gyro(0, k, *row) for k, row in enumerate(noise))
    path.write_bytes(gzip.compress(whole)[:-5000])
    log = open_log(path, Log())
    assert any("gzip data break off" in note for note in log.account.notes)
    assert 1000 < sum(rows.batch.num_rows for rows in log.rows("sensor_gyro", ["x"])) < 3000


def zipped(*names: str) -> bytes:
    from io import BytesIO

    made = BytesIO()
    with zipfile.ZipFile(made, "w") as archive:
        for name in names:
            archive.writestr(name, "x")
    return made.getvalue()


TLOG = struct.pack(">Q", 1_700_000_000_000_000) + b"\xfd\x09\0\0\0\1\1\0\0\0" + bytes(20)
MAT4 = struct.pack("<5i", 0, 3, 2, 0, 5) + b"gyro\0" + bytes(48)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"\x89PNG\r\n\x1a\n" + bytes(50), "PNG picture.*Take it off"),
        (zipped("[Content_Types].xml", "xl/workbook.xml"), "Excel workbook.*CSV"),
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(50), "old Excel workbook"),
        (zipped("a.csv"), "zip archive.*Unpack"),
        (TLOG, r"MAVLink .tlog.*mavlogdump"),
        (pickle.dumps({"gyro": [1, 2]}), "Python pickle"),
        (pickle.dumps([1.0]), "Python pickle"),
        (MAT4, "MATLAB 4 file.*save -v7"),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n", "Git LFS pointer.*git lfs pull"),
        (b"<!DOCTYPE html><html>", "web page"),
        (b"%PDF-1.7\n", "PDF"),
        (b"BZh91AY&SY" + bytes(30), "compressed by bzip2"),
        (b"ARROW1\0\0" + bytes(30), "Feather.*Parquet"),
        (b"\xa3\x95\x80\x80" + bytes(30), "DataFlash"),
        (b"#ROSBAG V1.2\n" + bytes(30), "version 1"),
    ],
)  # fmt: skip
def test_what_is_none_is_named(tmp_path, content, said):
    path = tmp_path / "log.csv"
    path.write_bytes(content)
    with pytest.raises(DataError, match=said):
        family_of(path)


def test_what_nobody_knows_lists_what_is_read(tmp_path):
    pytest.importorskip("vgyro.storage.logs.text")
    path = tmp_path / "log.bin"
    path.write_bytes(bytes(range(0, 256, 3)) * 20)
    with pytest.raises(DataError, match=r"begins 00 03.*Parquet \(\.parquet\), PX4 ULog"):
        family_of(path)


def test_empty_missing_and_folders(tmp_path):
    (tmp_path / "a.csv").write_bytes(b"")
    with pytest.raises(DataError, match="empty: 0 bytes"):
        family_of(tmp_path / "a.csv")
    with pytest.raises(DataError, match="no such file"):
        family_of(tmp_path / "b.csv")
    with pytest.raises(DataError, match="is a folder"):
        family_of(tmp_path)
    (tmp_path / "c.gz").write_bytes(b"\x1f\x8b\x08")
    with pytest.raises(DataError, match="no whole block of gzip"):
        family_of(tmp_path / "c.gz")


def test_a_manifest_may_name_the_family(made):
    with pytest.raises(DataError, match="not a readable ULog"):
        open_log(made["parquet"], Log(family="ulog"))
    assert open_log(made["ulog"], Log(family="ulog")).family == "ulog"


@pytest.mark.parametrize(("kind", "library"), [("ulog", "pyulog"), ("ros1", "rosbags"), ("v73", "h5py")])
def test_a_missing_library_is_named(made, monkeypatch, kind, library):
    plain = builtins.__import__

    def without(name, *rest, **more):
        if name.split(".")[0] == library:
            raise ImportError(name)
        return plain(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(DataError, match=rf"needs the library {library}.*pip install 'vgyro\[logs\]'"):
        open_log(made[kind], Log())
    assert FAMILIES[KIND[kind]].library == library


def test_heavy_libraries_are_left_alone_until_they_are_needed():
    code = (
        "import sys, vgyro.storage.logs.families\n"
        "print([name for name in ('h5py', 'pyulog', 'rosbags', 'scipy') if name in sys.modules])"
    )
    import sys

    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert said.strip() == "[]"
