"""vgyro doctor: what is missing is found, and named with its remedy."""

import json
import shutil
import sys
from collections import namedtuple
from importlib import metadata

import pytest

from vgyro.cli import doctor

Usage = namedtuple("Usage", "total used free")


@pytest.fixture
def lock(project):
    """A lock file that names exactly what is installed."""
    (project / "requirements").mkdir()
    path = project / "requirements/lock.txt"
    lines = [f"{name}=={metadata.version(name)} \\\n    --hash=sha256:00\n" for name in doctor._needed()]
    path.write_text("".join(lines))
    return path


def states(vgyro, *arguments):
    outcome = vgyro("doctor", "--json", *arguments)
    return outcome.code, {finding["what"]: (finding["state"], finding["remedy"]) for finding in json.loads(outcome.out)}


@pytest.mark.usefixtures("lock")
def test_a_whole_machine_is_ok(vgyro):
    code, found = states(vgyro)
    assert code == 0
    assert found[f"package numpy {metadata.version('numpy')}"] == ("ok", "")
    assert found[f"Python {'.'.join(map(str, sys.version_info[:3]))}"] == ("ok", "")
    assert found["folder raw can be written"] == ("ok", "")


def test_a_version_other_than_the_locked_one_is_missing(lock, vgyro):
    version = metadata.version("numpy")
    lock.write_text(lock.read_text().replace(f"numpy=={version} ", "numpy==0.1 "))
    code, found = states(vgyro)
    assert code == 1
    assert found[f"package numpy {version}, locked is 0.1"] == ("missing", "make env")


def test_a_lock_may_hold_two_versions_for_two_pythons(lock, vgyro):
    lock.write_text(lock.read_text() + "numpy==9.9 ; python_full_version >= '3.12'\n")
    assert states(vgyro)[0] == 0


def test_a_package_that_is_not_there(lock, vgyro, monkeypatch):
    monkeypatch.setattr(doctor, "_needed", lambda: ["no-such-package"])
    lock.write_text("no_such_package==1.0\n")
    code, found = states(vgyro)
    assert code == 1
    assert found["package no-such-package 1.0"] == ("missing", "make env")


@pytest.mark.usefixtures("lock")
def test_a_machine_without_programs(vgyro, monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda _: None)
    code, found = states(vgyro)
    assert code == 1
    assert found["C compiler (cc, gcc or clang)"] == ("missing", "apt install gcc libc6-dev")
    assert found["Chromium, which only the browser tests use"][0] == "optional"


@pytest.mark.usefixtures("lock")
def test_an_old_python_and_a_full_disk(vgyro, monkeypatch):
    monkeypatch.setattr(sys, "version_info", (3, 10, 1, "final", 0))
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(10, 10, 1024**2))
    found = states(vgyro)[1]
    assert found["Python 3.11 or newer (this is 3.10.1)"][0] == "missing"
    assert found["disk space: 0.0 GiB free, 2 GiB wanted"][0] == "missing"


@pytest.mark.usefixtures("lock")
def test_another_folder_than_the_project(vgyro, tmp_path, monkeypatch):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.chdir(elsewhere)
    outcome = vgyro("doctor")
    assert outcome.code == 1
    assert "missing   folder raw; run vgyro doctor in the project's folder" in outcome.out
    assert "missing   lock file requirements/lock.txt; run vgyro doctor in the project's folder" in outcome.out


def test_the_needed_packages_are_those_of_the_project_file(root):
    import tomllib

    declared = tomllib.loads((root / "pyproject.toml").read_text())["project"]["dependencies"]
    assert doctor._needed() == sorted(entry.split(">=")[0] for entry in declared)
