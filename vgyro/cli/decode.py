"""Decode dumps of a board and say how complete they are.

Several files are one recording, in the order given; .gz and .zst are read as they are. A dump larger than memory is
streamed.
"""

from __future__ import annotations

import argparse
import hashlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from vgyro.board import Board
    from vgyro.storage.frames import Reader
    from vgyro.storage.integrity import Integrity

EPILOG = """\
examples:
  vgyro decode capture.bin --board dsp6
  vgyro decode part1.bin.gz part2.bin.gz --board ./my-board.yaml --out frames.parquet
  vgyro decode capture.bin --json | jq .frames

exit codes:
  0  decoded; the summary says how well
  3  there is no such board, or its file is wrong
  4  refused: not there, empty, of another board, or too few good frames
"""
SHOWN = 10


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("dumps", nargs="+", metavar="DUMP", type=Path, help="dumps of one recording, in order")
    parser.add_argument("--board", help="board in config/boards, or path of a board file; default: the best fit")
    parser.add_argument("--boards", type=Path, default=Path("config/boards"), help="default: %(default)s")
    parser.add_argument("--out", type=Path, metavar="FRAMES.PARQUET", help="write the frames here")
    parser.add_argument("--json", action="store_true", help="print the whole integrity record as JSON")


def run(options: argparse.Namespace) -> int:
    """Decode, print, return the exit code."""
    from vgyro.config import IntegrityOptions
    from vgyro.dataset import Recording
    from vgyro.storage.decode import ReaderOptions, open_recording
    from vgyro.storage.inputs import read_board
    from vgyro.storage.integrity import Refused

    if options.board:
        board = read_board(options.board, boards=options.boards)
    else:
        from vgyro.cli.drafts.sniffing import best_board

        board = best_board(options.dumps[0], options.boards)[0]
    recording = Recording(name="dump", kind="free", files=tuple(map(str, options.dumps)))
    reader = open_recording(
        options.dumps, recording, board, IntegrityOptions(), reading=ReaderOptions(boards=options.boards)
    )
    try:
        read_all(reader, options.dumps, board, options.out)
    except Refused as refused:
        show(refused.integrity, options.json)
        raise
    assert reader.integrity is not None
    show(reader.integrity, options.json)
    return 0


def read_all(reader: Reader, dumps: list[Path], board: Board, out: Path | None) -> None:
    """Read every frame; write them to `out` if it is given.  raises : Refused"""
    from vgyro.storage.tables import Provenance, TableWriter, sha256_of_file
    from vgyro.tasks.closure import code_hash

    if out is None:
        for _ in reader:
            pass
        return
    inputs = {path.name: sha256_of_file(path) for path in dumps}
    provenance = Provenance(inputs, hashlib.sha256(board.model_dump_json().encode()).hexdigest(), code_hash(__name__))
    with TableWriter(out, "frames", provenance) as writer:
        for chunk in reader:
            columns = {"counter": chunk.counter, "time": chunk.time, "segment": chunk.segment, **chunk.counts}
            writer.append(columns)


def show(integrity: Integrity, as_json: bool) -> None:
    """Print the record: whole as JSON, or what a person wants to know of it."""
    if as_json:
        print(json.dumps(integrity.to_json(), indent=1, ensure_ascii=False))
    else:
        print("\n".join(summary(integrity)))


def summary(integrity: Integrity) -> Iterator[str]:
    """Lines for people."""
    frames = integrity.frames
    names = ", ".join(file.name for file in integrity.files)
    yield f"{names}: board {integrity.board}, {integrity.status}"
    yield f"frames    {frames.good} good, {frames.lost} lost, {frames.bad} damaged, {frames.repeated} repeated"
    yield f"duration  {integrity.duration_s:.3f} s in {_count(integrity.segments, 'gap-free stretch', 'es')}"
    yield f"rate      {integrity.rate_note}"
    yield from (f"reason    {reason}" for reason in integrity.reasons)
    yield from (f"warning   {warning}" for warning in integrity.warnings)
    clipped = {name: channel for name, channel in integrity.channels.items() if channel.clipped}
    worst = sorted(clipped, key=lambda name: -clipped[name].clipped)
    for name in worst[:SHOWN]:
        yield f"clipped   {name}: {_count(clipped[name].clipped, 'sample')}, {clipped[name].clipped_share:.3%}"
    yield from _more("clipped channels", len(clipped))
    for gap in integrity.gaps[:SHOWN]:
        lost = "an unknown number of frames" if gap.frames_lost is None else _count(gap.frames_lost, "frame")
        yield f"gap       at {gap.time:.3f} s: {lost}, {gap.cause}"
    yield from _more("gaps", len(integrity.gaps) + integrity.gaps_not_listed["entries"])
    for damage in integrity.damage[:SHOWN]:
        place = f"bytes {damage.start}-{damage.stop} of {damage.file}"
        yield f"damage    {place}: {_count(damage.frames_lost, 'frame')} lost, {damage.cause}"
    yield from _more("places of damage", len(integrity.damage) + integrity.damage_not_listed["entries"])


def _more(what: str, total: int) -> Iterator[str]:
    if total > SHOWN:
        yield f"          {total} {what} in all; --json lists them"


def _count(number: int, noun: str, plural: str = "s") -> str:
    return f"{number} {noun}{plural if number != 1 else ''}"
