"""Encoding of a text log, and its bytes as UTF-8 (or another superset of ASCII), a block at a time."""

from __future__ import annotations

import codecs
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from vgyro.errors import DataError
from vgyro.log import TextForm
from vgyro.storage.sources import SourceFile, read_blocks

UTF8_MARK = b"\xef\xbb\xbf"
MARKS = {b"\xff\xfe": "utf-16-le", b"\xfe\xff": "utf-16-be"}
CONTROL = bytes(set(range(32)) - set(b"\t\n\r\f\v\x1b\0"))
"""Bytes that no text holds; NUL stands apart: a logger that lost its power leaves runs of it."""
MOST_CONTROL = 0.02
"""Share of such bytes from which on a file is binary: a serial line's noise has fewer."""
MOST_NUL = 0.3
"""Share of zero bytes in each half of UTF-16's pairs that tells its order."""


class Encoding(NamedTuple):
    """name : Python's;  mark : bytes of the byte order mark"""

    name: str
    mark: int = 0

    @property
    def wide(self) -> bool:
        """Must the bytes be decoded before they are read?"""
        return self.name.startswith("utf-16")


def looks_like_text(head: bytes) -> bool:
    """Could the first bytes of a file, unpacked, be those of a text log? Any encoding that open_log reads."""
    if not head:
        return False
    encoding = _wide(head)
    if encoding is not None:
        shown = head[encoding.mark :].decode(encoding.name, "replace")
        odd = sum(one not in "\t\n\r\f\v\x1b" and (ord(one) < 32 or one == "\ufffd") for one in shown)
        return odd <= MOST_CONTROL * len(shown)
    odd = len(head) - len(head.translate(None, CONTROL))
    # What a logger lost at its start, or set aside for later.
    nul = head.count(0) - (len(head) - len(head.strip(b"\0")))
    return odd + nul <= MOST_CONTROL * len(head) and bool(head.strip(b"\0"))


def _wide(head: bytes) -> Encoding | None:
    """UTF-16, by its mark or by the zero bytes of its digits."""
    for mark, name in MARKS.items():
        if head.startswith(mark):
            return Encoding(name, 2)
    pairs = len(head) // 2
    if pairs < 2:
        return None
    low, high = head[0 : 2 * pairs : 2].count(0) / pairs, head[1 : 2 * pairs : 2].count(0) / pairs
    if max(low, high) > 1 - MOST_NUL and min(low, high) < MOST_NUL:
        return Encoding("utf-16-le" if high > low else "utf-16-be")
    return None


def find_encoding(head: bytes, form: TextForm, path: Path) -> Encoding:
    """The encoding of a log whose first bytes are `head`.  raises : DataError for a binary file"""
    wide = _wide(head)
    if form.encoding == "utf-16":
        return wide or Encoding("utf-16-le")
    if form.encoding == "latin-1":
        return Encoding("latin-1")
    if form.encoding is None and not looks_like_text(head):
        what = f"is not a text: it begins with the bytes {head[:8].hex(' ')}"
        raise DataError(what, str(path), "name the log as its program wrote it, or export it as CSV")
    mark = len(UTF8_MARK) if head.startswith(UTF8_MARK) else 0
    if form.encoding == "utf-8":
        return Encoding("utf-8", mark)
    if wide is not None:
        return wide
    try:
        # A character that the head's end cuts is no error.
        codecs.getincrementaldecoder("utf-8")().decode(head[mark:])
    except UnicodeDecodeError:
        return Encoding("latin-1")
    return Encoding("utf-8", mark)


def text_blocks(file: SourceFile, encoding: Encoding, size: int) -> Iterator[bytes | memoryview]:
    """The file's bytes without its mark, in blocks of about `size`; UTF-16 as UTF-8, all else as it is.

    A block is good until the next is asked for.
    """
    decoder = codecs.getincrementaldecoder(encoding.name)("replace") if encoding.wide else None
    left = encoding.mark
    for block in read_blocks(file, size):
        if left:
            cut = min(left, len(block))
            block, left = block[cut:], left - cut
        if decoder is not None:
            block = decoder.decode(block).encode("utf-8", "replace")
        if len(block):
            yield block
    if decoder is not None and (rest := decoder.decode(b"", True).encode("utf-8", "replace")):
        yield rest
