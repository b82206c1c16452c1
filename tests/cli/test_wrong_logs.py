"""Files that are no log, or none that can be used: one line says what, where, what to do, in no library's words."""

import gzip
import re

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

RNG = np.random.default_rng(0)
NOISE = RNG.standard_normal(200)


def rows(form, count=200):
    return "\n".join(form(k) for k in range(count)) + "\n"


def parquet_of_text(path):
    pq.write_table(pa.table({"t": ["a", "b"], "gx": ["c", "d"]}), path)


NPY_HEAD = b"\x93NUMPY\x01\0\x76\0" + (
    b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000, 3), }".ljust(117) + b"\n"
)

# name: (what is in it, what must be said, what to do)
WRONG = {
    "picture.png": (b"\x89PNG\r\n\x1a\n" + RNG.bytes(500), "is a PNG picture", "name a dump or a log"),
    "book.xlsx": (b"PK\x03\x04" + bytes(26) + b"[Content_Types].xml" + RNG.bytes(300), "Excel", "save it as CSV"),
    "page.html": ("<!DOCTYPE html><html>Not found</html>", "is a web page", "download the file itself"),
    "pointer.csv": ("version https://git-lfs.github.com/spec/v1\n", "Git LFS pointer", "git lfs pull"),
    "empty.csv": ("", "is empty: 0 bytes", "copy it again"),
    "header.csv": ("t,gx,gy,gz\n", "line 1: holds only a header: found 't,gx,gy,gz'", "header"),
    "letter.txt": ("Dear colleague,\nthe gyros were warm.\n" * 5, "line 1: holds no table of numbers", "header"),
    "one.csv": ("t,gx,gy\n0.0,0.1,0.2\n", "holds 1 row of numbers, too few", "10 rows or more"),
    "words.csv": ("name,place\nanna,berlin\n" * 20, "found 'name,place', expected a row of numbers", "header"),
    "power.csv": ("t,volts,amps\n" + rows(lambda k: f"{k / 100},3.3,{k}"), "t, volts, amps", "array"),
    "noise.bin": (RNG.bytes(5000), "no log that vgyro reads (it begins", "text with columns"),
    "half.csv.gz": (gzip.compress(b"")[:-4], "no whole block of gzip", "copy it again"),
    "cut.parquet": (b"PAR1" + RNG.bytes(100), "is not a readable Parquet file: damaged", "copy it again"),
    "cut.ulg": (b"ULog\x01\x12\x35\x01" + RNG.bytes(200), "holds no table of numbers", "closed properly"),
    "cut.bag": (b"#ROSBAG V2.0\n" + RNG.bytes(200), "is not a readable ROS bag", "copy it again"),
    "cut.mcap": (b"\x89MCAP0\r\n" + RNG.bytes(100), "MCAP file without a header", "copy it again"),
    "cut.db3": (b"SQLite format 3\0" + RNG.bytes(200), "is not a readable ROS bag", "copy it again"),
    "cut.mat": (b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\1IM" + RNG.bytes(300), "MATLAB file", "copy it again"),
    "cut.npy": (NPY_HEAD, "is not a readable NumPy file", "copy it again"),
    "cube.npy": (lambda path: np.save(path, np.zeros((3, 4, 5))), "3 dimensions", "[time, channel]"),
    "text.npy": (lambda path: np.save(path, np.array(["a", "b"])), "no table of numbers", "check"),
    "text.parquet": (parquet_of_text, "no table of numbers", "check"),
    "acc.csv": ("t,ax,ay\n" + rows(lambda k: f"{k / 100},{NOISE[k]:.3f},9.81"), "no column looks like a gyro", "array"),
    "still.csv": ("t,gx\n" + rows(lambda k: f"5.0,{NOISE[k]:.3f}"), "(t: does not go up)", "--rate HZ"),
    "nan.csv": ("t,gx\n" + rows(lambda k: f"{k / 100},NaN"), "(gx) have no value in the first 200 rows", "logger"),
    "inf.csv": ("t,gx\n" + rows(lambda k: f"{k / 100},inf"), "(gx) have no value in the first 200 rows", "logger"),
    "counts.csv": ("t,gx\n" + rows(lambda k: f"{k / 100},{round(20 * NOISE[k])}"), "whole numbers", "--scale"),
    "missing.csv": (None, "no such file", "check the path"),
    "folder": ("folder", "is an empty folder", "folder of logs"),
}  # fmt: skip


def write(path, content):
    if content == "folder":
        path.mkdir()
    elif callable(content):
        content(path)
    elif content is not None:
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def is_plain(message):
    """One line, and nothing of Python or of a library in it."""
    assert len(message.strip().splitlines()) == 1
    assert "Traceback" not in message
    assert not re.search(r"\b\w*(Error|Exception|Invalid|Warning)\b", message)
    assert not re.search(r"numpy|pyarrow|rosbags|pyulog|pydantic|<class|object at|NoneType|mmap", message)
    return True


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_file_is_named_with_what_it_is_and_what_to_do(project, vgyro, name):
    content, what, remedy = WRONG[name]
    path = write(project / name, content)
    outcome = vgyro("new-dataset", path, "--name", "log")
    assert outcome.code in (2, 4)
    assert outcome.out == ""
    assert outcome.err.startswith(f"vgyro: {path}")
    assert what in outcome.err
    assert remedy.lower() in outcome.err.lower()
    assert is_plain(outcome.err)
    assert not (project / "raw/log").exists()


@pytest.mark.parametrize(("count", "code"), [(9, 4), (10, 0)])
def test_ten_rows_are_looked_at(project, vgyro, count, code):
    path = write(project / "a.csv", "t,gx\n" + rows(lambda k: f"{k / 100:.2f},{NOISE[k]:.3f}", count))
    assert vgyro("new-dataset", path, "--name", "log").code == code


def good(header="t,gx,gy"):
    return f"{header}\n" + rows(lambda k: f"{k / 100:.2f},{NOISE[k]:.3f},{NOISE[-k]:.3f}")


def test_two_logs_of_other_columns(project, vgyro):
    paths = [write(project / "a.csv", good()), write(project / "b.csv", good("t,gx,gz"))]
    outcome = vgyro("new-dataset", *paths, "--name", "log", "--separate")
    assert outcome.code == 4
    assert f"{paths[1]}: its gyros have other columns (gx, gz) than those of a.csv" in outcome.err
    assert is_plain(outcome.err)


def test_a_good_and_a_wrong_file(project, vgyro):
    paths = [write(project / "a.csv", good()), write(project / "b.png", b"\x89PNG\r\n\x1a\n" + bytes(100))]
    outcome = vgyro("new-dataset", *paths, "--name", "log")
    assert outcome.code == 4
    assert f"{paths[1]}: is a PNG picture" in outcome.err
