"""Bounds on the shape of the code: what grows past them holds two ideas, or arguments that belong together."""

from __future__ import annotations

import ast
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "vgyro"
MODULES = {path.relative_to(PACKAGE).as_posix(): path for path in sorted(PACKAGE.rglob("*.py"))}
TREES = {name: ast.parse(path.read_bytes()) for name, path in MODULES.items()}

MOST_PARAMETERS, MOST_RETURNED, MOST_MODULES, MOST_LINES = 6, 3, 15, 400

KERNELS = {"conditional_weights": 10, "filter_bank": 7, "scale_bias_filter": 7}
"""Kernels of the engines: thin wrappers over C, each argument explained in vgyro.engine.protocols."""
CONTRACTS = {"allan_deviation": 9, "noise_coefficients": 7}
"""Public functions whose signatures are a contract (DESIGN)."""
NOT_YET = {
    "dynamic_figures": 9, "static_figures": 7, "explain_array": 7, "fit_windows": 7, "weights_of_windows": 11,
    "volatility/bekk.py:_row": 7,
}  # fmt: skip
"""To be brought down: they are called by tasks/figures/measure.py and tasks/volatility."""


def functions() -> Iterator[tuple[str, ast.FunctionDef]]:
    for module, tree in TREES.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef):
                yield module, node


def parameters(function: ast.FunctionDef) -> int:
    given = function.args
    named = [one.arg for one in (*given.posonlyargs, *given.args, *given.kwonlyargs) if one.arg not in ("self", "cls")]
    return len(named) + (given.vararg is not None) + (given.kwarg is not None)


def test_a_function_has_few_parameters():
    many = {}
    for module, function in functions():
        if parameters(function) > MOST_PARAMETERS:
            name = function.name if not function.name.startswith("_") else f"{module[6:]}:{function.name}"
            many.setdefault(name, set()).add(parameters(function))
    # An exception that is no longer one must leave the lists.
    assert many == {name: {number} for name, number in (KERNELS | CONTRACTS | NOT_YET).items()}


def test_kernels_with_many_parameters_stand_in_the_engines_alone():
    places = {module.split("/")[0] for module, function in functions() if function.name in KERNELS}
    assert places == {"engine"}


def test_a_tuple_that_is_returned_is_short():
    long = [
        f"{module}: {function.name}"
        for module, function in functions()
        for node in (ast.walk(function.returns) if function.returns else ())
        if isinstance(node, ast.Subscript)
        and ast.unparse(node.value) == "tuple"
        and isinstance(node.slice, ast.Tuple)
        and len(node.slice.elts) > MOST_RETURNED
    ]
    assert long == []


def test_a_folder_has_few_modules():
    counts = Counter(path.parent for path in MODULES.values() if path.name != "__init__.py")
    assert {str(folder): count for folder, count in counts.items() if count > MOST_MODULES} == {}


def test_a_module_is_short():
    lines = {name: len(path.read_text(encoding="utf-8").splitlines()) for name, path in MODULES.items()}
    assert {name: count for name, count in lines.items() if count > MOST_LINES} == {}


def test_a_class_name_has_one_meaning():
    """The engines' classes are twins: one name for what does the same."""
    places = defaultdict(set)
    for module, tree in TREES.items():
        for node in tree.body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places[node.name].add(
                    module.replace("engine/native/", "engine/").replace("engine/reference/", "engine/")
                )
    assert {name: sorted(found) for name, found in places.items() if len(found) > 1} == {}


@pytest.mark.parametrize(
    ("source", "count"),
    [
        ("def f(self, a, b=1): ...", 2),
        ("def f(cls, a, /, b, *, c, **d): ...", 4),
        ("def f(*a): ...", 1),
    ],
)
def test_parameters_are_counted(source: str, count: int):
    assert parameters(ast.parse(source).body[0]) == count
