"""A text as blocks of whole lines, ready for a kernel; memory grows neither with the file nor with its lines."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from vgyro.engine.text import PAD
from vgyro.storage.logs.text.encoding import Encoding, text_blocks
from vgyro.storage.sources import SourceFile

BLOCK = 1 << 22
LONGEST = 1 << 20
"""Bytes of the longest line; what is longer is damage."""
SHOWN = 200
"""Bytes that are kept of a line that is too long."""


class Block(NamedTuple):
    """Some lines.

    data : uint8, the lines and PAD bytes more;  size : bytes of the lines, the last is the end of a line
    line : number of the first line, from 1
    long : lines that are longer than LONGEST and not among them, before them: (number, first bytes)
    cut  : the last line has no end in the file; one was put there
    """

    data: np.ndarray
    size: int
    line: int
    long: tuple[tuple[int, bytes], ...] = ()
    cut: bool = False


class Lines:
    """The lines of a file as blocks."""

    def __init__(self, file: SourceFile, encoding: Encoding, eol: bytes, block: int = BLOCK) -> None:
        self._file, self._encoding, self._eol, self._size = file, encoding, eol, block
        # A rest of a line, then a block; UTF-16 grows by half at most when it becomes UTF-8.
        self._room = np.zeros(LONGEST + 2 * block + 4 * PAD, dtype=np.uint8)
        self._held = 0
        self._line = 1
        self._long: list[tuple[int, bytes]] = []
        self._skipping = False
        self.content_bytes = 0

    def blocks(self, count: bool = True) -> Iterator[Block]:
        """Blocks of lines; a block's data are good until the next is asked for.

        count : find the number of each block's first line; the caller may count instead, and set `line`
        """
        for piece in text_blocks(self._file, self._encoding, self._size):
            self.content_bytes += len(piece)
            fresh = np.frombuffer(piece, dtype=np.uint8)
            if self._skipping:
                rest = self._after_long(piece, fresh)
                if rest is None:
                    continue
                fresh = rest
            self._room[self._held : self._held + len(fresh)] = fresh
            size = self._held + len(fresh)
            whole = self._whole(size)
            if whole:
                yield self._block(whole, count)
            self._hold(whole, size)
        if self._held:
            self._room[self._held] = self._eol[0]
            yield self._block(self._held + 1, count)._replace(cut=True)
        elif self._long:
            yield Block(self._room, 0, self._line, tuple(self._long))

    @property
    def line(self) -> int:
        """Number of the next block's first line."""
        return self._line

    @line.setter
    def line(self, number: int) -> None:
        self._line = number

    def _whole(self, size: int) -> int:
        """Bytes of the whole lines among the first `size`."""
        # The last end is near: from the back, a little more each time.
        back = 1 << 12
        while True:
            first = max(0, size - back)
            found = self._room[first:size].tobytes().rfind(self._eol)
            if found >= 0 or first == 0:
                return first + found + 1 if found >= 0 else 0
            back *= 8

    def _block(self, size: int, count: bool) -> Block:
        block = Block(self._room, size, self._line, tuple(self._long))
        self._long = []
        if count:
            self._line += int(np.count_nonzero(self._room[:size] == self._eol[0]))
        return block

    def _hold(self, whole: int, size: int) -> None:
        """Keep the rest of a line for the next block; forget a line that is too long."""
        rest = self._room[whole:size]
        if len(rest) > LONGEST:
            self._long.append((self._line, rest[:SHOWN].tobytes()))
            self._skipping, self._held = True, 0
            return
        self._room[: len(rest)] = rest.copy()
        self._held = len(rest)

    def _after_long(self, piece: bytes | memoryview, fresh: np.ndarray) -> np.ndarray | None:
        """What follows the end of a line that is too long; None if it does not end here."""
        end = bytes(piece).find(self._eol)
        if end < 0:
            return None
        self._skipping = False
        self._line += 1
        return fresh[end + 1 :]
