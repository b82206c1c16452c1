"""Is a line of text one of the board's, a damaged one of them, or of another kind? And what does not fit in it?"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from functools import reduce

import numpy as np

from vgyro.board import Board, ChannelField, TextFrame
from vgyro.engine.frames import DTYPES

BLANK = b"\r\n \t\0"
BLANKS = rb"[ \t]*"
COMMENTS = (b"#", b"%", b";", b"//")
SHOWN = 60  # characters of a line in a message
RECURS = 3  # lines of one form make it a kind of its own …
NUMBERS_RECUR = 0.2  # … lines of bare numbers only as so large a share: many damaged ones look alike
FIELDS_TELL = 3  # with fewer fields, two lines in one look like one with a field too many
NEAR_STEP = 2.0  # the first step of a time stamp is at most so many times the next

_LINE_ENDS = re.compile(rb"[\r\n]+")
_WORD = re.compile(rb"[A-Za-z_]{2,}")
_NUMBER = rb"[+-]?\d*(?:\.\d*)?(?:[eE][+-]?\d*)?"
# 19 digits that begin with 9 may be more than 64 bits hold.
_WHOLE = rb"(?:[0-8]\d{18}|\d{1,18})"


def opening(frame: TextFrame) -> bytes:
    """The prefix without the separator that may stand at its end: `$VG,` means the same as `$VG`."""
    prefix, separator = frame.prefix.strip(), frame.separator.strip()
    if separator:
        prefix = prefix.removesuffix(separator).rstrip()
    return prefix.encode()


def separator_pattern(frame: TextFrame) -> bytes:
    """Regular expression of what stands between two fields: the separator, and any blanks about it."""
    separator = frame.separator.strip()
    return BLANKS + re.escape(separator.encode()) + BLANKS if separator else rb"[ \t]+"


def value_pattern(entry: ChannelField) -> bytes:
    """Regular expression of one value."""
    kind = DTYPES[entry.type]
    if kind.startswith("f"):
        if entry.decimals is not None:
            return rb"[+-]?\d+\.\d{%d}" % entry.decimals
        return rb"[+-]?\d+(?:\.\d*)?(?:[eE][+-]?\d{1,3})?"
    return rb"\+?" + _WHOLE if kind.startswith("u") else rb"[+-]?" + _WHOLE


def line_pattern(frame: TextFrame, blanks: bool = True) -> bytes:
    """Regular expression of a whole line; group 1 holds the fields, group 2 the checksum.

    blanks : false: for a text without any blank, in which it finds the same, and faster
    """
    separator = separator_pattern(frame)
    forms = [value_pattern(entry) for entry in frame.fields for _ in range(entry.count)]
    fields = rb"(" + separator.join(forms) + rb")"
    before = _opening_pattern(frame)
    if frame.checksum.family == "xor":
        pattern = before + fields + BLANKS + rb"\*([0-9A-Fa-f]{2})"
    else:
        # Many programs write a separator after the last field as well.
        ending = rb"(?:" + separator + rb")?" if frame.separator.strip() else b""
        pattern = rb"(?<=[\r\n])" + BLANKS + before + fields + ending + BLANKS + rb"(?=[\r\n])"
    return pattern if blanks else pattern.replace(BLANKS, b"")


def _opening_pattern(frame: TextFrame) -> bytes:
    head = opening(frame)
    if not head:
        return b""
    # After a sign such as the colon of `G:` the first field may follow at once.
    between = (
        separator_pattern(frame) if head[-1:].isalnum() else rb"(?:" + separator_pattern(frame) + rb"|" + BLANKS + rb")"
    )
    return re.escape(head) + between


class Kinds:
    """Tells damaged lines of a board from lines of another kind.

    frame : the board's;  recurring : forms of other lines, see `recurring_forms`
    """

    def __init__(self, frame: TextFrame, recurring: Iterable[bytes] = ()) -> None:
        self._frame, self._recurring = frame, frozenset(recurring)
        self._opening = opening(frame)
        separator = separator_pattern(frame)
        number = rb"(?:" + separator + rb")?" + _NUMBER
        count = self._fields = sum(entry.count for entry in frame.fields)
        self._separator = re.compile(separator)
        ends = b"|".join(re.escape(self._opening[place:]) for place in range(1, len(self._opening)))
        numbers = number + rb"(?:" + separator + _NUMBER + rb"){0,%d}" % count
        star = rb"[ \t]*\*[0-9A-Fa-f]{0,2}" if frame.checksum.family == "xor" else b""
        # A line that lost its beginning, with or without the end of its prefix.
        self._cut = re.compile(rb"(?:" + (ends or rb"") + rb")?" + numbers + star)
        self._rest = re.compile(separator + numbers + star)

    def is_other(self, line: bytes) -> bool:
        """True for a line that cannot be a damaged one of the board's.

        With a prefix: readable text without it, that is no line of the board without its beginning. Without one: a
        comment, text with words in it, or a line that begins with a letter and whose form recurs.
        """
        text = line.strip(BLANK)
        if not readable(text):
            return False
        if self._opening:
            if self._opening in text:
                return False
            if self._cut.fullmatch(text) or self._nearly(text):
                return form_of(text, self._frame) in self._recurring
            return True
        if text.startswith(COMMENTS) or _WORD.search(text):
            return True
        return text[:1].isalpha() and form_of(text, self._frame) in self._recurring

    def count(self, line: bytes) -> int:
        """How many lines of the board a damaged line may have been: more than one where line ends were lost."""
        if self._opening:
            return max(1, line.count(self._opening))
        between = len(self._separator.findall(line.strip(BLANK)))
        # Two lines that lost the line end between them have one field less than twice as many.
        return max(1, between // (self._fields - 1)) if self._fields >= FIELDS_TELL else 1

    def _nearly(self, text: bytes) -> bool:
        """A prefix with one wrong character, and all else as it should be."""
        size = len(self._opening)
        wrong = sum(a != b for a, b in zip(text[:size], self._opening, strict=False))
        return wrong == 1 and len(text) > size and self._rest.fullmatch(text[size:]) is not None


def readable(text: bytes) -> bool:
    """True for text without control characters, in UTF-8 or Latin-1."""
    if any((byte < 0x20 and byte != 0x09) or byte == 0x7F for byte in text):
        return False
    try:
        text.decode("utf-8")
    except UnicodeDecodeError:
        return not any(0x80 <= byte < 0xA0 for byte in text)
    return True


def form_of(text: bytes, frame: TextFrame) -> bytes:
    """What lines of one kind share: how they begin, up to the first digit, and how many fields they have."""
    begin = re.match(rb"[^\d\s,;*+-]*", text)
    count = len(re.findall(separator_pattern(frame), text.strip(BLANK)))
    return b"%s/%d" % (begin[0] if begin else b"", count)


def recurring_forms(head: bytes, frame: TextFrame) -> frozenset[bytes]:
    """Forms of the lines in the first bytes of a recording that are not the board's and come again and again."""
    fits = re.compile(line_pattern(frame)).search
    lines = [text for line in _LINE_ENDS.split(head) if (text := line.strip(BLANK))]
    others = [line for line in lines if not fits(b"\n" + line + b"\n")]
    found = Counter(form_of(line, frame) for line in others if readable(line))
    least = {True: RECURS, False: max(RECURS, NUMBERS_RECUR * len(lines))}
    return frozenset(form for form, count in found.items() if count >= least[not form.startswith(b"/")])


