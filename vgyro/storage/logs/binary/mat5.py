"""MATLAB 5.0 files (save -v6, -v7): vectors, matrices and structs of numbers. See "MAT-File Format", The MathWorks.

SciPy reads these too, and the tests compare; but a damaged file can crash it, and the whole process with it. Here every
length is checked against what is there. What is not compressed is mapped, not loaded.
"""

from __future__ import annotations

import math
import mmap
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from vgyro.storage.logs.binary.opened import Damaged

MATRIX, COMPRESSED = 14, 15
STRUCT = 2
COMPLEX = 0x800
CLASSES = {
    1: "cell", 2: "struct", 3: "object", 4: "char", 5: "sparse", 6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2",
    12: "i4", 13: "u4", 14: "i8", 15: "u8", 16: "function", 17: "opaque",
}  # fmt: skip
STORED = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
HEADER, START = 128, 1024
DEEPEST = 16
RATIO = 1032
"""Most that deflate can do."""
STRUCT_BYTES = 1 << 30
"""Most bytes of a compressed struct: it is in memory as a whole."""


@dataclass(frozen=True)
class Array:
    """A variable, or a field of a struct.

    kind    : type of its values (f8, i2 …), or cell, struct, object, char, sparse, function, opaque
    load    : gives the values, of that shape; of numbers alone
    fields  : of a single struct, its parts by name
    """

    name: str
    kind: str
    shape: tuple[int, ...]
    is_complex: bool
    load: Callable[[], np.ndarray] | None = None
    fields: tuple[Array, ...] = ()


def arrays_of(path: Path) -> list[Array]:
    """The variables of a file, in its order.

    raises : ValueError for a length that does not fit, EOFError where the file ends within a variable, zlib.error
    """
    with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as mapped:
        head = mapped[:HEADER]
        if len(head) < HEADER or head[126:128] not in (b"IM", b"MI"):
            raise Damaged("the header of 128 bytes is not one of a MATLAB 5.0 file")
        order = "<" if head[126:128] == b"IM" else ">"
        place, size, found = HEADER, len(mapped), list[Array]()
        while place < size:
            if size - place < 8:
                raise EOFError(f"cut short at byte {place}")
            kind, length = struct.unpack_from(f"{order}II", mapped, place)
            if kind not in (COMPRESSED, MATRIX):
                raise Damaged(f"no variable at byte {place}, but an element of type {kind}")
            if length > size - place - 8:
                raise EOFError(f"the variable at byte {place} needs {length} bytes; {size - place - 8} are left")
            start, whole = _content(path, place + 8, length, kind == COMPRESSED, order)
            found.append(_array(start, whole, order, 0))
            place += 8 + length
    return found


def _content(
    path: Path, place: int, length: int, compressed: bool, order: str
) -> tuple[memoryview, Callable[[], memoryview]]:
    """The first bytes of a variable, and what gives all of it."""
    if not compressed:

        def mapped() -> memoryview:
            # The map lives as long as the arrays that look into it.
            with open(path, "rb") as file:
                return memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))[place : place + length]

        return mapped()[:START], mapped

    def packed() -> bytes:
        with open(path, "rb") as file:
            file.seek(place)
            return file.read(length)

    start = zlib.decompressobj().decompress(packed(), START)
    if len(start) < 8:
        raise EOFError("a compressed variable is cut short")
    kind, inner = struct.unpack_from(f"{order}II", start)
    if kind != MATRIX:
        raise Damaged(f"a compressed element of type {kind}, not a variable")
    if inner > length * RATIO:
        raise Damaged(f"{inner} bytes claimed by {length} compressed ones")

    def unpacked() -> memoryview:
        unpacker = zlib.decompressobj()
        data = unpacker.decompress(packed(), 8 + inner)
        if len(data) < 8 + inner:
            raise EOFError("a compressed variable is cut short")
        unpacker.decompress(unpacker.unconsumed_tail, 64)  # the checksum, at the end, is looked at here
        return memoryview(data)[8:]

    return memoryview(start)[8:], unpacked


