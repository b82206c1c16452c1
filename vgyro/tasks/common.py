"""What every task shares: its command line, its log, its one clear message, its provenance."""

from __future__ import annotations

import argparse
import hashlib
import json
import logging
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel

from vgyro.errors import VgyroError
from vgyro.storage.tables import Provenance, sha256_of_file
from vgyro.tasks.startup import keep_pandas_away

BUG_EXIT_CODE = 70
Model = TypeVar("Model", bound=BaseModel)


class UndeclaredOption(Exception):
    """A bug: a task asks for an option that its rule does not give. There are no defaults behind the user's back."""


@dataclass(frozen=True)
class Task:
    """One job of the workflow: named files in, named files out, the options it uses, the hash of its code."""

    inputs: dict[str, list[Path]]
    outputs: dict[str, Path]
    options: dict[str, Any]
    code: str

    def input(self, name: str) -> Path:
        """The only file of that name."""
        (path,) = self.inputs[name]
        return path

    def output(self, name: str) -> Path:
        """The file to write."""
        return self.outputs[name]

    def option(self, name: str) -> Any:
        """One option, as the rule gave it.  raises : UndeclaredOption"""
        return self._given(self.options, name)

    def section(self, name: str, model: type[Model]) -> Model:
        """The manifest, the board, or a section of `analysis`.  raises : UndeclaredOption"""
        within = self.options if name in ("manifest", "board") else self.options.get("analysis", {})
        return model.model_validate(self._given(within, name))

    @property
    def engine(self) -> str:
        """Who runs the recursions.  raises : UndeclaredOption"""
        return str(self._given(self.options.get("analysis", {}), "engine"))

    @staticmethod
    def _given(options: dict[str, Any], name: str) -> Any:
        if name not in options:
            raise UndeclaredOption(
                f"{name!r} is asked for, and not given: name it in SECTIONS of the task, or in its rule"
            )
        return options[name]

    def provenance(self) -> Provenance:
        """Hashes of inputs, options and code, for the metadata of the artefacts."""
        hashes = {}
        for name, paths in sorted(self.inputs.items()):
            digest = hashlib.sha256()
            for path in paths:
                digest.update(sha256_of_file(path).encode())
            hashes[name] = digest.hexdigest()
        options = hashlib.sha256(json.dumps(self.options, sort_keys=True).encode()).hexdigest()
        return Provenance(hashes, options, self.code)


def run_task(main: Callable[[Task], None], arguments: list[str] | None = None) -> None:
    """Parse the command line, run `main`, end the process.

    --input NAME FILE…   --output NAME FILE   --options JSON   --code HASH   --log FILE
    A VgyroError becomes one message on stderr; the traceback of any error is in the log.
    """
    parser = argparse.ArgumentParser()
    parser.add_argument("--input", nargs="+", action="append", default=[])
    parser.add_argument("--output", nargs=2, action="append", default=[])
    parser.add_argument("--options", type=json.loads, default={})
    parser.add_argument("--code", default="")
    parser.add_argument("--log", type=Path)
    given = parser.parse_args(arguments)
    _start_log(given.log)
    inputs = {name: [Path(path) for path in paths] for name, *paths in given.input}
    keep_pandas_away()
    task = Task(inputs, {name: Path(path) for name, path in given.output}, given.options, given.code)
    try:
        main(task)
    except VgyroError as error:
        logging.exception("%s", error)
        print(f"vgyro: {error}", file=sys.stderr)
        sys.exit(error.exit_code)
    except Exception as error:
        logging.exception("not foreseen")
        where = f"; the traceback is in {given.log}" if given.log else ""
        print(f"vgyro: a bug: {type(error).__name__}: {error}{where}", file=sys.stderr)
        sys.exit(BUG_EXIT_CODE)


def _start_log(path: Path | None) -> None:
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
    logging.basicConfig(
        filename=path, filemode="w", level=logging.INFO, format="%(levelname)s %(message)s", encoding="utf-8"
    )
    logging.captureWarnings(True)
