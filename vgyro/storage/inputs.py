"""The files that a user writes, from disk to validated models: config, boards, manifests."""

from __future__ import annotations

from pathlib import Path

from vgyro.board import Board, parse_board
from vgyro.config import Config, parse_config
from vgyro.dataset import Manifest, array_board, check_against_board, parse_manifest, used_board
from vgyro.errors import ConfigError
from vgyro.validation import InvalidFile, Problem, did_you_mean, locate

BOARDS = Path("config/boards")


def read_config(path: str | Path) -> Config:
    """Read and validate config.yaml.  raises : ConfigError"""
    return parse_config(_text(path), str(path))


def read_board(name: str, folder: Path | None = None, boards: Path = BOARDS) -> Board:
    """Read a board by name (boards/<name>.yaml), or by a path from `folder` if `name` ends in .yaml.

    raises : ConfigError, with the names that exist
    """
    if name.endswith((".yaml", ".yml")):
        path = (folder or Path()) / name
        return parse_board(_text(path), str(path))
    path = boards / f"{name}.yaml"
    if not path.is_file():
        known = sorted(entry.stem for entry in boards.glob("*.yaml"))
        raise ConfigError(f"no board {name!r} in {boards}{did_you_mean(name, known)}")
    return parse_board(_text(path), str(path))


def read_dataset(path: str | Path, boards: Path = BOARDS) -> tuple[Manifest, Board]:
    """Read a manifest and its board (only the gyros that it uses), and check them against each other.

    raises : InvalidFile with every mistake at once
    """
    source = str(path)
    text = _text(path)
    manifest = parse_manifest(text, source)
    try:
        board = array_board(manifest, Path(path).resolve().parent.name)
        board = board or read_board(str(manifest.board), Path(path).parent, boards)
    except InvalidFile:
        raise
    except ConfigError as error:
        raise InvalidFile([Problem(source, _line(text, "board"), "board", error.what)]) from None
    problems = check_against_board(manifest, board, source)
    if problems:
        raise InvalidFile(locate(problems, text))
    return manifest, used_board(manifest, board)


def data_files(manifest: Manifest, recording: str, folder: Path) -> list[Path]:
    """The files of a recording, globs expanded, in the manifest's order; a pattern without a file stays."""
    base = folder / Path(manifest.folder).expanduser()
    found: list[Path] = []
    for pattern in manifest.recording(recording).files:
        found += matching_files(base, pattern)
    return found


def matching_files(base: Path, pattern: str) -> list[Path]:
    """The files that a pattern of a manifest stands for, sorted; itself where there is none."""
    matches = sorted(base.glob(pattern)) if any(sign in pattern for sign in "*?[") else []
    return matches or [base / pattern]


def _line(text: str, key: str) -> int:
    lines = text.splitlines()
    return next((number for number, line in enumerate(lines, 1) if line.startswith(f"{key}:")), 1)


def _text(path: str | Path) -> str:
    try:
        return Path(path).read_text(encoding="utf-8")
    except FileNotFoundError:
        raise ConfigError("no such file", str(path), "check the path") from None
    except UnicodeDecodeError as error:
        raise ConfigError(f"not UTF-8 text at byte {error.start}", str(path), "save it as UTF-8") from None
