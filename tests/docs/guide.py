"""The blocks of a guide: files to write, changes to make, and the test that comes last."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
PATH = re.compile(r"# (\S+/\S+\.py)\n")


class DoesNotFit(AssertionError):
    """A change of the guide that does not fit the code any more."""


@dataclass(frozen=True)
class Change:
    """Parts of one file, each with what comes in its place."""

    path: str
    parts: tuple[tuple[str, str], ...]

    @classmethod
    def of(cls, block: str) -> Change:
        head, *hunks = re.split(r"^@@\n", block, flags=re.MULTILINE)
        (path,) = re.findall(r"^--- (\S+)$", head, re.MULTILINE)
        return cls(path, tuple(_before_and_after(hunk) for hunk in hunks))

    def make(self, top: Path) -> None:
        """Change the file below `top`.  raises : DoesNotFit where a part is not there exactly once"""
        file = top / self.path
        text = file.read_text(encoding="utf-8")
        for before, after in self.parts:
            times = text.count(before)
            if times != 1:
                raise DoesNotFit(f"{self.path} has this {times} times, not once:\n{before}")
            text = text.replace(before, after)
        file.write_text(text, encoding="utf-8")


@dataclass(frozen=True)
class GuideSection:
    """A section of the guide. files : path → content, in the order of the text; the last one is a test"""

    title: str
    text: str
    files: dict[str, str]
    changes: tuple[Change, ...]

    @property
    def test(self) -> str:
        return list(self.files)[-1]

    def follow(self, top: Path) -> None:
        """Do what the section says, in a copy of the repository."""
        for path, content in self.files.items():
            assert not (top / path).exists(), f"{path} is there already"
            (top / path).parent.mkdir(parents=True, exist_ok=True)
            (top / path).write_text(content, encoding="utf-8")
        for change in self.changes:
            change.make(top)


def sections(text: str) -> dict[str, GuideSection]:
    """Sections of a Markdown text, by title."""
    found = {}
    for part in re.split(r"^## ", text, flags=re.MULTILINE)[1:]:
        title = part.partition("\n")[0]
        blocks = BLOCK.findall(part)
        named = [(PATH.match(body), body) for kind, body in blocks if kind == "python"]
        files = {head[1]: body[head.end() :] for head, body in named if head}
        changes = tuple(Change.of(body) for kind, body in blocks if kind == "diff")
        found[title] = GuideSection(title, part, files, changes)
    return found


def _before_and_after(hunk: str) -> tuple[str, str]:
    lines = hunk.splitlines(keepends=True)
    odd = [line for line in lines if line[:1] not in " +-\n"]
    assert not odd, f"neither kept, added nor taken out: {odd}"
    # An editor may have taken the blank off the end of an empty line that is kept.
    cut = [(line[:1].replace("\n", " "), line[1:] or "\n") for line in lines]
    return "".join(line for sign, line in cut if sign != "+"), "".join(line for sign, line in cut if sign != "-")
