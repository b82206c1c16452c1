"""Validate config.yaml, the boards in use and the data sets, and look whether the data are what they are said to be.

Everything wrong is named at once, one mistake a line: file:line: key: what was expected.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from vgyro.tasks.inputs_check import Loaded
    from vgyro.validation import Problem

EPILOG = """\
examples:
  vgyro check                              config.yaml and the data sets it asks for
  vgyro check raw/bench/dataset.yaml       this data set only (and config.yaml)
  vgyro check --quick                      the same without reading the data

exit codes:
  0  nothing wrong
  3  something is wrong; it was named on standard error (with --json: on standard output)
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("manifests", nargs="*", metavar="DATASET.YAML", help="default: what config.yaml asks for")
    parser.add_argument("--config", default="config/config.yaml", help="default: %(default)s")
    parser.add_argument("--raw", default="raw", help="folder of the data sets; default: %(default)s")
    parser.add_argument("--boards", default="config/boards", help="folder of the boards; default: %(default)s")
    parser.add_argument("--quick", action="store_true", help="read the manifests alone, not the data")
    parser.add_argument("--json", action="store_true", help="print the findings as JSON")


def run(options: argparse.Namespace) -> int:
    """Check, print, return the exit code."""
    from vgyro.errors import ConfigError

    loaded = _load(options)
    problems = loaded.problems + _unknown_methods(loaded, options.config)
    warnings: list[Problem] = []
    if not options.quick:
        problems, warnings = _with_data(loaded, problems, Path(options.boards))
    if options.json:
        record = {
            "ok": not problems,
            "datasets": sorted(loaded.datasets),
            "problems": [asdict(p) for p in problems],
            "warnings": [asdict(p) for p in warnings],
        }
        print(json.dumps(record, indent=1, ensure_ascii=False))
    else:
        for problem in problems:
            print(problem, file=sys.stderr)
        for warning in warnings:
            print(f"warning: {warning}", file=sys.stderr)
        for name, (manifest, board, _) in loaded.datasets.items():
            count = len(manifest.recordings)
            print(f"{name}: {count} recording{'s' * (count != 1)}, {len(board.gyros)} gyros of board {board.name}")
        if problems:
            count = len(problems)
            able = len(loaded.datasets)
            text = f"{count} mistake{'s' * (count != 1)}; {able} data set{'s' * (able != 1)} can run"
            print(text, file=sys.stderr)
        elif not loaded.datasets:
            print(f"nothing wrong, and no data set in {options.raw}; start one with vgyro new-dataset")
        elif warnings:
            print(f"no mistake, {len(warnings)} warning{'s' * (len(warnings) != 1)}")
        else:
            print("nothing wrong")
    return ConfigError.exit_code if problems else 0


def _with_data(loaded: Loaded, problems: list[Problem], boards: Path) -> tuple[list[Problem], list[Problem]]:
    """The mistakes with those that the recordings show, and warnings."""
    from vgyro.cli.check_data import check_data

    warnings: list[Problem] = []
    for dataset in loaded.datasets.values():
        found, doubtful = check_data(dataset, boards)
        problems, warnings = problems + found, warnings + doubtful
    return problems, warnings


def _load(options: argparse.Namespace) -> Loaded:
    from vgyro.tasks.inputs_check import Loaded, load_config, load_dataset, load_datasets

    boards = Path(options.boards)
    if not options.manifests:
        return load_datasets(options.config, options.raw, boards, files=True)
    config, problems = load_config(Path(options.config))
    datasets = {}
    for given in options.manifests:
        path = Path(given) / "dataset.yaml" if Path(given).is_dir() else Path(given)
        dataset, found = load_dataset(path, config, boards, files=True)
        problems += found
        if dataset is not None and not found:
            datasets[path.resolve().parent.name] = dataset
    return Loaded(config, datasets, problems, not problems)


def _unknown_methods(loaded: Loaded, config: str) -> list[Problem]:
    """Names in fusion.methods that the registry does not have; it is imported only if some are written."""
    written = [(Path(config), "analysis.fusion.methods", loaded.config.analysis.fusion.methods)]
    for manifest, _, folder in loaded.datasets.values():
        if manifest.analysis is not None:
            methods = manifest.analysis.fusion.methods
            written.append((folder / "dataset.yaml", "analysis.fusion.methods", methods))
    if all(methods == "all" for _, _, methods in written):
        return []
    from vgyro.fusion import METHODS
    from vgyro.validation import Problem, did_you_mean, locate

    problems = []
    for path, key, methods in written:
        found = [
            Problem(str(path), 1, f"{key}.{index}", f"there is no method {name!r}{did_you_mean(name, METHODS)}")
            for index, name in enumerate(methods if methods != "all" else ())
            if name not in METHODS
        ]
        problems += locate(found, path.read_text(encoding="utf-8")) if found else []
    return problems
