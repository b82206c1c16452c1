"""A commented dataset.yaml as text, from what was found in the files. Comments come from the models' descriptions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from vgyro.dataset import Kind, Manifest, Recording
from vgyro.describe import type_text, value_text
from vgyro.log import Log as ParquetLog

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


@dataclass(frozen=True)
class LogDraft:
    """What is known of a Parquet log.

    columns : channel or gyro of the board → column, where they are known;  missing : gyros without a column
    there   : all columns of the log;  time : the column that looks like a time in s
    values  : counts where the columns hold whole numbers
    """

    columns: dict[str, str]
    missing: list[str]
    there: list[str]
    time: str | None
    values: str = "counts"


@dataclass(frozen=True)
class RecordingDraft:
    """One recording to be: its file, what was measured, and notes for the user."""

    name: str
    file: str
    kind: Kind = "static"
    rate_hz: float | None = None
    notes: list[str] = field(default_factory=list)
    log: LogDraft | None = None


def manifest_text(board: str, board_notes: list[str], folder: str, recordings: list[RecordingDraft]) -> str:
    """The text of a dataset.yaml; the first recording explains every key, the others only hold what differs."""
    lines = [HEAD, "\n", *_key(Manifest, "board", board, notes=board_notes)]
    for name in ("title", "folder", "gyros", "latitude_deg", "simulated", "twin", "notes"):
        lines += ["\n", *_key(Manifest, name, folder if name == "folder" else None)]
    lines.append(f"\n# {Manifest.model_fields['recordings'].description}\nrecordings:\n")
    for index, draft in enumerate(recordings):
        lines += _recording(draft, explained=index == 0)
    lines.append(f"\n# {Manifest.model_fields['analysis'].description}\n{ANALYSIS}")
    return "".join(lines)


def _key(
    model: type[Manifest | Recording], name: str, value: object, indent: str = "", notes: Sequence[str] = ()
) -> list[str]:
    """Comment and line of a key; without a value, the default as a comment."""
    known = model.model_fields[name]
    choices = type_text(known.annotation)
    meaning = f"{known.description}; {choices}" if choices.startswith("one of") else str(known.description)
    lines = [f"{indent}# {text}\n" for text in (meaning, *notes)]
    if value is None:
        return [*lines, f"{indent}# {name}: {value_text(known.get_default())}\n"]
    return [*lines, f"{indent}{name}: {value_text(value)}\n"]


def _recording(draft: RecordingDraft, explained: bool) -> Iterator[str]:
    indent = "    "
    if not explained:
        yield f"\n  - name: {value_text(draft.name)}\n"
        yield from (f"{indent}# {note}\n" for note in draft.notes)
        yield f"{indent}kind: {draft.kind}\n{indent}files: {value_text([draft.file])}\n"
        if draft.rate_hz is not None:
            yield f"{indent}rate_hz: {value_text(draft.rate_hz)}\n"
        yield from _log(draft.log, indent)
        return
    yield f"  # {Recording.model_fields['name'].description}\n  - name: {value_text(draft.name)}\n"
    yield from (f"{indent}# {note}\n" for note in draft.notes)
    yield from _key(Recording, "kind", draft.kind, indent, ["a guess: correct it"])
    yield from _key(Recording, "files", [draft.file], indent)
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
    fields = ParquetLog.model_fields
    yield f"{indent}# {Recording.model_fields['parquet'].description}; the log has the columns\n"
    yield from (f"{indent}#   {line}\n" for line in _wrapped(log.there, WIDTH - len(indent) - 4))
    yield f"{indent}log:\n"
    kind = "floating-point" if log.values == "rates" else "whole"
    yield f"{indent}  # {fields['values'].description}; a guess, for the columns hold {kind} numbers\n"
    yield f"{indent}  values: {log.values}\n"
    yield f"{indent}  # {fields['time'].description}\n"
    yield f"{indent}  {'' if log.time else '# '}time: {value_text(log.time)}\n"
    yield f"{indent}  # {fields['columns'].description}; only where the names differ\n"
    differing = {name: column for name, column in log.columns.items() if name != column}
    yield f"{indent}  columns:{'' if differing else ' {}'}\n"
    yield from (f"{indent}    {name}: {value_text(column)}\n" for name, column in differing.items())
    yield from (f"{indent}    # {name}: no column found\n" for name in log.missing)


def _wrapped(words: list[str], width: int) -> Iterator[str]:
    line = ""
    for word in words:
        if line and len(line) + 2 + len(word) > width:
            yield line + ","
            line = word
        else:
            line = f"{line}, {word}" if line else word
    yield line
