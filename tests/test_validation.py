"""Messages are compared word by word: they are what a user sees. Lines are counted by hand in the texts below."""

import pickle
import re
from pathlib import Path

import pytest
import yaml

from vgyro.dataset import Manifest, parse_manifest
from vgyro.validation import InvalidFile, Problem, did_you_mean, locate, parse_model, parse_yaml

SOURCE = "raw/x/dataset.yaml"
ROOT = Path(__file__).resolve().parents[1]


def mistakes(text: str) -> list[str]:
    """What the mistakes of a manifest are called, without the file's name."""
    with pytest.raises(InvalidFile) as caught:
        parse_manifest(text, SOURCE)
    assert str(caught.value) == "\n".join(map(str, caught.value.problems))
    return [str(problem).removeprefix(f"{SOURCE}:") for problem in caught.value.problems]


def recording(line: str) -> list[str]:
    """Mistakes of a manifest whose only recording, on line 3, has `line` besides what is required."""
    return mistakes(f"board: b\nrecordings:\n- {{name: a, kind: free, files: [f], {line}}}\n")


def test_a_manifest_with_three_mistakes_names_all_three():
    text = "board: dsp6\ntitel: bench\nrecordings:\n- name: one\n  kind: statik\n  files: a.bin\n  rate_hz: fast\n"
    assert mistakes(text) == [
        "2: titel: unknown key; did you mean 'title'?",
        "5: recordings.0.kind: expected one of calibration, static, constant, random, sinusoid, thermal, free; "
        "found 'statik'; did you mean 'static'?",
        "7: recordings.0.rate_hz: expected a number, found 'fast'",
    ]


def test_a_wrong_item_does_not_make_its_list_too_short():
    assert mistakes("board: b\nrecordings:\n- 5\n") == ["3: recordings.0: expected keys and values, found 5"]


def test_an_empty_list_is_too_short():
    assert mistakes("board: b\nrecordings: []\n") == ["2: recordings: expected at least 1 item, found 0"]


def test_missing_keys_are_named_at_the_line_of_what_lacks_them():
    assert mistakes("title: t\nrecordings:\n- name: a\n  files: f\n") == [
        "1: board: missing; name a board file, or the gyros of a log under `array`",
        "3: recordings.0.kind: missing; this key is required",
    ]


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("rate_hz: -1", "rate_hz: expected a number greater than 0, found -1"),
        ("rate_hz: .inf", "rate_hz: expected a finite number, found inf"),
        ("axis: 5", "axis: expected text, found 5; put it in quotes"),
        ("axis: on", "axis: expected text, found true; put it in quotes"),
        ("axis: [x]", "axis: expected text, found a list"),
        ("rest: nearly", "rest: expected a list or 'auto', found 'nearly'"),
        ("rest: 5", "rest: expected a list or 'auto', found 5"),
        ("rest: [[0, 10], [20]]", "rest.1: item 2 is missing"),
        ("rest: [[0, 10], [20, soon]]", "rest.1.1: expected a number, found 'soon'"),
        ("rest: [[0, 10, 20]]", "rest.0: expected at most 2 items, found 3"),
        ("log: {values: count}",
         "log.values: expected one of counts, rates; found 'count'; did you mean 'counts'?"),
        ("log: {columns: {g1: 1}}", "log.columns.g1: expected text or keys and values, found 1"),
        ("log: log", "log: expected keys and values, found 'log'"),
        ("log: {colums: {}}", "log.colums: unknown key; did you mean 'columns'?"),
        ("log: {xyz: 1}", "log.xyz: unknown key; known: family, table, text, columns, values, time, clocks"),
    ],
)  # fmt: skip
def test_one_mistake_makes_one_message(line, expected):
    assert recording(line) == [f"3: recordings.0.{expected}"]


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("{kind: sinus}",
         "kind: expected one of plateaus, constant, sinusoid, file; found 'sinus'; did you mean 'sinusoid'?"),
        ("{kid: constant}", "kind: missing; this key is required"),
        ("{kind: constant}", "rate: missing; this key is required"),
        ("{kind: plateaus}", "plateaus: missing; this key is required"),
        ("{kind: constant, rate: x}", "rate: expected a number, found 'x'"),
        ("{kind: constant, rate: 1, rato: 1}", "rato: unknown key; did you mean 'rate'?"),
        ("{kind: constant, rate: 1, foo: 1}", "foo: unknown key; known: kind, rate"),
        ("{kind: plateaus, foo: 1, plateaus: [{start: 0, stop: 1, rate: 1}, {start: 1, stop: 2, rate: 1}]}",
         "foo: unknown key; known: kind, plateaus"),
        ("{kind: plateaus, plateaus: [{start: 0, stop: x, rate: 1}, {start: 1, stop: 2, rate: 1}]}",
         "plateaus.0.stop: expected a number, found 'x'"),
        ("{kind: plateaus, plateaus: [{start: 0, stop: 1, rat: 1}, {start: 1, stop: 2, rate: 1}]}",
         "plateaus.0.rate: missing; this key is required"),
        ("{kind: plateaus, plateaus: [{start: 9, stop: 1, rate: 1}, {start: 1, stop: 2, rate: 1}]}",
         "plateaus.0: stop = 1.0 s is not after start = 9.0 s"),
    ],
)  # fmt: skip
def test_the_branch_of_a_union_is_not_part_of_the_key(line, expected):
    found = recording(f"reference: {line}")
    assert f"3: recordings.0.reference.{expected}" in found
    assert len(found) == 1 + ("rat:" in line)


