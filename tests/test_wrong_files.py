"""Manifests and boards with the mistakes that people make: every message is in plain words, at the right line."""

import re

import pytest
import yaml

from vgyro.board import parse_board
from vgyro.dataset import parse_manifest
from vgyro.validation import InvalidFile

# Words of the YAML reader and of pydantic that must not reach a user.
FOREIGN = re.compile(
    r"token|mapping|scalar|block end|while scanning|stream|anchor|tag |constructor|document marker|flow|unhashable"
    r"|Input should|valid (?:string|integer|number|dict)|pydantic|validation|Value error|Field required|fromhex|literal"
    r"|instance|type=|unexpected|escape sequence|directive"
)

GOOD = "board: dsp6\nrecordings:\n- name: a\n  kind: static\n  files: a.bin\n"
MANIFESTS = {
    "board: dsp6\nrecordings:\n\t- name: a\n":
        "3: `→- name: a` has a tab where it is indented: YAML takes spaces only, so indent with spaces",
    "board:dsp6\nrecordings: []\n":
        "1: a space is missing after the colon in `board:dsp6`: write `key: value`",
    "board: dsp6\ntitle:bench\nrecordings: []\n":
        "2: a space is missing after the colon in `title:bench`: write `key: value`",
    "board:dsp6\n": "1: a space is missing after the colon: write 'board: dsp6'",
    "board: 'dsp6\nrecordings:\n- name: a\n": "1: a quote is opened in `board: 'dsp6` and never closed: close it",
    "board: dsp6\nrecordings:\n- {name: a, kind: static\n":
        "3: the bracket { in `- {name: a, kind: static` is never closed: put } where it ends",
    "board: dsp6\ngyros: [g1, g2\nrecordings: []\n":
        "2: the bracket [ in `gyros: [g1, g2` is never closed: put ] where it ends",
    "board: dsp6\ngyros: [g1]]\n": "2: `gyros: [g1]]` has a ] without a [: delete it, or open the bracket",
    "recordings:\n- {name: a kind: static}\n":
        "2: a comma is missing between two entries of { } in `- {name: a kind: static}`",
    "title: bench: first\n": "1: the value in `title: bench: first` has a colon in it: put the value in quotes",
    "recordings:\n- name: a\n  files: run: 1.bin\n":
        "3: the value in `files: run: 1.bin` has a colon in it: put the value in quotes",
    "recordings:\n- name: a\n   kind: static\n":
        "3: `kind: static` is indented deeper than the key above it, which has a value already: indent both alike",
    "recordings:\n  - name: a\n kind: static\n":
        "3: `kind: static` does not line up with the lines above it: keys of one level need the same indentation",
    "recordings:\n- name: a\n  kind: static\nname: b\n- kind: free\n":
        "5: `- kind: free` begins an item of a list where a key is due: a line above lacks its `- `, or is indented "
        "otherwise",
    "recordings:\n-name: a\n":
        "2: -name: unknown key; a space is missing after the dash: write '- name'",
    "title: &x a\nnotes: &x b\n":
        "2: the mark & in `notes: &x b` is there already, on line 1: use another name, or put the value in quotes",
    "title: *x\n":
        "1: in `title: *x` a value begins with *, which has a meaning of its own in YAML: put the value in quotes",
    "files: *.bin\n":
        "1: in `files: *.bin` a value begins with *, which has a meaning of its own in YAML: put the value in quotes",
    'folder: "C:\\Users\\lab"\n':
        "1: a backslash in double quotes has a meaning of its own in `folder: \"C:\\Users\\lab\"`: use single quotes, "
        "or / instead of \\",
    'folder: "C:\\data"\n':
        "1: a backslash in double quotes has a meaning of its own in `folder: \"C:\\data\"`: use single quotes, or / "
        "instead of \\",
    "title: %a\n":
        "1: in `title: %a` a value begins with %, which has a meaning of its own in YAML: put the value in quotes",
    "%a: 1\n":
        "1: `%a: 1` begins with %, which has a meaning of its own in YAML: put it in quotes, or # before a comment",
    "title: @home\n":
        "1: in `title: @home` a value begins with @, which has a meaning of its own in YAML: put the value in quotes",
    "title: `x`\n":
        "1: in `title: `x`` a value begins with `, which has a meaning of its own in YAML: put the value in quotes",
    "title: !best\n":
        "1: in `title: !best` a value begins with !, which has a meaning of its own in YAML: put the value in quotes",
    "title: a\nnotes: 2026-13-45\n":
        "2: a value in `notes: 2026-13-45` looks like a date or a number and is none: put it in quotes",
    "board\nrecordings: []\n": "1: `board` has no colon: write `key: value`",
    "title: 'my' bench\n":
        "1: in `title: 'my' bench` something follows the closing quote: put the whole value in quotes",
    "title: a\n---\nboard: b\n": "2: `---` begins a second document: keep one, and delete the line",
    "notes: | text\n  more\n":
        "1: in `notes: | text` text follows | or >: begin it on the next line, indented, or put it in quotes",
    "title: \x00\n": "1: the sign U+0000 may not stand in the file: delete it, and save the file as plain UTF-8 text",
    "title: {{name}}\n": "1: in `title: {{name}}` a list or a bracket stands where a key is due: put it in quotes",
    "board:\u00a0dsp6\n":
        "1: the blank after the colon is no plain space (it may have been copied from a page): type it again",
    "": "1: expected keys and values, such as `title: my bench`",
    GOOD.replace("static", "[static]"):
        "4: recordings.0.kind: expected one of calibration, static, constant, random, sinusoid, thermal, free; found "
        "a list",
    GOOD.replace("a.bin", "{a: 1}"): "5: recordings.0.files: expected a list, found keys and values",
    GOOD + "  rate_hz: []\n": "6: recordings.0.rate_hz: expected a number, found an empty list",
    GOOD + "  rate_hz: 1e400\n": "6: recordings.0.rate_hz: expected a finite number, found '1e400'",
    GOOD + "  latitude: 5\n":
        "6: recordings.0.latitude: unknown key; known: name, kind, files, log, rate_hz, rest, reference, axis",
    GOOD + "latitude_deg: 91\n": "6: latitude_deg: expected a number of at most 90, found 91",
    GOOD + "simulated: perhaps\n": "6: simulated: expected true or false, found 'perhaps'",
}  # fmt: skip

