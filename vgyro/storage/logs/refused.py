"""Files that are no log vgyro reads, told apart by their first bytes: what each is, and what to do."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from vgyro.errors import DataError

AS_CSV = "export the columns as CSV or Parquet"
UNPACK = "unpack it, and name the files in it"
NOT_A_LOG = "take it off `files` in the manifest"
YEARS_US = (946_684_800_000_000, 4_102_444_800_000_000)
"""2000 to 2100, µs since 1970."""


class RefusedFamily(NamedTuple):
    """A kind of file: how it begins, what it is, what to do instead."""

    begins: tuple[bytes, ...] | Callable[[bytes], bool]
    what: str
    remedy: str


def _tlog(head: bytes) -> bool:
    """MAVLink frames, each after a time in µs."""
    if len(head) < 9 or head[8] not in (0xFD, 0xFE):
        return False
    (time,) = struct.unpack_from(">Q", head)
    stamped: bool = YEARS_US[0] < time < YEARS_US[1]
    return stamped


def _zip_holds(*names: bytes) -> Callable[[bytes], bool]:
    return lambda head: head.startswith(b"PK\x03\x04") and any(name in head[30:] for name in names)


def _pickle(head: bytes) -> bool:
    return len(head) > 2 and head[0] == 0x80 and 2 <= head[1] <= 5 and head[2:3] in b"\x95}](cXKM"


def _mat4(head: bytes) -> bool:
    """Five numbers of 32 bits: type, rows, columns, complex?, length of the name; then the name."""
    if len(head) < 24:
        return False
    for order in "<>":
        kind, rows, columns, imaginary, name = struct.unpack_from(f"{order}5i", head)
        if kind in (*range(0, 60, 10), *range(1000, 1060, 10)) and rows > 0 < columns and imaginary in (0, 1):
            return 1 < name < 64 and head[20 : 20 + name][-1:] == b"\0" and head[20 : 19 + name].isascii()
    return False


REFUSED: tuple[RefusedFamily, ...] = (
    RefusedFamily((b"\x89PNG\r\n",), "a PNG picture", NOT_A_LOG),
    RefusedFamily((b"\xff\xd8\xff",), "a JPEG picture", NOT_A_LOG),
    RefusedFamily((b"GIF87a", b"GIF89a"), "a GIF picture", NOT_A_LOG),
    RefusedFamily((b"%PDF-",), "a PDF document", NOT_A_LOG),
    RefusedFamily(
        _zip_holds(b"[Content_Types].xml", b"xl/", b"_rels/"), "an Excel workbook or Office document", "save it as CSV"
    ),
    RefusedFamily(_zip_holds(b"opendocument"), "an OpenDocument spreadsheet", "save it as CSV"),
    RefusedFamily((b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1",), "an old Excel workbook (.xls)", "save it as CSV"),
    RefusedFamily((b"PK\x03\x04", b"PK\x05\x06"), "a zip archive", UNPACK),
    RefusedFamily((b"7z\xbc\xaf\x27\x1c",), "a 7-Zip archive", UNPACK),
    RefusedFamily((b"Rar!\x1a\x07",), "a RAR archive", UNPACK),
    RefusedFamily((b"BZh",), "compressed by bzip2", UNPACK),
    RefusedFamily((b"\xfd7zXZ\0",), "compressed by xz", UNPACK),
    RefusedFamily((b"\x04\x22\x4d\x18",), "compressed by lz4", UNPACK),
    RefusedFamily(lambda head: head[257:262] == b"ustar", "a tar archive", UNPACK),
    RefusedFamily((b"#ROSBAG V1",), "a ROS bag of version 1", "convert it: rosbag fix"),
    RefusedFamily(
        _tlog, "a MAVLink .tlog", "convert it to CSV (mavlogdump.py --format csv), or take the ULog from the board"
    ),
    RefusedFamily(
        (b"\xa3\x95\x80",), "an ArduPilot DataFlash log (.bin)", "convert it to CSV (mavlogdump.py --format csv)"
    ),
    RefusedFamily((b"H Product:Blackbox",), "a Betaflight blackbox log", "convert it to CSV: blackbox_decode"),
    RefusedFamily((b"TDSm",), "a LabVIEW TDMS file", AS_CSV),
    RefusedFamily((b"MDF     ", b"UnFinMF "), "an ASAM MDF file", AS_CSV),
    RefusedFamily((b"ARROW1\0\0", b"FEA1"), "an Arrow or Feather file", "save it as Parquet"),
    RefusedFamily((b"Obj\x01",), "an Avro file", AS_CSV),
    RefusedFamily((b"ORC",), "an ORC file", "save it as Parquet"),
    RefusedFamily(lambda head: head[:4] == b"RIFF" and head[8:12] == b"WAVE", "a WAV sound", AS_CSV),
    RefusedFamily((b"\x7fELF", b"MZ"), "a program", NOT_A_LOG),
    RefusedFamily(_pickle, "a Python pickle, which could run any program", "save it as Parquet, or by numpy.save"),
    RefusedFamily(_mat4, "a MATLAB 4 file", "save it again in MATLAB: save -v7"),
    RefusedFamily((b"version https://git-lfs",), "a Git LFS pointer, not the file itself", "fetch it: git lfs pull"),
    RefusedFamily((b"<!DOCTYPE html", b"<!doctype html", b"<html"), "a web page", "download the file itself"),
    RefusedFamily((b"{\\rtf",), "an RTF document", "save it as plain text"),
)


def named(head: bytes) -> RefusedFamily | None:
    """What a file is that is none of the logs; None where nobody knows."""
    for kind in REFUSED:
        if kind.begins(head) if callable(kind.begins) else head.startswith(kind.begins):
            return kind
    return None


def refusal(head: bytes, path: Path, families: str) -> DataError:
    """The error for a file that is none of the logs; families: what is read, for people."""
    if kind := named(head):
        return DataError(f"is {kind.what}", str(path), kind.remedy)
    shown = head[:8].hex(" ")
    return DataError(f"is no log that vgyro reads (it begins {shown})", str(path), f"give one of: {families}")
