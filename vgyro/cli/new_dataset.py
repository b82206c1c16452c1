"""Look at dumps or logs and write a commented raw/<name>/dataset.yaml for them.

A log is any file of a table with columns: text (CSV and all its kin), Parquet, PX4 ULog, ROS 1 or 2 bag, MCAP, NumPy,
MATLAB. Prints what it took for what, and why; asks nothing. Each file (or folder of logs) becomes one recording, unless
several hold one gyro each of one array. The files stay where they are. An existing dataset.yaml is never overwritten.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from vgyro.cli.drafts.found import FoundFiles

EPILOG = """\
examples:
  vgyro new-dataset ~/dumps/*.bin
  vgyro new-dataset ~/logs/imu.csv --name bench
  vgyro new-dataset counts.csv --scale 1/131              counts, 131 a deg/s
  vgyro new-dataset print.txt --rate 100                  a log without time stamps
  vgyro new-dataset one.csv two.csv three.csv --together  three boards with a gyro each: one array
  vgyro new-dataset /archive/2026-02 --name winter --board adis16405     a folder of logs

exit codes:
  0  written
  2  the data set exists already, its name cannot be used, or an option is needed that the files do not tell
  3  there is no such board
  4  a file is not there, is empty, or cannot be read
"""
ENDINGS = (
    ".gz", ".zst", ".parquet", ".bin", ".dat", ".txt", ".log", ".raw", ".csv", ".tsv", ".ulg", ".ulog", ".bag", ".mcap",
    ".db3", ".npy", ".npz", ".mat", ".json", ".jsonl",
)  # fmt: skip

KINDS = ("static", "constant", "random", "sinusoid", "thermal", "free")


def add_arguments(parser: argparse.ArgumentParser, files: str = "+") -> None:
    """Declare the arguments. files : how many"""
    what = "dump or log (.gz and .zst too), or a folder of logs"
    parser.add_argument("files", nargs=files, metavar="FILE", type=Path, help=what)
    parser.add_argument("--name", help="name of the data set; default: that of the files' folder")
    parser.add_argument(
        "--board", help="board in config/boards, or path of a board file; default: the one that fits best"
    )
    parser.add_argument("--rate", type=float, metavar="HZ", help="samples a second, for files without time stamps")
    known = parser.add_mutually_exclusive_group()
    known.add_argument(
        "--scale", type=_ratio, metavar="DEG_S", help="deg/s a count of a log's gyros: 0.00875, or 1/131"
    )
    known.add_argument("--unit", choices=("deg/s", "rad/s", "mdps", "deg/h"), help="unit of a log's gyros")
    parser.add_argument("--axis", metavar="NAME", help="axis of all gyros of a log; default: by their names, else z")
    both = parser.add_mutually_exclusive_group()
    both.add_argument(
        "--together", action="store_true", default=None, help="the files are one array, read by a clock each"
    )
    both.add_argument("--separate", action="store_false", dest="together", help="the files are recordings of their own")
    kinds = ", ".join(KINDS)
    what = f"kind of every recording: {kinds}; default: static or free, as the gyros move"
    parser.add_argument("--kind", type=_kind, metavar="KIND", help=what)
    parser.add_argument("--raw", type=Path, default=Path("raw"), help="default: %(default)s")
    parser.add_argument("--boards", type=Path, default=Path("config/boards"), help="default: %(default)s")
    parser.add_argument("--json", action="store_true", help="print what was found as JSON")


def run(options: argparse.Namespace) -> int:
    """Look, write, return the exit code."""
    target, found = write(options)
    if options.json:
        record = {
            "manifest": str(target),
            "board": found.board_name,
            "recordings": [
                {"name": one.name, "files": one.files, "kind": one.kind, "rate_hz": one.rate_hz} for one in found.drafts
            ],
            "notes": found.notes,
        }
        print(json.dumps(record, indent=1, ensure_ascii=False))
    else:
        print("\n".join(found.lines))
        print(f"wrote {target}")
        print("next: correct what is wrong in it, then vgyro check, then snakemake --cores 2")
    return 0


def write(options: argparse.Namespace) -> tuple[Path, FoundFiles]:
    """Look at the files and write the manifest.  returns : its path, and what was found"""
    from vgyro.cli.drafts.found import find
    from vgyro.cli.drafts.manifest_text import manifest_text
    from vgyro.dataset import check_against_board, parse_manifest
    from vgyro.storage.tables import write_text

    target = target_of(options)
    for path in options.files:
        _must_exist(path)
    folder = Path(os.path.commonpath([path.resolve().parent for path in options.files]))
    found = find(options, folder, target.parent, recording_names(options.files))
    text = manifest_text(found.board, found.notes, folder_text(folder, target.parent), found.drafts)
    manifest = parse_manifest(text, str(target))
    problems = check_against_board(manifest, found.used_board, str(target))
    if problems:
        raise AssertionError(f"new-dataset wrote what check refuses: {problems}")
    write_text(target, text)
    return target, found


def _kind(text: str) -> str:
    """A kind that needs no more than its name.  raises : ArgumentTypeError"""
    if text == "calibration":
        what = "calibration needs the plateaus of the rate table"
        raise argparse.ArgumentTypeError(f"{what}: leave --kind out, then set kind and reference in dataset.yaml")
    if text not in KINDS:
        raise argparse.ArgumentTypeError(f"expected one of {', '.join(KINDS)}, found {text!r}")
    return text


def _ratio(text: str) -> float:
    """A positive number, also as a fraction.  raises : ArgumentTypeError"""
    parts = text.split("/")
    try:
        over, *under = [float(part) for part in parts]
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected a number such as 0.00875 or 1/131, found {text!r}") from None
    if len(under) > 1 or not all(0 < part < math.inf for part in (over, *under)):
        raise argparse.ArgumentTypeError(f"expected a number greater than 0, such as 0.00875 or 1/131, found {text!r}")
    return over / under[0] if under else over


def target_of(options: argparse.Namespace, must_exist: bool = False) -> Path:
    """Path of the manifest to write; must_exist: of one that is there.  raises : UsageError"""
    from vgyro.errors import UsageError
    from vgyro.tasks.inputs_check import DATASET_NAME, MANIFEST, RESERVED

    name = options.name or identifier(options.files[0].resolve().parent.name)
    if not DATASET_NAME.fullmatch(name) or name in RESERVED:
        what = f"{name!r} cannot be the name of a data set"
        raise UsageError(what, None, f"give letters, digits, - and _ by --name, and none of {', '.join(RESERVED)}")
    target: Path = options.raw / name / MANIFEST
    if must_exist:
        if not target.is_file():
            raise UsageError("there is no such data set", str(target), "name its files, too")
        return target
    if target.exists():
        raise UsageError("it exists already, and is not overwritten", str(target), "give another --name, or edit it")
    return target


def _must_exist(path: Path) -> None:
    from vgyro.errors import DataError
    from vgyro.storage.sources import check_exists

    try:
        check_exists(path)
    except DataError as error:
        raise DataError(error.what, error.where, "check the path") from None
    if path.is_dir() and not any(one.is_file() for one in path.rglob("*")):
        raise DataError("is an empty folder", str(path), "name a file, or a folder of logs")


def folder_text(folder: Path, manifest: Path) -> str:
    """Relative inside the project, so that it can be moved; absolute outside."""
    if folder.is_relative_to(Path.cwd()):
        return Path(os.path.relpath(folder, manifest.resolve())).as_posix()
    return folder.as_posix()


def recording_names(files: Sequence[Path]) -> list[str]:
    """A name for each file, all different."""
    from vgyro.dataset import RESERVED

    names: list[str] = []
    for path in files:
        number, base = 1, identifier(_stem(path))
        chosen = base
        while chosen in names or chosen in RESERVED:
            number += 1
            chosen = f"{base}-{number}"
        names.append(chosen)
    return names


def _stem(path: Path) -> str:
    name = path.name
    while (ending := Path(name).suffix.lower()) in ENDINGS:
        name = name[: -len(ending)]
    return name


def identifier(text: str) -> str:
    """The text as the name of a recording or data set."""
    return re.sub(r"[^A-Za-z0-9_-]+", "-", text).strip("-_") or "recording"
