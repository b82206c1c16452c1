"""Which topics a ULog holds: its message headers alone, walked through before pyulog loads what is wanted.

https://docs.px4.io/main/en/dev_log/ulog_file_format.html
"""

from __future__ import annotations

import mmap
import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

from vgyro.storage.logs.binary.opened import Damaged

MAGIC = b"ULog\x01\x12\x35"
SYNC = b"\x2f\x73\x13\x20\x25\x0c\xbb\x12"
HEADER = 16
HEAD = struct.Struct("<HB")
KNOWN = frozenset(b"BFIMPQARDLCSO")
DATA, NOTED, ANYWHERE = ord("D"), frozenset(b"FAOB"), frozenset(b"IMPQLC")
LARGEST = 1 << 16
"""Most bytes of a message, and so of a format: its length is a number of 16 bits."""
SIZES = {
    "int8_t": 1, "uint8_t": 1, "int16_t": 2, "uint16_t": 2, "int32_t": 4, "uint32_t": 4, "int64_t": 8, "uint64_t": 8,
    "float": 4, "double": 8, "bool": 1, "char": 1,
}  # fmt: skip
DEEPEST = 8


@dataclass
class Contents:
    """What a ULog's headers say.

    formats    : of each message type, its fields (type, length of an array or 0, name)
    topics     : subscriptions by their number, (message type, instance);  counts: messages by that number
    needed     : places of the bytes that pyulog needs: header, formats, subscriptions, data
    dropout_ms : lengths of the dropouts
    damaged    : bytes that are no message;  cut : does the file end within one?
    odd        : was a part added later, or is there a message that has no business in its place?
    """

    formats: dict[str, list[tuple[str, int, str]]] = field(default_factory=dict)
    topics: dict[int, tuple[str, int]] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    needed: list[tuple[int, int]] = field(default_factory=lambda: [(0, HEADER)])
    dropout_ms: list[int] = field(default_factory=list)
    damaged: int = 0
    cut: bool = False
    odd: bool = False

    @property
    def sound(self) -> bool:
        """May pyulog read the file as it is? It can turn in circles in one that is not sound."""
        return not (self.damaged or self.cut or self.odd)


def scan(path: Path) -> Contents:
    """Walk through a ULog.

    Where there is no message, the walk goes on at the next sync mark, or a byte further where there is none.
    raises : ValueError for a file that is no ULog, or a format that no message could hold
    """
    found = Contents()
    with open(path, "rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise Damaged("does not begin as a ULog does")
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            if len(data) < HEADER:
                raise Damaged("ends within its header")
            _walk(data, found)
    for name in found.formats:
        if (size := size_of(name, found.formats)) > LARGEST:
            raise Damaged(f"message type {name!r} claims {size} bytes; a message holds {LARGEST} at most")
    return found


def _walk(data: mmap.mmap, found: Contents) -> None:
    place, end, counts, needed = HEADER, len(data), found.counts, found.needed
    while place + 3 <= end:
        length, kind = HEAD.unpack_from(data, place)
        after = place + 3 + length
        if not length or (kind not in KNOWN and not _follows(data, after)):
            place = _resumed(data, place, found)
            continue
        if after > end:
            break
        wanted = False
        if kind == DATA:  # by far the most
            number = data[place + 3] | data[place + 4] << 8 if length > 1 else -1
            if wanted := number in found.topics:
                counts[number] = counts.get(number, 0) + 1
            else:
                found.odd = True
        elif kind in NOTED:
            wanted = _note(chr(kind), data[place + 3 : after], found)
            found.odd |= not wanted and (kind in b"FA" or not found.topics)
        else:
            found.odd |= kind not in ANYWHERE and not found.topics
        if wanted:
            if needed[-1][1] == place:
                needed[-1] = (needed[-1][0], after)
            else:
                needed.append((place, after))
        place = after
    found.cut = place < end


def _follows(data: mmap.mmap, place: int) -> bool:
    """Is there a message, or the end?"""
    return place == len(data) or (place + 3 <= len(data) and data[place + 2] in KNOWN)


def _resumed(data: mmap.mmap, place: int, found: Contents) -> int:
    mark = data.find(SYNC, place + 1)
    # The mark is itself the content of a message: three bytes of header come before it.
    after = max(mark - 3, place + 1) if mark >= 0 else _next_message(data, place)
    found.damaged += after - place
    return after


def _next_message(data: mmap.mmap, place: int) -> int:
    """A place after this one where two messages could follow each other, or the end."""
    end = len(data)
    for start in range(place + 1, end - 3):
        length, kind = HEAD.unpack_from(data, start)
        if kind in KNOWN and length and _follows(data, start + 3 + length):
            return start
    return end


def _note(kind: str, content: bytes, found: Contents) -> bool:
    """Write down what a message says. Does pyulog need it?  raises : ValueError for flags that nobody knows yet"""
    if kind == "O" and len(content) == 2 and found.topics:
        found.dropout_ms.append(content[0] | content[1] << 8)
    elif kind == "A" and len(content) > 3:
        name = content[3:].decode("utf-8", "ignore")
        if name in found.formats:
            found.topics[content[1] | content[2] << 8] = (name, content[0])
            return True
    elif kind == "F" and not found.topics:
        name, colon, fields = content.decode("utf-8", "ignore").partition(":")
        parts = [one.split(" ") for one in fields.split(";") if one]
        if colon and all(len(part) == 2 for part in parts):
            found.formats[name] = [_field(*part) for part in parts]
            return True
    elif kind == "B" and len(content) >= 40 and found.needed[-1][1] == HEADER:
        if content[8] & ~1 or any(content[9:16]):
            raise Damaged("made by a newer logger: its flags are unknown")
        found.odd = any(content[16:40])
        return not found.odd
    return False


def copy_needed(path: Path, found: Contents, target: IO[bytes]) -> None:
    """Write what pyulog needs, and no damage, into another file."""
    with open(path, "rb") as file:
        for start, stop in found.needed:
            file.seek(start)
            while start < stop:
                start += target.write(file.read(min(stop - start, 1 << 20)))


def _field(kind: str, name: str) -> tuple[str, int, str]:
    base, bracket, rest = kind.partition("[")
    digits = rest.rstrip("]")
    return base, min(int(digits), LARGEST + 1) if bracket and digits.isdecimal() and len(digits) < 9 else 0, name


def size_of(name: str, formats: dict[str, list[tuple[str, int, str]]], depth: int = 0) -> int:
    """Bytes of a message type, those within it unfolded; more than any message holds where types hold each other."""
    if depth > DEEPEST:
        return LARGEST + 1
    total = 0
    for kind, length, _ in formats.get(name, ()):
        one = SIZES.get(kind)
        total += max(length, 1) * (one if one is not None else size_of(kind, formats, depth + 1))
        if total > LARGEST:
            break
    return total


def fields_of(name: str, formats: dict[str, list[tuple[str, int, str]]], prefix: str = "") -> list[str]:
    """Names of a topic's numbers as pyulog has them, without the padding at its end."""
    names: list[str] = []
    for kind, length, field_name in formats.get(name, ()):
        for index in range(max(length, 1)):
            full = f"{prefix}{field_name}{f'[{index}]' if length else ''}"
            names += [full] if kind in SIZES else fields_of(kind, formats, f"{full}.")
    while names and not prefix and names[-1].startswith("_padding"):
        names.pop()
    return names
