"""A commented dataset.yaml as text, from what was found in the files. Comments come from the models' descriptions."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from vgyro.dataset import Kind, Manifest, Recording
from vgyro.describe import type_text, value_text
from vgyro.log import Log, LogGyro, LogTime

WIDTH = 120

HEAD = """\
# Written by `vgyro new-dataset`. Check what it guessed, correct the kind of each recording, then:
#     vgyro check
#     snakemake --cores 2
# A line that begins with "# key:" is a key with its default; remove the # to set it. All keys: docs/configuration.md.
"""
REFERENCES = """\
    #   reference: {kind: constant, rate: 50}
    #   reference: {kind: sinusoid, amplitude: 60, frequency_hz: 0.5}
    #   reference: {kind: file, file: table.csv, time: time, rate: rate}
    #   reference: {kind: plateaus, plateaus: [{start: 0, stop: 20, rate: 0}, {start: 25, stop: 45, rate: 50}]}
"""
ANALYSIS = """\
# analysis:
#   volatility: {window: 360, step: 30}
"""


@dataclass
class ArrayDraft:
    """The gyros of logs, as keys of `array`.

    places : channel → where it stands, where a column's name alone does not tell;  why : gyro → how its unit is known
    other  : column → what it is taken for, and not used
    """

    gyros: list[dict[str, Any]] = field(default_factory=list)
    temperatures: list[dict[str, Any]] = field(default_factory=list)
    places: dict[str, dict[str, Any]] = field(default_factory=dict)
    why: dict[str, str] = field(default_factory=dict)
    other: dict[str, str] = field(default_factory=dict)


@dataclass
class LogDraft:
    """How a log is to be read.

    time   : name of the column;  time_unit : of its numbers;  meaning : what its stamps were found to be
    places : channel → Place, where names differ;  there : all columns;  form : phrases on the form of the text
    values : of a board's columns: counts, or rates in deg/s;  missing : gyros of the board without a column
    unused : tables with gyros that were not taken
    """

    family: str
    there: list[str]
    time: str | None = None
    time_unit: str | None = None
    meaning: str = ""
    table: str | None = None
    places: dict[str, Any] = field(default_factory=dict)
    form: list[str] = field(default_factory=list)
    values: str | None = None
    missing: list[str] = field(default_factory=list)
    unused: list[str] = field(default_factory=list)


@dataclass
class RecordingDraft:
    """One recording to be: its files, what was measured, and notes for the user."""

    name: str
    files: list[str]
    kind: Kind = "static"
    why: str = "a guess: correct it"
    rate_hz: float | None = None
    notes: list[str] = field(default_factory=list)
    log: LogDraft | None = None


def manifest_text(
    board: str | ArrayDraft, board_notes: list[str], folder: str, recordings: Sequence[RecordingDraft]
) -> str:
    """The text of a dataset.yaml; the first recording explains every key, the others only hold what differs.

    board : name of a board file, or the gyros that the manifest names itself
    """
    lines = [HEAD, "\n"]
    if isinstance(board, ArrayDraft):
        lines += [*_array(board), "\n", *_key(Manifest, "board", None)]
    else:
        lines += [*_key(Manifest, "board", board, notes=board_notes), "\n", *_key(Manifest, "array", None)]
    for name in ("title", "folder", "gyros", "latitude_deg", "simulated", "twin", "notes"):
        lines += ["\n", *_key(Manifest, name, folder if name == "folder" else None)]
    lines.append(f"\n# {Manifest.model_fields['recordings'].description}\nrecordings:\n")
    for index, draft in enumerate(recordings):
        lines += _recording(draft, explained=index == 0)
    lines.append(f"\n# {Manifest.model_fields['analysis'].description}\n{ANALYSIS}")
    return "".join(lines)


def _array(array: ArrayDraft) -> Iterator[str]:
    fields = LogGyro.model_fields
    yield f"# {Manifest.model_fields['array'].description}; keys of a gyro:\n"
    for name in ("column", "axis", "sign", "unit", "scale", "bias", "range_deg_s", "lowpass_hz"):
        yield f"#   {name}: {fields[name].description}\n"
    yield "array:\n  gyros:\n"
    said = ""
    for gyro in array.gyros:
        if (why := array.why[gyro["name"]]) != said:
            yield from _comment(f"unit: {why}", "    ")
            said = why
        yield from entry("- ", gyro, "    ")
    yield "  # thermometers: °C = value · scale + offset\n"
    yield f"  temperatures:{'' if array.temperatures else ' []'}\n"
    for one in array.temperatures:
        yield from entry("- ", one, "    ")
    if array.other:
        yield "  # not used:\n"
        for column, what in array.other.items():
            yield from _comment(f"  {column}: {what}", "  ")


def entry(key: str, value: object, indent: str) -> Iterator[str]:
    """Lines of a key, "name: " or "- ", and its value: in one line, or an item a line where that is too wide."""
    flat = f"{indent}{key}{value_text(value)}\n"
    if len(flat) <= WIDTH + 1 or not isinstance(value, dict | list) or not value:
        yield flat
        return
    inner = indent + "  "
    if isinstance(value, dict):
        inside = [line for name, one in value.items() for line in entry(f"{name}: ", one, inner)]
    else:
        inside = [line for one in value for line in entry("- ", one, inner)]
    if key == "- ":
        yield f"{indent}- {inside[0].lstrip()}"
        inside = inside[1:]
    else:
        yield f"{indent}{key.rstrip()}\n"
    yield from inside


def _comment(text: str, indent: str) -> Iterator[str]:
    """A comment, on several lines where it is too wide."""
    hanging = " " * (len(text) - len(text.lstrip()))
    width = WIDTH - len(indent) - 2
    for line in textwrap.wrap(text.strip(), width, initial_indent=hanging, subsequent_indent=hanging):
        yield f"{indent}# {line}\n"


def _key(
    model: type[Manifest | Recording], name: str, value: object, indent: str = "", notes: Sequence[str] = ()
) -> list[str]:
    """Comment and line of a key; without a value, the default as a comment."""
    known = model.model_fields[name]
    choices = type_text(known.annotation)
    meaning = f"{known.description}; {choices}" if choices.startswith("one of") else str(known.description)
    lines = [line for text in (meaning, *notes) for line in _comment(text, indent)]
    if value is None:
        return [*lines, f"{indent}# {name}: {value_text(known.get_default())}\n"]
    return [*lines, *entry(f"{name}: ", value, indent)]


def _recording(draft: RecordingDraft, explained: bool) -> Iterator[str]:
    indent = "    "
    if not explained:
        yield f"\n  - name: {value_text(draft.name)}\n"
        for note in (*draft.notes, draft.why):
            yield from _comment(note, indent)
        yield f"{indent}kind: {draft.kind}\n"
        yield from entry("files: ", draft.files, indent)
        if draft.rate_hz is not None:
            yield f"{indent}rate_hz: {value_text(draft.rate_hz)}\n"
        yield from _log(draft.log, indent)
        return
    yield f"  # {Recording.model_fields['name'].description}\n  - name: {value_text(draft.name)}\n"
    for note in draft.notes:
        yield from _comment(note, indent)
    yield from _key(Recording, "kind", draft.kind, indent, [draft.why])
    yield from _key(Recording, "files", draft.files, indent)
    yield from _key(Recording, "rate_hz", draft.rate_hz, indent)
    yield from _key(Recording, "rest", None, indent)
    yield from _key(Recording, "axis", None, indent)
    yield f"{indent}# {Recording.model_fields['reference'].description}; deg/s and s; one of\n{REFERENCES}"
    if draft.log is None:
        yield from _key(Recording, "log", None, indent)
    yield from _log(draft.log, indent)


def _log(log: LogDraft | None, indent: str) -> Iterator[str]:
    if log is None:
        return
    fields, inner = Log.model_fields, f"{indent}  "
    form = f" ({', '.join(log.form)})" if log.form else ""
    yield f"{indent}# {Recording.model_fields['log'].description}\n"
    yield f"{indent}# it has the columns{form}\n"
    yield from _comment("  " + ", ".join(log.there), indent)
    yield f"{indent}log:\n{inner}family: {log.family}\n"
    if log.table is not None:
        others = f"; others with gyros: {', '.join(log.unused)}" if log.unused else ""
        yield from _comment(f"{fields['table'].description}{others}", inner)
        yield f"{inner}table: {value_text(log.table)}\n"
    else:
        yield f"{inner}# {fields['table'].description}\n{inner}# table: null\n"
    yield f"{inner}# {fields['text'].description}\n{inner}# text: {{}}\n"
    yield f"{inner}# {fields['time'].description}\n"
    if log.time is None:
        yield f"{inner}time: null\n"
    else:
        stamp: dict[str, str] = {"column": log.time} | ({"unit": log.time_unit} if log.time_unit else {})
        meaning = LogTime.model_fields["meaning"].description
        yield from _comment(f"meaning: {meaning}; {log.meaning or 'found when it is read'}", inner)
        yield from entry("time: ", stamp, inner)
    if log.values is not None:
        kind = "floating-point" if log.values == "rates" else "whole"
        yield f"{inner}# {fields['values'].description}; a guess, for the columns hold {kind} numbers\n"
        yield f"{inner}values: {log.values}\n"
    yield f"{inner}# {fields['clocks'].description}\n{inner}# clocks: auto\n"
    yield f"{inner}# {fields['columns'].description}; only where the names differ\n"
    yield f"{inner}columns:{'' if log.places else ' {}'}\n"
    for name, place in log.places.items():
        yield from entry(f"{name}: ", place, f"{inner}  ")
    yield from (f"{inner}  # {name}: no column found\n" for name in log.missing)
