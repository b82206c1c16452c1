"""YAML text → validated model, with every mistake named at once: dotted key, line, what was expected, did you mean."""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from typing import Any, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError

from vgyro.errors import ConfigError

Model = TypeVar("Model", bound="StrictModel")
Path = tuple[str | int, ...]


class StrictModel(BaseModel):
    """Base of all models that a user writes: unknown keys are refused, values are frozen."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, validate_default=True)


@dataclass(frozen=True)
class Problem:
    """One mistake in a file.

    key : dotted key, "" for the whole file;  line : from 1;  message : what was expected, and what was found
    """

    source: str
    line: int
    key: str
    message: str

    def __str__(self) -> str:
        key = f" {self.key}:" if self.key else ""
        return f"{self.source}:{self.line}:{key} {self.message}"


class InvalidFile(ConfigError):
    """A YAML file with one or more mistakes, all of them listed."""

    def __init__(self, problems: list[Problem]) -> None:
        self.problems = problems
        super().__init__("\n".join(str(problem) for problem in problems))

    def __str__(self) -> str:
        return self.what

    def __reduce__(self) -> tuple:
        return type(self), (self.problems,)


def parse_model(text: str, model: type[Model], source: str) -> Model:
    """Parse `text` as YAML and validate it against `model`.

    source : the name that messages give to the text, a path as the user would type it
    raises : InvalidFile, with every mistake at once
    """
    data, lines = parse_yaml(text, source)
    if not isinstance(data, dict):
        raise InvalidFile([Problem(source, 1, "", "expected keys and values (a YAML mapping)")])
    try:
        return model.model_validate(data)
    except ValidationError as error:
        problems = [_problem(entry, model, lines, source) for entry in error.errors()]
        raise InvalidFile(sorted(problems, key=lambda problem: problem.line)) from None


def parse_yaml(text: str, source: str) -> tuple[Any, dict[Path, int]]:
    """Parse YAML; return the data and the line (from 1) of each key path. A key written twice is a mistake."""
    try:
        node = yaml.compose(text, Loader=yaml.SafeLoader)
        data = yaml.safe_load(text)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        reason = getattr(error, "problem", None) or "not readable as YAML"
        raise InvalidFile([Problem(source, mark.line + 1 if mark else 1, "", f"not valid YAML: {reason}")]) from None
    lines: dict[Path, int] = {(): 1}
    problems: list[Problem] = []
    if node is not None:
        _collect_lines(node, (), lines, problems, source)
    if problems:
        raise InvalidFile(problems)
    return data, lines


def _collect_lines(node: yaml.Node, path: Path, lines: dict[Path, int], problems: list[Problem], source: str) -> None:
    if isinstance(node, yaml.MappingNode):
        seen: set[str] = set()
        for key, value in node.value:
            child = (*path, str(key.value))
            line = key.start_mark.line + 1
            if key.value in seen:
                problems.append(Problem(source, line, _dotted(child), "written twice; keep one of them"))
            seen.add(key.value)
            lines[child] = line
            _collect_lines(value, child, lines, problems, source)
    elif isinstance(node, yaml.SequenceNode):
        for index, value in enumerate(node.value):
            lines[*path, index] = value.start_mark.line + 1
            _collect_lines(value, (*path, index), lines, problems, source)


def _problem(entry: Any, model: type[BaseModel], lines: dict[Path, int], source: str) -> Problem:
    # Pydantic adds the name of a union's branch to the path; only steps that exist in the file are kept.
    path: Path = ()
    for step in entry["loc"]:
        if (*path, step) in lines or (step == entry["loc"][-1] and entry["type"] == "missing"):
            path = (*path, step)
    line = _line_of(path, lines)
    message = _message(entry)
    if entry["type"] == "extra_forbidden":
        message = "unknown key" + did_you_mean(str(entry["loc"][-1]), _known_keys(model, entry["loc"][:-1]))
    return Problem(source, line, _dotted(path), message)


def _message(entry: Any) -> str:
    if entry["type"] == "missing":
        return "missing; this key is required"
    text = str(entry["msg"]).removeprefix("Value error, ").removeprefix("Assertion failed, ")
    text = text[0].lower() + text[1:]
    value = entry.get("input")
    if entry["type"] in {"value_error", "union_tag_invalid"} or isinstance(value, dict | list):
        return text
    return f"{text}, found {value!r}"


def _line_of(path: Path, lines: dict[Path, int]) -> int:
    while path and path not in lines:
        path = path[:-1]
    return lines[path]


def _dotted(path: Path) -> str:
    return ".".join(str(step) for step in path)


def did_you_mean(word: str, known: list[str]) -> str:
    """Return "; did you mean …?" if a known word is near, else the list of known words."""
    close = difflib.get_close_matches(word, known, n=1, cutoff=0.6)
    if close:
        return f"; did you mean {close[0]!r}?"
    return f"; known keys: {', '.join(known)}" if known else ""


def _known_keys(model: type[BaseModel], steps: tuple[str | int, ...]) -> list[str]:
    """Field names of the (sub)model at `steps`, following fields, lists, mappings and unions."""
    candidates: list[Any] = [model]
    for step in steps:
        following: list[Any] = []
        for candidate in candidates:
            if isinstance(step, str) and step in getattr(candidate, "model_fields", {}):
                following += _models_in(candidate.model_fields[step].annotation)
            else:
                following.append(candidate)
        candidates = following
    names = [name for candidate in candidates for name in getattr(candidate, "model_fields", {})]
    return list(dict.fromkeys(names))


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [found for argument in getattr(annotation, "__args__", ()) for found in _models_in(argument)]
