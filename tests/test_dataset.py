"""Manifests: what is accepted, what is refused, and what only shows together with the board."""

import pytest

from vgyro.board import parse_board
from vgyro.dataset import Manifest, check_against_board, parse_manifest, used_board
from vgyro.validation import InvalidFile

BOARD = parse_board(
    """
name: test
title: three gyros on two axes
rate_hz: 100
frame:
  kind: binary
  sync: EB 90
  length: 10
  fields:
  - {name: g, type: i16, at: 2, count: 3}
  - {name: t, type: i16, at: 8}
  checksum: {family: none}
gyros:
- {name: g1, field: g1, axis: z, scale: 0.1}
- {name: g2, field: g2, axis: z, scale: 0.1}
- {name: g3, field: g3, axis: y, scale: 0.1}
temperatures:
- {name: t3, field: t, gyro: g3, scale: 1, offset: 0}
""",
    "test.yaml",
)


def manifest(recordings: str, head: str = "") -> Manifest:
    return parse_manifest(f"board: test\n{head}recordings:\n{recordings}", "dataset.yaml")


def refusal(recordings: str, head: str = "") -> str:
    with pytest.raises(InvalidFile) as caught:
        manifest(recordings, head)
    return str(caught.value)


def test_one_file_may_stand_without_a_list():
    assert manifest("- {name: a, kind: static, files: x.bin}\n").recording("a").files == ("x.bin",)


def test_two_recordings_of_one_name_are_refused():
    text = "- {name: a, kind: static, files: x}\n- {name: a, kind: free, files: y}\n"
    assert refusal(text) == "dataset.yaml:1: two recordings are named 'a'"


def test_the_folder_of_the_noise_is_taken():
    assert "cannot be named 'noise'" in refusal("- {name: noise, kind: static, files: x}\n")


def test_a_calibration_needs_plateaus_or_a_log():
    message = "dataset.yaml:3: recordings.0: a calibration recording needs a reference of kind plateaus or file"
    assert refusal("- {name: a, kind: calibration, files: x}\n") == message
    assert refusal("- {name: a, kind: calibration, files: x, reference: {kind: constant, rate: 1}}\n") == message


@pytest.mark.parametrize("kind", ["static", "thermal"])
def test_a_board_at_rest_takes_no_reference(kind):
    text = f"- {{name: a, kind: {kind}, files: x, reference: {{kind: constant, rate: 1}}}}\n"
    assert f"a {kind} recording stands still" in refusal(text)


def test_an_override_may_set_a_part_of_what_belongs_together():
    text = "- {name: a, kind: static, files: x}\n"
    assert manifest(text, "analysis: {volatility: {step: 400}}\n").analysis.volatility.step == 400


def test_no_gyro_at_all_is_refused():
    assert refusal("- {name: a, kind: static, files: x}\n", "gyros: []\n") == (
        "dataset.yaml:2: gyros: expected at least 1 item, found 0"
    )


def test_the_used_board_keeps_the_chosen_gyros_and_their_temperatures():
    text = "- {name: a, kind: static, files: x}\n"
    board = used_board(manifest(text, "gyros: [g1, g2]\n"), BOARD)
    assert ([gyro.name for gyro in board.gyros], board.axes, board.temperatures) == (["g1", "g2"], ["z"], ())
    assert used_board(manifest(text), BOARD) is BOARD


def test_every_disagreement_with_the_board_is_named():
    text = """\
- {name: a, kind: free, files: x, axis: x}
- {name: b, kind: constant, files: x, reference: {kind: constant, rate: 1}}
- {name: c, kind: free, files: x, log: {columns: {g9: rate}}}
- {name: d, kind: constant, files: x, axis: y, reference: {kind: constant, rate: 1}}
"""
    found = check_against_board(manifest(text, "gyros: [g1, g3, gg2]\n"), BOARD, "f")
    assert [(problem.key, problem.message) for problem in found] == [
        ("gyros.2", "board 'test' has no gyro 'gg2'; did you mean 'g2'?"),
        ("recordings.0.axis", "expected one of z, y; found 'x'"),
        ("recordings.1.axis", "missing; the reference turns about one of z, y"),
        ("recordings.2.log.columns.g9", "board 'test' has no channel 'g9'; known: g1, g2, g3, t"),
    ]


def test_a_board_with_one_axis_needs_no_axis_for_its_reference():
    text = "- {name: b, kind: constant, files: x, reference: {kind: constant, rate: 1}}\n"
    assert check_against_board(manifest(text, "gyros: [g1, g2]\n"), BOARD, "f") == []