def typical_line(head: bytes) -> float:
    """Median length of the lines in the first bytes of a recording, without their ends; 0 without lines."""
    lengths = [len(line) for line in _LINE_ENDS.split(head) if line.strip(BLANK)]
    return float(np.median(lengths)) if lengths else 0.0


def first_is_whole(first: bytes, after: Sequence[bytes], board: Board) -> bool:
    """True if the first line of a stream, whose form is right, has not lost its beginning.

    first, after : the first field of the line, and of those after it
    Only the first field can have lost something. A counter is one step before the next one; a time stamp's first step
    is like the second; any other value lies within the span of its neighbours, widened by that span. What was cut and
    still lies there cannot be told from a whole value.
    """
    if not after:
        return True
    name = board.layout.fields[0].channels()[0]
    here, values = _value(first), [_value(text) for text in after]
    if board.counter is not None and board.counter.field == name:
        return (values[0] - here - board.counter.step) % board.counter.modulus == 0
    if board.timestamp is not None and board.timestamp.field == name:
        wrap = board.timestamp.wrap
        steps = [b - a if wrap is None else (b - a) % wrap for a, b in zip([here, *values], values, strict=False)]
        usual = steps[1] if len(steps) > 1 else steps[0] if len(first) == len(after[0]) else 0
        return 0 < steps[0] <= NEAR_STEP * usual
    low, high = min(values), max(values)
    return 2 * low - high <= here <= 2 * high - low


