"""What is in a dump? A look at its first megabyte with one board, or with all of them."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from vgyro.board import BinaryFrame, Board, TextFrame
from vgyro.errors import ConfigError, DataError
from vgyro.storage.dumps.scan import BinaryScanner, FoundFrames, Scanner
from vgyro.storage.dumps.selection import CounterRule
from vgyro.storage.dumps.text_form import recurring_forms, typical_line
from vgyro.storage.dumps.text_scan import TextScanner
from vgyro.storage.inputs import BOARDS, read_board
from vgyro.storage.sources import Sources, open_sources

PROBE_BYTES = 1 << 20
MAX_PAIRS = 4096
LINE_END = 2


class Probe(NamedTuple):
    """The start of a recording as one board reads it.

    frames         : good frames
    good_share     : share of the bytes that belong to them
    period_ticks   : median step of the time stamp between frames in step; None without
    typical_length : bytes of a frame (a line with its end)
    counter_step   : the commonest step of the counter between adjacent frames; None without
    forms          : text: what lines of another kind look like
    head           : the bytes that were looked at
    """

    frames: int
    good_share: float
    period_ticks: float | None
    typical_length: float
    counter_step: int | None
    forms: frozenset[bytes] = frozenset()
    head: bytes = b""


class Sniffed(NamedTuple):
    """How well a board fits a file. rate_hz: by the time stamps; None without."""

    board: str
    good_share: float
    frames: int
    rate_hz: float | None


def scanner_of(board: Board, typical_length: float = 0, engine: str = "native", forms: Iterable[bytes] = ()) -> Scanner:
    """The scanner for a board's frames. engine : of the search for binary ones;  forms : of other lines, of text"""
    if isinstance(board.layout, BinaryFrame):
        return BinaryScanner(board, engine)
    return TextScanner(board, typical_length, forms)


def probe(sources: Sources, board: Board) -> Probe:
    """Read the first megabyte of a recording with a board."""
    head = b""
    # A fresh Sources, so that the real reading does not see how far this one came.
    for block in Sources(list(sources.files)).chunks(PROBE_BYTES):
        head += block
        if len(head) >= PROBE_BYTES:
            break
    head = head[:PROBE_BYTES]
    if isinstance(board.layout, TextFrame):
        return _probe_text(head, board, board.layout)
    scanner = scanner_of(board)
    found = scanner.feed(head, last=True)
    share = float((found.stop - found.start).sum()) / len(head) if head else 0.0
    step = _counter_step(found)
    return Probe(
        len(found.start), min(1.0, share), _period(found, board), scanner.typical_length, step, frozenset(), head
    )


def _probe_text(head: bytes, board: Board, frame: TextFrame) -> Probe:
    forms = recurring_forms(head, frame)
    scanner = TextScanner(board, typical_line(head) + LINE_END, forms)
    found = scanner.feed(head, last=True)
    count, length = len(found.start), scanner.typical_length
    if count:
        length = scanner.good_bytes / count + LINE_END
    share = count * length / len(head) if head else 0.0
    return Probe(count, min(1.0, share), _period(found, board), length, _counter_step(found), forms, head)


def _period(found: FoundFrames, board: Board) -> float | None:
    if board.timestamp is None:
        return None
    default = 1 / (board.frame_rate_hz * board.timestamp.tick_s)
    if found.stamp is None or len(found.stamp) < 2:
        return default
    steps = np.diff(found.stamp)
    if board.timestamp.wrap is not None:
        steps %= board.timestamp.wrap
    if found.counter is not None and board.counter is not None:
        rule = CounterRule(board.counter.step, board.counter.modulus)
        in_step = rule.frames(found.counter[1:], found.counter[:-1]) == 1
        steps = steps[in_step] if in_step.any() else steps
    steps = steps[steps > 0][:MAX_PAIRS]
    return float(np.median(steps)) if len(steps) else default


def _counter_step(found: FoundFrames) -> int | None:
    if found.counter is None or len(found.counter) < 2:
        return None
    adjacent = found.start[1:] - found.stop[:-1] <= 2
    steps = np.diff(found.counter)[adjacent]
    steps = steps[steps > 0]
    if not len(steps):
        return None
    values, counts = np.unique(steps, return_counts=True)
    best = int(np.argmax(counts))
    return int(values[best]) if counts[best] > len(steps) / 2 else None


def all_boards(folder: Path = BOARDS) -> list[Board]:
    """Every valid board of a folder, by name."""
    found = []
    for path in sorted(folder.glob("*.yaml")):
        try:
            found.append(read_board(path.stem, boards=folder))
        except ConfigError:
            # A board file with a mistake cannot fit; `vgyro check` names the mistake.
            continue
    return found


def sniff(path: str | Path, boards: Iterable[Board] | None = None) -> list[Sniffed]:
    """Boards that find good frames in the first megabyte of a dump, the best first.

    boards : those to try; None: all of config/boards
    raises : DataError if the file is missing, empty or a Parquet file
    """
    sources = open_sources([path])
    found = []
    for board in boards if boards is not None else all_boards():
        if board.frame is None:
            continue
        seen = probe(sources, board)
        if seen.frames:
            rate = 1 / (seen.period_ticks * board.timestamp.tick_s) if board.timestamp and seen.period_ticks else None
            found.append(Sniffed(board.name, seen.good_share, seen.frames, rate))
    return sorted(found, key=lambda entry: (-entry.good_share, -entry.frames, entry.board))


def boards_that_fit(path: str | Path, folder: Path = BOARDS, besides: str = "", share: float = 0.5) -> list[str]:
    """Names of the boards, `besides` left out, that make frames of at least that share of the file's start."""
    try:
        return [
            entry.board
            for entry in sniff(path, all_boards(folder))
            if entry.good_share >= share and entry.board != besides
        ]
    except DataError:
        return []
