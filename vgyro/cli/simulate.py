"""Make a data set from a twin: a simulated board whose truth is known, down to the bytes of its dumps.

The folder gets the dumps, dataset.yaml (which says that the data are simulated) and the truth, and runs like any other
data set. The same twin and seed give the same bytes.
"""

from __future__ import annotations

import argparse
from pathlib import Path

EPILOG = """\
examples:
  vgyro simulate demo                          writes raw/demo/
  vgyro simulate demo --out raw/demo2 --seed 2
  vgyro simulate my-twin.yaml --out raw/mine
  vgyro simulate endurance --hours 1           an hour at rest instead of a day

exit codes:
  0  written
  2  there is no such twin, or the folder holds a data set already
  3  the twin or its board is wrong
"""
TWINS = Path("config/twins")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("twin", metavar="TWIN", help="name of a file in config/twins, or a path to one")
    parser.add_argument("--out", type=Path, help="folder to write; default: raw/<twin>")
    parser.add_argument("--seed", type=int, help="default: the seed that the twin names")
    parser.add_argument(
        "--hours",
        type=positive,
        help="length of the recordings at rest, their damage in proportion; default: the twin's",
    )
    parser.add_argument("--force", action="store_true", help="overwrite a data set that is there")


def run(options: argparse.Namespace) -> int:
    """Simulate, write, return the exit code."""
    from vgyro.errors import UsageError
    from vgyro.tasks.simulate import simulate_dataset

    path = twin_path(options.twin)
    folder = options.out or Path("raw") / path.stem
    if (folder / "dataset.yaml").exists() and not options.force:
        raise UsageError("there is a data set already", str(folder), "give another folder by --out, or --force")
    simulate_dataset(path, folder, options.seed, hours=options.hours)
    print(f"{folder}: simulated; next: snakemake --cores 2")
    return 0


def positive(text: str) -> float:
    """A number above 0.  raises : ArgumentTypeError"""
    value = float(text)
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is not above 0")
    return value


def twin_path(name: str) -> Path:
    """The file of a twin given by name or path.  raises : UsageError, with the names that exist"""
    from vgyro.complaints import did_you_mean
    from vgyro.errors import UsageError

    if name.endswith((".yaml", ".yml")):
        if not Path(name).is_file():
            raise UsageError("no such file", name, "give the path of a twin")
        return Path(name)
    path = TWINS / f"{name}.yaml"
    if not path.is_file():
        known = sorted(entry.stem for entry in TWINS.glob("*.yaml"))
        raise UsageError(f"there is no twin {name!r} in {TWINS}{did_you_mean(name, known)}")
    return path
