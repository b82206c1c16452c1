"""CPU time of each method although methods share what an array has found out once: what is shared counts for all."""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import TypeVar

from vgyro.fusion.types import ArrayRates

T = TypeVar("T")
Key = tuple[int, Hashable]


@dataclass(eq=False)
class Entry:
    """One shared result. own : CPU seconds without what it needed;  needs : that;  of : the array that it is of"""

    own: float = 0.0
    of: object = None
    needs: set[Key] = field(default_factory=set)


@dataclass
class Ledger:
    """open : what is being made, outermost first;  entries : what was made"""

    open: list[Entry] = field(default_factory=list)
    entries: dict[Key, Entry] = field(default_factory=dict)
    since: float = 0.0

    def book(self) -> None:
        """Book the time since the last event to what is being made."""
        now = time.process_time()
        if self.open:
            self.open[-1].own += now - self.since
        self.since = now

    def clear(self) -> None:
        """Begin anew."""
        self.entries.clear()

    def made(self, key: Key, make: Callable[[], T], of: object) -> T:
        """Run `make` and book its time. The array is held, so that its identity is no other's."""
        self.book()
        entry = self.entries[key] = Entry(of=of)
        self.open.append(entry)
        try:
            return make()
        finally:
            self.book()
            self.open.pop()

    def need(self, key: Key) -> None:
        """What is being made needs this."""
        if self.open:
            self.open[-1].needs.add(key)

    def cost(self, entry: Entry) -> float:
        """CPU seconds with all that it needed, each once."""
        total, left, seen = entry.own, list(entry.needs), set[Key]()
        while left:
            key = left.pop()
            if key in seen or key not in self.entries:
                continue
            seen.add(key)
            total += self.entries[key].own
            left += self.entries[key].needs
        return total


LEDGER = Ledger()


class TimedRates(ArrayRates):
    """ArrayRates that books what it finds out once."""

    def once(self, key: Hashable, make: Callable[[], T]) -> T:
        """As ArrayRates.once."""
        place = (id(self), key)
        LEDGER.need(place)
        return super().once(key, lambda: LEDGER.made(place, make, self))


def timed(run: Callable[[], T]) -> tuple[T, float]:
    """What `run` returns, and its CPU seconds as if it had found out all that it needs by itself."""
    LEDGER.book()
    entry = Entry()
    LEDGER.open.append(entry)
    try:
        return run(), _closed(entry)
    except BaseException:
        _closed(entry)
        raise


def _closed(entry: Entry) -> float:
    if entry in LEDGER.open:
        LEDGER.book()
        LEDGER.open.remove(entry)
    return LEDGER.cost(entry)
