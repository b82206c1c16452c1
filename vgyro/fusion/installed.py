"""Installed packages that bring fusion methods: their entry points, and a fingerprint of what they are.

This module imports nothing of the fusion, so that the workflow can ask it before it starts a job.
"""

from __future__ import annotations

import hashlib
from importlib.machinery import PathFinder
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path

GROUP = "vgyro.methods"


def method_entries() -> list[EntryPoint]:
    """The entry points of the group `vgyro.methods`, in the order of their packages' names."""
    return sorted(entry_points(group=GROUP), key=lambda entry: (package_of(entry), entry.name))


def package_of(entry: EntryPoint) -> str:
    """Name and version of the package that has the entry point."""
    return f"{entry.dist.name} {entry.dist.version}" if entry.dist is not None else "of no name"


def fingerprint() -> str:
    """SHA-256 over names, versions, entry points and Python sources of the packages that bring methods.

    Nothing of theirs is imported for it. Empty where there are no such packages.
    """
    entries = method_entries()
    if not entries:
        return ""
    digest = hashlib.sha256()
    for entry in entries:
        digest.update(f"{package_of(entry)}\0{entry.name}\0{entry.value}\0".encode())
        for path in _sources(entry.module.partition(".")[0]):
            digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def _sources(module: str) -> list[Path]:
    """The Python files of a top-level module or package."""
    found = PathFinder.find_spec(module)
    if found is None:
        return []
    if found.submodule_search_locations:
        return sorted(path for folder in found.submodule_search_locations for path in Path(folder).rglob("*.py"))
    return [Path(found.origin)] if found.origin and Path(found.origin).is_file() else []
