"""The command line as a whole: help, mistakes, exit codes."""

import subprocess
import sys
import time

import pytest

from vgyro.cli import entry
from vgyro.cli.entry import COMMANDS


def test_help_names_every_command_and_exit_code(vgyro):
    outcome = vgyro("--help")
    assert outcome.code == 0
    for name, text in COMMANDS.items():
        assert f"  {name}" in outcome.out
        assert text in outcome.out
    for code in (0, 1, 2, 3, 4, 5, 70):
        assert f"\n {code:>2}  " in outcome.out


@pytest.mark.parametrize("command", COMMANDS)
def test_each_command_has_a_description_an_example_and_exit_codes(vgyro, command):
    outcome = vgyro(command, "--help")
    assert outcome.code == 0
    assert f"usage: vgyro {command}" in outcome.out
    assert "example" in outcome.out
    assert f"\n  vgyro {command}" in outcome.out
    assert "exit codes:\n  0  " in outcome.out


def test_help_is_instant():
    # Only interpreter and argparse: 0.1 s here. Importing NumPy, pydantic or pyarrow would show in sys.modules.
    code = "import sys; from vgyro.cli import main; main(['--help']); print([m for m in sys.modules if m in "
    code += "('numpy', 'pydantic', 'pyarrow', 'yaml')])"
    start = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"
    assert time.perf_counter() - start < 5


def test_no_command_prints_help_and_is_a_mistake(vgyro):
    outcome = vgyro()
    assert outcome.code == 2
    assert "usage: vgyro COMMAND" in outcome.out


def test_an_unknown_command_gets_the_nearest(vgyro):
    outcome = vgyro("chekc")
    assert outcome == (2, "", "vgyro: there is no command 'chekc'; did you mean 'check'? Try vgyro --help.\n")


def test_an_unknown_option_gets_the_nearest(vgyro):
    outcome = vgyro("check", "--jsno")
    assert outcome == (2, "", "vgyro: vgyro check: unknown argument '--jsno'; did you mean '--json'?\n")


def test_a_missing_argument_is_one_message(vgyro):
    outcome = vgyro("compare", "a")
    assert outcome.code == 2
    assert outcome.err == "vgyro: vgyro compare: the following arguments are required: B. Try vgyro compare --help.\n"


def test_a_bug_is_told_from_a_mistake(vgyro, monkeypatch):
    def broken(given: list[str]) -> int:
        raise ZeroDivisionError(f"in {given}")

    monkeypatch.setattr(entry, "_run", broken)
    outcome = vgyro("check")
    assert outcome.code == 70
    assert "Traceback" in outcome.err
    assert outcome.err.endswith("vgyro: a bug: ZeroDivisionError: in ['check']\n")


def test_the_version_is_printed(vgyro):
    assert vgyro("--version").out.startswith("vgyro 0.")
