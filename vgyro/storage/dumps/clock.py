"""Counter and time stamps of good frames: wraps undone, repeats dropped, gaps found and placed in time."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from vgyro.arrays import Ints
from vgyro.board import Board
from vgyro.storage.dumps.scan import Content, FoundFrames
from vgyro.storage.dumps.selection import CounterRule

HISTORY = 4096  # frames that are remembered to know a block that was sent again
NEAR_ZERO = 16  # a counter below this, far from its wrap, has restarted
HALF_PERIOD = 0.5
CLOCK_TOLERANCE = 0.02  # of a gap's length, between time stamp and counter
MIN_TOLERANCE = 1.5  # periods

LOST, RESTART, PAUSE = "frames lost", "restart", "pause"


class Jump(NamedTuple):
    """A place where frames do not follow each other.

    row       : of the kept frame after it, in the chunk
    kind      : LOST, RESTART (counter begins anew: nothing is known) or PAUSE (counter in step, time is not)
    lost      : frames missing; None: unknown
    known     : true if the duration is known
    ambiguous : true if more whole wraps would fit as well
    """

    row: int
    kind: str
    lost: int | None
    known: bool
    ambiguous: bool


class Timed(NamedTuple):
    """Frames of a chunk without the repeated ones, on the recording's clock.

    rows : their places in the chunk; None: all of them
    """

    found: FoundFrames
    rows: np.ndarray | None
    counter: np.ndarray
    time: np.ndarray
    segment: np.ndarray
    jumps: list[Jump]
    repeated: int


@dataclass
class FrameClock:
    """Undo wraps and find gaps, chunk by chunk.

    board          : its counter and time stamp
    rate_hz        : frames a second; of the recording
    period_ticks   : usual step of the time stamp, measured at the start of the recording; None without time stamps
    typical_length : bytes of a frame, where only the damaged bytes tell how many frames are missing
    """

    board: Board
    rate_hz: float
    period_ticks: float | None
    typical_length: float
    in_step_frames: int = 0  # pairs of frames that follow each other …
    in_step_ticks: int = 0  # … and the time stamps' steps between them
    still: int = 0  # frames whose counter did not move
    _first: bool = True
    _counter: int = 0
    _first_counter: int = 0
    _ticks: int = 0
    _segment: int = 0
    _last: FoundFrames | None = None
    _history: deque[_Sent] = field(default_factory=deque)
    _remembered: int = 0  # frames in _history
    _lag: int = 0
    _rule: CounterRule | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        if self.board.counter:
            self._rule = CounterRule(self.board.counter.step, self.board.counter.modulus)

    def feed(self, found: FoundFrames) -> Timed:
        """Place the frames of the next chunk in time."""
        fresh = self._fresh(found)
        rows = None if fresh is None else np.flatnonzero(fresh)
        kept = found if rows is None else found.take(rows, self._rule)
        repeated = len(found.start) - len(kept.start)
        if not len(kept.start):
            empty = np.empty(0, dtype=np.int64)
            return Timed(kept, empty, empty, empty.astype(np.float64), empty.astype(np.int32), [], repeated)
        frames, ticks, jumps = self._steps(kept)
        if self._first:
            # The first frame follows nothing: it sets counter and time zero.
            step = self._rule.step if self._rule else 1
            self._first_counter = 0 if kept.counter is None else int(kept.counter[0]) // step
            self._counter, self._first = self._first_counter, False
        frames[0] += self._counter
        counter = np.cumsum(frames)
        segment = _segments(self._segment, jumps, len(counter))
        self._counter, self._segment = int(counter[-1]), int(segment[-1])
        self._last = kept.take(np.array([len(kept.start) - 1]), self._rule)
        if ticks is not None and self.board.timestamp:
            total = self._ticks + np.cumsum(ticks)
            self._ticks = int(total[-1])
            time = total * self.board.timestamp.tick_s
        else:
            time = (counter - self._first_counter) / self.rate_hz
        return Timed(kept, rows, counter, time, segment, jumps, repeated)

    @property
    def measured_rate_hz(self) -> float | None:
        """Frames a second by the time stamps of frames that follow each other; None without time stamps."""
        if not self.board.timestamp or not self.in_step_ticks:
            return None
        return self.in_step_frames / (self.in_step_ticks * self.board.timestamp.tick_s)

    def _steps(self, kept: FoundFrames) -> tuple[np.ndarray, np.ndarray | None, list[Jump]]:
        """Frames and ticks from the frame before to each, int64 [n] each; the very first frame's are 0."""
        stamp = _with_last(self._last and self._last.stamp, kept.stamp)
        elapsed = self._elapsed(stamp)
        if elapsed is None and kept.counter is not None:
            frames, jumps = self._by_counter(kept)
            return frames, None, jumps
        counter = _with_last(self._last and self._last.counter, kept.counter)
        if elapsed is None:
            return self._by_bytes(kept)
        if self._rule is None or counter is None:
            frames, jumps = self._by_stamp(elapsed)
        else:
            frames, jumps = self._by_both(counter, elapsed)
        shift = len(kept.start) - len(frames)
        jumps = [jump._replace(row=jump.row + shift) for jump in jumps]
        self._count_in_step(frames, elapsed, jumps, shift)
        return np.insert(frames, 0, [0] * shift), np.insert(elapsed, 0, [0] * shift), jumps

    def _elapsed(self, stamp: np.ndarray | None) -> np.ndarray | None:
        """Ticks from each frame to the next, modulo the time stamp's wrap."""
        if stamp is None or self.board.timestamp is None:
            return None
        difference = np.diff(stamp)
        wrap = self.board.timestamp.wrap
        return difference if wrap is None else difference % wrap

    def _count_in_step(self, frames: np.ndarray, ticks: np.ndarray, jumps: list[Jump], shift: int) -> None:
        plain = np.ones(len(frames), dtype=bool)
        plain[[jump.row - shift for jump in jumps]] = False
        self.in_step_frames += int(frames[plain].sum())
        self.in_step_ticks += int(ticks[plain].sum())

    def _by_bytes(self, kept: FoundFrames) -> tuple[np.ndarray, None, list[Jump]]:
        """Neither counter nor time stamp: damaged bytes stand for as many frames as they could have been."""
        before = kept.stop[kept.breaks - 1]
        before[0] = kept.start[0] if self._last is None else self._last.stop[0]
        hole = kept.start[kept.breaks] - before
        lost = np.where(hole > 0, np.maximum(1, np.rint(hole / self.typical_length)), 0).astype(np.int64)
        frames = np.ones(len(kept.start), dtype=np.int64)
        frames[kept.breaks] += lost
        if self._last is None:
            frames[0] = 0
        jumps = [
            Jump(int(row), LOST, int(missing), True, True)
            for row, missing in zip(kept.breaks, lost, strict=True)
            if missing
        ]
        return frames, None, jumps

    def _by_counter(self, kept: FoundFrames) -> tuple[np.ndarray, list[Jump]]:
        """The counter alone: a gap is as short as it can be; a counter near zero has restarted."""
        rule = self._known_rule()
        assert kept.counter is not None
        steps = np.ones(len(kept.start), dtype=np.int64)
        rows = kept.breaks
        if self._last is None:
            steps[0], rows = 0, rows[1:]
        here, before = kept.counter[rows], kept.counter[rows - 1]
        if self._last is not None and self._last.counter is not None:
            before[0] = self._last.counter[0]
        period = rule.modulus // rule.step
        frames = rule.frames(here, before)
        self.still += int(np.count_nonzero(here == before))
        frames[here == before] = 1
        near_zero = min(NEAR_ZERO, max(2, period // 64))
        restart = (frames > near_zero) & (here // rule.step < near_zero) | (frames < 0)
        jumps = []
        for index in np.flatnonzero((frames != 1) | restart).tolist():
            if restart[index]:
                jumps.append(Jump(int(rows[index]), RESTART, None, False, False))
            else:
                jumps.append(Jump(int(rows[index]), LOST, int(frames[index]) - 1, True, True))
        frames[restart] = 1
        steps[rows] = frames
        return steps, jumps

    def _by_stamp(self, elapsed: np.ndarray | None) -> tuple[np.ndarray, list[Jump]]:
        """The time stamp alone: a gap is as many periods as it lasts."""
        if elapsed is None or self.period_ticks is None:
            raise ValueError("the board sends no time stamp")
        periods = elapsed / self.period_ticks
        frames = np.maximum(1, np.rint(periods)).astype(np.int64)
        jumps = []
        for index in np.flatnonzero((frames > 1) | (elapsed < 0)):
            if elapsed[index] < 0:
                elapsed[index] = round(self.period_ticks)
                jumps.append(Jump(int(index), RESTART, None, False, False))
            else:
                wraps = self.board.timestamp is not None and self.board.timestamp.wrap is not None
                jumps.append(Jump(int(index), LOST, int(frames[index]) - 1, True, wraps))
        return frames, jumps

    def _by_both(self, counter: np.ndarray, elapsed: np.ndarray) -> tuple[np.ndarray, list[Jump]]:
        """Counter and time stamp must agree on how long a gap is, whole wraps of both allowed for."""
        rule, period_ticks = self._known_rule(), self.period_ticks
        if period_ticks is None:
            raise ValueError("the board sends no time stamp")
        frames = rule.frames(counter[1:], counter[:-1])
        usual = (frames == 1) & (np.abs(elapsed / period_ticks - 1) <= HALF_PERIOD)
        jumps = []
        for index in np.flatnonzero(~usual):
            step, ticks, jump = self._resolve(int(index), int(frames[index]), int(elapsed[index]))
            frames[index], elapsed[index] = step, ticks
            if jump is not None:
                jumps.append(jump)
        return frames, jumps

    def _resolve(self, index: int, frames: int, elapsed: int) -> tuple[int, int, Jump | None]:
        """Frames, ticks and the jump at one place where counter or time stamp is not in step."""
        rule, period_ticks = self._known_rule(), self.period_ticks or 1.0
        period = rule.modulus // rule.step
        wrap = self.board.timestamp.wrap if self.board.timestamp else None
        # One wrap of the counter more than the time stamp's, and the same pair of values comes again.
        wraps = 0 if wrap is None else math.ceil(period * period_ticks / wrap) + 1
        for turns in range(wraps + 1) if frames >= 0 else ():
            ticks = elapsed + turns * (wrap or 0)
            periods = ticks / period_ticks
            total = frames + period * max(0, round((periods - frames) / period))
            if total >= 1 and abs(periods - total) <= max(MIN_TOLERANCE, CLOCK_TOLERANCE * periods):
                if total == 1:
                    # Jitter of the stamp, no gap.
                    return 1, ticks, None if abs(periods - 1) <= 1 else Jump(index, PAUSE, 0, True, False)
                ambiguous = CLOCK_TOLERANCE * periods > period / 2
                return total, ticks, Jump(index, LOST, total - 1, True, ambiguous)
        if frames == 1 and elapsed > 0:
            return 1, elapsed, Jump(index, PAUSE, 0, True, wrap is not None)
        if wrap is None and elapsed > 0:
            return 1, elapsed, Jump(index, RESTART, None, True, False)
        return 1, round(period_ticks), Jump(index, RESTART, None, False, False)

    def _known_rule(self) -> CounterRule:
        if self._rule is None:
            raise ValueError("the board sends no counter")
        return self._rule

    def _fresh(self, found: FoundFrames) -> np.ndarray | None:
        """bool [n]: false for a frame that was sent before, alone or in a block: same counter, same bytes.

        None: there is no such frame.
        """
        key = found.stamp if found.counter is None else found.counter
        if key is None or not len(key):
            return None
        suspects = self._suspects(key, found.breaks)
        fresh = self._told_apart(key, found.content, suspects) if self._lag or len(suspects) else None
        self._history.append(_Sent(key, found.content))
        self._remembered += len(key)
        while self._remembered - len(self._history[0].key) >= HISTORY:
            self._remembered -= len(self._history.popleft().key)
        return fresh

    def _suspects(self, key: np.ndarray, breaks: Ints) -> Ints:
        """Rows whose counter (or time stamp) does not advance: they may have been sent before."""
        rows = breaks if self._rule and self._rule.is_long else np.arange(len(key))
        earlier = key[rows - 1]
        if self._history:
            earlier[0] = self._history[-1].key[-1]
        else:
            rows, earlier = rows[1:], earlier[1:]
        if self._rule is None:
            return rows[key[rows] <= earlier]
        reach = min(HISTORY * self._rule.step, self._rule.modulus // 2)
        late: Ints = rows[(earlier - key[rows]) % self._rule.modulus <= reach]
        return late

    def _told_apart(self, key: np.ndarray, content: Content, suspects: np.ndarray) -> np.ndarray:
        """bool [n]: false for the suspects that were sent before, and for what follows them in the same order."""
        parts = [*self._history, _Sent(key, content)]
        keys = np.concatenate([part.key for part in parts])
        raw = np.concatenate([part.content.rows() for part in parts])
        old = len(keys) - len(key)
        fresh = np.ones(len(key), dtype=bool)
        places = iter((suspects + old).tolist())
        index, lag = old, self._lag
        suspect = next(places, len(keys))
        while index < len(keys):
            if lag and np.array_equal(raw[index], raw[index - lag]):
                fresh[index - old] = False
                index += 1
                continue
            lag = 0
            while suspect < index:
                suspect = next(places, len(keys))
            index = suspect
            if index < len(keys):
                lag = _lag_of(keys, raw, index)
                index += not lag
        self._lag = lag
        return fresh


class _Sent(NamedTuple):
    """Frames that were sent: counter or time stamp, and their bytes."""

    key: np.ndarray
    content: Content


def _segments(first: int, jumps: list[Jump], count: int) -> np.ndarray:
    """Number of each row's stretch, int32; a stretch begins at every jump."""
    borders = np.array([0, *(jump.row for jump in jumps), count])
    return np.repeat(np.arange(first, first + len(borders) - 1, dtype=np.int32), np.diff(borders))


def _with_last(last: np.ndarray | None, values: np.ndarray | None) -> np.ndarray | None:
    """The values with those of the frame before at their head, where there is one."""
    return values if last is None or values is None else np.concatenate([last, values])


def _lag_of(keys: np.ndarray, raw: np.ndarray, row: int) -> int:
    """How many rows ago the same frame came, 0 if never."""
    first = max(0, row - HISTORY)
    same = np.flatnonzero(keys[first:row] == keys[row])
    if len(same) and np.array_equal(raw[first + same[-1]], raw[row]):
        return row - first - int(same[-1])
    return 0
