"""Which tests a mutant is run against: those that call the changed function, by what the recorder found.

A number of a module's own line counts as changed in the functions that name it; where none does, and in a class's own
lines, in all of the module. First the test files that import the module, then the cheapest, up to a budget.
"""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from benchmarks.mutation.modules import deciding
from benchmarks.mutation.sites import Mutant


@dataclass(frozen=True)
class Calls:
    """Of each test, its CPU time in seconds, and the functions that it calls, "module::function"."""

    seconds: dict[str, float]
    functions: dict[str, frozenset[str]]

    @classmethod
    def read(cls, folder: Path) -> Calls:
        """All records in a folder; where one test is in two files, the later name counts."""
        seconds, functions = {}, {}
        for path in sorted(folder.glob("*.json")):
            for test, record in json.loads(path.read_text(encoding="utf-8")).items():
                seconds[test], functions[test] = record["seconds"], frozenset(record["calls"])
        return cls(seconds, functions)

    def of(self, wanted: set[str]) -> list[str]:
        """Tests that call one of them."""
        return [test for test, called in self.functions.items() if called & wanted]

    def in_module(self, module: str) -> list[str]:
        """Tests that call anything of a module."""
        return [test for test, called in self.functions.items() if any(one.startswith(f"{module}::") for one in called)]


def chosen_tests(mutant: Mutant, calls: Calls, root: Path, budget_s: float) -> list[str]:
    """Node ids in the order in which they are to run; of no more than the budget together, one at least."""
    direct = calls.of(_functions(mutant, root)) or calls.in_module(mutant.module)
    chosen: list[str] = []
    spent = 0.0
    for test in _cheapest(direct, calls.seconds, _importing(direct, mutant.module, root)):
        if chosen and spent + calls.seconds[test] > budget_s:
            continue
        chosen.append(test)
        spent += calls.seconds[test]
    return chosen


def _cheapest(tests: list[str], seconds: dict[str, float], first: set[str]) -> list[str]:
    """File by file, so that what the tests of a file share is made once.  first : these files before the others"""
    total: dict[str, float] = {}
    for test in tests:
        total[_file(test)] = total.get(_file(test), 0.0) + seconds[test]
    return sorted(tests, key=lambda test: (_file(test) not in first, total[_file(test)], _file(test), seconds[test]))


def _importing(tests: list[str], module: str, root: Path) -> set[str]:
    """The files of the tests in which the module is named."""
    package, _, name = module.removesuffix(".py").replace("/", ".").rpartition(".")
    names = re.compile(rf"{re.escape(package)}(\.{name}\b| import .*\b{name}\b)")
    files = {_file(test) for test in tests if (root / _file(test)).is_file()}
    return {one for one in files if names.search((root / one).read_text(encoding="utf-8"))}


def _file(test: str) -> str:
    return test.split("::")[0]


def _functions(mutant: Mutant, root: Path) -> set[str]:
    """What is to be called to see the change."""
    if mutant.function:
        return {f"{mutant.module}::{mutant.function}"}
    source = (root / mutant.module).read_text(encoding="utf-8")
    names = _assigned(ast.parse(source), mutant.span[0])
    found = set(_naming(source, names, mutant.module))
    dotted = mutant.module.removesuffix(".py").replace("/", ".")
    for module in deciding(root):
        other = (root / module).read_text(encoding="utf-8")
        if dotted in other and module != mutant.module:
            found |= set(_naming(other, names, module))
    return found


def _assigned(tree: ast.Module, line: int) -> set[str]:
    """Names that the statement of that line sets, and those that are set by them in turn."""
    names: set[str] = set()
    for node in tree.body:
        if not isinstance(node, (ast.Assign, ast.AnnAssign)) or node.value is None:
            continue
        used = {one.id for one in ast.walk(node.value) if isinstance(one, ast.Name)}
        if node.lineno <= line <= (node.end_lineno or 0) or used & names:
            names |= {one.id for one in ast.walk(node) if isinstance(one, ast.Name) and isinstance(one.ctx, ast.Store)}
    return names


def _naming(source: str, names: set[str], module: str) -> Iterator[str]:
    """Functions, as the recorder names them, in which one of the names occurs."""
    for node in ast.parse(source).body:
        parts = [(node.name, node)] if isinstance(node, ast.FunctionDef) else []
        if isinstance(node, ast.ClassDef):
            parts = [(f"{node.name}.{one.name}", one) for one in node.body if isinstance(one, ast.FunctionDef)]
        for name, part in parts:
            if any(
                (isinstance(one, ast.Name) and one.id in names)
                or (isinstance(one, ast.Attribute) and one.attr in names)
                for one in ast.walk(part)
            ):
                yield f"{module}::{name}"
