"""The files that a user writes, from disk to validated models: config, boards, manifests."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

from vgyro.board import Board, parse_board
from vgyro.config import Config, parse_config
from vgyro.dataset import Manifest, array_board, check_against_board, parse_manifest, used_board
from vgyro.errors import ConfigError
from vgyro.validation import InvalidFile, Problem, did_you_mean, locate

BOARDS = Path("config/boards")
BAG_RECORD = "metadata.yaml"
PACKED = (".gz", ".zst")


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
    """The files of a recording, globs and folders of logs opened, in the manifest's order; what is not there stays."""
    base = folder / Path(manifest.folder).expanduser()
    known = manifest.recording(recording)
    found: list[Path] = []
    for pattern in known.files:
        for path in matching_files(base, pattern):
            found += files_inside(path) if known.log is not None and path.is_dir() else [path]
    return found


def files_inside(folder: Path) -> list[Path]:
    """Logs in a folder, by path: those of the commonest ending, so that a note beside them is none.

    Numbers in a path count as numbers: day=9 comes before day=10. A ROS 2 bag is a folder, and one log. An empty folder
    stays as it is.
    """
    if (folder / BAG_RECORD).is_file():
        return [folder]
    inside = [path for path in folder.rglob("*") if path.is_file() and not _hidden(path.relative_to(folder))]
    endings = Counter(_ending(path) for path in inside)
    if not endings:
        return [folder]
    most = max(endings, key=lambda ending: (endings[ending], ending))
    return sorted((path for path in inside if _ending(path) == most), key=natural)


def natural(path: Path) -> list[tuple[int, int, str]]:
    """Key that sorts paths with their numbers as numbers."""
    parts = re.split(r"(\d+)", path.as_posix())
    return [(1, int(part), "") if part.isdigit() else (0, 0, part) for part in parts]


def _hidden(path: Path) -> bool:
    return any(part.startswith((".", "_")) for part in path.parts)


def _ending(path: Path) -> str:
    name = path.with_suffix("") if path.suffix.lower() in PACKED else path
    return name.suffix.lower()


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