def test_whole_numbers_bounds_and_nothing():
    text = "board: b\nrecordings:\n- {name: a, kind: free, files: f}\nanalysis:\n  volatility:\n    window: 10\n"
    text += (
        "    step:\n    arch_lags: 1.5\n    definitions: [levl]\n    rate_hz: fast\n  fusion:\n    methods: [1, dcc]\n"
    )
    choice = "expected one of level, demeaned, difference, residual; found 'levl'; did you mean 'level'?"
    assert mistakes(text) == [
        "6: analysis.volatility.window: expected a number of at least 50, found 10",
        "7: analysis.volatility.step: expected a whole number, found nothing",
        "8: analysis.volatility.arch_lags: expected a whole number, found 1.5",
        f"9: analysis.volatility.definitions.0: {choice}",
        "10: analysis.volatility.rate_hz: expected a number or 'full', found 'fast'",
        "12: analysis.fusion.methods.0: expected text, found 1; put it in quotes",
    ]


def test_names_are_described_not_given_as_patterns():
    assert mistakes("board: b\nrecordings:\n- {name: a b, kind: free, files: f}\n") == [
        "3: recordings.0.name: expected a name of letters, digits, - and _, found 'a b'"
    ]


def test_a_key_written_twice_is_a_mistake_on_the_second_line():
    assert mistakes("board: a\ntitle: x\nboard: b\n") == ["3: board: written twice; keep one of them"]


@pytest.mark.parametrize("text", ["", "# nothing\n", "- a\n", "just text\n"])
def test_a_file_without_keys_is_refused(text):
    assert mistakes(text) == ["1: expected keys and values, such as `title: my bench`"]


@pytest.mark.parametrize(
    ("text", "line"),
    [("board: [a\n", 1), ("a: 1\n\tb: 2\n", 2), ("a: b: c\n", 1), ("a: 2026-13-45\n", 1), ("a: \x00", 1)],
)
def test_text_that_is_not_yaml_is_refused_with_a_line(text, line):
    # The words are in test_wrong_files.py.
    (message,) = mistakes(text)
    assert message.startswith(f"{line}: ")


def test_yaml_lines_start_at_one_and_reach_into_lists():
    data, lines = parse_yaml("a: 1\nb:\n  - c: 2\n  - d\n", "f")
    assert data == {"a": 1, "b": [{"c": 2}, "d"]}
    assert lines[("a",)] == 1
    assert lines["b", 0, "c"] == 3
    assert lines["b", 1] == 4


def test_later_findings_get_the_line_of_their_key_or_of_the_nearest_one_above():
    found = [Problem("f", 1, key, "m") for key in ("b.1.z", "a", "b.0.c", "q")]
    placed = [(problem.key, problem.line) for problem in locate(found, "a: 1\nb:\n  - c: 2\n  - d: 3\n")]
    assert placed == [("a", 1), ("q", 1), ("b.0.c", 3), ("b.1.z", 4)]


def test_a_near_word_is_offered_and_a_far_one_gets_the_list():
    assert did_you_mean("statik", ["static", "free"]) == "; did you mean 'static'?"
    assert did_you_mean("zzz", ["static", "free"]) == "; known: static, free"
    assert did_you_mean("zzz", ["static", "free"], listed=False) == ""
    assert did_you_mean("zzz", []) == ""


def test_all_problems_survive_pickling():
    error = InvalidFile([Problem("f", 1, "a", "m"), Problem("f", 2, "b", "n")])
    assert pickle.loads(pickle.dumps(error)).problems == error.problems


def test_the_context_reaches_the_validators():
    text = "board: b\nrecordings:\n- {name: a, kind: free, files: f}\nanalysis: {volatility: {step: 400}}\n"
    assert parse_model(text, Manifest, SOURCE, {"partial": True}).analysis is not None
    with pytest.raises(InvalidFile, match="step = 400 is longer than window = 360"):
        parse_model(text, Manifest, SOURCE)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("title: a\tb", "has a tab"),
        ("one: {a?: 1, b: 2}", "a comma is missing"),
        ("title: ># of the bench", "text follows | or >"),
    ],
)
def test_what_the_fast_parser_would_accept_is_a_mistake_all_the_same(text, words):
    # Expected: the words of PyYAML's own parser, which is stricter.
    with pytest.raises(InvalidFile, match=re.escape(words)):
        parse_yaml(text, SOURCE)


def test_a_tag_of_nothing_is_nothing():
    assert parse_yaml("rest_s: !", SOURCE) == ({"rest_s": None}, {(): 1, ("rest_s",): 1})


@pytest.mark.parametrize("path", sorted(ROOT.glob("config/**/*.yaml")), ids=lambda path: path.stem)
def test_both_parsers_read_the_projects_files_alike(path, monkeypatch):
    text = path.read_text(encoding="utf-8")
    fast = parse_yaml(text, str(path))
    monkeypatch.setattr("vgyro.validation._FAST_LOADER", yaml.SafeLoader)
    assert repr(parse_yaml(text, str(path))) == repr(fast)
