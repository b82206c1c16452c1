"""Where a decision rule may be changed, and how.

    named       a number of a module's constant: ×2, ×0.5, +1, to 0
    constant    any other number, likewise         comparison  < to <= and >, …; == to !=
    boolean     and to or                          not         left out; ~ too
    arithmetic  + to -, * to /                     extreme     min to max
    condition   of if, of a comprehension: forced  returned    by a function of bool: forced

Left out: texts (docstrings, messages, f-strings), annotations, decorators, what is raised or logged; `is None` (its
condition is forced instead); loops of while, which would not end; numbers and sums inside an index, shapes, axes and
the like: plumbing that stops at once or makes no difference; numbers up to 1e-9, which keep from dividing by zero;
operands of <<, the sizes of pieces of work; seeds.
"""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace

Node = ast.AST
COMPARED = {
    ast.Lt: (("<", "<="), ("<", ">")),
    ast.LtE: (("<=", "<"), ("<=", ">=")),
    ast.Gt: ((">", ">="), (">", "<")),
    ast.GtE: ((">=", ">"), (">=", "<=")),
    ast.Eq: (("==", "!="),),
    ast.NotEq: (("!=", "=="),),
}
OPERATORS: dict[str, type[ast.cmpop]] = {
    "<": ast.Lt, "<=": ast.LtE, ">": ast.Gt, ">=": ast.GtE, "==": ast.Eq, "!=": ast.NotEq
}  # fmt: skip
ARITHMETIC: dict[type[ast.operator], tuple[str, str, type[ast.operator]]] = {
    ast.Add: ("+", "-", ast.Sub), ast.Sub: ("-", "+", ast.Add),
    ast.Mult: ("*", "/", ast.Div), ast.Div: ("/", "*", ast.Mult),
}  # fmt: skip
EXTREMES = {
    "min": "max", "minimum": "maximum", "fmin": "fmax", "nanmin": "nanmax", "argmin": "argmax", "nanargmin": "nanargmax"
}  # fmt: skip
EXTREMES |= {right: left for left, right in EXTREMES.items()}
LOGGED = {"log", "logger", "logging", "warnings", "print"}
PLUMBING = {
    "axis", "axis1", "axis2", "axes", "keepdims", "dtype", "strict", "kind", "order", "maxsize", "decimals", "indent"
}  # fmt: skip
SHAPED = {"zeros", "ones", "empty", "full", "eye"}
RESHAPED = {"reshape", "transpose", "swapaxes", "moveaxis", "expand_dims", "astype", "broadcast_to"}
NEGLIGIBLE = 1e-9
NOT_SUMMED = (ast.List, ast.ListComp, ast.Tuple, ast.Dict, ast.JoinedStr, ast.Set)


@dataclass(frozen=True)
class Mutant:
    """One change of one module.

    function : qualified name of the outermost function, or "" in the module's own lines
    line     : the source line on which the changed expression begins, without indentation
    change   : "before → after";  number : of this among equal ones in the function, from 0
    span     : (line, column, line, column) of the expression, as ast counts;  text : what stands there afterwards
    """

    module: str
    function: str
    kind: str
    line: str
    change: str
    number: int
    span: tuple[int, int, int, int]
    text: str

    @property
    def name(self) -> tuple[str, str, str, str, str, int]:
        """What stays the same while code moves."""
        return self.module, self.function, self.kind, self.line, self.change, self.number

    @property
    def site(self) -> tuple[str, str, tuple[int, int, int, int]]:
        """The place, whatever the change."""
        return self.module, self.kind, self.span

    def applied(self, source: str) -> str:
        """The module's source with the change."""
        first, begin, last, end = self.span
        lines = source.splitlines(keepends=True)
        before = lines[first - 1].encode()[:begin].decode()
        after = lines[last - 1].encode()[end:].decode()
        return "".join([*lines[: first - 1], before + self.text + after, *lines[last:]])


def mutants(module: str, source: str) -> list[Mutant]:
    """Every mutant of a module, in the order of its lines."""
    lines = source.splitlines()
    seen: Counter[tuple[str, str, str, str]] = Counter()
    found = []
    for function, node, kind, change, text in _changes(ast.parse(source), ""):
        span = (node.lineno, node.col_offset, node.end_lineno or 0, node.end_col_offset or 0)
        line = lines[node.lineno - 1].strip()
        one = Mutant(module, function, kind, line, change, 0, span, text)
        key = (function, kind, line, change)
        found.append(replace(one, number=seen[key]))
        seen[key] += 1
    return found


Change = tuple[str, ast.expr | ast.stmt, str, str, str]


