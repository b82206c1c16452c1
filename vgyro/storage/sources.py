"""Bytes of dumps, in chunks: plain, gzip and zstd files, told apart by their content, one after the other."""

from __future__ import annotations

import hashlib
import zlib
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pyarrow as pa

from vgyro.errors import DataError
from vgyro.storage.tables import sha256_of_file
from vgyro.validation import did_you_mean

GZIP, ZSTD, PARQUET = b"\x1f\x8b\x08", b"\x28\xb5\x2f\xfd", b"PAR1"
NAMES_SHOWN = 20
ZSTD_PIECE = 1 << 16


@dataclass
class SourceFile:
    """One file: bytes on disk, compression; when it is read, SHA-256, bytes of the dump in it, and whether it was cut
    short."""

    path: Path
    name: str
    size: int
    compression: str
    sha256: str = ""
    start: int = 0
    content_bytes: int = 0
    cut_short: bool = False


@dataclass
class Sources:
    """The files of one recording as one stream of bytes; a frame may begin in one and end in the next.

    left_out : files that are not there or empty, as sentences; the others are read
    """

    files: list[SourceFile]
    left_out: list[str] = field(default_factory=list)
    _starts: list[int] = field(default_factory=list)

    def chunks(self, size: int) -> Iterator[bytes | memoryview]:
        """All bytes, in order, at most `size` at a time; a block is good until the next is asked for."""
        total = 0
        for file in self.files:
            file.start = total
            self._starts.append(total)
            for block in read_blocks(file, size):
                total += len(block)
                yield block
            file.content_bytes = total - file.start
            file.sha256 = file.sha256 or sha256_of_file(file.path)

    def place(self, offset: int) -> tuple[SourceFile, int]:
        """The file that holds a byte of the stream, and the offset there; the end belongs to the last file."""
        index = max(0, bisect_right(self._starts, offset) - 1)
        return self.files[index], offset - self._starts[index]

    def borders(self) -> list[int]:
        """Stream offsets at which a file other than the first begins, as far as they are read."""
        return self._starts[1:]


def open_sources(paths: Sequence[str | Path]) -> Sources:
    """Look at the files of a recording; one that is missing or empty is left out where there are others.

    raises : DataError if none is left, or one is a folder or a Parquet file
    """
    files: list[SourceFile] = []
    errors: list[DataError] = []
    for path in map(Path, paths):
        try:
            check_holds_bytes(path)
        except DataError as error:
            errors.append(error)
            continue
        with open(path, "rb") as stream:
            head = stream.read(4)
        if head == PARQUET:
            raise DataError("is a Parquet file, not a dump", str(path), "set `log:` for this recording")
        files.append(SourceFile(path, path.name, path.stat().st_size, _compression(head)))
    if not files:
        raise errors[0]
    return Sources(files, [str(error) for error in errors])


def check_holds_bytes(path: Path) -> None:
    """raises : DataError if the file is not there, or is empty, or a folder"""
    check_exists(path)
    if path.is_dir():
        raise DataError("is a folder, not a dump", str(path), "name the files, or set `log:` if it holds logs")
    if path.stat().st_size == 0:
        raise DataError("is empty: 0 bytes", str(path), "copy it again from the logger, or take it off the list")


def check_exists(path: Path) -> None:
    """raises : DataError that lists what is in the folder"""
    if path.exists():
        return
    folder = path.parent
    if not folder.is_dir():
        raise DataError("no such file; its folder does not exist either", str(path), "check `folder` in the manifest")
    names = sorted(entry.name for entry in folder.iterdir())
    near = did_you_mean(path.name, names)
    near = near if near.startswith("; did") else ""
    more = f" and {len(names) - NAMES_SHOWN} more" if len(names) > NAMES_SHOWN else ""
    listed = f"{folder} holds {', '.join(names[:NAMES_SHOWN]) or 'nothing'}{more}"
    raise DataError(f"no such file{near}", str(path), f"check `files` in the manifest; {listed}")


def read_blocks(file: SourceFile, size: int) -> Iterator[bytes | memoryview]:
    """The dump's bytes, unpacked; a block is good until the next is asked for.

    A compressed file that breaks off gives what can be unpacked of it.
    """
    if file.compression == "gzip":
        yield from _gzip_blocks(file, size)
    elif file.compression == "zstd":
        yield from _zstd_blocks(file, size)
    else:
        yield from _plain_blocks(file, size)


def _plain_blocks(file: SourceFile, size: int) -> Iterator[memoryview]:
    digest, room = hashlib.sha256(), memoryview(bytearray(min(size, file.size)))
    with open(file.path, "rb", buffering=0) as stream:
        while count := stream.readinto(room):
            digest.update(room[:count])
            yield room[:count]
    file.sha256 = digest.hexdigest()


def _compression(head: bytes) -> str:
    if head.startswith(GZIP):
        return "gzip"
    return "zstd" if head.startswith(ZSTD) else "none"


def _gzip_blocks(file: SourceFile, size: int) -> Iterator[bytes]:
    with open(file.path, "rb") as stream:
        unpacker = zlib.decompressobj(wbits=31)
        pending = b""
        while pending or (pending := stream.read(size)):
            try:
                block = unpacker.decompress(pending, size)
            except zlib.error:
                # What follows the last whole member is not gzip: the file is damaged from here on.
                file.cut_short = True
                return
            pending = unpacker.unconsumed_tail
            if unpacker.eof:
                # Loggers that append write one member after the other.
                pending = unpacker.unused_data.lstrip(b"\0")
                unpacker = zlib.decompressobj(wbits=31)
                fresh = True
            else:
                fresh = False
            if block:
                yield block
        if rest := unpacker.flush():
            yield rest
        file.cut_short = not fresh


def _zstd_blocks(file: SourceFile, size: int) -> Iterator[bytes]:
    # Where the data break off, the read that finds out gives nothing: small reads lose little.
    piece = min(size, ZSTD_PIECE)
    with pa.CompressedInputStream(pa.OSFile(str(file.path)), "zstd") as stream:
        held: list[bytes] = []
        block = b"more"
        while block:
            try:
                block = stream.read(piece)
            except OSError:
                file.cut_short, block = True, b""
            held.append(block)
            if sum(map(len, held)) > size - piece or not block:
                if full := b"".join(held):
                    yield full
                held = []
