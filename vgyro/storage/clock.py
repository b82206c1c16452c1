"""Counter and time stamps of good frames: wraps undone, repeats dropped, gaps found and placed in time."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from vgyro.board import Board
from vgyro.storage.scan import Found
from vgyro.storage.selection import CounterRule

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
    """Frames of a chunk without the repeated ones, on the recording's clock; `rows`: their places in the chunk."""

    found: Found
    rows: np.ndarray
    counter: np.ndarray
    time: np.ndarray
    segment: np.ndarray
    jumps: list[Jump]
    repeated: int


@dataclass
class Clock:
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
    _last: Found | None = None
    _history: Found | None = None
    _lag: int = 0
    _rule: CounterRule | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        if self.board.counter:
            self._rule = CounterRule(self.board.counter.step, self.board.counter.modulus)

    def feed(self, found: Found) -> Timed:
        """Place the frames of the next chunk in time."""
        fresh = self._fresh(found)
        repeated = int(len(fresh) - fresh.sum())
        kept = found.take(fresh)
        if not len(kept.start):
            empty = np.empty(0, dtype=np.int64)
            return Timed(kept, empty, empty, empty.astype(np.float64), empty.astype(np.int32), [], repeated)
        frames, ticks, jumps = self._steps(kept)
        if self._first:
            # The first frame follows nothing: it sets counter and time zero.
            step = self._rule.step if self._rule else 1
            self._first_counter = 0 if kept.counter is None else int(kept.counter[0]) // step
            self._counter, self._first = self._first_counter, False
        counter = self._counter + np.cumsum(frames)
        total = self._ticks + np.cumsum(ticks)
        segment = np.full(len(frames), self._segment, dtype=np.int32)
        for jump in jumps:
            segment[jump.row :] += 1
        self._counter, self._ticks, self._segment = int(counter[-1]), int(total[-1]), int(segment[-1])
        self._last = kept.take(np.array([len(kept.start) - 1]))
        if self.board.timestamp:
            time = total * self.board.timestamp.tick_s
        else:
            time = (counter - self._first_counter) / self.rate_hz
        return Timed(kept, np.flatnonzero(fresh), counter, time, segment, jumps, repeated)

    @property
    def measured_rate_hz(self) -> float | None:
        """Frames a second by the time stamps of frames that follow each other; None without time stamps."""
        if not self.board.timestamp or not self.in_step_ticks:
            return None
        return self.in_step_frames / (self.in_step_ticks * self.board.timestamp.tick_s)

    def _steps(self, kept: Found) -> tuple[np.ndarray, np.ndarray, list[Jump]]:
        """Frames and ticks from each frame to the next, int64 [n] each; the very first frame's are 0."""
        count = len(kept.start)
        before = self._before(kept)
        elapsed = self._elapsed(before)
        if self._rule is None and elapsed is None:
            return self._by_bytes(before, count)
        if self._rule is None or before.counter is None:
            frames, jumps = self._by_stamp(elapsed)
        elif elapsed is None:
            frames, jumps = self._by_counter(np.diff(before.counter), before.counter)
        else:
            frames, jumps = self._by_both(before.counter, elapsed)
        ticks = np.zeros(len(frames), dtype=np.int64) if elapsed is None else elapsed
        shift = count - len(frames)
        jumps = [jump._replace(row=jump.row + shift) for jump in jumps]
        self._count_in_step(frames, ticks, jumps, shift)
        return np.insert(frames, 0, [0] * shift), np.insert(ticks, 0, [0] * shift), jumps

    def _before(self, kept: Found) -> Found:
        """The chunk with the last frame of the one before at its head."""
        return kept if self._last is None else _joined(self._last, kept)

    def _elapsed(self, frames: Found) -> np.ndarray | None:
        """Ticks from each frame to the next, modulo the time stamp's wrap."""
        if frames.stamp is None or self.board.timestamp is None:
            return None
        difference = np.diff(frames.stamp)
        wrap = self.board.timestamp.wrap
        return difference if wrap is None else difference % wrap

    def _count_in_step(self, frames: np.ndarray, ticks: np.ndarray, jumps: list[Jump], shift: int) -> None:
        plain = np.ones(len(frames), dtype=bool)
        plain[[jump.row - shift for jump in jumps]] = False
        self.in_step_frames += int(frames[plain].sum())
        self.in_step_ticks += int(ticks[plain].sum())

    def _by_bytes(self, before: Found, count: int) -> tuple[np.ndarray, np.ndarray, list[Jump]]:
        """Neither counter nor time stamp: damaged bytes stand for as many frames as they could have been."""
        hole = before.start[1:] - before.stop[:-1]
        lost = np.where(hole > 0, np.maximum(1, np.rint(hole / self.typical_length)), 0).astype(np.int64)
        shift = count - len(lost)
        jumps = [Jump(int(i) + shift, LOST, int(lost[i]), True, True) for i in np.flatnonzero(lost)]
        frames = np.insert(lost + 1, 0, [0] * shift)
        return frames, np.zeros(count, dtype=np.int64), jumps

    def _by_counter(self, difference: np.ndarray, counter: np.ndarray) -> tuple[np.ndarray, list[Jump]]:
        """The counter alone: a gap is as short as it can be; a counter near zero has restarted."""
        rule = self._known_rule()
        period = rule.modulus // rule.step
        frames = rule.frames(counter[1:], counter[:-1])
        self.still += int(np.count_nonzero(difference == 0))
        frames[difference == 0] = 1
        near_zero = min(NEAR_ZERO, max(2, period // 64))
        restart = (frames > near_zero) & (counter[1:] // rule.step < near_zero) | (frames < 0)
        jumps = []
        for index in np.flatnonzero((frames != 1) | restart):
            if restart[index]:
                jumps.append(Jump(int(index), RESTART, None, False, False))
            else:
                jumps.append(Jump(int(index), LOST, int(frames[index]) - 1, True, True))
        frames[restart] = 1
        return frames, jumps

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

    def _fresh(self, found: Found) -> np.ndarray:
        """bool [n]: false for a frame that was sent before, alone or in a block: same counter, same bytes."""
        fresh = np.ones(len(found.start), dtype=bool)
        key = found.stamp if found.counter is None else found.counter
        if key is None or not len(fresh):
            return fresh
        known = found if self._history is None else _joined(self._history, found)
        old = len(known.start) - len(fresh)
        keys = known.stamp if known.counter is None else known.counter
        if keys is None:
            return fresh
        suspects = iter(self._suspects(keys).tolist())
        raw = known.raw
        index, lag = old, self._lag
        suspect = next(suspects, len(keys))
        while index < len(keys):
            if lag and np.array_equal(raw[index], raw[index - lag]):
                fresh[index - old] = False
                index += 1
                continue
            lag = 0
            while suspect < index:
                suspect = next(suspects, len(keys))
            index = suspect
            if index < len(keys):
                lag = _lag_of(keys, raw, index)
                index += not lag
        self._lag = lag
        self._history = known.take(np.arange(max(0, len(keys) - HISTORY), len(keys)))
        return fresh

    def _suspects(self, keys: np.ndarray) -> np.ndarray:
        """Rows whose counter (or time stamp) does not advance: they may have been sent before."""
        difference = np.diff(keys)
        if self._rule is None:
            return np.flatnonzero(difference <= 0) + 1
        reach = min(HISTORY * self._rule.step, self._rule.modulus // 2)
        return np.flatnonzero(-difference % self._rule.modulus <= reach) + 1


def _lag_of(keys: np.ndarray, raw: np.ndarray, row: int) -> int:
    """How many rows ago the same frame came, 0 if never."""
    first = max(0, row - HISTORY)
    same = np.flatnonzero(keys[first:row] == keys[row])
    if len(same) and np.array_equal(raw[first + same[-1]], raw[row]):
        return row - first - int(same[-1])
    return 0


def _joined(first: Found, second: Found) -> Found:
    def join(one: np.ndarray | None, other: np.ndarray | None) -> np.ndarray | None:
        return None if one is None or other is None else np.concatenate([one, other])

    return Found(
        np.concatenate([first.start, second.start]),
        np.concatenate([first.stop, second.stop]),
        np.concatenate([first.damage, second.damage]),
        np.concatenate([first.raw, second.raw]),
        join(first.counter, second.counter),
        join(first.stamp, second.stamp),
        {},
    )
