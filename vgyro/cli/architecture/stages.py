"""The stages of the workflow, as its rules say: what each reads and writes, and the task that does it."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from vgyro.tasks.closure import sections_of

RULE = re.compile(r"^(?:rule|checkpoint) (\w+):\n(.*?)(?=^\S|\Z)", re.DOTALL | re.MULTILINE)
INCLUDED = re.compile(r'^include: "(workflow/rules/\w+\.smk)"$', re.MULTILINE)
ARRAYS = "artefacts"
"""The input of a stage that reads every table of every array."""


@dataclass(frozen=True)
class StageFile:
    """A file that a stage reads or writes.

    name : in the rule;  path : with wildcards in braces; empty where a function of the workflow finds the files
    passing : it is deleted when it has been read
    """

    name: str
    path: str
    passing: bool


@dataclass(frozen=True)
class Stage:
    """A rule of the workflow. task : its module below vgyro.tasks;  sections : options that the module asks for"""

    name: str
    words: str
    reads: tuple[StageFile, ...]
    writes: tuple[StageFile, ...]
    task: str
    sections: tuple[str, ...]


def stages(top: Path) -> list[Stage]:
    """All rules that run a task, in the order in which the Snakefile below `top` includes them."""
    files = INCLUDED.findall((top / "Snakefile").read_text(encoding="utf-8"))
    return [stage for file in files for stage in _stages((top / file).read_text(encoding="utf-8"))]


def makers(stage: Stage, known: Sequence[Stage]) -> list[str]:
    """Names of the stages that make what a stage reads; none of files that a person gives."""
    found: dict[str, None] = {}
    for file in stage.reads:
        if file.name == ARRAYS:
            found.update({other.name: None for other in known if any("{axis}/" in one.path for one in other.writes)})
            continue
        hits = [(other, one) for other in known if other != stage for one in other.writes if _is(file, one)]
        lasting = [hit for hit in hits if not hit[1].passing]
        found.update({other.name: None for other, _ in lasting or hits})
    return [name for name in found if name != stage.name]


def _is(read: StageFile, written: StageFile) -> bool:
    return read.path == written.path if read.path else read.name == written.name


def _stages(text: str) -> Iterator[Stage]:
    for name, body in RULE.findall(text):
        task = re.search(r'code\("([\w.]+)"\)', body)
        if task is None:
            continue
        words = re.search(r'"""(.*?)"""', body, re.DOTALL)
        yield Stage(
            name,
            " ".join(words[1].split()) if words else "",
            tuple(_files(body, "input")),
            tuple(_files(body, "output")),
            task[1],
            _sections(task[1]) if f'stage("{task[1]}"' in body else (),
        )


def _sections(task: str) -> tuple[str, ...]:
    return sections_of(f"vgyro.tasks.{task}")


def _files(body: str, part: str) -> Iterator[StageFile]:
    block = re.search(rf"^    {part}:\n(.*?)(?=^    \w|\Z)", body, re.DOTALL | re.MULTILINE)
    for name, value in re.findall(
        r"^        (\w+)=(.*?)(?=^        \w|\Z)", block[1] if block else "", re.DOTALL | re.M
    ):
        path = re.search(r'"([^"]*)"', value)
        yield StageFile(name, path[1] if path else "", value.startswith("temp("))
