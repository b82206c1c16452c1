"""The head of a text log as lines, and what stands around the cells of each: a stamp of the receiver, a checksum."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

from vgyro.errors import DataError
from vgyro.log import TextForm
from vgyro.storage.logs.text.blocks import LONGEST, SHOWN
from vgyro.storage.logs.text.encoding import Encoding, find_encoding, text_blocks
from vgyro.storage.logs.text.header import is_comment
from vgyro.storage.sources import SourceFile

SIZE = 1 << 18
SAMPLE = 400
"""Lines that are looked at closely, from all over the head."""
STAMP = r"(?:\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}[T ]+)?\d{1,2}:\d\d:\d\d(?:[.,]\d+)?Z?(?: [AaPp][Mm])?"
LEAD = re.compile(rf"(\[?)({STAMP})(\]\s*(?:-+>|=>)?\s*|\s*(?:-+>|=>)\s*|\s+>\s+)")
CHECKSUM = re.compile(r"\*[0-9A-Fa-f]{2}$")
MOST = 0.8
GOLDEN = 0.6180339887498949
T = TypeVar("T")


@dataclass(frozen=True)
class TextHead:
    """Lines of the head, without their ends; the first is number 1.

    whole : are they all lines of the file?;  ended : does the last line have an end?
    """

    lines: tuple[str, ...]
    encoding: Encoding
    eol: bytes
    whole: bool
    ended: bool

    @property
    def codec(self) -> str:
        """Of the bytes that lines become."""
        return "latin-1" if self.encoding.name == "latin-1" else "utf-8"

    def body(self, skip: int) -> list[tuple[int, str]]:
        """Numbers and texts of the lines that are neither empty nor comments, without blanks around them."""
        numbered = enumerate(self.lines[skip:], start=skip + 1)
        return [(number, line.strip()) for number, line in numbered if line.strip() and not is_comment(line)]


def read_head(source: SourceFile, form: TextForm, swap: bytes = b"") -> TextHead:
    """The head of a log; `swap`: bytes that are taken for one sign, chr(31).

    raises : DataError for a file that is empty or binary, and for one whose first line does not end
    """
    path = source.path
    first = _first(source)
    if not first:
        what = (
            "is empty"
            if source.compression == "none"
            else f"unpacks to nothing: the {source.compression} data are damaged"
        )
        raise DataError(what, str(path), "copy it again from the logger, or take it off the list")
    encoding = find_encoding(first, form, path)
    head, whole = _take(source, encoding, SIZE)
    if b"\n" not in head and b"\r" not in head and not whole:
        head, whole = _take(source, encoding, LONGEST)
    if b"\n" not in head and b"\r" not in head and not whole:
        shown = head[:SHOWN].decode("utf-8", "replace")[:40]
        what = f"line 1 is longer than {LONGEST >> 10} KiB: it begins {shown!r}"
        raise DataError(
            what, str(path), "expected lines with numbers; if it is binary, name it as its program wrote it"
        )
    eol = b"\n" if b"\n" in head else b"\r"
    lines = head.replace(swap, b"\x1f").split(eol) if swap else head.split(eol)
    ended = not lines[-1].strip()
    if not whole or ended:
        # What the head's end cuts, or the nothing behind the last end.
        lines.pop()
    codec = "latin-1" if encoding.name == "latin-1" else "utf-8"
    return TextHead(tuple(one.decode(codec, "replace") for one in lines), encoding, eol, whole, ended)


def _first(source: SourceFile) -> bytes:
    from vgyro.storage.sources import read_blocks

    return bytes(next(iter(read_blocks(source, SIZE)), b""))


def _take(source: SourceFile, encoding: Encoding, size: int) -> tuple[bytes, bool]:
    """The first bytes, and whether they are all."""
    taken = bytearray()
    for block in text_blocks(source, encoding, size):
        taken += block
        if len(taken) > size:
            return bytes(taken[:size]), False
    return bytes(taken), True


def sample(items: Sequence[T], most: int = SAMPLE) -> list[T]:
    """Some of the items, in their order, the first among them; from all over, for the first ones may be special.

    The golden ratio's multiples are even, but in step with nothing that comes again and again.
    """
    if len(items) <= most:
        return list(items)
    return [items[place] for place in sorted({int(len(items) * (k * GOLDEN % 1)) for k in range(most)})]


@dataclass(frozen=True)
class Lead:
    """What stands before the cells of each line: `label`, a stamp, `sign`."""

    label: str = ""
    sign: str = ""

    def strip(self, line: str) -> str | None:
        """The line's own part; None if it has no lead."""
        found = LEAD.match(line)
        return line[found.end() :].strip() if found else None

    def stamp(self, line: str) -> str:
        """The stamp of a line that has one."""
        found = LEAD.match(line)
        return found[2] if found else ""


def find_lead(lines: Sequence[str]) -> Lead | None:
    """The stamp that a serial monitor put before each line, such as "12:34:56.789 -> "; None if there is none."""
    found = [match for line in lines if (match := LEAD.match(line)) is not None]
    if len(found) < MOST * len(lines) or not found:
        return None
    label, sign = Counter((one[1], one[3].strip()) for one in found).most_common(1)[0][0]
    # An opening bracket wants its closing one.
    return Lead(label, sign) if bool(label) == sign.startswith("]") and sign else None


def has_checksums(lines: Sequence[str]) -> bool:
    """Do most lines end with "*" and the XOR of what stands before it?"""
    right = sum(_checked(line) for line in lines)
    return right > 0 and right >= 0.5 * len(lines)


def _checked(line: str) -> bool:
    found = CHECKSUM.search(line)
    if found is None:
        return False
    total = 0
    for byte in line[: found.start()].encode("utf-8", "replace").lstrip(b"$!"):
        total ^= byte
    return total == int(found[0][1:], 16)


def without_checksum(line: str) -> str:
    """The line without the checksum at its end."""
    return CHECKSUM.sub("", line)
