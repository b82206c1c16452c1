"""The families of logs: what each is, how a file of it is known, and what opens it. A new family is entered here."""

from __future__ import annotations

import os
import shutil
import tempfile
import weakref
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from vgyro.errors import DataError
from vgyro.log import Log
from vgyro.storage.logs.refused import named, refusal
from vgyro.storage.logs.table import LogFile
from vgyro.storage.sources import GZIP, ZSTD, SourceFile, check_exists, read_blocks

HEAD = 8192
UNPACKED_MOST = 4 << 30
"""Most bytes that a compressed binary log may unpack to; a text is read without unpacking it first."""
HDF5 = b"\x89HDF\r\n\x1a\n"
BAGS = (b"#ROSBAG V2.0", b"\x89MCAP0\r\n", b"SQLite format 3\0")
PIECE = 1 << 20


@dataclass(frozen=True)
class LogFamily:
    """A family of logs.

    what    : for people;  endings : the usual ones
    sniff   : (first bytes, path) → is it one?
    open    : (path, how to read it, engine) → the log
    library : what it needs beside vgyro's own, from the extra vgyro[logs]; None: nothing
    """

    what: str
    endings: tuple[str, ...]
    sniff: Callable[[bytes, Path], bool]
    open: Callable[[Path, Log, str], LogFile]
    library: str | None = None


# A reader is imported when it is needed, and by its name as it stands, so that an edit of it re-runs what it read.
def _open_parquet(path: Path, _: Log, __: str) -> LogFile:
    from vgyro.storage.logs.binary import parquet

    return parquet.open_log(path)


def _open_ulog(path: Path, _: Log, __: str) -> LogFile:
    from vgyro.storage.logs.binary import ulog

    return ulog.open_log(path)


def _open_bag(path: Path, _: Log, __: str) -> LogFile:
    from vgyro.storage.logs.binary import bag

    return bag.open_log(path)


def _open_numpy(path: Path, _: Log, __: str) -> LogFile:
    from vgyro.storage.logs.binary import numpy_file

    return numpy_file.open_log(path)


def _open_matlab(path: Path, _: Log, __: str) -> LogFile:
    from vgyro.storage.logs.binary import matlab

    return matlab.open_log(path)


def _open_text(path: Path, log: Log, engine: str) -> LogFile:
    from vgyro.storage.logs import text

    return text.open_log(path, log.text, engine)


def _is_text(head: bytes, _: Path) -> bool:
    if named(head) is not None:
        return False
    from vgyro.storage.logs import text

    return text.looks_like_text(head)


def _is_bag(head: bytes, path: Path) -> bool:
    return head.startswith(BAGS) or (path / "metadata.yaml").is_file()


def _is_numpy(head: bytes, _: Path) -> bool:
    if head.startswith(b"\x93NUMPY"):
        return True
    length = int.from_bytes(head[26:28], "little")
    return head.startswith(b"PK\x03\x04") and head[30 : 30 + length].endswith(b".npy")


def _is_matlab(head: bytes, _: Path) -> bool:
    return head.startswith(b"MATLAB 5.0") or any(head[at : at + 8] == HDF5 for at in (0, 512, 1024, 2048, 4096))


FAMILIES: dict[str, LogFamily] = {
    "parquet": LogFamily("Parquet", (".parquet",), lambda head, _: head.startswith(b"PAR1"), _open_parquet),
    "ulog": LogFamily(
        "PX4 ULog", (".ulg", ".ulog"), lambda head, _: head.startswith(b"ULog\x01\x12\x35"), _open_ulog, "pyulog"
    ),
    "bag": LogFamily("ROS 1 or ROS 2 bag, MCAP", (".bag", ".mcap", ".db3"), _is_bag, _open_bag, "rosbags"),
    "numpy": LogFamily("NumPy array", (".npy", ".npz"), _is_numpy, _open_numpy),
    "matlab": LogFamily("MATLAB or HDF5 file", (".mat", ".h5", ".hdf5"), _is_matlab, _open_matlab, "h5py"),
    "text": LogFamily("text with columns", (".csv", ".tsv", ".txt", ".log", ".dat"), _is_text, _open_text),
}
"""By name, in the order in which they are tried."""


def family_of(path: Path) -> str:
    """The family of a log, by its content; that of a .gz or .zst, by what is in it.

    raises : DataError for a file that is missing, empty or none of them, with what it is instead
    """
    head, _ = _head(path)
    for name, family in FAMILIES.items():
        if family.sniff(head, path):
            return name
    known = ", ".join(f"{one.what} ({one.endings[0]})" for one in FAMILIES.values())
    raise refusal(head, path, known)


def _head(path: Path) -> tuple[bytes, str]:
    """The first bytes, unpacked, and the compression; none of a folder that is a bag."""
    check_exists(path)
    if path.is_dir():
        if (path / "metadata.yaml").is_file():
            return b"", "none"
        raise DataError("is a folder, not a log", str(path), "name the files in it")
    with open(path, "rb") as file:
        head = file.read(HEAD)
    if not head:
        raise DataError("is empty: 0 bytes", str(path), "copy it again from the logger, or take it off the list")
    compression = "gzip" if head.startswith(GZIP) else "zstd" if head.startswith(ZSTD) else "none"
    if compression != "none":
        source = SourceFile(path, path.name, path.stat().st_size, compression)
        head = bytes(next(iter(read_blocks(source, HEAD)), b""))
        if not head:
            raise DataError(f"holds no whole block of {compression}", str(path), "copy it again from the logger")
    return head, compression


def open_log(path: Path, log: Log, engine: str = "native") -> LogFile:
    """Open a log: by the family that the manifest names, or by its content. Only its head is read.

    A compressed log of a binary family is unpacked to a temporary file, which goes when the log is no longer used.
    raises : DataError for a file that cannot be read, with what it is and what to do
    """
    name = log.family or family_of(path)
    _, compression = _head(path)
    if compression == "none" or name == "text":
        return FAMILIES[name].open(path, log, engine)
    source = SourceFile(path, path.name, path.stat().st_size, compression)
    unpacked = _unpacked(source)
    try:
        opened = FAMILIES[name].open(unpacked, log, engine)
    except DataError as error:
        unpacked.unlink()
        raise DataError(error.what, str(path), error.remedy) from None
    weakref.finalize(opened, unpacked.unlink, missing_ok=True)
    opened.path, opened.account.compression = path, compression
    if source.cut_short:
        opened.account.notes.append(f"the {compression} data break off: what could be unpacked is read")
    return opened


def _unpacked(source: SourceFile) -> Path:
    """A temporary file with the content, beside the system's other ones.

    raises : DataError where it would be too large, or the disk too full
    """
    most = min(UNPACKED_MOST, shutil.disk_usage(tempfile.gettempdir()).free // 2)
    handle, name = tempfile.mkstemp(prefix="vgyro-", suffix=Path(source.path.stem).suffix)
    written = 0
    with os.fdopen(handle, "wb") as file:
        for block in read_blocks(source, PIECE):
            written += len(block)
            if written > most:
                Path(name).unlink()
                what = f"unpacks to more than {most // 2**20} MiB"
                raise DataError(what, str(source.path), "unpack it (gunzip -k, unzstd), and name the unpacked file")
            file.write(block)
    return Path(name)
