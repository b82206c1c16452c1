"""Everything a user wrote, read together: config, data sets, boards, and whether the files are there.

The Snakefile calls `load_datasets` while it is parsed, so nothing here may import a model or open a recording.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from vgyro.board import Board
from vgyro.config import Config, override_problems
from vgyro.dataset import FileReference, Manifest
from vgyro.errors import ConfigError
from vgyro.storage.inputs import BOARDS, matching_files, read_board, read_config, read_dataset
from vgyro.validation import InvalidFile, Problem, did_you_mean, locate, parse_yaml

CONFIG = Path("config/config.yaml")
RAW = Path("raw")
MANIFEST = "dataset.yaml"
DATASET_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*")
# reports/index.html, reports/papers/, results/{twins,logs,benchmarks}/ belong to the workflow.
RESERVED = ("benchmarks", "index", "logs", "papers", "twins")


class Dataset(NamedTuple):
    """One data set that can run: its manifest, the board with the gyros it uses, the folder of the manifest."""

    manifest: Manifest
    board: Board
    folder: Path


@dataclass(frozen=True)
class Loaded:
    """What can run, and every mistake that was found.

    config   : the validated config; all defaults where config.yaml has a mistake (then `config_ok` is false)
    datasets : name → data set; one with a mistake is left out as a whole, because a recording that silently went
               missing (the calibration, say) would change the meaning of all others
    problems : in the order of config, then data sets by name, then lines
    """

    config: Config
    datasets: dict[str, Dataset]
    problems: list[Problem]
    config_ok: bool


def load_datasets(
    config_path: str | Path = CONFIG, raw_dir: str | Path = RAW, boards: str | Path = BOARDS, files: bool = False
) -> Loaded:
    """Read and check config.yaml, every data set it asks for, and their boards. Raises nothing for a user's mistake.

    files : the files of each recording must exist. The workflow leaves that to the decoding, which refuses the one
            recording and lets the others go on.
    """
    config, problems = load_config(Path(config_path))
    config_ok = not problems
    names, missing = _names(config, Path(config_path), Path(raw_dir))
    problems += missing
    datasets = {}
    for name in names:
        dataset, found = load_dataset(Path(raw_dir) / name / MANIFEST, config, Path(boards), files)
        problems += found
        if dataset is not None and not found:
            datasets[name] = dataset
    return Loaded(config, datasets, problems, config_ok)


def load_dataset(
    path: Path, config: Config, boards: Path = BOARDS, files: bool = False
) -> tuple[Dataset | None, list[Problem]]:
    """Read and check one manifest; `files`: its files must exist. None where it could not be read at all."""
    source = str(path)
    problems = _name_problems(path)
    try:
        manifest, board = read_dataset(path, boards)
    except ConfigError as error:
        found = as_problems(error, source)
        return None, sorted(problems + found + _board_too(path, found, boards), key=lambda problem: problem.line)
    found = override_problems(config.analysis, manifest.analysis, source)
    if files:
        found += _missing_files(manifest, path.parent, source)
    return Dataset(manifest, board, path.parent), problems + locate(found, path.read_text(encoding="utf-8"))


def as_problems(error: ConfigError, source: str) -> list[Problem]:
    """The mistakes that an error of a reader names."""
    if isinstance(error, InvalidFile):
        return error.problems
    remedy = f"; {error.remedy}" if error.remedy else ""
    return [Problem(error.where or source, 1, "", f"{error.what}{remedy}")]


def reference_file(manifest: Manifest, recording: str, folder: Path) -> Path | None:
    """The logged rate of a recording, beside its dumps; None where it has none."""
    reference = manifest.recording(recording).reference
    if not isinstance(reference, FileReference):
        return None
    return folder / Path(manifest.folder).expanduser() / reference.file


def load_config(path: Path) -> tuple[Config, list[Problem]]:
    """Read config.yaml; every default where it has a mistake."""
    try:
        return read_config(path), []
    except ConfigError as error:
        return Config(), as_problems(error, str(path))


def _names(config: Config, path: Path, raw: Path) -> tuple[list[str], list[Problem]]:
    present = sorted(manifest.parent.name for manifest in raw.glob(f"*/{MANIFEST}"))
    if config.datasets == "auto":
        return present, []
    problems = []
    for index, name in enumerate(config.datasets):
        if name not in present:
            message = f"there is no {raw / name / MANIFEST}{did_you_mean(name, present)}"
            problems.append(Problem(str(path), 1, f"datasets.{index}", message))
    if problems:
        problems = locate(problems, path.read_text(encoding="utf-8"))
    return [name for name in dict.fromkeys(config.datasets) if name in present], problems


def _name_problems(path: Path) -> list[Problem]:
    name = path.resolve().parent.name
    if not DATASET_NAME.fullmatch(name):
        message = f"the folder's name {name!r} may hold only letters, digits, - and _; rename it"
        return [Problem(str(path), 1, "", message)]
    if name in RESERVED:
        return [Problem(str(path), 1, "", f"the folder's name {name!r} is taken by the workflow; rename it")]
    return []


def _board_too(path: Path, found: list[Problem], boards: Path) -> list[Problem]:
    """Mistakes about the board of a manifest that has others, so that all are named at once."""
    source = str(path)
    if any(problem.source != source or problem.key in {"", "board"} for problem in found):
        return []
    text = path.read_text(encoding="utf-8")
    try:
        read_board(parse_yaml(text, source)[0]["board"], path.parent, boards)
    except InvalidFile as error:
        return error.problems
    except ConfigError as error:
        return locate([Problem(source, 1, "board", error.what)], text)
    return []


def _missing_files(manifest: Manifest, folder: Path, source: str) -> list[Problem]:
    base = folder / Path(manifest.folder).expanduser()
    if not base.is_dir():
        key = "folder" if "folder" in manifest.model_fields_set else ""
        return [Problem(source, 1, key, f"no such folder: {base}; point `folder` at the files")]
    problems = []
    for index, recording in enumerate(manifest.recordings):
        for number, pattern in enumerate(recording.files):
            missing = [file for file in matching_files(base, pattern) if not file.exists()]
            if missing:
                key = f"recordings.{index}.files.{number}"
                problems.append(Problem(source, 1, key, _missing(pattern, base, missing[0])))
        reference = reference_file(manifest, recording.name, folder)
        if reference is not None and not reference.is_file():
            problems.append(Problem(source, 1, f"recordings.{index}.reference.file", f"no such file: {reference}"))
    return problems


def _missing(pattern: str, base: Path, path: Path) -> str:
    if any(sign in pattern for sign in "*?["):
        return f"no file fits {path}"
    near = did_you_mean(pattern, sorted(entry.name for entry in base.iterdir()), listed=False)
    return f"no such file: {path}{near}"