def _array(start: memoryview, whole: Callable[[], memoryview], order: str, depth: int, name: str = "") -> Array:
    """An array by its first elements: flags, dimensions, name."""
    if not len(start):
        return Array(name, "empty", (0, 0), False)
    parts = list(islice(_elements(start, order), 3))
    if len(parts) < 3 or len(parts[0][1]) < 8:
        raise Damaged("an array without flags, dimensions or name")
    (flags,) = struct.unpack_from(f"{order}I", parts[0][1])
    kind = CLASSES.get(flags & 0xFF, "unknown")
    own = bytes(parts[2][1]).rstrip(b"\0").decode("utf-8", "replace")
    name = own if not depth else name
    if kind in ("opaque", "unknown"):  # its second element is its name
        return Array(bytes(parts[1][1]).decode("utf-8", "replace") if not depth else name, kind, (), False)
    dimensions = parts[1][1]
    shape = struct.unpack(f"{order}{len(dimensions) // 4}i", dimensions[: len(dimensions) // 4 * 4])
    if len(shape) < 2 or min(shape) < 0:
        raise Damaged(f"{name or 'an array'} has the dimensions {shape}")
    if flags & 0xFF == STRUCT and math.prod(shape) == 1:
        return Array(name, kind, shape, False, fields=_fields(whole(), order, depth))
    load = None if len(kind) > 2 else lambda: _values(whole(), order, np.dtype(kind), shape)
    return Array(name, kind, shape, bool(flags & COMPLEX), load)


def _fields(data: memoryview, order: str, depth: int) -> tuple[Array, ...]:
    """The parts of a single struct."""
    if depth > DEEPEST or len(data) > STRUCT_BYTES:
        raise Damaged(f"structs more than {DEEPEST} deep or larger than {STRUCT_BYTES} bytes")
    parts = list(_elements(data, order))
    if len(parts) < 5 or len(parts[3][1]) != 4:
        raise Damaged("a struct without names of its fields")
    (width,) = struct.unpack(f"{order}i", parts[3][1])
    text = bytes(parts[4][1])
    count = len(text) // width if width > 0 else 0
    names = [text[at * width : (at + 1) * width].partition(b"\0")[0].decode("utf-8", "replace") for at in range(count)]
    contents = [content for kind, content in parts[5:] if kind == MATRIX]
    if len(contents) != count:
        raise Damaged(f"a struct of {count} fields with {len(contents)} arrays")
    return tuple(
        _array(content, lambda held=content: held, order, depth + 1, name)  # type: ignore[misc]
        for name, content in zip(names, contents, strict=True)
    )


def _values(data: memoryview, order: str, wanted: np.dtype, shape: tuple[int, ...]) -> np.ndarray:
    """The numbers of an array; MATLAB stores whole ones in as few bytes as they need."""
    parts = list(islice(_elements(data, order), 4))
    if len(parts) < 4:
        raise Damaged("an array without values")
    kind, content = parts[3]
    if kind not in STORED:
        raise Damaged(f"values of type {kind}")
    stored = np.dtype(STORED[kind]).newbyteorder(order)  # type: ignore[arg-type]
    if len(content) != math.prod(shape) * stored.itemsize:
        raise Damaged(f"{len(content)} bytes for an array {shape} of {stored}")
    if not np.can_cast(stored, wanted, "safe"):
        raise Damaged(f"values of type {stored} in an array of {wanted}")
    return np.frombuffer(content, stored).astype(wanted, copy=False).reshape(shape, order="F")


def _elements(data: memoryview, order: str) -> Iterator[tuple[int, memoryview]]:
    """Type and content of each element, one after the other; each begins at a multiple of 8 bytes."""
    place = 0
    while place + 8 <= len(data):
        kind, length = struct.unpack_from(f"{order}II", data, place)
        if kind >> 16:  # a small element: length and type in one word, up to four bytes after it
            kind, length = kind & 0xFFFF, kind >> 16
            if length > 4:
                raise Damaged(f"a small element of {length} bytes")
            yield kind, data[place + 4 : place + 4 + length]
            place += 8
            continue
        if length > len(data) - place - 8:
            raise Damaged(f"an element of {length} bytes where {len(data) - place - 8} are left")
        yield kind, data[place + 8 : place + 8 + length]
        place += 8 + length + (-length % 8)
