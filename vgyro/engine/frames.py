"""What the kernels of frames are told and what they return; both engines share it."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    # For the checker alone: the models of boards take longer to load than the engine.
    from vgyro.board import BinaryFrame, ByteOrder, FieldType

# NumPy has no 24-bit integers; they are kept as 32-bit ones.
DTYPES: dict[FieldType, str] = {
    "u8": "u1", "i8": "i1", "u16": "u2", "i16": "i2", "u24": "u4", "i24": "i4", "u32": "u4", "i32": "i4", "u64": "u8",
    "i64": "i8", "f32": "f4", "f64": "f8",
}  # fmt: skip


class Candidates(NamedTuple):
    """Offsets in a buffer where the sync bytes and constants of a whole frame stand, ascending, int64.

    good : checksum right;  failed : checksum wrong
    """

    good: np.ndarray
    failed: np.ndarray


class FrameColumn(NamedTuple):
    """A channel of a frame: its type, the byte where it begins, and its byte order."""

    kind: FieldType
    at: int
    order: ByteOrder

    @property
    def size(self) -> int:
        """Bytes in the frame."""
        return int(self.kind[1:]) // 8


class Run(NamedTuple):
    """A stretch of equal samples: s."""

    start: float
    duration: float


def fixed_bytes(frame: BinaryFrame) -> list[tuple[int, int]]:
    """(offset, value) of every byte that is the same in all frames, the sync bytes first."""
    fixed = list(enumerate(bytes.fromhex(frame.sync)))
    for offset, text in frame.constants.items():
        fixed += [(offset + place, value) for place, value in enumerate(bytes.fromhex(text))]
    return fixed
