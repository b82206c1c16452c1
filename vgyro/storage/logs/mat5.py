"""Structure of a MATLAB 5.0 file, checked before SciPy reads it: no length may claim more than the file holds.

SciPy makes room for as many structs or cells as a damaged file claims. See "MAT-File Format", The MathWorks, 2019.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO

COMPRESSED, MATRIX = 15, 14
CELL, STRUCT, OBJECT = 1, 2, 3
COMPLEX = 0x800
HEADER = 128
DEEPEST = 32
NESTED_BYTES = 1 << 28
"""Most bytes of a compressed struct or cell array: it is in memory as a whole, and ten times over as objects."""


def check_structure(path: Path) -> list[bool]:
    """Walk through the variables, and into structs and cells; of each variable: is it complex?

    raises : ValueError for a length that does not fit, EOFError where the file ends within a variable, zlib.error
    """
    size, complex_ = path.stat().st_size, list[bool]()
    with open(path, "rb") as file:
        head = file.read(HEADER)
        if len(head) < HEADER or head[126:128] not in (b"IM", b"MI"):
            raise ValueError("the header of 128 bytes is not one of a MATLAB 5.0 file")
        order = "<" if head[126:128] == b"IM" else ">"
        place = HEADER
        while place < size:
            file.seek(place)
            tag = file.read(8)
            if len(tag) < 8:
                raise EOFError(f"cut short at byte {place}")
            kind, length = struct.unpack(f"{order}II", tag)
            if kind not in (COMPRESSED, MATRIX):
                raise ValueError(f"no variable at byte {place}, but an element of type {kind}")
            if length > size - place - 8:
                raise EOFError(f"the variable at byte {place} needs {length} bytes; {size - place - 8} are left")
            if kind == COMPRESSED:
                flags = _check_compressed(file.read(length), order)
            else:
                flags = _check_plain(file, length, order)
            complex_.append(bool(flags & COMPLEX))
            place += 8 + length
    return complex_


def _check_plain(file: IO[bytes], length: int, order: str) -> int:
    """Check the array that begins there; its flags."""
    place = file.tell()
    flags = _flags(file.read(min(length, 16)), 0, order)
    if flags & 0xFF in (CELL, STRUCT, OBJECT):
        file.seek(place)
        _check_matrix(memoryview(file.read(length)), order, 0)
    return flags


def _check_compressed(data: bytes, order: str) -> int:
    unpacker = zlib.decompressobj()
    start = unpacker.decompress(data, 512)
    if len(start) < 8:
        raise EOFError("a compressed variable is cut short")
    kind, length = struct.unpack_from(f"{order}II", start)
    if kind != MATRIX:
        raise ValueError(f"a compressed element of type {kind}, not a variable")
    flags = _flags(start, 8, order)
    if flags & 0xFF not in (CELL, STRUCT, OBJECT):
        return flags
    if length > NESTED_BYTES:
        raise ValueError(f"a struct or cell array of {length} bytes is too big: save its fields as variables")
    rest = start + unpacker.decompress(unpacker.unconsumed_tail, length)
    if len(rest) < 8 + length:
        raise EOFError("a compressed variable is cut short")
    _check_matrix(memoryview(rest)[8 : 8 + length], order, 0)
    return flags


def _flags(data: bytes, place: int, order: str) -> int:
    """Flags of an array, its class in the lowest byte: they follow a tag of 8 bytes."""
    if len(data) < place + 12:
        raise EOFError("a variable is cut short")
    return struct.unpack_from(f"{order}I", data, place + 8)[0]


def _check_matrix(data: memoryview, order: str, depth: int) -> None:
    """The elements of an array: flags, dimensions, name, then what its class has."""
    if depth > DEEPEST:
        raise ValueError(f"structs nested more than {DEEPEST} deep")
    if not len(data):
        return
    parts = list(_elements(data, order))
    if len(parts) < 3:
        raise ValueError("an array without flags, dimensions or name")
    kind = _flags(bytes(data[:16]), 0, order) & 0xFF
    if kind not in (CELL, STRUCT, OBJECT):
        return
    dimensions = parts[1][1]
    count = math.prod(struct.unpack(f"{order}{len(dimensions) // 4}i", dimensions[: len(dimensions) // 4 * 4]))
    inner = [content for type_, content in parts[3:] if type_ == MATRIX]
    fields = 1
    if kind != CELL:
        names = parts[3 if kind == STRUCT else 4 :][:2]
        width = int.from_bytes(names[0][1][:4], "little" if order == "<" else "big") if names else 0
        fields = len(names[1][1]) // width if len(names) == 2 and width else 0
    if count < 0 or count * fields > len(inner) or (not fields and count > 1):
        raise ValueError(f"{count} structs or cells of {fields} fields claimed, {len(inner)} arrays there")
    for content in inner:
        _check_matrix(content, order, depth + 1)


def _elements(data: memoryview, order: str) -> Iterator[tuple[int, memoryview]]:
    place = 0
    while place + 8 <= len(data):
        kind, length = struct.unpack_from(f"{order}II", data, place)
        if kind >> 16:  # a small element: length and type in one word, up to four bytes after it
            kind, length = kind & 0xFFFF, kind >> 16
            if length > 4:
                raise ValueError(f"a small element of {length} bytes")
            yield kind, data[place + 4 : place + 4 + length]
            place += 8
            continue
        if length > len(data) - place - 8:
            raise ValueError(f"an element of {length} bytes where {len(data) - place - 8} are left")
        yield kind, data[place + 8 : place + 8 + length]
        place += 8 + length + (-length % 8)
