"""A board and a small twin for the tests of simulate."""

from collections.abc import Callable
from pathlib import Path

import pytest

from vgyro.board import Board
from vgyro.simulate import Twin, parse_twin
from vgyro.storage.inputs import read_board

SMALL = """
name: small
board: dsp6
seed: 11
gyros:
  all: {arw_deg_rt_h: 6, bias_instability_deg_h: 40, rrw_deg_h_rt_h: 200, garch: {alpha: 0.05, beta: 0.9}}
  g2: {scale_error: 0.05, bias_deg_s: 3}
correlation: 0.2
dcc: {a: 0.03, b: 0.94}
sensor_pole_hz: 40
recordings:
  - name: table
    kind: calibration
    motion: {kind: rate_table, rates: [0, 100, -50], settle_s: 1, plateau_s: 2}
  - {name: still, kind: static, duration_s: 20}
  - name: swing
    kind: sinusoid
    duration_s: 8
    rate_hz: 500
    motion: {kind: sinusoid, amplitude: 60, frequency_hz: 0.25}
  - name: shaken
    kind: random
    duration_s: 8
    motion: {kind: random, sd: 20, bandwidth_hz: 0.5}
"""


@pytest.fixture
def board(root: Path) -> Callable[[str], Board]:
    """A shipped board by name."""
    return lambda name: read_board(name, boards=root / "config/boards")


@pytest.fixture
def dsp6(board: Callable[[str], Board]) -> Board:
    return board("dsp6")


@pytest.fixture
def twin() -> Twin:
    return parse_twin(SMALL, "small.yaml")


@pytest.fixture
def quiet() -> Callable[[str], Twin]:
    """A twin of gyros without any error, with one recording made of `keys` (YAML flow mapping entries)."""

    def make(keys: str, gyros: str = "{}", more: str = "") -> Twin:
        text = f"name: quiet\nboard: dsp6\nseed: 3\ngyros: {gyros}\n{more}\nrecordings:\n  - {{name: run, {keys}}}\n"
        return parse_twin(text, "quiet.yaml")

    return make
