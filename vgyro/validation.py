"""YAML text → validated model, with every mistake named at once: dotted key, line, what was expected, did you mean."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Self, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError

from vgyro import complaints
from vgyro.complaints import did_you_mean as did_you_mean
from vgyro.errors import ConfigError
from vgyro.yaml_words import spaceless, yaml_fault

Model = TypeVar("Model", bound="StrictModel")
Path = tuple[str | int, ...]
_FAST_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_OTHERWISE = re.compile(r"[\t?!]|[>|][-+\d]*#")
"""What libyaml reads in another way than PyYAML's own parser, or lets pass."""


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

    def __reduce__(self) -> tuple[type[Self], tuple[object, ...]]:
        return type(self), (self.problems,)


def parse_model(text: str, model: type[Model], source: str, context: Mapping[str, Any] | None = None) -> Model:
    """Parse `text` as YAML and validate it against `model`.

    source  : the name that messages give to the text, a path as the user would type it
    context : handed to the model's validators
    raises  : InvalidFile, with every mistake at once
    """
    data, lines = parse_yaml(text, source)
    if not isinstance(data, dict):
        missing = spaceless(data) if isinstance(data, str) else ""
        raise InvalidFile([Problem(source, 1, "", missing or "expected keys and values, such as `title: my bench`")])
    try:
        return model.model_validate(data, context=dict(context or {}))
    except ValidationError as error:
        found = complaints.of_errors(error.errors(include_url=False), data, model)
    problems = [Problem(source, _line_of(path, lines), _dotted(path), message) for path, message in found]
    raise InvalidFile(sorted(problems, key=lambda problem: problem.line))


def parse_yaml(text: str, source: str) -> tuple[Any, dict[Path, int]]:
    """Parse YAML; return the data and the line (from 1) of each key path. A key written twice is a mistake."""
    lines: dict[Path, int] = {(): 1}
    problems: list[Problem] = []
    try:
        kind = yaml.SafeLoader if _OTHERWISE.search(text) else _FAST_LOADER
        data = _data(text, kind, lines, problems, source)
    except (yaml.YAMLError, ValueError):
        # The other parser words its faults for people, and has the last word on what is one.
        lines, problems = {(): 1}, []
        try:
            data = _data(text, yaml.SafeLoader, lines, problems, source)
        except (yaml.YAMLError, ValueError) as error:
            # ValueError: PyYAML's own conversion of dates and numbers, such as 2026-13-45.
            line, message = yaml_fault(error, text)
            raise InvalidFile([Problem(source, line, "", message)]) from None
    if problems:
        raise InvalidFile(problems)
    return data, lines


def _data(text: str, kind: Any, lines: dict[Path, int], problems: list[Problem], source: str) -> Any:
    """The data of a text, by a loader of that kind; lines and problems are added to those given."""
    loader = kind(text)
    try:
        node = loader.get_single_node()
        if node is None:
            return None
        # Before the data are made, for that writes merged keys into the nodes.
        _collect_lines(node, (), lines, problems, source)
        return loader.construct_document(node)
    finally:
        loader.dispose()


def locate(problems: Iterable[Problem], text: str) -> list[Problem]:
    """Give each problem the line of its key in `text`, and sort them by line; for checks made after parsing.

    A key that is not written in the text takes the line of the nearest one above it.
    """
    found = list(problems)
    if not found:
        return []
    _, lines = parse_yaml(text, found[0].source)
    placed = [replace(problem, line=_line_of(_path(problem.key), lines)) for problem in found]
    return sorted(placed, key=lambda problem: problem.line)


def _collect_lines(node: yaml.Node, path: Path, lines: dict[Path, int], problems: list[Problem], source: str) -> None:
    if isinstance(node, yaml.MappingNode):
        seen: set[str] = set()
        for key, value in node.value:
            if not isinstance(key, yaml.ScalarNode):
                continue  # No data can be made of it, which is said then.
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


def _line_of(path: Path, lines: dict[Path, int]) -> int:
    while path and path not in lines:
        path = path[:-1]
    return lines[path]


def _path(key: str) -> Path:
    return tuple(int(step) if step.isdecimal() else step for step in key.split(".")) if key else ()


def _dotted(path: Path) -> str:
    return ".".join(str(step) for step in path)
