"""CPU time of each method although methods share what an array has found out once: what is shared counts for all."""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import TypeVar

from vgyro.fusion.array import ArrayRates

T = TypeVar("T")
Key = tuple[int, Hashable]


@dataclass(eq=False)
class Entry:
    """One shared result. own : CPU seconds without what it needed;  needs : that"""

    own: float = 0.0
    needs: set[Key] = field(default_factory=set)


@dataclass
class Ledger:
    """open : what is being made, outermost first;  entries : what was made"""

    open: list[Entry] = field(default_factory=list)
    entries: dict[Key, Entry] = field(default_factory=dict)
    since: float = 0.0

    def _pass(self) -> None:
        """Book the time since the last event to what is being made."""
        now = time.process_time()
        if self.open:
            self.open[-1].own += now - self.since
        self.since = now

    def made(self, key: Key, make: Callable[[], T]) -> T:
        """Run `make` and book its time."""
        self._pass()
        entry = self.entries[key] = Entry()
        self.open.append(entry)
        try:
            return make()
        finally:
            self._pass()
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
        return super().once(key, lambda: LEDGER.made(place, make))


def timed(run: Callable[[], T]) -> tuple[T, float]:
    """What `run` returns, and its CPU seconds as if it had found out all that it needs by itself."""
    LEDGER._pass()
    entry = Entry()
    LEDGER.open.append(entry)
    try:
        return run(), _closed(entry)
    except BaseException:
        _closed(entry)
        raise


def _closed(entry: Entry) -> float:
    if entry in LEDGER.open:
        LEDGER._pass()
        LEDGER.open.remove(entry)
    return LEDGER.cost(entry)
