"""A small project folder, and the command line run inside it."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from vgyro.cli import main

BOARD = """\
name: tiny
title: two gyros on one axis
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
- {name: g2, field: g2, axis: z, scale: 0.1}
"""


class Outcome(NamedTuple):
    """How a command ended."""

    code: int
    out: str
    err: str


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project folder with the board `tiny` and an empty config; the current folder."""
    for name in ("config/boards", "config/twins", "raw", "results", "reports"):
        (tmp_path / name).mkdir(parents=True)
    (tmp_path / "config/boards/tiny.yaml").write_text(BOARD)
    (tmp_path / "config/config.yaml").write_text("datasets: auto\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def vgyro(capsys: pytest.CaptureFixture[str]) -> Callable[..., Outcome]:
    """Run a command in this process: vgyro("check", "--json")."""

    def run(*arguments: object) -> Outcome:
        try:
            code = main([str(argument) for argument in arguments])
        except SystemExit as end:
            code = int(end.code or 0)
        captured = capsys.readouterr()
        return Outcome(code, captured.out, captured.err)

    return run
