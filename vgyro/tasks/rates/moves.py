"""Where a board moves that its manifest declares to be at rest: from the frames, one channel in memory at a time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vgyro.board import Gyro
from vgyro.calibration import (
    GyroWindows,
    find_moves,
    gyro_windows,
    noise_level,
    seems_to_move,
    widened,
    window_length,
)
from vgyro.config import RestOptions
from vgyro.dataset import AT_REST, Recording
from vgyro.runs import true_runs
from vgyro.storage.tables import read_column


@dataclass(frozen=True)
class Moves:
    """How a board moved that was to stand still.

    still : bool [T], the samples at rest, with what is cut from both ends of each rest left out
    first, stop : [M] seconds, begin and end of each motion;  share : of the recording's samples, in motion
    """

    still: np.ndarray
    first: tuple[float, ...]
    stop: tuple[float, ...]
    share: float

    @property
    def record(self) -> dict[str, Any]:
        """The entry "moved" in the metadata of rates.parquet."""
        return {"share": self.share, "stretches": [list(span) for span in zip(self.first, self.stop, strict=True)]}


def moves_of(
    frames: Path, recording: Recording, gyros: Sequence[Gyro], time: np.ndarray, rate_hz: float, options: RestOptions
) -> Moves | None:
    """Motion in a recording that is declared to be at rest throughout; None: there is none, or nothing was declared.

    time : [T] s, of the frames;  gyros : of the board, whose nominal scale is enough to compare them
    A recording whose rests are listed is believed.
    """
    if recording.kind not in AT_REST or recording.rest != "auto":
        return None
    length = window_length(rate_hz, options)
    windows = [gyro_windows(read_column(frames, gyro.field), length) for gyro in gyros]
    scales = [gyro.sign * gyro.scale for gyro in gyros]
    levels = levels_of(frames, gyros, windows, length)
    moving = find_moves(windows, [gyro.axis for gyro in gyros], scales, options, levels)
    if not moving.any():
        return None
    guarded = widened(moving, math.ceil(options.guard_s / options.window_s))
    # What is left over at the end is in no window: it is as the last one.
    window = np.minimum(np.arange(len(time)) // length, len(moving) - 1)
    edges = [
        (start * length, len(time) if stop == len(moving) else stop * length)
        for start, stop in true_runs(moving).tolist()
    ]
    share = sum(stop - start for start, stop in edges) / len(time)
    return Moves(
        ~guarded[window],
        tuple(float(time[start]) for start, _ in edges),
        tuple(float(time[stop - 1]) + 1 / rate_hz for _, stop in edges),
        share,
    )


def levels_of(frames: Path, gyros: Sequence[Gyro], windows: Sequence[GyroWindows], length: int) -> dict[int, float]:
    """Place → noise level of the gyros that seem to move all the time, from differences within their axis.

    Two channels are read at a time, and none where no gyro seems to move: so for every recording that is at rest.
    """
    levels: dict[int, float] = {}
    for axis in dict.fromkeys(gyro.axis for gyro in gyros):
        members = [place for place, gyro in enumerate(gyros) if gyro.axis == axis and seems_to_move(windows[place])]
        if len(members) < 2:
            continue
        for place, other in zip(members, [*members[1:], members[0]], strict=True):
            own, beside = gyros[place], gyros[other]
            difference = read_column(frames, own.field, float)
            difference -= read_column(frames, beside.field, float) * (
                beside.sign * beside.scale / (own.sign * own.scale)
            )
            level = noise_level(windows[place], gyro_windows(difference, length))
            if level is not None:
                levels[place] = level
    return levels
