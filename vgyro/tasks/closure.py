"""The code that a task can reach, as one hash: Snakemake re-runs a job when it changes, and only then."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

from vgyro.fusion.installed import fingerprint

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT.name
REGISTRY = f"{PACKAGE}.fusion.registry"


def code_hash(module: str) -> str:
    """SHA-256 over the sources of `module` and of everything in the package that it imports, at any depth.

    Imports inside functions count. Templates and other data files of a package that is reached count too; so do, for
    what reaches the registry of fusion methods, the installed packages that bring some: their versions and sources.
    """
    digest = hashlib.sha256()
    reached = import_closure(module)
    if REGISTRY in reached:
        digest.update(fingerprint().encode())
    for name in sorted(reached):
        digest.update(name.encode() + b"\0" + _digest(name))
    return digest.hexdigest()


def forget() -> None:
    """Look at all sources anew: what is known of them is kept for the life of the process."""
    for known in (_digest, _imports, _source, sections_of):
        known.cache_clear()


@cache
def _digest(module: str) -> bytes:
    """SHA-256 of a module's source, its C files, and the data files of a package."""
    path = _source(module)
    digest = hashlib.sha256(path.read_bytes())
    for source in _c_sources(path):
        digest.update(source.name.encode() + b"\0" + source.read_bytes())
    if path.name == "__init__.py":
        for data in sorted(entry for entry in path.parent.rglob("*") if _is_data(entry)):
            digest.update(str(data.relative_to(ROOT)).encode() + b"\0" + data.read_bytes())
    return digest.digest()


@cache
def sections_of(module: str) -> tuple[str, ...]:
    """SECTIONS of a task's module: what it asks of manifest, board and `analysis`. Read, so that nothing is imported.

    raises : ValueError if it names none
    """
    for node in ast.parse(_source(module).read_bytes()).body:
        if isinstance(node, ast.Assign) and [ast.unparse(one) for one in node.targets] == ["SECTIONS"]:
            return tuple(ast.literal_eval(node.value))
    raise ValueError(f"{module} names no SECTIONS")


def import_closure(module: str) -> frozenset[str]:
    """Names of all modules of the package that `module` reaches, itself included.

    A package that is only passed through (a in `import a.b`) counts with what its __init__ runs at import; what it
    loads later, on demand, counts where a name is taken from it.
    """
    reached: set[tuple[str, bool]] = set()
    waiting = [(module, True)]
    while waiting:
        step = waiting.pop()
        if step in reached:
            continue
        reached.add(step)
        waiting += _imports(*step)
        parents = step[0].split(".")[:-1]
        waiting += [(".".join(parents[:depth]), False) for depth in range(2, len(parents) + 1)]
    return frozenset(name for name, _ in reached)


@cache
def _imports(module: str, on_demand: bool) -> tuple[tuple[str, bool], ...]:
    path = _source(module)
    if path.suffix == ".pyx":
        return ()
    body = ast.parse(path.read_bytes()).body
    nodes = _statements(body) if on_demand else iter(body)
    found: set[tuple[str, bool]] = set()
    for node in nodes:
        if isinstance(node, ast.Import):
            found.update((alias.name, True) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            submodules = {f"{node.module}.{alias.name}" for alias in node.names}
            modules = {name for name in submodules if _exists(name)}
            found.update((name, True) for name in modules)
            found.add((node.module, modules != submodules))
    return tuple(sorted((name, deep) for name, deep in found if name.split(".")[0] == PACKAGE and _exists(name)))


def _statements(body: Iterable[ast.AST]) -> Iterator[ast.AST]:
    """All statements, at any depth: where an import can stand. Expressions, which are most of a tree, are left out."""
    waiting = list(body)
    while waiting:
        statement = waiting.pop()
        yield statement
        for name in ("body", "orelse", "finalbody", "handlers", "cases"):
            waiting += getattr(statement, name, ())


@cache
def _source(module: str) -> Path:
    path = ROOT.joinpath(*module.split(".")[1:])
    if path.is_dir():
        return path / "__init__.py"
    compiled = path.with_suffix(".pyx")
    return compiled if compiled.is_file() else path.with_suffix(".py")


def _c_sources(path: Path) -> list[Path]:
    """The C files of the extension _<domain>.pyx: c/<domain>*, and the headers that all domains share."""
    if path.suffix != ".pyx":
        return []
    folder = path.parent / "c"
    return sorted([*folder.glob(f"{path.stem[1:]}*"), folder / "vg.h", folder / "each_isa.h"])


def _exists(module: str) -> bool:
    return module.startswith(f"{PACKAGE}.") and _source(module).is_file()


def _is_data(path: Path) -> bool:
    return (
        path.is_file()
        and path.suffix not in {".py", ".pyc", ".so", ".pyx", ".c", ".h"}
        and "__pycache__" not in path.parts
    )
