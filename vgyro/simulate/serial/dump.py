"""Pieces of a simulated recording → the bytes of its dump, damaged as the line does."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from vgyro.board import BinaryFrame, Board
from vgyro.simulate.recording import LINE, Simulated, Streams, rows_of
from vgyro.simulate.rows import row_at
from vgyro.simulate.serial.encode import Encoded, encode
from vgyro.simulate.serial.line import DamageDone, Line
from vgyro.simulate.twin import Twin, line_of


def dump_of(simulated: Simulated, board: Board, twin: Twin, seed: int | None = None) -> tuple[bytes, list[DamageDone]]:
    """The bytes of a whole recording that reach the disk, and what the line did to them.

    seed : instead of the twin's; the one given to simulate_recording
    """
    dump = Dump(twin, board, simulated.recording, lambda: [simulated], seed)
    data = dump.feed(simulated)
    return data, dump.damage


class Dump:
    """The bytes of a recording that reach the disk, piece after piece.

    pieces : makes the pieces of the recording anew; asked for where frames have no fixed length, to measure the whole
    seed   : instead of the twin's; the one given to simulate_pieces
    """

    def __init__(
        self,
        twin: Twin,
        board: Board,
        recording: str,
        pieces: Callable[[], Iterable[Simulated]],
        seed: int | None = None,
    ) -> None:
        self._board, self._spec = board, twin.recording(recording)
        spec = line_of(twin, self._spec)
        samples, rate_hz = rows_of(twin, board, recording)
        spans = ([min(row_at(moment, rate_hz), samples) for moment in span] for span in spec.missing)
        self._missing = [(first, stop) for first, stop in spans if stop > first]
        total, begin = self._size(samples, pieces)
        generator = Streams(twin.seed if seed is None else seed, recording).of(LINE)
        self._line = Line(spec, total, begin, generator)
        self._sent = self._last_start = 0
        self._left_out: list[DamageDone] = []

    @property
    def damage(self) -> list[DamageDone]:
        """What the line did so far, by offset."""
        return sorted([*self._line.done, *self._left_out], key=lambda item: item.offset)

    def feed(self, piece: Simulated) -> bytes:
        """The next piece → the bytes that arrive by now."""
        rows, encoded = self._encode(piece)
        starts = self._sent + encoded.starts
        for first, stop in self._missing:
            if piece.first <= first < piece.first + piece.time.size:
                place = int(np.searchsorted(rows, first)) - 1
                before = int(starts[place]) if place >= 0 else self._last_start
                self._left_out.append(DamageDone("missing", before, first, f"{stop - first} frames"))
        if not rows.size:
            return b""
        self._sent, self._last_start = self._sent + len(encoded.data), int(starts[-1])
        return self._line.feed(encoded.data, starts, rows)

    def _encode(self, piece: Simulated) -> tuple[np.ndarray, Encoded]:
        """Rows of the recording that are sent, and their bytes."""
        rows = np.arange(piece.first, piece.first + piece.time.size)
        kept = np.ones(rows.size, dtype=bool)
        for first, stop in self._missing:
            kept &= (rows < first) | (rows >= stop)
        counts = {name: values[kept] for name, values in piece.counts.items()}
        return rows[kept], encode(self._board, self._spec.counter_start + rows[kept], counts, piece.time[kept])

    def _size(self, samples: int, pieces: Callable[[], Iterable[Simulated]]) -> tuple[int, int]:
        """Bytes of the undamaged dump, and of its first frame."""
        layout = self._board.layout
        if isinstance(layout, BinaryFrame):
            kept = np.ones(samples, dtype=bool)
            for first, stop in self._missing:
                kept[first:stop] = False
            return int(kept.sum()) * layout.length, layout.length
        total, begin = 0, None
        for _, encoded in map(self._encode, pieces()):
            total += len(encoded.data)
            if begin is None:
                begin = int(encoded.starts[1]) if encoded.starts.size > 1 else len(encoded.data)
        return total, begin or 0
