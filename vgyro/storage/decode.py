"""Recordings, dumps or archived logs → frames: integer counts on one clock, and the record of what is missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from vgyro.board import Board
from vgyro.config import IntegrityOptions
from vgyro.dataset import Recording
from vgyro.log import LogArray
from vgyro.storage.dumps.reader import DumpReader
from vgyro.storage.frames import Frames, Reader, gather
from vgyro.storage.inputs import BOARDS


def decode_dump(
    paths: str | Path | Sequence[str | Path],
    board: Board,
    options: IntegrityOptions | None = None,
    engine: str = "native",
) -> Frames:
    """Decode the dumps of one recording, in order, as one stream; plain, .gz or .zst.

    returns : Frames with counts {channel: [T]}, counter [T], time [T] s, segment [T] and the integrity record
    engine  : native, or reference (NumPy alone)
    raises  : DataError for a missing or empty file, a file of another board, too few good frames
    """
    paths = [paths] if isinstance(paths, str | Path) else list(paths)
    reader = DumpReader(paths, board, board.frame_rate_hz, options or IntegrityOptions(), engine=engine)
    frames = gather(reader, board)
    return frames._replace(integrity=reader.integrity)


@dataclass(frozen=True)
class ReaderOptions:
    """How a recording is read.

    boards : folder of the boards that are tried when the recording's own does not fit
    engine : of the search for the frames of a dump, and of the numbers of a text
    """

    boards: Path = BOARDS
    engine: str = "native"


def open_recording(
    paths: Sequence[str | Path],
    recording: Recording,
    board: Board,
    options: IntegrityOptions,
    array: LogArray | None = None,
    reading: ReaderOptions | None = None,
) -> Reader:
    """Stream a recording of dumps or logs.

    returns : an iterable of Frames; its `integrity` is set when the last chunk is read
    raises  : DataError for a missing or empty file, a wrong column; while it is read, Refused
    array   : the gyros of a log, where the manifest names them itself
    """
    reading = reading or ReaderOptions()
    if recording.log is not None:
        from vgyro.storage.logs.reader import LogReader

        return LogReader(paths, recording, board, options, array, reading.engine)
    rate_hz = recording.rate_hz or board.frame_rate_hz
    return DumpReader(paths, board, rate_hz, options, boards=reading.boards, engine=reading.engine)
