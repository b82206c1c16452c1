"""What both engines read: frames of a serial dump, and lines of a text log."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np

from vgyro.arrays import Floats, Ints
from vgyro.engine.frames import Candidates, FrameColumn, Run
from vgyro.engine.text import LineForm, Parsed

if TYPE_CHECKING:
    # For the checker alone: the models of boards take longer to load than the engine.
    from vgyro.board import BinaryFrame


class FrameFinder(Protocol):
    """Candidates of one frame layout. A place counts if sync, constants and checksum are right, wherever it lies."""

    def find(self, buffer: Ints) -> Candidates:
        """Good and failed candidates of a buffer, uint8 [m]."""


class FramesEngine(Protocol):
    """Frames of a serial dump: synchronisation, checksums, columns, runs; of any binary layout."""

    def Finder(self, frame: BinaryFrame) -> FrameFinder:
        """What finds the frames of that layout."""

    def read_columns(self, buffer: Ints, places: Ints, length: int, columns: Sequence[FrameColumn]) -> list[np.ndarray]:
        """Values of channels of the frames of `length` bytes that begin at `places`, each [n], in the channel's type.

        buffer : uint8 [m];  places : int64 [n], ascending
        """

    def breaks(self, start: Ints, length: int, counter: Ints | None, step: int, modulus: int) -> Ints:
        """Rows that do not follow the one before: int64, ascending, row 0 always among them.

        start   : int64 [n], offsets of frames of `length` bytes;  counter : int64 [n] as sent, or None
        A row follows if it begins where the other ends and its counter is `step` more, modulo `modulus`.
        """

    def longest_run(self, values: np.ndarray, time: Floats, since: float, least: float) -> tuple[Run | None, float]:
        """The longest run of equal samples, and when the last sample's run began.

        values : [n], n >= 1;  time : float64 [n], s, ascending
        since  : when the run that values[0] belongs to began
        least  : s; None is returned if no run is longer.  Of runs equally long the first counts.
        """


class LineParser(Protocol):
    """Reads lines of one form."""

    def parse(self, data: Ints, size: int, room: int) -> Parsed:
        """Rows of data[:size], uint8, which ends with the end of a line; PAD bytes more must stand behind it.

        room   : rows to read at most, > 0; it may stop before, after some thousands of bad lines
        raises : ValueError if data does not end as it must, or the form is none
        """


class TextEngine(Protocol):
    """Lines of a text log: cells, numbers and stamps straight into columns."""

    def Parser(self, form: LineForm) -> LineParser:
        """What reads the lines of that form."""