BOARD = """\
name: tiny
title: two gyros
rate_hz: 100
frame:
  kind: binary
  sync: EB 90
  length: 10
  fields:
  - {name: counter, type: u16, at: 2}
  - {name: g, type: i16, at: 4, count: 2}
  checksum: {family: crc, width: 16, polynomial: 0x1021, init: 0xFFFF, span: [0, 8], at: 8}
counter: {field: counter, modulus: 65536}
gyros:
- {name: g1, field: g1, axis: z, scale: 0.1}
"""
BOARDS = [
    ("sync: EB 90", "sync: EB 9",
     "6: frame.sync: expected bytes of two hexadecimal digits each, such as EB 90; found 'EB 9'"),
    ("sync: EB 90", "sync: 0xEB90",
     "6: frame.sync: expected text, found 60304; put it in quotes"),
    ("sync: EB 90", "sync: ''", "6: frame.sync: sync needs at least one byte, such as EB 90"),
    ("length: 10", "length: 10\n  constants: {2: xy}",
     "8: frame.constants: expected bytes of two hexadecimal digits each, such as EB 90; found 'xy'"),
    ("length: 10", "length: 10\n  constants: {two: '00'}",
     "8: frame.constants.two: expected a whole number, found 'two'"),
    ("length: 10", "length: ten", "7: frame.length: expected a whole number, found 'ten'"),
    ("width: 16", "width: 12", "11: frame.checksum.width: expected one of 8, 16, 32; found 12"),
    ("span: [0, 8]", "span: 8", "11: frame.checksum.span: expected a list, found 8"),
    ("type: i16", "type: int16",
     "10: frame.fields.1.type: expected one of u8, i8, u16, i16, u24, i24, u32, i32, u64, i64, f32, f64; "
     "found 'int16'; did you mean 'i16'?"),
    ("modulus: 65536", "modulus: 2^16", "12: counter.modulus: expected a whole number, found '2^16'"),
    ("kind: binary", "kind: bin", "5: frame.kind: expected one of binary, text; found 'bin'; did you mean 'binary'?"),
]  # fmt: skip


def said(parse, text: str) -> list[str]:
    with pytest.raises(InvalidFile) as caught:
        parse(text, "f.yaml")
    return [str(problem).removeprefix("f.yaml:") for problem in caught.value.problems]


@pytest.mark.parametrize("text", MANIFESTS, ids=range(len(MANIFESTS)))
def test_wrong_manifests(text):
    messages = said(parse_manifest, text)
    assert not any(FOREIGN.search(message) for message in messages)
    expected = MANIFESTS[text]
    assert expected in messages
    if not _is_yaml(text):
        assert len(messages) == 1


def _is_yaml(text: str) -> bool:
    try:
        return isinstance(yaml.safe_load(text), dict)
    except (yaml.YAMLError, ValueError):
        return False


@pytest.mark.parametrize(("right", "wrong", "expected"), BOARDS)
def test_wrong_boards(right, wrong, expected):
    assert BOARD.count(right) == 1
    messages = said(parse_board, BOARD.replace(right, wrong))
    assert not any(FOREIGN.search(message) for message in messages)
    assert messages == [expected]


def test_good_files_are_good():
    parse_manifest(GOOD, "f.yaml")
    parse_board(BOARD, "f.yaml")