def _value(text: bytes) -> float:
    try:
        return int(text)
    except ValueError:
        return float(text)


def shown(line: bytes) -> str:
    """A line as a message quotes it."""
    text = line.strip(BLANK).decode("utf-8", "replace")
    text = "".join(sign if sign.isprintable() else "·" for sign in text)
    return f'"{text[:SHOWN]}…"' if len(text) > SHOWN else f'"{text}"'


def fault_of(line: bytes, frame: TextFrame) -> str:
    """What does not fit in a line, in words; empty if all does."""
    text, head = line.strip(BLANK), opening(frame)
    if not text.startswith(head):
        return f'it does not begin with "{head.decode()}"'
    body, separator = text[len(head) :].strip(), separator_pattern(frame)
    if head:
        body = re.sub(rb"^" + separator, b"", body)
    stated = None
    if frame.checksum.family == "xor":
        body, star, stated = body.partition(b"*")
        if not star:
            return "it has no checksum (* and two hexadecimal digits)"
        if not re.fullmatch(rb"[0-9A-Fa-f]{2}", stated):
            return f"its checksum {shown(stated)} is not two hexadecimal digits"
    fault = _fault_of_fields(body.strip(), frame)
    if fault:
        return fault
    if stated is not None:
        covered = text[1 : text.index(b"*")]
        computed = reduce(int.__xor__, covered, 0)
        if computed != int(stated, 16):
            return f"its checksum is {stated.decode().upper()}, computed {computed:02X}"
    return f"it is longer than max_length: {frame.max_length}" if len(body) > frame.max_length else ""


def _fault_of_fields(body: bytes, frame: TextFrame) -> str:
    entries = [(entry, name) for entry in frame.fields for name in entry.channels()]
    found = re.split(separator_pattern(frame), body) if body else []
    if len(found) == len(entries) + 1 and not found[-1]:
        found.pop()
    if len(found) != len(entries):
        if len(found) == 1 < len(entries):
            return f"one field of {len(entries)} between separators {frame.separator!r}"
        return f"too {'few' if len(found) < len(entries) else 'many'} fields: {len(found)} of {len(entries)}"
    for number, (text, (entry, name)) in enumerate(zip(found, entries, strict=True), 1):
        fault = _fault_of_value(text, entry)
        if fault:
            return f"field {number} ({name}) {fault}"
        wanted = frame.require.get(name)
        if wanted is not None and float(text) != wanted:
            return f"field {number} ({name}) is {text.decode()}, not {wanted}"
    return ""


def _fault_of_value(text: bytes, entry: ChannelField) -> str:
    if not text:
        return "is empty"
    number = re.fullmatch(rb"[+-]?\d+(\.(\d*))?([eE][+-]?\d{1,3})?", text)
    if number is None:
        return f"{shown(text)} is no number"
    kind = np.dtype(DTYPES[entry.type])
    if kind.kind == "f":
        digits = len(number[2] or b"")
        if entry.decimals is not None and (digits != entry.decimals or number[3]):
            return f"{shown(text)} has {digits} digits after the point, not {entry.decimals}"
        return ""
    if number[1] or number[3]:
        return f"{shown(text)} is no whole number (type {entry.type})"
    low, high = type_limits(entry)
    if not low <= int(text) <= high:
        return f"{text.decode()} is out of range of {entry.type}"
    return ""


def type_limits(entry: ChannelField) -> tuple[int, int]:
    """Smallest and largest whole number that a field of its type takes; 64 bits unsigned end at 2^63 - 1 in text."""
    bits = int(entry.type[1:])
    if entry.type.startswith("u"):
        return 0, min(2**bits, 2**63) - 1
    return -(2 ** (bits - 1)), 2 ** (bits - 1) - 1
