"""What a serial line does to a dump, with a list of everything that was done."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from vgyro.simulate.twin import LineDamage

LARGEST_PIECE = 4


@dataclass(frozen=True)
class Damage:
    """One thing done: `offset` in the undamaged stream, `frame` there (row of the recording), `detail` in bytes."""

    kind: str
    offset: int
    frame: int
    detail: str

    def record(self) -> dict[str, Any]:
        """As a JSON-able mapping."""
        return asdict(self)


def damage(
    data: bytes,
    spec: LineDamage,
    generator: np.random.Generator,
    starts: np.ndarray,
    frames: np.ndarray | None = None,
) -> tuple[bytes, list[Damage]]:
    """Flip, drop and insert bytes, put garbage in front and cut the end.

    starts : [T] offset of each frame in `data`;  frames : [T] their numbers in the recording (None: 0, 1, …)
    The first frame stays whole, so that the recording's time begins where the truth's does; no byte is hit twice.
    `spec.missing` is not done here: those frames are left out before they become bytes.
    """
    numbers = np.arange(starts.size) if frames is None else frames
    done: list[Damage] = []
    pieces: list[bytes] = []
    if spec.leading_bytes:
        garbage = generator.bytes(spec.leading_bytes)
        pieces.append(garbage)
        done.append(Damage("leading", 0, int(numbers[0]), garbage.hex()))
    begin = int(starts[1]) if starts.size > 1 else len(data)
    end = len(data) - spec.cut_tail
    position = 0
    for offset, kind in _places(spec, begin, end, generator):
        frame = int(numbers[np.searchsorted(starts, offset, side="right") - 1])
        old, new = _change(kind, data, offset, generator)
        done.append(Damage(kind, offset, frame, f"{old.hex()}>{new.hex()}"))
        pieces += [data[position:offset], new]
        position = offset + len(old)
    pieces.append(data[position : max(end, position)])
    if spec.cut_tail:
        done.append(Damage("cut_tail", end, int(numbers[-1]), data[end:].hex()))
    return b"".join(pieces), done


def _places(spec: LineDamage, begin: int, end: int, generator: np.random.Generator) -> list[tuple[int, str]]:
    """Offsets, rising and never nearer than the largest piece, each with what happens there."""
    kinds = ["flip"] * spec.flips + ["drop"] * spec.drops + ["insertion"] * spec.insertions
    slots = max((end - begin) // LARGEST_PIECE, 0)
    kinds = kinds[:slots]
    chosen = np.sort(generator.choice(slots, size=len(kinds), replace=False)) if kinds else np.empty(0, dtype=int)
    order = generator.permutation(len(kinds))
    return [(begin + LARGEST_PIECE * int(slot), kinds[int(kind)]) for slot, kind in zip(chosen, order, strict=True)]


def _change(kind: str, data: bytes, offset: int, generator: np.random.Generator) -> tuple[bytes, bytes]:
    """The bytes that stood at `offset`, and those that stand there afterwards."""
    if kind == "flip":
        return data[offset : offset + 1], bytes([data[offset] ^ (1 << int(generator.integers(8)))])
    size = int(generator.integers(1, LARGEST_PIECE + 1))
    return (data[offset : offset + size], b"") if kind == "drop" else (b"", generator.bytes(size))
