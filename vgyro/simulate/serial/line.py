"""What a serial line does to a dump, with a list of everything that was done."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from vgyro.simulate.twin import LineDamage

LARGEST_PIECE = 4


@dataclass(frozen=True)
class DamageDone:
    """One thing done: `offset` in the undamaged stream, `frame` there (row of the recording), `detail` in bytes."""

    kind: str
    offset: int
    frame: int
    detail: str

    def record(self) -> dict[str, Any]:
        """As a JSON-able mapping."""
        return asdict(self)


class Line:
    """Flips, drops and inserts bytes, puts garbage in front and cuts the end of a stream that comes in pieces.

    spec  : `spec.missing` is not done here: those frames are left out before they become bytes
    total : bytes of the whole stream;  begin : length of the first frame, which stays whole, so that the recording's
            time begins where the truth's does
    No byte is hit twice. `done` lists what was done so far.
    """

    def __init__(self, spec: LineDamage, total: int, begin: int, generator: np.random.Generator) -> None:
        self.done: list[DamageDone] = []
        self._generator = generator
        self._garbage = generator.bytes(spec.leading_bytes) if spec.leading_bytes else b""
        self._total, self._end = total, total - spec.cut_tail
        self._places = _places(spec, begin, self._end, generator)[::-1]
        self._held, self._base = b"", 0  # bytes that are not out yet, and where they begin in the stream
        self._starts, self._frames = np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)

    def feed(self, data: bytes, starts: np.ndarray, frames: np.ndarray) -> bytes:
        """The next bytes of the stream → what arrives of them by now.

        starts : offset in the stream of each frame in `data`;  frames : their numbers in the recording
        """
        out: list[bytes] = []
        if self._garbage:
            out.append(self._garbage)
            self.done.append(DamageDone("leading", 0, int(frames[0]), self._garbage.hex()))
            self._garbage = b""
        base, held, place = self._base, self._held + data, self._base
        self._starts = np.concatenate([self._starts, starts])
        self._frames = np.concatenate([self._frames, frames])
        stop = base + len(held)
        last = stop == self._total
        if not last:
            stop -= LARGEST_PIECE  # a drop may reach so far
        while self._places and self._places[-1][0] < stop:
            offset, kind = self._places.pop()
            old, new = _change(kind, held[offset - base : offset - base + LARGEST_PIECE], self._generator)
            self.done.append(DamageDone(kind, offset, self._frame(offset), f"{old.hex()}>{new.hex()}"))
            out += [held[place - base : offset - base], new]
            place = offset + len(old)
        stop = max(place, min(stop, self._end))
        out.append(held[place - base : stop - base])
        self._held, self._base = held[stop - base :], stop
        if last and self._held:
            self.done.append(DamageDone("cut_tail", stop, int(self._frames[-1]), self._held.hex()))
        kept = max(int(np.searchsorted(self._starts, stop, side="right")) - 1, 0)
        self._starts, self._frames = self._starts[kept:], self._frames[kept:]
        return b"".join(out)

    def _frame(self, offset: int) -> int:
        return int(self._frames[np.searchsorted(self._starts, offset, side="right") - 1])


def damage(
    data: bytes,
    spec: LineDamage,
    generator: np.random.Generator,
    starts: np.ndarray,
    frames: np.ndarray | None = None,
) -> tuple[bytes, list[DamageDone]]:
    """Send a whole stream through a `Line`.

    starts : [T] offset of each frame in `data`;  frames : [T] their numbers in the recording (None: 0, 1, …)
    """
    line = Line(spec, len(data), int(starts[1]) if starts.size > 1 else len(data), generator)
    return line.feed(data, starts, np.arange(starts.size) if frames is None else frames), line.done


def _places(spec: LineDamage, begin: int, end: int, generator: np.random.Generator) -> list[tuple[int, str]]:
    """Offsets, rising and never nearer than the largest piece, each with what happens there."""
    kinds = ["flip"] * spec.flips + ["drop"] * spec.drops + ["insertion"] * spec.insertions
    slots = max((end - begin) // LARGEST_PIECE, 0)
    kinds = kinds[:slots]
    chosen = np.sort(generator.choice(slots, size=len(kinds), replace=False)) if kinds else np.empty(0, dtype=int)
    order = generator.permutation(len(kinds))
    return [(begin + LARGEST_PIECE * int(slot), kinds[int(kind)]) for slot, kind in zip(chosen, order, strict=True)]


def _change(kind: str, data: bytes, generator: np.random.Generator) -> tuple[bytes, bytes]:
    """The bytes that stood at the head of `data`, and those that stand there afterwards."""
    if kind == "flip":
        return data[:1], bytes([data[0] ^ (1 << int(generator.integers(8)))])
    size = int(generator.integers(1, LARGEST_PIECE + 1))
    return (data[:size], b"") if kind == "drop" else (b"", generator.bytes(size))
