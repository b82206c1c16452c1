"""Files of a bag as rosbags wants them: ending right, reads bounded, an MCAP that breaks off given an end."""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from vgyro.errors import DataError
from vgyro.storage.logs.binary.opened import BoundedFile, Damaged

ROS1, MCAP, SQLITE = b"#ROSBAG V2.0", b"\x89MCAP0\r\n", b"SQLite format 3\0"
FOOTER = b"\x02" + struct.pack("<QQQI", 20, 0, 0, 0) + MCAP
HEADER, RECORD = 1, struct.Struct("<BQ")


class BoundedPath(type(Path())):  # type: ignore[misc]
    """A path whose files are read no further than they go, and whose cut MCAP files have an end."""

    def open(self, mode: str = "r", *args: Any, **kwargs: Any) -> Any:
        """Open the file."""
        if mode != "rb":
            return super().open(mode, *args, **kwargs)
        whole = whole_mcap(self)
        return BoundedFile(self) if whole is None else io.BufferedReader(_Tailed(self, whole, FOOTER))


class _Tailed(io.RawIOBase):
    """The first `length` bytes of a file, and a tail after them."""

    def __init__(self, path: Path, length: int, tail: bytes) -> None:
        self._file, self._length, self._tail, self._place = open(path, "rb"), length, tail, 0  # noqa: SIM115

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def close(self) -> None:
        self._file.close()
        super().close()

    def tell(self) -> int:
        return self._place

    def seek(self, offset: int, whence: int = 0, /) -> int:
        start = (0, self._place, self._length + len(self._tail))[whence]
        if start + offset < 0:
            raise Damaged("a place before the beginning")
        self._place = start + offset
        return self._place

    def readinto(self, buffer: Any, /) -> int:
        if self._place < self._length:
            self._file.seek(self._place)
            data = self._file.read(min(len(buffer), self._length - self._place))
        else:
            start = self._place - self._length
            data = self._tail[start : start + len(buffer)]
        buffer[: len(data)] = data
        self._place += len(data)
        return len(data)


def whole_mcap(path: Path) -> int | None:
    """Of an MCAP file without end, the bytes of its whole records; None for any other file."""
    size = path.stat().st_size
    with open(path, "rb") as file:
        if file.read(8) != MCAP or size < 8:
            return None
        if size >= 45:
            file.seek(-8, 2)
            if file.read() == MCAP:
                return None
        place = 8
        while True:
            file.seek(place)
            head = file.read(9)
            if len(head) < 9:
                return place
            kind, length = RECORD.unpack(head)
            if kind == 0 or length > size - place - 9:
                return place
            place += 9 + length


def kind_of(path: Path) -> bytes:
    """The magic bytes that a bag begins with; empty for a folder.  raises : DataError for something else"""
    if path.is_dir():
        if not (path / "metadata.yaml").is_file():
            raise DataError("is a folder without metadata.yaml, so no ROS 2 bag", str(path), "name the files in it")
        return b""
    with open(path, "rb") as file:
        head = file.read(16)
    for magic in (ROS1, MCAP, SQLITE):
        if head.startswith(magic):
            return magic
    raise DataError("is no ROS bag: neither ROS 1, nor ROS 2 (SQLite, MCAP)", str(path), "check `family` in `log`")


def check_profile(path: Path) -> None:
    """raises : DataError for an MCAP file that is not a ROS 2 bag"""
    with BoundedFile(path) as file:
        file.seek(8)
        kind, length = RECORD.unpack(file.read(9).ljust(9, b"\0"))
        content = file.read(min(length, 1 << 16))
    profile = content[4 : 4 + int.from_bytes(content[:4], "little")]
    if kind != HEADER or len(content) < 4:
        raise DataError("is an MCAP file without a header", str(path), "copy it again from its source")
    if profile != b"ros2":
        said = repr(profile.decode("utf-8", "replace")) if profile else "none"
        what = f"is an MCAP file, but no ROS 2 bag (profile: {said}): messages in JSON, Protobuf or ROS 1 are not read"
        raise DataError(what, str(path), "convert it to a ROS 2 bag (mcap convert), or export the topic as CSV")


@contextmanager
def readable(path: Path, kind: bytes) -> Iterator[BoundedPath]:
    """The path under a name that has the ending rosbags goes by."""
    ending = {ROS1: ".bag", MCAP: ".mcap", SQLITE: ".db3"}.get(kind, path.suffix)
    if path.suffix == ending:
        yield BoundedPath(path)
        return
    with TemporaryDirectory() as folder:
        link = Path(folder) / f"bag{ending}"
        link.symlink_to(path.resolve())
        yield BoundedPath(link)
