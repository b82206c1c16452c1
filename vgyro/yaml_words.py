"""What is wrong with a text that is not YAML, in plain words: the line, its text, and what to do."""

from __future__ import annotations

import re
from collections.abc import Callable

import yaml

SHOWN = 60
QUOTES = "put the value in quotes"

_KEY = r"^\s*(?:- +)*[\w.-]+"
_NO_SPACE = re.compile(_KEY + r":[^\s:/]")
_PLAIN_KEY = re.compile(_KEY + r":(\s|$)")
_COLON_IN_VALUE = re.compile(_KEY + r":\s+[^'\"\[{#|>&*!].*:(\s|$)")
_DATE = re.compile(r":\s+\d{4}-\d{1,2}-\d{1,2}")

# A line (from 0), and what is wrong with it.
Said = tuple[int, str]


def yaml_fault(error: Exception, text: str) -> tuple[int, str]:
    """The line of a mistake, from 1, and a sentence on it, for an error of the YAML reader.

    error : yaml.YAMLError, or the ValueError of a date or number that is none
    """
    lines = text.splitlines() or [""]
    line, said = _said(error, text, lines)
    # The end of the file stands after its last line.
    line = min(max(line, 0), len(lines) - 1)
    return line + 1, said.replace("{line}", _shown(lines[line]))


def spaceless(text: str) -> str:
    """What is wrong with a text in which YAML sees no key, or with a key that holds a colon; "" if nothing shows."""
    if "\u00a0" in text:
        return "the blank after the colon is no plain space (it may have been copied from a page): type it again"
    if re.search(r"^-[\w]", text):
        return f"a space is missing after the dash: write '- {text[1:]}'"
    if found := re.search(r"^([\w.-]+):([^\s/\\].*)", text):
        return f"a space is missing after the colon: write '{found[1]}: {found[2]}'"
    return ""


def _said(error: Exception, text: str, lines: list[str]) -> Said:
    if isinstance(error, yaml.reader.ReaderError):
        place = text[: error.position].count("\n")
        code = error.character if isinstance(error.character, int) else ord(error.character[:1] or "\0")
        return (
            place,
            f"the sign U+{code:04X} may not stand in the file: delete it, and save the file as plain UTF-8 text",
        )
    if not isinstance(error, yaml.MarkedYAMLError):
        place = next((number for number, line in enumerate(lines) if _DATE.search(line)), 0)
        return place, "a value in {line} looks like a date or a number and is none: put it in quotes"
    mark = error.problem_mark or error.context_mark
    line, column = (mark.line, mark.column) if mark else (0, 0)
    opened = error.context_mark.line if error.context_mark else line
    problem, context = error.problem or "", error.context or ""
    for words, say in _RULES:
        if words in problem or words in context:
            return say(lines, line, column, opened, problem)
    return line, "{line} cannot be read: check its indentation, and the colons, quotes and brackets in it and above it"


def _first_sign(lines: list[str], line: int, column: int, opened: int, problem: str) -> Said:
    del opened, problem
    sign = lines[line][column : column + 1] if line < len(lines) else ""
    if sign == "\t":
        return line, "{line} has a tab where it is indented: YAML takes spaces only, so indent with spaces"
    return line, f"in {{line}} a value begins with {sign}, which has a meaning of its own in YAML: {QUOTES}"


def _marked(lines: list[str], line: int, column: int, opened: int, problem: str) -> Said:
    del column, opened, problem
    sign = next(
        (sign for sign in "*&!" if re.search(rf"[:\-,\[]\s*\{sign}", lines[min(line, len(lines) - 1)])), "* or &"
    )
    return line, f"in {{line}} a value begins with {sign}, which has a meaning of its own in YAML: {QUOTES}"


def _per_cent(lines: list[str], line: int, column: int, opened: int, problem: str) -> Said:
    del lines, column, problem, line
    return (
        opened,
        "{line} begins with %, which has a meaning of its own in YAML: put it in quotes, or # before a comment",
    )


def _twice(lines: list[str], line: int, column: int, opened: int, problem: str) -> Said:
    del lines, column, problem
    return line, f"the mark & in {{line}} is there already, on line {opened + 1}: use another name, or {QUOTES}"


def _escape(lines: list[str], line: int, column: int, opened: int, problem: str) -> Said:
    del lines, column, opened, problem
    return (
        line,
        "a backslash in double quotes has a meaning of its own in {line}: use single quotes, or / instead of \\",
    )


def _open_quote(lines: list[str], line: int, column: int, opened: int, problem: str) -> Said:
    del lines, line, column, problem
    return opened, "a quote is opened in {line} and never closed: close it"


