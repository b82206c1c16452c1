"""Methods that other installed packages bring: the entry points of the group `vgyro.methods`.

An entry point is a Method, a sequence of them, or a function without arguments that returns one or the other. What is
wrong with a package leaves its methods out, with one line that names it, and nothing else.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from importlib.metadata import EntryPoint
from typing import Any

from vgyro.fusion.installed import GROUP, method_entries, package_of
from vgyro.fusion.types import Method

NAME = re.compile(r"[a-z][a-z0-9_]*")
RESERVED = ("time", "segment")
PREFIX = "sd_"
"""Columns of fused.parquet that are no method's."""


def methods_of_packages(known: Collection[str]) -> tuple[list[Method], list[str]]:
    """The methods of all installed packages, in the order of their packages' names; what was left out, a line each.

    known   : names that are taken
    returns : methods of the family "other", with `package` set and named in `source`
    """
    methods: dict[str, Method] = {}
    problems: list[str] = []
    for entry in method_entries():
        label = package_of(entry)
        try:
            found = list(_methods(entry.load()))
        except (Exception, SystemExit) as error:
            reason = str(error).partition("\n")[0]
            problems.append(f"{_where(entry)} cannot be loaded: {type(error).__name__}: {reason}; it is left out")
            continue
        for method in found:
            flaw = _flaw(method, known, methods)
            if flaw:
                problems.append(f"{_where(entry)}: {flaw}; it is left out")
            else:
                source = f"{method.source}; package {label}"
                methods[method.name] = replace(method, family="other", package=label, source=source)
    return list(methods.values()), problems


def _where(entry: EntryPoint) -> str:
    return f"package {package_of(entry)}, entry point {entry.name!r} of {GROUP}"


def _methods(thing: Any) -> Iterator[Any]:
    """What an entry point gives, one after the other."""
    if callable(thing) and not isinstance(thing, Method):
        thing = thing()
    if isinstance(thing, Sequence) and not isinstance(thing, str):
        yield from thing
    else:
        yield thing


def _flaw(method: Any, known: Collection[str], others: Mapping[str, Method]) -> str:
    """Why a method cannot join the registry; empty if it can."""
    if not isinstance(method, Method):
        return f"{method!r:.60} is no vgyro.fusion.Method"
    name = method.name
    if not (isinstance(name, str) and NAME.fullmatch(name)) or name in RESERVED or name.startswith(PREFIX):
        return (
            f"the name {name!r} does not do: lower-case letters, digits and _, not {', '.join(RESERVED)} or {PREFIX}…"
        )
    if name in known:
        return f"the name {name!r} is taken by a method of vgyro"
    if name in others:
        return f"the name {name!r} is taken by package {others[name].package}"
    return _wrong_field(method)


def _wrong_field(method: Method) -> str:
    """Which field of a method is not what it has to be; empty if none."""
    checks: dict[str, Callable[[Any], bool]] = {
        "title": _is_text,
        "source": _is_text,
        "inferred": _is_text,
        "causal": lambda value: isinstance(value, bool),
        "per_definition": lambda value: isinstance(value, bool),
        "needs": lambda value: isinstance(value, tuple) and all(map(_is_text, value)),
        "fuse": callable,
        "operations": callable,
        "same_at_any_rate": lambda value: isinstance(value, Mapping),
    }
    for field, right in checks.items():
        if not right(getattr(method, field)):
            return f"{method.name}: {field} is {getattr(method, field)!r:.60}"
    return ""


def _is_text(value: Any) -> bool:
    return isinstance(value, str)
