"""The rooms of the house: what each package says it is, and which others it imports."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

PACKAGE = "vgyro"
FOUNDATION = "foundation"
"""The modules that lie beside the packages and import none of them are one room."""


@dataclass(frozen=True)
class House:
    """The package vgyro as it lies in the folder `top`/vgyro."""

    top: Path

    @cached_property
    def words(self) -> dict[str, str]:
        """Module or package, as in `fusion.motion.models` → first line of its docstring; sorted."""
        return {name: (ast.get_docstring(tree) or "").partition("\n")[0] for name, tree in self._trees.items()}

    @property
    def modules(self) -> list[str]:
        """Names of all modules that are no packages."""
        return [name for name in self.words if not self._is_package(name)]

    @property
    def rooms(self) -> list[str]:
        """Names of the packages at the top, of modules beside them that import packages, and FOUNDATION."""
        return [*(name for name in self.words if "." not in name and self.room_of(name) == name), FOUNDATION]

    def room_of(self, name: str) -> str:
        """The room of a module or package."""
        first = name.partition(".")[0]
        packages = (other.partition(".")[0] for other in (first, *self.imports[first]))
        return first if any(map(self._is_package, packages)) else FOUNDATION

    def folder_of(self, name: str) -> str:
        """The innermost package that holds a module; of a package itself, of a module beside them its room."""
        if self._is_package(name):
            return name
        return name.rpartition(".")[0] or self.room_of(name)

    @cached_property
    def imports(self) -> dict[str, tuple[str, ...]]:
        """Module or package → modules and packages of vgyro that it imports anywhere, also within functions."""
        return {name: tuple(sorted(set(self._imported(tree)))) for name, tree in self._trees.items()}

    def rooms_imported(self) -> dict[str, list[str]]:
        """Room → the other rooms that it imports."""
        return self._grouped(self.room_of)

    def folders_imported(self) -> dict[str, list[str]]:
        """Folder → the other folders that it imports."""
        return self._grouped(self.folder_of)

    def _grouped(self, group: Callable[[str], str]) -> dict[str, list[str]]:
        found: dict[str, set[str]] = {}
        for name, imported in self.imports.items():
            found.setdefault(group(name), set()).update(group(other) for other in imported)
        return {name: sorted(others - {name}) for name, others in found.items()}

    def _imported(self, tree: ast.Module) -> Iterator[str]:
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
                names = [f"{node.module}.{alias.name}" for alias in node.names]
            else:
                continue
            for name in names:
                package, _, rest = name.partition(".")
                if package == PACKAGE:
                    # The last part may be what a module holds.
                    inner = rest if rest in self.words else rest.rpartition(".")[0]
                    yield from [inner] if inner in self.words else []

    def _is_package(self, name: str) -> bool:
        return name in self._packages

    @cached_property
    def _packages(self) -> frozenset[str]:
        top = self.top / PACKAGE
        return frozenset(".".join(path.parent.relative_to(top).parts) for path in top.rglob("__init__.py"))

    @cached_property
    def _trees(self) -> dict[str, ast.Module]:
        found = {self._name(path): ast.parse(path.read_bytes()) for path in (self.top / PACKAGE).rglob("*.py")}
        return {name: found[name] for name in sorted(found) if name}

    def _name(self, path: Path) -> str:
        parts = path.relative_to(self.top / PACKAGE).with_suffix("").parts
        return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def direct(edges: Mapping[str, list[str]]) -> dict[str, list[str]]:
    """Edges of a graph without loops that no longer way replaces: what a drawing needs.

    raises : ValueError for a graph with a loop
    """
    reached: dict[str, frozenset[str]] = {}

    def reach(name: str, above: tuple[str, ...] = ()) -> frozenset[str]:
        if name in above:
            raise ValueError(f"a loop: {' → '.join((*above, name))}")
        if name not in reached:
            others = edges.get(name, [])
            reached[name] = frozenset(others).union(*(reach(other, (*above, name)) for other in others))
        return reached[name]

    ways = {name: reach(name) for name in [*edges, *(other for others in edges.values() for other in others)]}
    return {
        name: [other for other in others if not any(other in ways[one] for one in others if one != other)]
        for name, others in edges.items()
    }
