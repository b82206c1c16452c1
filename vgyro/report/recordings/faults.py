"""Faults of single gyros: the table of events, and what to conclude from them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import Any

import numpy as np
from markupsafe import Markup

from vgyro.report.html import heading, join, paragraph
from vgyro.report.model import ArrayPart, DatasetPart, Record, rows_of
from vgyro.report.numbers import plain, significant
from vgyro.report.sentences import MOST_NAMED, Conclusion, named
from vgyro.report.tables import Cell, TableColumn, TableRow, render_table

LONG_SHARE = 0.1
MOST_ROWS = 100
FAULT_RULE = (
    "A gyro fails where it leaves the combination of the other gyros of its array by more than healthy gyros of this "
    "recording do, by as many standard deviations as analysis.faults.threshold says; the strongest event is taken "
    "first, and that gyro left out there, so that it accuses no other. Noise or scale that is wrong all the time is no "
    f"event: see the rule for bad gyros. Red: to the end of the recording, or more than {LONG_SHARE:.0%} of it."
)


def faults_part(dataset: DatasetPart, array: ArrayPart) -> Markup:
    """The events of one array, or that none was found, and what was looked for."""
    table = array.tables.get("faults")
    if table is None:
        return Markup("")
    found, about = list(rows_of(table)), _about(dataset, array)
    words = _searched(about)
    if not found:
        text = words if about.get("note") else f"No fault found. {words}"
        return join(heading("Faults", 4), paragraph(text, "note" if about.get("note") else ""))
    columns = [
        TableColumn("gyro", numeric=False),
        TableColumn("kind", numeric=False),
        TableColumn("from", "s"),
        TableColumn("to", "s"),
        TableColumn("evidence", "σ", hint="size over its standard error in health"),
        TableColumn("size", hint="greatest drift, step, ratio of the noise, change of the scale factor"),
        TableColumn("", numeric=False, wide=True),
    ]
    rows = [_row(row) for row in found[:MOST_ROWS]]
    more = [f"{len(found) - MOST_ROWS} more events are in faults.parquet"] if len(found) > MOST_ROWS else []
    caption = "Stretches in which one gyro is at fault; methods that need “faults” leave it out there"
    table_of = render_table(columns, rows, caption, more)
    return join(heading("Faults", 4), table_of, paragraph(words, "note"))


def fault_times(array: ArrayPart) -> list[float]:
    """Begin and end of every event, s, for marks in a plot."""
    table = array.tables.get("faults", {})
    if not table or len(table["start"]) > MOST_ROWS:
        return []
    return sorted({float(moment) for name in ("start", "stop") for moment in table[name]})


def fault_sentences(dataset: DatasetPart) -> list[Conclusion]:
    """Which gyro fails, when and how, gyro by gyro; where nothing was found, that too, in one sentence an axis."""
    found = []
    for axis in dataset.board.axes:
        arrays = [array for array in dataset.arrays if array.axis == axis and "faults" in array.tables]
        for array in arrays:
            found += _of_array(dataset, array)
        found += _nothing(dataset, axis, arrays)
    return found


def faulty_gyros(dataset: DatasetPart) -> set[str]:
    """Gyros with an event in some recording."""
    return {str(gyro) for array in dataset.arrays for gyro in array.tables.get("faults", {}).get("gyro", ())}


def _of_array(dataset: DatasetPart, array: ArrayPart) -> list[Conclusion]:
    rows = sorted(rows_of(array.tables["faults"]), key=lambda row: (array.gyros.index(row["gyro"]), row["start"]))
    gyros = {gyro: list(group) for gyro, group in groupby(rows, key=lambda row: str(row["gyro"]))}
    if len(gyros) > MOST_NAMED:
        text = f"{len(gyros)} of {len(array.gyros)} gyros fail at times ({array.recording}, axis {array.axis})."
        return [Conclusion(text, "bad", array.anchor)]
    return [_sentence(dataset, array, gyro, events) for gyro, events in gyros.items()]


def _sentence(dataset: DatasetPart, array: ArrayPart, gyro: str, events: Sequence[dict[str, Any]]) -> Conclusion:
    """One gyro of one recording: its first event, what happens, whether it lasts."""
    length = float(dataset.recording(array.recording).integrity.get("duration_s") or 0.0)
    listed = [str(row["sentence"]).removeprefix(f"{gyro}: ").rstrip(".") for row in events]
    lasting = any(
        row["stop"] - row["start"] > LONG_SHARE * length or " to the end" in row["sentence"] for row in events
    )
    more = f"; and {len(listed) - MOST_NAMED} more events" if len(listed) > MOST_NAMED else ""
    start = plain(min(float(row["start"]) for row in events), 6)
    text = (
        f"{gyro} fails from {start} s ({array.recording}, axis {array.axis}): {'; '.join(listed[:MOST_NAMED])}{more}."
    )
    return Conclusion(text, "bad" if lasting else "warn", array.anchor)


def _nothing(dataset: DatasetPart, axis: str, arrays: Sequence[ArrayPart]) -> list[Conclusion]:
    """Recordings without an event, and those in which not all could be looked for."""
    found = []
    empty = [array for array in arrays if len(array.tables["faults"]["gyro"]) == 0]
    limited: dict[str, list[str]] = {}
    for array in empty:
        limited.setdefault(str(_about(dataset, array).get("note") or ""), []).append(array.recording)
    for note, recordings in limited.items():
        where = f"axis {axis}, {named(recordings)}"
        if note:
            found.append(Conclusion(f"Faults ({where}): {note}.", "", f"{recordings[0]}-{axis}"))
        else:
            looked = _about(dataset, next(one for one in empty if one.recording == recordings[0]))["looked_for"]
            text = f"No fault found ({where}); looked for: {looked}."
            found.append(Conclusion(text, "good", f"{recordings[0]}-{axis}"))
    return found


def _about(dataset: DatasetPart, array: ArrayPart) -> Record:
    """Metadata of the table."""
    return dataset.sources.get(f"{array.recording}/{array.axis}/faults.parquet", {})


def _searched(about: Record) -> str:
    note = str(about.get("note") or "")
    if note:
        return note[0].upper() + note[1:] + "."
    threshold = about.get("threshold")
    return f"Looked for: {about.get('looked_for')}; evidence of {plain(float(threshold or 0), 3)} σ or more."


def _row(row: dict[str, Any]) -> TableRow:
    evidence, size = float(row["evidence"]), float(row["size"])
    return TableRow((
        Cell(row["gyro"]),
        Cell(row["kind"]),
        Cell(plain(float(row["start"]), 7)),
        Cell(plain(float(row["stop"]), 7)),
        Cell(significant(evidence) if np.isfinite(evidence) else "certain", hint="the values alone show it"
             if not np.isfinite(evidence) else ""),
        Cell(_size(row["kind"], size, str(row["unit"]))),
        Cell(row["sentence"]),
    ))  # fmt: skip


def _size(kind: str, size: float, unit: str) -> str:
    if not np.isfinite(size):
        return "—"
    if kind in ("scale", "dead"):
        return f"{100.0 * size:+.3g} %"
    return f"{size:.3g} ×" if unit == "1" else f"{size:+.3g} {unit}"
