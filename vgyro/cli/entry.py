"""Parse the command line, run one command, turn every foreseen error into one message and an exit code.

Only argparse is imported here, so that help is instant.
"""

from __future__ import annotations

import argparse
import importlib
import os
import sys
import traceback
from collections.abc import Sequence
from typing import NoReturn

from vgyro import __version__
from vgyro.errors import UsageError, VgyroError

COMMANDS = {
    "run": "from files to the page in one command",
    "new-dataset": "look at dumps or logs and write a commented raw/<name>/dataset.yaml",
    "check": "validate config.yaml, boards and data sets; every mistake at once",
    "decode": "decode dumps of a board and say how complete they are",
    "simulate": "make a data set from a twin: dumps, manifest, and the truth beside them",
    "compare": "compare the figures of two runs",
    "doctor": "say what this machine lacks to run vgyro",
}

BUG_EXIT_CODE = 70
INTERRUPTED = 130
EXIT_CODES = """\
exit codes (all commands):
  0  done, nothing wrong
  1  the answer is no: figures differ, something is missing
  2  the command line is wrong
  3  config.yaml, a board, a twin or a manifest is wrong
  4  a recording cannot be used: damaged, empty, of another board
  5  the engine cannot do what was asked
 70  a bug in vgyro
"""
EXAMPLES = """\
from a log to a report:
  vgyro run ~/logs/imu.csv
from dumps to a report, step by step:
  vgyro new-dataset ~/dumps/*.bin --name bench --board dsp6
  vgyro check
  snakemake --cores 2

`vgyro COMMAND --help` says more, with an example.

"""


class CommandParser(argparse.ArgumentParser):
    """argparse, with mistakes as UsageError."""

    def error(self, message: str) -> NoReturn:
        raise UsageError(message, self.prog, f"Try {self.prog} --help")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; return the exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        return _run(given)
    except VgyroError as error:
        print(f"vgyro: {error}", file=sys.stderr)
        return error.exit_code
    except BrokenPipeError:
        # The reader of our output (head, less) has seen enough; keep Python from complaining at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except KeyboardInterrupt:
        return INTERRUPTED
    except Exception as error:
        traceback.print_exc()
        print(f"vgyro: a bug: {type(error).__name__}: {error}", file=sys.stderr)
        return BUG_EXIT_CODE


def _run(given: list[str]) -> int:
    overview = _overview()
    if not given or given[0] in {"-h", "--help", "help"}:
        overview.print_help()
        return 0 if given else UsageError.exit_code
    if given[0] == "--version":
        print(f"vgyro {__version__}")
        return 0
    name, rest = given[0], given[1:]
    if name not in COMMANDS:
        from vgyro.complaints import did_you_mean

        raise UsageError(f"there is no command {name!r}{did_you_mean(name, COMMANDS)}", None, "Try vgyro --help")
    module = importlib.import_module(f"vgyro.cli.{name.replace('-', '_')}")
    parser = CommandParser(
        prog=f"vgyro {name}",
        description=module.__doc__,
        epilog=module.EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    module.add_arguments(parser)
    options = _parse(parser, rest)
    code: int = module.run(options)
    return code


def _parse(parser: CommandParser, rest: list[str]) -> argparse.Namespace:
    options, unknown = parser.parse_known_args(rest)
    if unknown:
        from vgyro.complaints import did_you_mean

        known = [flag for action in parser._actions for flag in action.option_strings]
        word = unknown[0].split("=")[0]
        raise UsageError(f"unknown argument {word!r}{did_you_mean(word, known, listed=False)}", parser.prog)
    return options


def _overview() -> argparse.ArgumentParser:
    width = max(map(len, COMMANDS)) + 2
    commands = "".join(f"  {name:<{width}}{text}\n" for name, text in COMMANDS.items())
    return argparse.ArgumentParser(
        prog="vgyro",
        usage="vgyro COMMAND [ARGUMENT ...]",
        description="Offline pipeline for arrays of MEMS gyroscopes: how good is each gyro, how good a virtual\n"
        f"gyroscope, how sure. The pipeline itself is run by snakemake.\n\ncommands:\n{commands}",
        epilog=EXAMPLES + EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        add_help=False,
    )