def _changes(node: Node, function: str, plain: bool = True, inside: bool = False) -> Iterator[Change]:
    """plain : numbers and sums count here, as they are in no index;  inside : of a function"""
    if isinstance(node, (ast.Raise, ast.Assert, ast.JoinedStr, ast.Import, ast.ImportFrom)) or _is_logging(node):
        return
    if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
        return
    if isinstance(node, ast.Assign) and "SEED" in ast.unparse(node.targets[0]):
        return
    for kind, change, text, whole in _here(node, plain):
        yield function, whole, "named" if kind == "constant" and not function else kind, change, text
    if isinstance(node, (ast.FunctionDef, ast.ClassDef)) and not inside:
        function = f"{function}.{node.name}".lstrip(".")
        inside = isinstance(node, ast.FunctionDef)
    if isinstance(node, ast.FunctionDef):
        yield from _returned(node, function)
    for field, value in ast.iter_fields(node):
        if field in ("annotation", "returns", "decorator_list"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield from _changes(child, function, plain and _counts(node, field, child), inside)


def _counts(node: Node, field: str, child: Node) -> bool:
    """Whether numbers and sums in this part of an expression are more than plumbing."""
    if isinstance(node, ast.Subscript):
        return field != "slice"
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.LShift):
        return False
    if isinstance(node, ast.keyword):
        return node.arg not in PLUMBING
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and field == "args":
        return node.func.attr not in RESHAPED and not (node.func.attr in SHAPED and child is node.args[0])
    return True


def _is_logging(node: Node) -> bool:
    if not isinstance(node, ast.Call):
        return False
    return ast.unparse(node.func).split(".")[0] in LOGGED


def _here(node: Node, plain: bool) -> Iterator[tuple[str, str, str, ast.expr]]:
    """Kind, change, new text and the expression that it replaces."""
    if isinstance(node, ast.Compare):
        yield from _compared(node)
    elif isinstance(node, ast.BoolOp):
        is_and = isinstance(node.op, ast.And)
        changed = ast.BoolOp(ast.Or() if is_and else ast.And(), node.values)
        yield "boolean", "and → or" if is_and else "or → and", _text(changed), node
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.Not, ast.Invert)):
        yield "not", "not → " if isinstance(node.op, ast.Not) else "~ → ", _text(node.operand), node
    elif isinstance(node, ast.BinOp) and type(node.op) in ARITHMETIC and plain and not _joins(node):
        before, after, operator = ARITHMETIC[type(node.op)]
        yield "arithmetic", f"{before} → {after}", _text(ast.BinOp(node.left, operator(), node.right)), node
    elif isinstance(node, ast.Constant) and plain and isinstance(node.value, (int, float)):
        for word, value in _other_values(node.value):
            yield "constant", f"{node.value!r} → {word}", repr(value), node
    elif isinstance(node, ast.Call):
        yield from _extreme(node)
    elif isinstance(node, (ast.If, ast.IfExp)):
        yield from _forced(node.test)
    elif isinstance(node, ast.comprehension):
        for test in node.ifs:
            yield from _forced(test)


def _compared(node: ast.Compare) -> Iterator[tuple[str, str, str, ast.expr]]:
    for place, operator in enumerate(node.ops):
        for before, after in COMPARED.get(type(operator), ()):
            ops = [*node.ops[:place], OPERATORS[after](), *node.ops[place + 1 :]]
            yield "comparison", f"{before} → {after}", _text(ast.Compare(node.left, ops, node.comparators)), node


def _extreme(node: ast.Call) -> Iterator[tuple[str, str, str, ast.expr]]:
    func = node.func
    name = func.id if isinstance(func, ast.Name) else func.attr if isinstance(func, ast.Attribute) else ""
    other = EXTREMES.get(name)
    if other:
        text = other if isinstance(func, ast.Name) else f"{ast.unparse(func)[: -len(name)]}{other}"
        yield "extreme", f"{name} → {other}", text, func


def _forced(test: ast.expr) -> Iterator[tuple[str, str, str, ast.expr]]:
    for value in ("True", "False"):
        yield "condition", f"if → {value}", value, test


def _returned(node: ast.FunctionDef, function: str) -> Iterator[Change]:
    """The values that a function of bool returns."""
    if node.returns is None or ast.unparse(node.returns) != "bool":
        return
    waiting: list[Node] = [*node.body]
    while waiting:
        one = waiting.pop(0)
        if isinstance(one, ast.Return) and one.value is not None:
            for value in ("True", "False"):
                if ast.unparse(one.value) != value:
                    yield function, one.value, "returned", f"return → {value}", value
        if not isinstance(one, (ast.FunctionDef, ast.Lambda)):
            waiting += ast.iter_child_nodes(one)


def _joins(node: ast.BinOp) -> bool:
    """Whether the operands are lists or texts."""
    return any(
        isinstance(one, NOT_SUMMED) or (isinstance(one, ast.Constant) and isinstance(one.value, str))
        for one in (node.left, node.right)
    )


def _other_values(value: float) -> list[tuple[str, float]]:
    if isinstance(value, bool) or 0 < abs(value) <= NEGLIGIBLE:
        return []
    half = value // 2 if isinstance(value, int) else value * 0.5
    found: list[tuple[str, float]] = []
    for word, other in (("×2", value * 2), ("×0.5", half), ("+1", value + 1), ("0", type(value)(0))):
        if other != value and other not in (one for _, one in found):
            found.append((word, other))
    return found


def _text(node: ast.expr) -> str:
    return f"({ast.unparse(node)})"
