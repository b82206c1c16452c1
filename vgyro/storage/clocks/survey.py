"""The first pass over the stamps of a recording."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import replace
from typing import Literal

import numpy as np

from vgyro import units
from vgyro.arrays import Bools
from vgyro.errors import DataError
from vgyro.storage.clocks.clock import Clock, Track
from vgyro.storage.clocks.evenness import SHORTEST_PERIOD, Judgement
from vgyro.storage.clocks.head import Rules, look
from vgyro.storage.clocks.lines import ClockLine, StampFit, fit_lines
from vgyro.storage.clocks.model import MAX_GAPS, ClockGap, ClockOptions, ClockRecord
from vgyro.storage.clocks.pieces import Collector
from vgyro.storage.clocks.repeats import Keeper
from vgyro.storage.clocks.stream import Chunk, Filler, chunked
from vgyro.storage.clocks.unfold import Unfolder, spikes, usable

RATE_TOLERANCE = 0.02
FEW_RESTARTS, RESTART_SHARE = 10, 0.01
REMEDY = "give `rate_hz`, or log finer stamps"


def survey(blocks: Iterable[tuple[np.ndarray, np.ndarray]], options: ClockOptions | None = None) -> Clock:
    """Find out what the time stamps of a recording are.

    The first 131 072 rows tell what they are (see `judge`, `keep_rule`); all rows tell rate, losses and drift. Memory
    grows by 40 bytes in 1024 rows, and by 16 bytes for each place where samples are missing.

    blocks  : (stamps [n] int64 or float64, same bool [n]: the row equals the one before in every channel), in order
    returns : the Clock; `place` takes the same blocks again
    raises  : DataError if the stamps do not tell the rate and none is declared, or if they are no clock at all
    """
    options = options or ClockOptions()
    if options.meaning not in ("auto", "sampled", "arrival"):
        raise DataError(f"time stamps cannot mean {options.meaning!r}", None, "use auto, sampled or arrival")
    if options.rate_hz is not None and not 0 < options.rate_hz < np.inf:
        raise DataError(f"a rate of {options.rate_hz} Hz is impossible", None, "give a positive `rate_hz`")
    chunks = chunked(blocks)
    first = next(chunks)
    rules = look(first.stamps, first.same, options, whole=not len(first.after))
    pass_ = _Pass(rules)
    pass_.take(first)
    for chunk in chunks:
        pass_.take(chunk)
    return pass_.clock(options)


class _Pass:
    """State of the first pass."""

    def __init__(self, rules: Rules) -> None:
        self.rules = rules
        self.rows = self.kept = 0
        self.keeper = Keeper(rules.keep)
        self.spikes: list[np.ndarray] = []
        self.unfolder: Unfolder | None = None
        self._restart = 0  # restarts up to the last kept row
        if rules.unfold is not None and rules.judgement is not None:
            self.unfolder = Unfolder(rules.unfold)
            self.filler = Filler(rules.judgement.period)
            self.collector = Collector(rules.judgement, rules.bin_rows)

    def take(self, chunk: Chunk) -> None:
        """The next chunk."""
        keep = self.keeper.feed(chunk.stamps, chunk.same)
        self.kept += int(keep.sum())
        if self.unfolder is not None:
            bad = self._bad(chunk)
            before = self.unfolder.restarts
            unfolded = self.unfolder.feed(chunk.stamps, bad)
            # A restart in a row that is not kept is one before the next kept row.
            passed = before + np.cumsum(unfolded.restart)[keep]
            restart = np.diff(passed, prepend=self._restart) > 0
            self._restart = int(passed[-1]) if len(passed) else self._restart
            self.collector.feed(*self.filler.feed(unfolded.seconds[keep], restart))
            self._check_restarts(self.rows + len(chunk.stamps))
        self.rows += len(chunk.stamps)

    def _bad(self, chunk: Chunk) -> Bools:
        rules = self.rules
        assert rules.unfold is not None
        around = np.concatenate([chunk.before, chunk.stamps, chunk.after])
        good = usable(around, rules.scale)
        inner = slice(len(chunk.before), len(chunk.before) + len(chunk.stamps))
        spike = spikes(around, good, rules.unfold)[inner]
        self.spikes.append(np.flatnonzero(spike) + self.rows)
        return ~good[inner] | spike

    def _check_restarts(self, rows: int) -> None:
        assert self.unfolder is not None
        if self.unfolder.restarts > FEW_RESTARTS + RESTART_SHARE * rows:
            what = f"the time stamps begin anew, or go back, {self.unfolder.restarts} times in {rows} rows"
            raise DataError(what, None, "name another time column, or none and `rate_hz`")

    def clock(self, options: ClockOptions) -> Clock:
        """Finish.  raises : DataError"""
        judgement = self.rules.judgement
        if self.unfolder is None or judgement is None:
            return self._silent(options)
        tail = self.filler.flush()
        self.collector.feed(tail, np.zeros(len(tail), dtype=bool))
        self.collector.close()
        fit = _fit(self.collector, judgement)
        if not fit.period >= SHORTEST_PERIOD:
            raise DataError("the time stamps do not advance", None, REMEDY)
        track = self._track(fit, judgement)
        return Clock(self.rules, track, self._record(options, fit, track, judgement))

    def _silent(self, options: ClockOptions) -> Clock:
        rules = self.rules
        if options.rate_hz is None:
            raise DataError(f"the time stamps do not tell the rate: {rules.nothing}", None, "give `rate_hz`")
        warning = f"{rules.nothing}: time is counted at the declared {options.rate_hz:g} Hz; losses cannot be seen"
        return Clock(
            rules,
            None,
            ClockRecord(
                meaning="none",
                even=None,
                time_from="rate",
                why=rules.nothing,
                unit=rules.unit,
                unit_why=rules.unit_why,
                samples=self.kept,
                rate_hz=float(options.rate_hz),
                rate_sd_hz=None,
                drift_ppm=None,
                jitter_s=None,
                resolution_s=rules.resolution,
                wrap_s=None,
                wraps=0,
                midnights=0,
                restarts=0,
                repeated=0,
                held=1.0,
                lost=0,
                least_loss=None,
                uneven=0.0,
                gaps=[],
                gaps_not_listed=0,
                bad_stamps=0,
                warnings=[warning],
            ),
        )

    def _track(self, fit: StampFit, judgement: Judgement) -> Track:
        pieces = self.collector.pieces
        counters, times, events, lost = [0], [pieces[0].first], [], []
        on_line = judgement.time_from != "stamps"
        if on_line:
            times = [0.0]
        for number, (before, piece) in enumerate(itertools.pairwise(pieces)):
            gap = fit.period if piece.restart else piece.elapsed
            missing = 0 if piece.restart else max(0, round(gap / fit.period) - 1)
            counters.append(counters[-1] + before.counter + 1 + missing)
            end = float(fit.lines[number](np.array([float(before.counter)]))[0]) if on_line else 0.0
            times.append(times[-1] + end + gap if on_line else piece.first)
            events.append(piece.start)
            lost.append(missing)
        rows, counts = self.collector.events()
        at = np.concatenate([rows, np.array(events, dtype=np.int64)])
        order = np.argsort(at, kind="stable")
        total = np.concatenate([counts, np.array(lost, dtype=np.int64)])[order]
        return Track(
            at[order],
            np.concatenate([[0], np.cumsum(total)]),
            np.array([piece.start for piece in pieces], dtype=np.int64),
            np.array(counters, dtype=np.int64),
            np.array(times),
            fit.lines if on_line else [],
            np.concatenate(self.spikes),
            self.filler.runs(),
        )

    def _record(self, options: ClockOptions, fit: StampFit, track: Track, judgement: Judgement) -> ClockRecord:
        assert self.unfolder is not None
        rules, collector = self.rules, self.collector
        gaps = self._gaps(fit, track, judgement)
        day = options.day
        uneven = 0.0
        if not judgement.even and collector.step_sum > 0:
            mean = collector.step_sum / collector.step_count
            uneven = float(np.sqrt(max(0.0, collector.step_squares / collector.step_count - mean**2)) / mean)
        meaning: Literal["sampled", "arrival"] = "arrival" if judgement.time_from == "envelope" else "sampled"
        wrap = self.unfolder.wrap if self.unfolder.wraps else None
        return ClockRecord(
            meaning=meaning,
            even=judgement.even,
            time_from=judgement.time_from,
            why=judgement.why + (f"; readings are held: {rules.keep.why}" if rules.keep.held > 1 else ""),
            unit=rules.unit,
            unit_why=rules.unit_why,
            samples=self.kept,
            rate_hz=1 / fit.period,
            rate_sd_hz=fit.period_sd / fit.period**2,
            drift_ppm=None if fit.drift is None else round(units.parts_per_million(fit.drift), 6),
            jitter_s=judgement.jitter,
            resolution_s=judgement.resolution,
            wrap_s=None if wrap is None else wrap * rules.scale,
            wraps=0 if day else self.unfolder.wraps,
            midnights=self.unfolder.wraps if day else 0,
            restarts=self.unfolder.restarts,
            repeated=self.keeper.repeated,
            held=(self.kept + self.keeper.held_back) / self.kept if rules.keep.held > 1 else 1.0,
            lost=int(track.lost[-1]),
            least_loss=judgement.least_loss if judgement.even else None,
            uneven=uneven,
            gaps=gaps[:MAX_GAPS],
            gaps_not_listed=len(track.events) - len(gaps[:MAX_GAPS]),
            bad_stamps=self.filler.bad,
            warnings=self._warnings(options, fit, judgement),
        )

    def _gaps(self, fit: StampFit, track: Track, judgement: Judgement) -> list[ClockGap]:
        """In order of time; no more than the first 1000 of each kind."""
        found: list[tuple[int, int | None, float, float, str]] = []
        cause = {
            "steps": "the stamps jump",
            "level": "a lasting step of the stamps",
            "pauses": "a pause of the stamps",
        }[judgement.losses]
        for event in self.collector.listed:
            found.append((event.row, event.lost, event.before, event.after, cause))
        pieces = self.collector.pieces
        for before, piece in zip(pieces[:-1][:MAX_GAPS], pieces[1:], strict=False):
            at = int(np.searchsorted(track.events, piece.start))
            lost = None if piece.restart else int(track.lost[at + 1] - track.lost[at])
            why = "the clock began anew" if piece.restart else cause
            found.append((piece.start, lost, before.last, piece.first, why))
        gaps = []
        for row, lost, last, first, why in sorted(found, key=lambda entry: entry[0]):
            if track.lines:
                rows = np.array([row - 1, row])
                last, first = (track.on_line(rows, track.counter(rows)[0])).tolist()
            else:
                last, first = last - track.times[0], first - track.times[0]
            duration = None if lost is None else max(0.0, float(first - last - fit.period))
            gaps.append(ClockGap(float(last + fit.period), duration, lost, why))
        return gaps

    def _warnings(self, options: ClockOptions, fit: StampFit, judgement: Judgement) -> list[str]:
        assert self.unfolder is not None
        rate = 1 / fit.period
        texts = []
        if options.rate_hz is not None and abs(rate / options.rate_hz - 1) > RATE_TOLERANCE:
            texts.append(f"the time stamps say {rate:.6g} Hz, {options.rate_hz:g} Hz was declared: the stamps are used")
        if self.filler.bad:
            texts.append(
                f"{self.filler.bad} rows have no usable time stamp, or one far off: their times are interpolated"
            )
        if self.unfolder.restarts:
            texts.append(f"the clock began anew {self.unfolder.restarts} times: how long it stood still is not known")
        if self.collector.set_clocks:
            texts.append(f"the stamps' clock was set {self.collector.set_clocks} times by no whole number of periods")
        if not judgement.even:
            texts.append("sampled unevenly: single lost samples cannot be told from long steps")
        elif judgement.least_loss > 1:
            texts.append(f"jitter hides losses of fewer than {judgement.least_loss} samples in a row")
        if self.rules.keep.held > 1:
            texts.append(f"readings were logged several times: each is kept once ({self.rules.keep.why})")
        return texts


def _fit(collector: Collector, judgement: Judgement) -> StampFit:
    pieces = collector.pieces
    if judgement.even:
        bins = [piece.bins.close() for piece in pieces]
        last = [piece.counter for piece in pieces]
        fit = fit_lines(bins, last, judgement.period, judgement.time_from == "envelope")
        # A line through rounded stamps is no surer than their rounding lets the ends be.
        rows = max(1, sum(last))
        return replace(fit, period_sd=float(max(fit.period_sd, judgement.resolution / rows / np.sqrt(12))))
    length = sum(piece.last - piece.first for piece in pieces)
    steps = sum(piece.counter for piece in pieces)
    period = length / steps if steps else judgement.period
    lines: list[ClockLine] = []
    spread = judgement.jitter / np.sqrt(max(1, collector.step_count))
    return StampFit(period, float(spread), None, lines)
