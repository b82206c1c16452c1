"""Lines of a text log in C: cells, numbers and stamps straight into columns. One pass, for any form."""

from __future__ import annotations

import numpy as np

from vgyro.engine.native import _text
from vgyro.engine.text import ORDERS, Cell, LineForm, Parsed, check

BAD_ROOM = 1 << 12
TYPES: dict[Cell, type] = {
    "number": np.float64, "hex": np.float64, "integer": np.int64, "date": np.int64, "day": np.int64, "words": np.int64,
}  # fmt: skip


class Parser:
    """As vgyro.engine.protocols.reading.LineParser."""

    def __init__(self, form: LineForm) -> None:
        self._form = form
        self._lines = _text.Form(
            [(_text.KINDS[one.kind], ORDERS.index(one.order), one.split, one.label) for one in form.fields],
            form.word, form.lead, form.delimiter[0], form.decimal[0], form.eol[0], form.checksum,
        )  # fmt: skip

    def parse(self, data: np.ndarray, size: int, room: int) -> Parsed:
        """As vgyro.engine.protocols.reading.LineParser.parse; it also stops after BAD_ROOM bad lines."""
        check(data, size, self._form)
        columns: list[np.ndarray | None] = []
        for field in self._form.fields:
            shape = (room, 2) if field.kind == "words" else (room,)
            columns.append(np.empty(shape, dtype=TYPES[field.kind]) if field.kind in TYPES else None)
        outs = [None if column is None else column.reshape(-1).view(np.int64) for column in columns]
        bad = np.empty((BAD_ROOM, 5), dtype=np.int64)
        consumed, lines, rows, wrong, other, first = self._lines.rows(data, size, outs, room, bad)
        given = [None if column is None else column[:rows] for column in columns]
        return Parsed(given, bad[:wrong], consumed, lines, other, first)
