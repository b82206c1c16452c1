"""What was measured and how complete it is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from markupsafe import Markup

from vgyro.report.html import details, join, paragraph
from vgyro.report.model import DatasetPart, RecordingPart
from vgyro.report.numbers import MISSING, count, duration, percent, plain
from vgyro.report.recordings.clocks import clocks_part
from vgyro.report.sentences import moved_words
from vgyro.report.tables import Cell, TableColumn, TableRow, Tone, render_table

MOST_LISTED = 50
MOST_NAMED = 3
STUCK_S = 1.0
TONES: dict[str, Tone] = {"good": "good", "suspect": "warn", "refused": "bad"}
COLUMNS = (
    TableColumn("recording", numeric=False),
    TableColumn("kind", numeric=False),
    TableColumn("status", numeric=False),
    TableColumn("duration"),
    TableColumn("good", group="frames", hint="frames whose checksum and counter are right"),
    TableColumn("bad", group="frames", hint="damaged frames, left out"),
    TableColumn("lost", group="frames", hint="missing by the frame counter"),
    TableColumn("gaps", hint="interruptions; nothing is put in their place"),
    TableColumn("declared", "Hz", group="sample rate"),
    TableColumn("measured", "Hz", group="sample rate"),
    TableColumn("clipped, stuck or missing channels", numeric=False),
)


def recordings_part(dataset: DatasetPart) -> Markup:
    """Table of the recordings, why one was refused or is suspect, and the damage in detail."""
    longest = float(dataset.options.get("integrity", {}).get("stuck_s", STUCK_S))
    table = render_table(COLUMNS, [_row(recording, longest) for recording in dataset.recordings])
    remarks = [_remarks(recording) for recording in dataset.recordings]
    return join(table, *remarks, *map(clocks_part, dataset.recordings), *map(_detail, dataset.recordings))


def _row(recording: RecordingPart, longest: float) -> TableRow:
    record = recording.integrity
    status = recording.status
    frames = record["frames"]
    gaps = len(record["gaps"]) + record["gaps_not_listed"]["entries"]
    measured = record["measured_rate_hz"]
    cells = (
        Cell(recording.name),
        Cell(recording.kind),
        Cell(status, "" if recording.moved is None else "the board moved", TONES.get(status, "")),
        Cell(duration(float(record["duration_s"]))),
        *(Cell(count(frames[name])) for name in ("good", "bad", "lost")),
        Cell(count(gaps), _longest_gap(record["gaps"])),
        Cell(MISSING if record["declared_rate_hz"] is None else plain(float(record["declared_rate_hz"]))),
        Cell(MISSING if measured is None else plain(float(measured)), hint=str(record["rate_note"])),
        Cell(channel_words(record["channels"], longest)),
    )
    return TableRow(cells)


def _longest_gap(gaps: list[Mapping[str, Any]]) -> str:
    known = [gap["duration"] for gap in gaps if gap["duration"] is not None]
    return f"longest {duration(max(known))}" if known else ""


def channel_words(channels: Mapping[str, Any], longest: float = STUCK_S) -> str:
    """Channels that are clipped, or repeat one value for more than `longest` s, in words."""
    most = sorted(channels.items(), key=lambda item: -item[1]["clipped"])
    clipped = [
        f"{name} ({count(record['clipped'])}, {percent(record['clipped_share'], 2)})"
        for name, record in most
        if record["clipped"]
    ]
    stuck = [
        f"{name} ({duration(record['stuck_duration'])} from {plain(record['stuck_start'])} s on)"
        for name, record in channels.items()
        if record["stuck_duration"] > longest
    ]
    words = [f"clipped: {_listed(clipped)}"] if clipped else []
    words += [f"stuck: {_listed(stuck)}"] if stuck else []
    gone = [f"{name} ({count(record['missing'])})" for name, record in channels.items() if record["missing"]]
    words += [f"without a value: {_listed(gone)}"] if gone else []
    return "; ".join(words) or "none"


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return ", ".join(names[:MOST_NAMED]) + more


def _remarks(recording: RecordingPart) -> Markup:
    record = recording.integrity
    refused = [] if recording.usable else record["reasons"]
    parts = [paragraph(f"{recording.name} was refused: {reason}", "bad") for reason in refused]
    if recording.moved is not None:
        parts.append(paragraph(f"{recording.name} {moved_words(recording.kind, recording.moved)}.", "bad"))
    if recording.usable:
        parts += [paragraph(f"{recording.name}: {reason}", "warn") for reason in record["reasons"]]
    parts += [paragraph(f"{recording.name}: {text}", "note") for text in record["warnings"]]
    return join(*parts)


def _detail(recording: RecordingPart) -> Markup:
    """Damage and gaps, one by one, the first of them."""
    record = recording.integrity
    parts = []
    for key, title in (("damage", "Damage"), ("gaps", "Gaps")):
        entries = record[key]
        if entries:
            total = len(entries) + record[f"{key}_not_listed"]["entries"]
            more = f", the first {MOST_LISTED} of {total}" if total > min(len(entries), MOST_LISTED) else ""
            columns = [_detail_column(name, entries[0][name]) for name in entries[0]]
            rows = [[_plain(entry[name]) for name in entries[0]] for entry in entries[:MOST_LISTED]]
            parts.append(render_table(columns, rows, f"{title}{more}", row_header=False, compact=True))
    if not parts:
        return Markup("")
    return details(f"Damage and gaps of {recording.name}", join(*parts))


def _detail_column(name: str, example: Any) -> TableColumn:
    unit = {"time": "s", "duration": "s", "start": "byte", "stop": "byte"}.get(name, "")
    return TableColumn(name.replace("_", " "), unit, numeric=not isinstance(example, str | bool))


def _plain(value: Any) -> str:
    if value is None:
        return MISSING
    if isinstance(value, bool):
        return "yes" if value else "no"
    return plain(value) if isinstance(value, float) else str(value)
