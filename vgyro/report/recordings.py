"""What was measured and how complete it is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from markupsafe import Markup

from vgyro.report.html import details, join, paragraph
from vgyro.report.model import DatasetPart, RecordingPart
from vgyro.report.numbers import MISSING, count, duration, percent, significant
from vgyro.report.tables import Cell, Column, Row, Tone, render_table

MOST_LISTED = 50
TONES: dict[str, Tone] = {"good": "good", "ok": "good", "suspect": "warn", "refused": "bad"}
COLUMNS = (
    Column("recording", numeric=False),
    Column("kind", numeric=False),
    Column("status", numeric=False),
    Column("duration"),
    Column("good", group="frames", hint="frames whose checksum and counter are right"),
    Column("bad", group="frames", hint="damaged frames, left out"),
    Column("lost", group="frames", hint="missing by the frame counter"),
    Column("gaps", hint="interruptions; no figure bridges one"),
    Column("declared", "Hz", group="sample rate"),
    Column("measured", "Hz", group="sample rate"),
    Column("clipped or stuck channels", numeric=False),
)


def recordings_part(dataset: DatasetPart) -> Markup:
    """Table of the recordings, why one was refused or is suspect, and the damage in detail."""
    table = render_table(COLUMNS, [_row(recording) for recording in dataset.recordings])
    return join(table, *(_remarks(recording) for recording in dataset.recordings), *map(_detail, dataset.recordings))


def _row(recording: RecordingPart) -> Row:
    record = recording.integrity
    status = str(record.get("status", MISSING))
    frames = record.get("frames") or {}
    rate = record.get("rate") or {}
    cells = (
        Cell(recording.name),
        Cell(recording.kind),
        Cell(status, tone=TONES.get(status, "")),
        Cell(duration(_number(record.get("duration_s")))),
        *(_count(frames.get(name)) for name in ("good", "bad", "lost")),
        _count(len(record.get("gaps") or [])),
        Cell(significant(_number(rate.get("declared_hz", record.get("rate_hz"))), 6)),
        Cell(significant(_number(rate.get("measured_hz")), 6), hint="by the board's own clock, where it has one"),
        Cell(channel_words(record.get("channels") or {})),
    )
    return Row(cells)


def _number(value: Any) -> float:
    return float("nan") if value is None else float(value)


def _count(value: Any) -> Cell:
    return Cell(MISSING, tone="muted", hint="not known for this kind of file") if value is None else Cell(count(value))


def channel_words(channels: Mapping[str, Any]) -> str:
    """Channels that are clipped or stuck, in words."""
    words = []
    for name, record in channels.items():
        clipped, stuck = record.get("clipped"), record.get("stuck")
        share = record.get("clipped_share")
        if clipped:
            words.append(f"{name}: {count(clipped)} clipped" + (f" ({percent(share, 2)})" if share is not None else ""))
        if stuck:
            times = len(stuck) if isinstance(stuck, list | tuple) else stuck
            words.append(f"{name}: stuck {times} {'time' if times == 1 else 'times'}")
    return "; ".join(words) or "none"


def _remarks(recording: RecordingPart) -> Markup:
    record = recording.integrity
    parts = [
        paragraph(f"{recording.name} was refused: {reason}", "bad")
        for reason in (record.get("reasons") or [] if not recording.usable else [])
    ]
    known = set(record.get("reasons") or []) if not recording.usable else set()
    remarks = [*(record.get("reasons") or []), *(record.get("warnings") or [])]
    parts += [paragraph(f"{recording.name}: {text}", "warn") for text in dict.fromkeys(remarks) if text not in known]
    return join(*parts)


def _detail(recording: RecordingPart) -> Markup:
    """Damage and gaps, one by one, the first of them."""
    record = recording.integrity
    parts = []
    for key, title in (("damage", "Damage"), ("gaps", "Gaps")):
        entries = [entry for entry in record.get(key) or [] if isinstance(entry, Mapping)]
        if entries:
            names = list(dict.fromkeys(name for entry in entries for name in entry))
            columns = [
                Column(name.replace("_", " "), numeric=not isinstance(entries[0].get(name), str)) for name in names
            ]
            rows = [[_plain(entry.get(name)) for name in names] for entry in entries[:MOST_LISTED]]
            more = f", the first {MOST_LISTED} of {len(entries)}" if len(entries) > MOST_LISTED else ""
            parts.append(render_table(columns, rows, f"{title}{more}", row_header=False, compact=True))
    if not parts:
        return Markup("")
    return details(f"Damage and gaps of {recording.name}", join(*parts))


def _plain(value: Any) -> str:
    if value is None:
        return MISSING
    return significant(value, 6) if isinstance(value, float) else str(value)
