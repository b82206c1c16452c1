"""Why a recording of text is refused: the first line that does not fit, where it is, and what is wrong with it."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

from vgyro.board import TextFrame
from vgyro.config import IntegrityOptions
from vgyro.storage.dumps.text_form import BLANK, fault_of, shown
from vgyro.storage.integrity import Integrity, Refused, percent
from vgyro.storage.sources import SourceFile, read_blocks

BLOCK = 1 << 20
UTF16 = 0.25  # so large a share of zero bytes is text of two bytes a character


def line_number(file: SourceFile, offset: int) -> int:
    """Number, from 1, of the line that holds a byte of an unpacked file. Lines end with LF, CR LF or CR."""
    number, place, after_return = 1, 0, False
    for block in read_blocks(file, BLOCK):
        part = bytes(block[: max(0, offset - place)])
        number += part.count(b"\n") + part.count(b"\r") - part.count(b"\r\n")
        # CR at the end of one block and LF at the begin of the next are one line end.
        number -= after_return and part.startswith(b"\n")
        after_return, place = part.endswith(b"\r"), place + len(block)
        if place >= offset:
            break
    return number


def describe(file: SourceFile, offset: int, line: bytes, frame: TextFrame) -> str:
    """A sentence on a line that does not fit: its number and file, the line itself, and what does not fit."""
    if line.count(0) > UTF16 * len(line):
        return f"{file.name} is UTF-16 text, two bytes a character: save it as UTF-8"
    place = f"line {line_number(file, offset)} of {file.name}, {shown(line)}"
    return f"{place}, does not fit: {fault_of(line, frame) or 'its beginning or its end may be missing'}"


def first_line(head: bytes) -> tuple[int, bytes]:
    """Offset and text of the first line that is not blank; (0, b"") without one."""
    for match in re.finditer(rb"[^\r\n]+", head):
        if match[0].strip(BLANK):
            return match.start(), match[0]
    return 0, b""


def refuse_text(
    record: Integrity, options: IntegrityOptions, where: str, fault: str, others: int, remedy: Callable[[], str]
) -> None:
    """raises : Refused if there is no good line, or too small a share of them

    fault  : what `describe` says of the first line that does not fit, or ""
    others : lines of another kind
    """
    frames = record.frames
    besides = f", {others} of another kind" if others else ""
    first = f"; {fault}" if fault else ""
    if frames.good == 0:
        what = f"no good line of board {record.board} ({frames.bad} that do not fit{besides}){first}"
    elif frames.good_share < options.min_good_share:
        counts = f"{frames.good} good, {frames.lost} lost, {frames.bad} that do not fit{besides}"
        limit = f"integrity.min_good_share = {percent(options.min_good_share)}"
        what = f"only {percent(frames.good_share)} of the lines are good ({counts}), less than {limit}{first}"
    else:
        return
    message = Refused(record, what, where, remedy())
    message.integrity = replace(record, status="refused", reasons=[str(message), *record.reasons])
    raise message
