"""Is a recording good, suspect or to be refused? The reasons, as sentences."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from vgyro.board import Board
from vgyro.config import IntegrityOptions
from vgyro.errors import DataError
from vgyro.storage.integrity import (
    ChannelRecord,
    FileRecord,
    FrameCount,
    Integrity,
    Ledger,
    Refused,
    good_share,
    listed,
    percent,
)

SUSPECT_SHARE = 0.99
NEARLY_ALL_GYROS = 0.9


@dataclass(frozen=True)
class RecordingOutcome:
    """What a reader knows at the end of a recording. end_s: time of the last frame, s; None without frames.

    declared_rate_hz : None: only the stamps tell;  stamped : the measured rate holds, whatever is declared
    clocks           : of a log, the record of each stream's clock;  left_out : files that were not read, as sentences
    """

    board: Board
    values: Literal["counts", "rates"]
    files: list[FileRecord]
    good: int
    repeated: int
    end_s: float | None
    declared_rate_hz: float | None
    measured_rate_hz: float | None
    segments: int
    still: int = 0
    stamped: bool = False
    clocks: list[dict[str, Any]] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)


def conclude(
    outcome: RecordingOutcome,
    ledger: Ledger,
    channels: dict[str, ChannelRecord],
    options: IntegrityOptions,
    hints: list[str],
) -> Integrity:
    """The integrity record: good or suspect, or refused because the values are not of this board.

    See refuse_if_needed, which raises what the record says.
    """
    board, declared, measured = outcome.board, outcome.declared_rate_hz, outcome.measured_rate_hz
    share = good_share(outcome.good, ledger.bad, ledger.lost)
    frames = FrameCount(outcome.good, ledger.bad, ledger.lost, outcome.repeated, share)
    rate_note, contradicts = rate_check(board, declared, measured, options)
    reasons = [f"left out: {text}" for text in outcome.left_out]
    reasons += [f"{rate_note}: the measured rate is used"] if contradicts else []
    reasons += suspicions(board, frames, ledger, channels, options)
    rate = measured if measured is not None and (contradicts or outcome.stamped or declared is None) else declared
    if rate is None:
        raise ValueError("a recording without a rate")
    foreign = out_of_range(board, channels, options)
    reasons = [foreign, *reasons] if foreign else reasons
    return Integrity(
        board=board.name,
        status="refused" if foreign else "suspect" if reasons else "good",
        reasons=reasons,
        warnings=notes(board, ledger, outcome.still) + hints,
        values=outcome.values,
        files=outcome.files,
        frames=frames,
        duration_s=0.0 if outcome.end_s is None else outcome.end_s + 1 / rate,
        rate_hz=rate,
        declared_rate_hz=declared,
        measured_rate_hz=measured,
        rate_note=rate_note,
        segments=outcome.segments,
        clocks=outcome.clocks,
        restarts=ledger.restarts,
        gaps=ledger.gaps,
        gaps_not_listed=ledger.more_gaps,
        damage=ledger.damage,
        damage_not_listed=ledger.more_damage,
        channels=channels,
    )


def refuse_if_needed(record: Integrity, options: IntegrityOptions, where: str, remedy: Callable[[], str]) -> None:
    """raises : Refused if there is no good frame, or too small a share of them, or if the record is refused already

    where, remedy : the file; what to do about frames that are not good
    """
    frames, reasons = record.frames, record.reasons
    advice = remedy
    if frames.good == 0:
        size = sum(file.content_bytes for file in record.files)
        what = f"no good frame of board {record.board} in {size} bytes, from byte 0 to the end"
    elif frames.good_share < options.min_good_share:
        first = f", from byte {record.damage[0].start} of {record.damage[0].file} on" if record.damage else ""
        counts = f"{frames.good} good, {frames.lost} lost, {frames.bad} damaged{first}"
        limit = f"integrity.min_good_share = {percent(options.min_good_share)}"
        what = f"only {percent(frames.good_share)} of the frames are good ({counts}), less than {limit}"
    elif record.status == "refused":
        what, *reasons = record.reasons
        advice = _out_of_range_remedy
    else:
        return
    message = Refused(record, what, where, advice())
    message.integrity = replace(record, status="refused", reasons=[str(message), *reasons])
    raise message


def _out_of_range_remedy() -> str:
    return (
        "is this the right board, with the right unit and the right type, byte order and scale of its channels? See"
        " `board` and `log` in the manifest and the board file. If the gyros were at their limits all along, measure"
        " again"
    )


def out_of_range(board: Board, channels: dict[str, ChannelRecord], options: IntegrityOptions) -> str:
    """Why the values cannot be this board's: nearly all samples of nearly all gyros at the rails; "" if they can."""
    limit = options.refuse_clipped_share
    shares = {gyro.name: channels[gyro.field].clipped_share for gyro in board.gyros if gyro.field in channels}
    beyond = [name for name, share in shares.items() if share > limit]
    if not beyond or len(beyond) < NEARLY_ALL_GYROS * len(board.gyros):
        return ""
    many = f"{len(beyond)} of {len(board.gyros)} gyros ({listed(beyond)})"
    text = f"the values are out of the range of board {board.name}: more than {percent(limit)} of the samples of {many}"
    return f"{text} lie at or beyond its limits (integrity.refuse_clipped_share = {limit:g})"


