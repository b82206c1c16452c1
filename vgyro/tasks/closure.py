"""The code that a task can reach, as one hash: Snakemake re-runs a job when it changes, and only then."""

from __future__ import annotations

import ast
import hashlib
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT.name


def code_hash(module: str) -> str:
    """SHA-256 over the sources of `module` and of everything in the package that it imports, at any depth.

    Imports inside functions count. Templates and other data files of a package that is reached count too.
    """
    digest = hashlib.sha256()
    for name in sorted(import_closure(module)):
        path = _source(name)
        digest.update(name.encode() + b"\0" + path.read_bytes())
        if path.name == "__init__.py":
            for data in sorted(entry for entry in path.parent.rglob("*") if _is_data(entry)):
                digest.update(str(data.relative_to(ROOT)).encode() + b"\0" + data.read_bytes())
    return digest.hexdigest()


def import_closure(module: str) -> frozenset[str]:
    """Names of all modules of the package that `module` reaches, itself included."""
    reached: set[str] = set()
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if name in reached:
            continue
        reached.add(name)
        waiting += _imports(name)
    return frozenset(reached)


@cache
def _imports(module: str) -> tuple[str, ...]:
    tree = ast.parse(_source(module).read_bytes())
    found: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            found.add(node.module)
            found.update(f"{node.module}.{alias.name}" for alias in node.names)
    names = {name for name in found if name.split(".")[0] == PACKAGE}
    # Importing a.b.c runs a/__init__ and a.b/__init__ too.
    names |= {".".join(name.split(".")[:depth]) for name in names for depth in range(2, name.count(".") + 1)}
    return tuple(sorted(name for name in names if _exists(name)))


def _source(module: str) -> Path:
    path = ROOT.joinpath(*module.split(".")[1:])
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


def _exists(module: str) -> bool:
    return _source(module).is_file()


def _is_data(path: Path) -> bool:
    return path.is_file() and path.suffix not in {".py", ".pyc", ".so"} and "__pycache__" not in path.parts
