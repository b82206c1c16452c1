"""Say what this machine has, what it lacks, and what to install.

Run it in the project's folder.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path

EPILOG = """\
example:
  vgyro doctor

exit codes:
  0  everything that is needed is there
  1  something that is needed is missing
"""
LOCK = Path("requirements/lock.txt")
FOLDERS = ("raw", "results", "reports")
OLDEST_PYTHON = (3, 11)
COMPILERS = ("cc", "gcc", "clang")
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
ENOUGH_DISK = 2 * 1024**3
GIB = 1024**3
RENEW = "make env"


@dataclass(frozen=True)
class MachineFinding:
    """One line of the answer.   state : ok, missing, or optional (not there, and not needed for the pipeline)"""

    state: str
    what: str
    remedy: str = ""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("--lock", type=Path, default=LOCK, help="lock file; default: %(default)s")
    parser.add_argument("--json", action="store_true", help="print the findings as JSON")


def run(options: argparse.Namespace) -> int:
    """Look, print, return the exit code."""
    findings = [*_python(), *_compiler(), *_engine(), *_packages(options.lock), *_programs(), *_folders(), *_disk()]
    if options.json:
        print(json.dumps([asdict(finding) for finding in findings], indent=1, ensure_ascii=False))
    else:
        for finding in findings:
            remedy = f"; {finding.remedy}" if finding.remedy else ""
            print(f"{finding.state:<8}  {finding.what}{remedy}")
    return int(any(finding.state == "missing" for finding in findings))


def _python() -> Iterator[MachineFinding]:
    found = ".".join(map(str, sys.version_info[:3]))
    if sys.version_info >= OLDEST_PYTHON:
        yield MachineFinding("ok", f"Python {found}")
    else:
        wanted = ".".join(map(str, OLDEST_PYTHON))
        yield MachineFinding(
            "missing", f"Python {wanted} or newer (this is {found})", "apt install python3.11 python3.11-venv"
        )


def _compiler() -> Iterator[MachineFinding]:
    path = next(filter(None, map(shutil.which, COMPILERS)), None)
    if path:
        yield MachineFinding("ok", f"C compiler: {path}")
    else:
        yield MachineFinding("missing", "C compiler (cc, gcc or clang)", "apt install gcc libc6-dev")


def _engine() -> Iterator[MachineFinding]:
    try:
        from vgyro.engine.native import _cpu
    except ImportError:
        yield MachineFinding("missing", "the native engine is not built", RENEW)
    else:
        yield MachineFinding("ok", f"native engine, for {_cpu.instruction_set()}")


def _packages(lock: Path) -> Iterator[MachineFinding]:
    """Each package that vgyro needs, and whether its version is the locked one."""
    locked = _locked_versions(lock)
    if not locked:
        yield MachineFinding("missing", f"lock file {lock}", "run vgyro doctor in the project's folder, or give --lock")
    for name in _needed():
        wanted = locked.get(_normal(name))
        try:
            found = metadata.version(name)
        except metadata.PackageNotFoundError:
            yield MachineFinding("missing", f"package {name} {' or '.join(sorted(wanted or ()))}".rstrip(), RENEW)
            continue
        if wanted and found not in wanted:
            yield MachineFinding("missing", f"package {name} {found}, locked is {' or '.join(sorted(wanted))}", RENEW)
        else:
            yield MachineFinding("ok", f"package {name} {found}")


def _programs() -> Iterator[MachineFinding]:
    # The one beside this Python, as `make` uses it, or the one on the path.
    beside = Path(sys.executable).with_name("snakemake")
    path = str(beside) if beside.exists() else shutil.which("snakemake")
    yield (
        MachineFinding("ok", f"Snakemake: {path}")
        if path
        else MachineFinding("missing", "the program snakemake", RENEW)
    )
    path = next(filter(None, map(shutil.which, BROWSERS)), None)
    if path:
        yield MachineFinding("ok", f"Chromium: {path}")
    else:
        yield MachineFinding("optional", "Chromium, which only the browser tests use", "apt install chromium")


def _folders() -> Iterator[MachineFinding]:
    for name in FOLDERS:
        if not Path(name).is_dir():
            yield MachineFinding("missing", f"folder {name}", "run vgyro doctor in the project's folder")
        elif not os.access(name, os.W_OK):
            yield MachineFinding("missing", f"the right to write into {name}", f"chmod u+w {name}")
        else:
            yield MachineFinding("ok", f"folder {name} can be written")


def _disk() -> Iterator[MachineFinding]:
    free = shutil.disk_usage(".").free
    text = f"{free / GIB:.1f} GiB free"
    if free < ENOUGH_DISK:
        yield MachineFinding(
            "missing", f"disk space: {text}, {ENOUGH_DISK / GIB:.0f} GiB wanted", "make room, or move results/"
        )
    else:
        yield MachineFinding("ok", f"disk: {text}")


def _needed() -> list[str]:
    """Names of the packages that vgyro declares, without its development tools."""
    declared = metadata.requires("vgyro") or []
    return sorted(re.split(r"[^A-Za-z0-9._-]", entry, maxsplit=1)[0] for entry in declared if "extra ==" not in entry)


def _locked_versions(lock: Path) -> dict[str, set[str]]:
    """Versions in a lock file; a package may have several, for different versions of Python."""
    versions: dict[str, set[str]] = {}
    if lock.is_file():
        for line in lock.read_text(encoding="utf-8").splitlines():
            if match := re.match(r"([A-Za-z0-9._-]+)==([^\s;\\]+)", line):
                versions.setdefault(_normal(match[1]), set()).add(match[2])
    return versions


def _normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()