def _bracket(lines: list[str], line: int, column: int, opened: int, problem: str) -> Said:
    del column
    sign, pair = ("[", "]") if "']'" in problem else ("{", "}")
    if line != opened or "stream end" in problem or line >= len(lines):
        return opened, f"the bracket {sign} in {{line}} is never closed: put {pair} where it ends"
    if "':'" in problem and sign == "[":
        return line, f"a comma is missing in {{line}}, or the bracket {sign} is not closed"
    return line, f"a comma is missing between two entries of {sign} {pair} in {{line}}"


def _colon(lines: list[str], line: int, column: int, opened: int, problem: str) -> Said:
    """A colon where none is due: in a value, after a key without a space, or too deep."""
    del column, opened, problem
    here = lines[line]
    if _COLON_IN_VALUE.search(here):
        return line, f"the value in {{line}} has a colon in it: {QUOTES}"
    above = next((number for number in range(line - 1, -1, -1) if _content(lines[number])), None)
    if above is not None and not _PLAIN_KEY.match(lines[above]):
        return above, _without_colon(lines[above])
    return line, "{line} is indented deeper than the key above it, which has a value already: indent both alike"


def _no_colon(lines: list[str], line: int, column: int, opened: int, problem: str) -> Said:
    del line, column, problem
    return opened, _without_colon(lines[opened])


def _without_colon(line: str) -> str:
    if _NO_SPACE.match(line):
        return "a space is missing after the colon in {line}: write `key: value`"
    return "{line} has no colon: write `key: value`"


def _not_in_line(lines: list[str], line: int, column: int, opened: int, problem: str) -> Said:
    """Something else than a key of the level that is open."""
    del opened
    if "'-'" in problem:
        return line, (
            "{line} begins an item of a list where a key is due: a line above lacks its `- `, or is indented otherwise"
        )
    if "'<scalar>'" in problem and lines[line][:column].rstrip()[-1:] in {'"', "'"}:
        return line, "in {line} something follows the closing quote: put the whole value in quotes"
    for sign, pair in ("]", "["), ("}", "{"):
        if f"'{sign}'" in problem:
            return line, f"{{line}} has a {sign} without a {pair}: delete it, or open the bracket"
    if "','" in problem:
        return line, "in {line} a comma follows a closed value: put the whole value in quotes or in brackets"
    return line, "{line} does not line up with the lines above it: keys of one level need the same indentation"


def _second_document(lines: list[str], line: int, column: int, opened: int, problem: str) -> Said:
    del lines, column, opened, problem
    return line, "{line} begins a second document: keep one, and delete the line"


def _block(lines: list[str], line: int, column: int, opened: int, problem: str) -> Said:
    del lines, column, opened, problem
    return line, "in {line} text follows | or >: begin it on the next line, indented, or put it in quotes"


def _bad_key(lines: list[str], line: int, column: int, opened: int, problem: str) -> Said:
    del lines, column, opened, problem
    return line, "in {line} a list or a bracket stands where a key is due: put it in quotes"


def _merge(lines: list[str], line: int, column: int, opened: int, problem: str) -> Said:
    del lines, column, opened, problem
    return line, "the key << in {line} has a meaning of its own in YAML: use another name"


# Words of the reader's error, and who puts them into plain ones; the first that fits.
_RULES: tuple[tuple[str, Callable[[list[str], int, int, int, str], Said]], ...] = (
    ("cannot start any token", _first_sign),
    ("scanning a directive", _per_cent),
    ("alias", _marked),
    ("scanning an anchor", _marked),
    ("constructor for the tag", _marked),
    ("duplicate anchor", _twice),
    ("second occurrence", _twice),
    ("escape", _escape),
    ("quoted scalar", _open_quote),
    ("parsing a flow", _bracket),
    ("mapping values are not allowed", _colon),
    ("could not find expected ':'", _no_colon),
    ("expected <block end>", _not_in_line),
    ("sequence entries are not allowed", _not_in_line),
    ("single document", _second_document),
    ("block scalar", _block),
    ("for merging", _merge),
    ("unhashable key", _bad_key),
)


def _content(line: str) -> bool:
    return bool(line.strip()) and not line.lstrip().startswith("#")


def _shown(line: str) -> str:
    text = line.replace("\t", "→").rstrip()
    text = "".join(sign if sign.isprintable() else "·" for sign in text)
    return f"`{text[:SHOWN]}…`" if len(text) > SHOWN else f"`{text.strip()}`"
