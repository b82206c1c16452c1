"""config.yaml and docs/configuration.md as text, written from the models, so that they cannot drift apart.

`python -m vgyro.cli.documents` writes both files; a test fails when one differs from what is made here.
"""

from __future__ import annotations

import types
from collections.abc import Iterator
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import yaml
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from vgyro.board import Board
from vgyro.config import Config
from vgyro.dataset import Manifest

WIDTH = 120

CONFIG_HEAD = """\
# vgyro: your choices. What stands here is the default; a key that is left out keeps it.
# Types and limits of every key: docs/configuration.md.   Is the file right?  vgyro check
# A data set may override any key of `analysis` in its raw/<dataset>/dataset.yaml.
"""

GUIDE_HEAD = """\
# Configuration

Three kinds of YAML file steer vgyro. All of them refuse unknown keys; `vgyro check` names every mistake at once, with
file, line, key and what was expected.

| file | what it says |
|---|---|
| `config/config.yaml` | your choices for every data set |
| `raw/<dataset>/dataset.yaml` | one data set: its board, its recordings, what is known of the true rate |
| `config/boards/<board>.yaml` | one board: frame layout, channels, gyros, nominal scale |

Times are in s, rates in deg/s, temperatures in °C, unless the key says otherwise. "–" in the default column means that
the key is required. This page is written from the models (`python -m vgyro.cli.documents`): do not edit it by hand.
"""

GUIDE_PARTS = (
    ("config/config.yaml", "", Config),
    ("raw/&lt;dataset&gt;/dataset.yaml", "", Manifest),
    ("config/boards/&lt;board&gt;.yaml", "", Board),
)

OVERRIDE = "Any keys of `analysis` in config/config.yaml; those left out keep their value there."

_SIGNS = {"gt": ">", "ge": "≥", "lt": "<", "le": "≤"}
_NAMES = {int: "whole number", float: "number", str: "text", bool: "true or false", type(None): "null"}


def config_yaml() -> str:
    """The text of config/config.yaml: every key with its default and its meaning as a comment."""
    return CONFIG_HEAD + "".join(_config_lines(Config(), 0))


def configuration_guide() -> str:
    """The text of docs/configuration.md: a table of keys for each section of each kind of file."""
    parts = [GUIDE_HEAD]
    for title, prefix, model in GUIDE_PARTS:
        parts.append(f"\n## {title}\n")
        parts += _guide_sections(model, prefix, set())
    return "".join(parts)


def models_in(annotation: Any) -> list[type[BaseModel]]:
    """The models that a field may hold, through lists, mappings and unions, in the order they are written."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [inner for argument in get_args(annotation) for inner in models_in(argument)]


def type_text(annotation: Any, metadata: tuple[Any, ...] | list[Any] = ()) -> str:
    """What a key takes, in words: "number > 0", "one of dcc, ccc", "list of text, or all"."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return type_text(arguments[0], arguments[1:])
    if origin is Literal:
        words = [str(word) for word in arguments]
        return words[0] if len(words) == 1 else f"one of {', '.join(words)}"
    if origin in (Union, types.UnionType):
        return _union_text(arguments, metadata)
    if origin is tuple and Ellipsis not in arguments:
        return f"[{', '.join(type_text(argument) for argument in arguments)}]"
    if origin is tuple:
        items = type_text(arguments[0]).removeprefix("one of ")
        return f"list of {items}"
    if origin is dict:
        return f"mapping of {type_text(arguments[0])} to {type_text(arguments[1])}"
    if models_in(annotation):
        return "keys, see below"
    return " ".join([_NAMES[annotation], " and ".join(_limits(metadata))]).rstrip()


def value_text(value: Any) -> str:
    """A default as it is written in YAML, on one line."""
    if isinstance(value, tuple):
        value = list(value)
    text = yaml.safe_dump(value, default_flow_style=True, allow_unicode=True, width=WIDTH * 10, sort_keys=False)
    return text.removesuffix("\n").removesuffix("\n...")


def _union_text(arguments: tuple[Any, ...], metadata: tuple[Any, ...] | list[Any]) -> str:
    if all(models_in(argument) for argument in arguments):
        return "keys, see below"
    texts = [type_text(argument, metadata if argument in (int, float) else ()) for argument in arguments]
    return ", or ".join(dict.fromkeys(texts))


def _limits(metadata: tuple[Any, ...] | list[Any]) -> Iterator[str]:
    for entry in metadata:
        for name, sign in _SIGNS.items():
            if getattr(entry, name, None) is not None:
                yield f"{sign} {getattr(entry, name):g}"


def _config_lines(section: BaseModel, depth: int) -> Iterator[str]:
    indent = "  " * depth
    fields = type(section).model_fields
    leaves = [name for name in fields if not isinstance(getattr(section, name), BaseModel)]
    entries = {name: f"{indent}{name}: {value_text(getattr(section, name))}" for name in leaves}
    column = max((len(entry) for entry in entries.values() if len(entry) <= WIDTH // 3), default=0) + 2
    for name, field in fields.items():
        value = getattr(section, name)
        if isinstance(value, BaseModel):
            yield f"\n{indent}# {_summary(type(value))}\n{indent}{name}:\n"
            yield from _config_lines(value, depth + 1)
        else:
            comment = f"# {field.description}"
            line = f"{entries[name]:<{column}}{comment}"
            beside = len(entries[name]) < column and len(line) <= WIDTH
            yield f"{line}\n" if beside else f"{indent}{comment}\n{entries[name]}\n"


def _guide_sections(model: type[BaseModel], prefix: str, written: set[type[BaseModel]]) -> Iterator[str]:
    written.add(model)
    yield f"\n{_summary(model)}\n" if prefix else ""
    yield "\n| key | takes | default | meaning |\n|---|---|---|---|\n"
    for name, field in model.model_fields.items():
        takes = _cell(type_text(field.annotation, field.metadata))
        yield f"| `{name}` | {takes} | {_default(field)} | {_meaning(field)} |\n"
    for name, field in model.model_fields.items():
        inner = models_in(field.annotation)
        for choice in inner:
            if choice in written:
                continue
            path = f"{prefix}.{name}" if prefix else name
            tag = f" (kind: {_tag(choice)})" if len(inner) > 1 else ""
            if path == "analysis" and model is Manifest:
                yield f"\n### analysis\n\n{OVERRIDE}\n"
                continue
            yield f"\n### {path}{tag}\n"
            yield from _guide_sections(choice, path, written)


def _tag(model: type[BaseModel]) -> str:
    return str(get_args(model.model_fields["kind"].annotation)[0])


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "–"
    default = field.get_default()
    return "" if isinstance(default, BaseModel) else f"`{value_text(default)}`"


def _meaning(field: FieldInfo) -> str:
    inner = models_in(field.annotation)
    return _cell(field.description or (_summary(inner[0]) if len(inner) == 1 else ""))


def _summary(model: type[BaseModel]) -> str:
    return " ".join((model.__doc__ or "").split("\n\n")[0].split())


def _cell(text: str) -> str:
    return text.replace("|", "\\|")
