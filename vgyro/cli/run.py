"""From files to the page in one command: new-dataset, check, and the pipeline for this data set alone.

Takes the files and options of `vgyro new-dataset`; --name of a data set that exists runs it again. To correct what was
guessed, edit its dataset.yaml and run it again by `vgyro run --name NAME`, or all data sets by snakemake --cores 2.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

EPILOG = """\
examples:
  vgyro run ~/logs/imu.csv
  vgyro run ~/logs/imu.csv --name bench
  vgyro run one.csv two.csv three.csv --together --rate 100
  vgyro run --name bench                  again, after an edit of raw/bench/dataset.yaml

exit codes:
  0  the page is there
  1  a job of the pipeline failed: its message is above, its traceback in results/logs
  2  an option is needed that the files do not tell
  3  the manifest that was edited has a mistake
  4  a file is not there, is empty, or cannot be read
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    from vgyro.cli import new_dataset

    new_dataset.add_arguments(parser, files="*")
    parser.add_argument("--cores", type=int, default=2, help="processors to use; default: %(default)s")


def run(options: argparse.Namespace) -> int:
    """Write the manifest, check it, run the pipeline, name the page."""
    from vgyro.cli.new_dataset import target_of, write
    from vgyro.errors import UsageError

    if options.files:
        manifest, found = write(options)
        print("\n".join(found.lines))
        print(f"wrote {manifest}")
    elif options.name is None:
        raise UsageError("there is nothing to run", "vgyro run", "name the files, or a data set by --name")
    else:
        manifest = target_of(options, must_exist=True)
    name = manifest.parent.name
    if (code := _check(manifest, options)) != 0:
        return code
    page = Path("reports") / f"{name}.html"
    snakemake = [sys.executable, "-m", "snakemake", "--cores", str(options.cores), "--quiet", "rules", "host"]
    command = [*snakemake, "--config", f"only={name}", "--", "one"]
    ended = subprocess.run(command, check=False)
    if ended.returncode != 0:
        return 1
    print(f"\nthe report: {page.resolve()}")
    return 0


def _check(manifest: Path, options: argparse.Namespace) -> int:
    from vgyro.cli import check
    from vgyro.cli.entry import CommandParser

    parser = CommandParser(prog="vgyro check")
    check.add_arguments(parser)
    return check.run(parser.parse_args([str(manifest), "--raw", str(options.raw), "--boards", str(options.boards)]))