def rate_check(
    board: Board, declared: float | None, measured: float | None, options: IntegrityOptions
) -> tuple[str, bool]:
    """A sentence on declared and measured rate, and whether they contradict each other."""
    if declared is None:
        return f"measured {measured:.6g} Hz by the time stamps; none is declared", False
    if measured is None:
        why = "it holds no time stamps" if board.counter else "it holds neither time stamps nor a frame counter"
        return (
            f"the rate of {declared:g} Hz is as declared and cannot be checked from the recording alone: {why}",
            False,
        )
    error = measured / declared - 1
    text = f"measured {measured:.6g} Hz, declared {declared:g} Hz ({100 * error:+.2g} %)"
    return text, abs(error) > options.max_rate_error


def suspicions(
    board: Board,
    frames: FrameCount,
    ledger: Ledger,
    channels: dict[str, ChannelRecord],
    options: IntegrityOptions,
) -> list[str]:
    """Reasons to look twice; empty for a good recording."""
    reasons = []
    if frames.good_share < SUSPECT_SHARE:
        counts = f"{frames.good} good, {frames.lost} lost, {frames.bad} damaged"
        reasons.append(f"only {percent(frames.good_share)} of the frames are good ({counts})")
    if ledger.restarts:
        times = "once" if ledger.restarts == 1 else f"{ledger.restarts} times"
        reasons.append(f"the counter or clock restarted {times}; how long the board was off is not known")
    gyros = {gyro.field: gyro.name for gyro in board.gyros}
    limit_share = options.max_clipped_share
    clipped = [gyros[name] for name in gyros if name in channels and channels[name].clipped_share > limit_share]
    if clipped:
        limit = percent(limit_share)
        reasons.append(f"more than {limit} of the samples are clipped on {listed(clipped)}")
    for name, record in channels.items():
        if name in gyros and record.stuck_duration > options.stuck_s:
            when = f"from {record.stuck_start:.6g} s on"
            reasons.append(f"gyro {gyros[name]} repeats one value for {record.stuck_duration:.3g} s, {when}")
    return reasons


def notes(board: Board, ledger: Ledger, still: int) -> list[str]:
    """What is good to know and makes nothing suspect."""
    found = []
    if ledger.ambiguous:
        what = "whole wraps of the counter" if board.counter else "more frames"
        if not board.counter and not board.timestamp:
            found.append(
                "without counter and time stamp, gaps are as long as the damaged bytes; whole pauses do not show"
            )
        else:
            gaps = "gap is the shortest that fits" if ledger.ambiguous == 1 else "gaps are the shortest that fit"
            found.append(f"{ledger.ambiguous} {gaps}; {what} more would fit as well")
    if still:
        found.append(f"the counter stood still in {still} frames")
    if board.frame is not None and board.frame.checksum.family == "none":
        found.append("the frames carry no checksum: a damaged digit that still reads as a number does not show")
    return found


def unreadable_record(board: Board, rate_hz: float | None, error: DataError) -> Integrity:
    """The record of a recording that could not even be opened."""
    return Integrity(
        board=board.name,
        status="refused",
        reasons=[str(error)],
        warnings=[],
        values="counts",
        files=[],
        frames=FrameCount(0, 0, 0, 0, 0.0),
        duration_s=0.0,
        rate_hz=rate_hz or 0.0,
        declared_rate_hz=rate_hz,
        measured_rate_hz=None,
        rate_note="not read",
        segments=0,
        clocks=[],
        restarts=0,
        gaps=[],
        gaps_not_listed={"entries": 0, "frames_lost": 0},
        damage=[],
        damage_not_listed={"entries": 0, "bytes": 0, "frames_lost": 0},
        channels={},
    )
