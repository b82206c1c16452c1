"""Lines that are no rows: which of them are damage, and which were to be expected."""

from __future__ import annotations

from collections.abc import Sequence

from vgyro.storage.logs.table import Account, BadLine
from vgyro.storage.logs.text.blocks import LONGEST
from vgyro.storage.logs.text.head import Lead
from vgyro.storage.logs.text.header import is_comment

NAMED = 1000
"""Bad lines of a file that are named; more are only counted."""
SHOWN = 80


class TextDamage:
    """Sorts lines that do not fit, and counts them in the account.

    known : lines that may come again and are none;  cut : numbers of lines before the first row that are damage
    """

    def __init__(self, account: Account, codec: str, known: frozenset[str], cut: Sequence[int]) -> None:
        self.account, self._codec, self._known, self._cut = account, codec, known, cut
        self._waiting: list[BadLine] = []
        self._named = 0
        self.first: BadLine | None = None

    def line(self, number: int, line: bytes, expected: str) -> None:
        """A line that is no row."""
        text = line.decode(self._codec, "replace").strip(" \t\r\n")
        bare = Lead().strip(text)
        if is_comment(text) or text in self._known or (bare and bare in self._known):
            self.account.other += 1
        else:
            self._add(BadLine(number, shown(text), expected))

    def before_start(self, number: int, line: bytes) -> None:
        """A line before the first row."""
        text = line.decode(self._codec, "replace").strip(" \t\r\n")
        if number in self._cut:
            self._add(BadLine(number, shown(text), "has fewer cells than the rows behind it"))
        elif text:
            self.account.other += 1

    def too_long(self, lines: Sequence[tuple[int, bytes]]) -> None:
        """Lines that are too long to be read."""
        for number, start in lines:
            text = start.decode(self._codec, "replace")
            self._add(BadLine(number, shown(text), f"is longer than {LONGEST >> 10} KiB"))

    def cut(self, number: int) -> None:
        """The bad line of that number is the last one, and has no end."""
        if self._waiting and self._waiting[-1].place == number:
            last = self._waiting[-1]
            self._waiting[-1] = BadLine(number, last.found, f"{last.expected}; the file ends within this line")
        self.account.notes.append(f"the file ends within line {number}, which is left out")

    def taken(self) -> tuple[BadLine, ...]:
        """The bad lines since the last call, as far as they are named."""
        waiting, self._waiting = self._waiting, []
        return tuple(waiting)

    def _add(self, bad: BadLine) -> None:
        self.account.bad += 1
        self.first = self.first or bad
        if self._named < NAMED:
            self._waiting.append(bad)
            self._named += 1


def shown(text: str) -> str:
    """The beginning of a line, fit to be printed."""
    printable = "".join(one if one.isprintable() else repr(one)[1:-1] for one in text[: SHOWN + 1])
    return printable if len(text) <= SHOWN else f"{printable[:SHOWN]}…"
