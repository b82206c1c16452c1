"""Boards and dumps for the tests of storage."""

import sys
from pathlib import Path

import pytest

from vgyro.board import Board
from vgyro.storage.inputs import read_board

ROOT = Path(__file__).resolve().parents[2]
# storage_frames.py, beside this file, is not a package.
sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def boards() -> Path:
    """The folder of the shipped boards."""
    return ROOT / "config" / "boards"


@pytest.fixture
def board(boards):
    """Read a shipped board by name."""

    def read(name: str) -> Board:
        return read_board(name, boards=boards)

    return read


@pytest.fixture
def dump(tmp_path):
    """Write bytes to a file; return its path."""

    def write(data: bytes, name: str = "dump.bin") -> Path:
        path = tmp_path / name
        path.write_bytes(data)
        return path

    return write
