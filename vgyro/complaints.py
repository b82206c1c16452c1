"""Pydantic's errors in words for people: what was expected, what was found, did you mean.

One mistake makes one complaint: where a value fits no branch of a union, or where a wrong item makes its list too
short, pydantic reports several errors, and only one of them helps.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from typing import Any, get_args

from pydantic import BaseModel

from vgyro.yaml_words import spaceless

Path = tuple[str | int, ...]

_NOUNS = {
    "int_type": "a whole number", "int_parsing": "a whole number", "int_from_float": "a whole number",
    "float_type": "a number", "float_parsing": "a number", "finite_number": "a finite number",
    "bool_type": "true or false", "bool_parsing": "true or false", "string_type": "text",
    "list_type": "a list", "tuple_type": "a list", "dict_type": "keys and values", "model_type": "keys and values",
    "model_attributes_type": "keys and values", "mapping_type": "keys and values", "set_type": "a list",
    "int_parsing_size": "a smaller whole number", "none_required": "nothing", "dataclass_type": "keys and values",
}  # fmt: skip
_KEY_ERRORS = {"missing", "union_tag_not_found", "union_tag_invalid", "extra_forbidden", "value_error"}
_BOUNDS = {
    "greater_than": ("gt", "greater than"),
    "greater_than_equal": ("ge", "of at least"),
    "less_than": ("lt", "less than"),
    "less_than_equal": ("le", "of at most"),
}
_PATTERNS = {
    r"^[A-Za-z_][A-Za-z0-9_]*$": "a name of letters, digits and _ that does not begin with a digit",
    r"^[A-Za-z0-9][A-Za-z0-9_-]*$": "a name of letters, digits, - and _",
    r"^[A-Za-z0-9_]+$": "a name of letters, digits and _",
}


def of_errors(errors: Sequence[Any], data: Any, model: type[BaseModel]) -> list[tuple[Path, str]]:
    """Complaints (path in the file, message) for pydantic's `errors` about `data`; each mistake once.

    errors : ValidationError.errors();  data : what was validated, as parsed;  model : what it was validated against
    """
    groups: dict[Path, list[Any]] = {}
    for error in errors:
        groups.setdefault(_path_of(error, data), []).append(error)
    kept = {path: group for path, group in groups.items() if not _is_follow_up(path, groups)}
    return [(path, _message(group, _known_keys(model, path[:-1], data))) for path, group in kept.items()]


def did_you_mean(word: str, known: Iterable[str], listed: bool = True) -> str:
    """Return "; did you mean …?" if a known word is near, else (if `listed`) "; known: …"."""
    known = list(known)
    close = difflib.get_close_matches(word, known, n=1, cutoff=0.6)
    # Two letters swapped in a short word are below that cutoff.
    close = close or [other for other in known if sorted(other) == sorted(word)]
    if close:
        return f"; did you mean {close[0]!r}?"
    return f"; known: {', '.join(known)}" if known and listed else ""


def _is_follow_up(path: Path, groups: dict[Path, list[Any]]) -> bool:
    return any(other != path and other[: len(path)] == path for other in groups)


def _path_of(error: Any, data: Any) -> Path:
    """The steps of an error's location that exist in the file: pydantic mixes in the names of a union's branches."""
    path: Path = ()
    node, tagged = data, False
    steps = error["loc"]
    for number, step in enumerate(steps):
        last = number == len(steps) - 1
        if isinstance(node, dict):
            if node.get("kind") == step and not last and not tagged:
                # {kind: plateaus, plateaus: [...]} gives the steps "plateaus" (the branch), "plateaus" (the key).
                tagged = True
            elif step in node:
                path, node, tagged = (*path, step), node[step], False
            elif last and error["type"] in {"missing", "value_error"}:
                path = (*path, step)
        elif isinstance(node, list) and isinstance(step, int) and step < len(node):
            path, node, tagged = (*path, step), node[step], False
    if error["type"] in {"union_tag_not_found", "union_tag_invalid"}:
        path = (*path, "kind")
    return path


def _message(group: list[Any], known: list[str]) -> str:
    kinds = {error["type"] for error in group}
    for error in group:
        if error["type"] in _KEY_ERRORS:
            return _message_of_key(error, known)
        if error["type"] in {"too_short", "too_long"}:
            return _message_of_length(error)
    value = group[0]["input"]
    literals = [word for error in group if error["type"] == "literal_error" for word in _literals(error)]
    nouns = list(dict.fromkeys(_noun(error) for error in group if error["type"] != "literal_error"))
    near = did_you_mean(value, literals, listed=False) if isinstance(value, str) else ""
    if not nouns:
        choice = f"one of {', '.join(literals)}" if len(literals) > 1 else _quoted(literals)
        return f"expected {choice}; found {found(value)}{near}"
    expected = " or ".join([*nouns, *([_quoted(literals)] if literals else [])])
    quote = "; put it in quotes" if kinds == {"string_type"} and not isinstance(value, dict | list | None) else ""
    return f"expected {expected}, found {found(value)}{near}{quote}"


def _message_of_key(error: Any, known: list[str]) -> str:
    kind, step = error["type"], error["loc"][-1] if error["loc"] else ""
    if kind == "missing" and isinstance(step, int):
        return f"item {step + 1} is missing"
    if kind in {"missing", "union_tag_not_found"}:
        return "missing; this key is required"
    if kind == "extra_forbidden":
        missing = spaceless(str(step))
        return f"unknown key; {missing}" if missing else "unknown key" + did_you_mean(str(step), known)
    if kind == "value_error":
        return str(error["ctx"]["error"])
    tags = [tag.strip(" '") for tag in error["ctx"]["expected_tags"].split(",")]
    tag = str(error["ctx"]["tag"])
    return f"expected one of {', '.join(tags)}; found {tag!r}{did_you_mean(tag, tags, listed=False)}"


def _message_of_length(error: Any) -> str:
    short, context = error["type"] == "too_short", error["ctx"]
    limit = context["min_length" if short else "max_length"]
    items = "item" if limit == 1 else "items"
    actual = context["actual_length"]
    count = "more" if actual is None else actual
    return f"expected at {'least' if short else 'most'} {limit} {items}, found {count}"


def _noun(error: Any) -> str:
    kind = error["type"]
    if kind in _NOUNS:
        return _NOUNS[kind]
    if kind in _BOUNDS:
        key, words = _BOUNDS[kind]
        return f"a number {words} {error['ctx'][key]:g}"
    if kind == "string_pattern_mismatch":
        pattern = error["ctx"]["pattern"]
        return _PATTERNS.get(pattern, f"text that matches {pattern}")
    # What pydantic says is for programmers; no field of ours comes here as far as is known.
    return "another kind of value"


def _literals(error: Any) -> list[str]:
    text = error["ctx"]["expected"].replace(" or ", ", ")
    return [word.strip(" '") for word in text.split(",")]


def _quoted(literals: list[str]) -> str:
    return " or ".join(repr(word) for word in literals)


def found(value: Any) -> str:
    """A value as its writer would recognise it in the file."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        return "keys and values"
    if isinstance(value, list | tuple):
        return "a list" if value else "an empty list"
    return repr(value) if isinstance(value, str | int | float) else str(value)


def _known_keys(model: type[BaseModel], path: Path, data: Any) -> list[str]:
    """Field names of the (sub)model at `path` of the file, following fields, lists, mappings and unions."""
    candidates: list[type[BaseModel]] = [model]
    node = data
    for step in path:
        node = node[step]
        if isinstance(step, str):
            fields = [candidate.model_fields[step] for candidate in candidates if step in candidate.model_fields]
            # A step that is no field is the key of a mapping, whose models are the candidates already.
            candidates = [inner for field in fields for inner in _models_in(field.annotation)] if fields else candidates
        if isinstance(node, dict):
            candidates = [inner for inner in candidates if node.get("kind") in _tags(inner)] or candidates
    return list(dict.fromkeys(name for candidate in candidates for name in candidate.model_fields))


def _tags(model: type[BaseModel]) -> tuple[Any, ...]:
    return get_args(model.model_fields["kind"].annotation) if "kind" in model.model_fields else ()


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [inner for argument in get_args(annotation) for inner in _models_in(argument)]
