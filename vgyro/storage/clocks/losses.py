"""Where samples are missing: found block by block, with rows held back until enough of what follows is known."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from vgyro.arrays import Floats
from vgyro.storage.clocks.evenness import ENVELOPE_ROWS, Judgement, level_slope
from vgyro.storage.clocks.windows import backward_min, forward_min

STRETCH = 1 << 17  # rows judged at a time
NEAR = 16  # rows on each side of a long step whose median tells the level
SETTLE = 48  # rows after which the level after a loss is read
TAIL = 64  # rows that must follow a loss of arrival stamps, at least
WHOLE = 0.3  # periods by which a lasting step may differ from whole ones
WHOLE_SHARE = 1e-3  # … and this share of itself
LONG_STEP = 1.5  # periods
FLAT = 0.1  # periods by which the middle half of the rows after a loss may differ
SURELY = 0.05  # periods below a level, for a row to lie before it rose


class FoundEvents(NamedTuple):
    """Events among judged rows.

    rows  : int64; lost: int64, samples missing before each, 0 if the clock was set; shift: of the stamps, s
    """

    rows: np.ndarray
    lost: np.ndarray
    shift: np.ndarray


def tail_rows(grid: Judgement) -> int:
    """Rows that must follow a loss: 64, and so many that the noise of their envelope, which shrinks as their number
    grows, is a tenth of a period; the whole horizon if even that does not show single losses."""
    if grid.least_loss > 1:
        return max(TAIL, grid.horizon)
    return int(max(TAIL, min(grid.horizon, ENVELOPE_ROWS * 10 * grid.noise / grid.period)))


def _found(rows: list[int], lost: list[int], shift: list[float]) -> FoundEvents:
    return FoundEvents(np.array(rows, dtype=np.int64), np.array(lost, dtype=np.int64), np.array(shift))


class LossFinder:
    """Feed the times of one piece of a recording without restarts; `sink` gets (times, events) of judged rows in order.

    Stretches begin at the piece's first row and do not depend on the blocks that are fed.
    """

    def __init__(self, judgement: Judgement, sink: Callable[[np.ndarray, FoundEvents], None]) -> None:
        self.judgement = judgement
        self._sink = sink
        self._back, self._ahead = {
            "steps": (NEAR, NEAR),
            "pauses": (1, 0),
            "level": (judgement.horizon, judgement.horizon + judgement.reach),
        }[judgement.losses]
        self._reset()

    def _reset(self) -> None:
        self._times = np.empty(0)
        self._low = 0  # first row of _times that is not judged
        self._period = self.judgement.period
        self._raise = np.empty(0)  # level method: total shift at rows before it

    def feed(self, times: np.ndarray) -> None:
        """times: float64 [n], s"""
        self._times = np.concatenate([self._times, times])
        while len(self._times) - self._low >= STRETCH + self._ahead:
            self._judge(self._low + STRETCH, self._low + STRETCH + self._ahead, last=False)

    def flush(self) -> None:
        """The piece ends."""
        if len(self._times) > self._low:
            self._judge(len(self._times), len(self._times), last=True)
        self._reset()

    def _judge(self, high: int, end: int, last: bool) -> None:
        times = self._times[:end]
        if self.judgement.losses == "pauses":
            found = self._by_pauses(times, self._low, high)
        elif self.judgement.losses == "steps":
            found = self._by_steps(times, self._low, high)
        else:
            found = self._by_level(times, self._low, high, last)
        self._sink(self._times[self._low : high], found._replace(rows=found.rows - self._low))
        drop = max(0, high - self._back)
        self._times, self._low = self._times[drop:], high - drop

    def _by_pauses(self, times: np.ndarray, low: int, high: int) -> FoundEvents:
        first = max(low, 1)
        step = times[first:high] - times[first - 1 : high - 1]
        rows = np.flatnonzero(step > self.judgement.pause)
        periods = step[rows] / self.judgement.period
        lost = np.maximum(1, np.rint(periods) - 1).astype(np.int64)
        return FoundEvents(rows + first, lost, step[rows] - self.judgement.period)

    def _by_steps(self, times: np.ndarray, low: int, high: int) -> FoundEvents:
        """A long step is a gap of as many periods as the median level after it is above the one before."""
        period = self.judgement.period
        level = times / period - np.arange(len(times))
        long = np.flatnonzero(np.diff(times) > LONG_STEP * period) + 1
        borders = np.concatenate([[0], long, [len(times)]])
        mine = np.flatnonzero((long >= max(low, 1)) & (long < high))
        if not len(mine):
            return _found([], [], [])
        rows, before, after = long[mine], borders[mine], borders[mine + 2]
        reach = np.arange(NEAR)
        behind = rows[:, None] - 1 - reach
        ahead = rows[:, None] + reach
        past = np.where(behind >= before[:, None], level[np.maximum(behind, 0)], np.nan)
        next_ = np.where(ahead < after[:, None], level[np.minimum(ahead, len(level) - 1)], np.nan)
        shift = np.nanmedian(next_, axis=1) - np.nanmedian(past, axis=1)
        lost = np.rint(shift).astype(np.int64)
        real = lost > 0
        return FoundEvents(rows[real], lost[real], shift[real] * period)

    def _by_level(self, times: np.ndarray, low: int, high: int, last: bool) -> FoundEvents:
        """Lasting steps of the lower envelope.

        F, the least distance from the line in the horizon ahead, less B, the least one in the horizon behind (earlier
        steps taken away), is the step at a row. It counts if it is above the least loss less half a period and lasts:
        the first half of the horizon is not above the second by half a period, as it is while a stall is caught up.
        """
        grid, width = self.judgement, self.judgement.horizon
        self._period = period = level_slope(times[low:high], self._period, width)
        rest = times - period * np.arange(len(times))
        known = self._raise
        raised = rest.copy()
        total = float(known[-1]) if len(known) else 0.0
        raised[: len(known)] += total - known
        half = max(1, width // 2)
        near = forward_min(rest, half)
        ahead = np.minimum(near, np.append(near[half:], np.full(min(half, len(near)), np.inf)))
        lasts = _lasting(rest, near, half, period, last)
        # Rows too near the end of a piece are not judged.
        stop = min(high, len(times) - tail_rows(grid) + 1) if last else high
        scan = _Scan(raised, ahead, lasts, period, grid)
        found = scan.run(max(low, 1), stop)
        shifts = np.zeros(high)
        shifts[found.rows] = found.shift
        shifts = np.cumsum(shifts[low:]) + total
        self._raise = np.concatenate([known, shifts])[max(0, high - self._back) :]
        return found


def _lasting(rest: np.ndarray, near: np.ndarray, half: int, period: float, last: bool) -> np.ndarray:
    """bool [n]: the level after a row does not fall later on by half a period."""
    later = np.append(near[half:], np.full(min(half, len(near)), np.inf))[: len(near)]
    lasts = later >= near - period / 2
    if last:
        # Near the end there is less to look at: of what is left, a first part of a quarter to a half, and the rest.
        width, end = 1, len(rest)
        suffix = np.minimum.accumulate(rest[::-1])[::-1]
        while width < half and 2 * width <= end:
            rows = np.arange(max(0, end - 4 * width + 1), end - 2 * width + 1)
            first = forward_min(rest[rows[0] :], width)[: len(rows)]
            lasts[rows] = suffix[rows + width] >= first - period / 2
            width *= 2
    return lasts


class _Scan:
    """Walk through the lasting steps of one stretch, in order."""

    def __init__(
        self, raised: np.ndarray, ahead: np.ndarray, lasts: np.ndarray, period: float, grid: Judgement
    ) -> None:
        self.raised, self.ahead, self.lasts = raised, ahead, lasts
        self.period, self.limit, self.width = period, (grid.least_loss - 0.5) * period, grid.horizon
        self.noise, self.reach = grid.noise, grid.reach
        self._first = backward_min(raised, self.width)

    def run(self, low: int, stop: int) -> FoundEvents:
        rows: list[int] = []
        lost: list[int] = []
        shifts: list[float] = []
        # Shifts cancel once the whole horizon behind lies after the last event.
        step = np.where(np.isfinite(self._first), self.ahead - self._first, -np.inf)
        bulk = np.flatnonzero((step > self.limit) & self.lasts)
        row = low
        while row < stop:
            found = self._next(row, stop, rows[-1] if rows else None, bulk)
            if found is None:
                break
            row, height = found
            count, shift = self._weigh(height)
            row = self._place(row, shift, stop)
            rows.append(row)
            lost.append(count)
            shifts.append(shift)
            self.raised[max(0, row - self.width) : row] += shift
            row += 1
        return _found(rows, lost, shifts)

    def _next(self, row: int, stop: int, event: int | None, bulk: np.ndarray) -> tuple[int, float] | None:
        """The next step from `row` on, and its height, s."""
        if event is not None and row <= event + self.width:
            end = min(stop, event + self.width + 1)
            step = self._steps(max(0, event - self.width), row, end)
            hits = np.flatnonzero((step[: end - row] > self.limit) & self.lasts[row:end])
            if len(hits):
                return row + int(hits[0]), self._height(step, row, int(hits[0]))
            row = end
        place = int(np.searchsorted(bulk, row))
        if place == len(bulk) or bulk[place] >= stop:
            return None
        row = int(bulk[place])
        return row, self._height(self._steps(max(0, row - self.width), row, row + 1), row, 0)

    def _steps(self, origin: int, row: int, end: int) -> np.ndarray:
        """The step at rows from `row` to `reach` after `end`, with what was found so far taken away."""
        behind = backward_min(self.raised[origin : end + self.reach], self.width)[row - origin :]
        step = self.ahead[row : row + len(behind)] - behind
        return np.where(np.isfinite(step), step, -np.inf)

    def _height(self, step: Floats, row: int, hit: int) -> float:
        """The median step of the rows after it, as long as there are as many to come.

        The rows just before the loss, and the next loss, may spoil some: if it is not whole, shorter stretches (unless
        the first is flat) or later ones may tell whole periods.
        """
        settle = min(SETTLE, max(1, (len(self.ahead) - row - hit) // 2))
        near = step[hit : hit + settle]
        low, middle, high = np.quantile(near, [0.25, 0.5, 0.75]).tolist()
        others = [near[: settle // 2], near[: settle // 4]] if high - low >= FLAT * self.period else []
        if settle == SETTLE and len(self.ahead) - row - hit > 2 * self.reach:
            others += [step[hit + settle : hit + 2 * settle], step[hit + 2 * settle : hit + self.reach]]
        heights = [middle, *(float(np.median(part)) for part in others if len(part))]
        whole: float = next((height for height in heights if self._weigh(height)[0]), middle)
        return whole

    def _place(self, row: int, shift: float, stop: int) -> int:
        """The loss comes after the last row that is still below the new level."""
        end = min(row + self.reach, stop)
        level = float(self.raised[max(0, row - self.width) : row].min()) + shift
        low = np.flatnonzero(self.raised[row:end] < level - max(SURELY * self.period, 3 * self.noise))
        row = min(row + int(low[-1]) + 1, stop - 1) if len(low) else row
        # A row that is on the wrong side after all must not hide the next loss, or make one.
        self.raised[row : row + self.reach] = np.maximum(self.raised[row : row + self.reach], level)
        return row

    def _weigh(self, height: float) -> tuple[int, float]:
        """Lost samples and the shift to take away: whole periods, or all of it if it is not whole."""
        height = max(height, self.limit)
        count = int(np.rint(height / self.period))
        tolerance = max(WHOLE * self.period, 4 * self.noise) + WHOLE_SHARE * height
        if count and abs(height - count * self.period) <= tolerance:
            return count, count * self.period
        return 0, height
