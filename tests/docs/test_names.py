"""Every link, path, module and name of vgyro that a guide mentions is there."""

import importlib
import re
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from guide import sections

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted(
    {
        path.relative_to(ROOT).as_posix()
        for pattern in ("*.md", "*/*.md", "config/**/*.md")
        for path in ROOT.glob(pattern)
    }
)
FOLDERS = ("vgyro", "tests", "docs", "config", "workflow", "benchmarks", "profiles", "requirements")
NAME = re.compile(r"\bvgyro(?:\.[A-Za-z_]\w*)+")
PATH = re.compile(rf"(?<![\w./<>*-])(?:{'|'.join(FOLDERS)})/[\w./*<>{{}},-]*")
FILE = re.compile(r"(?<![\w./*>-])(?:\w+/)*\w+\.(?:py|pyx|smk)\b")
LINK = re.compile(r"\]\(([^)\s]+)\)")
MADE = {"benchmarks/accuracy/.results"}
"""What a command makes."""
NO_MODULES = {"vgyro.methods"}
"""The group of entry points."""


def text_of(page):
    return (ROOT / page).read_text(encoding="utf-8")


def missing_name(name):
    """What of a dotted name is not there; empty if all is."""
    parts = name.split(".")
    for length in range(len(parts), 0, -1):
        module = ".".join(parts[:length])
        try:
            found = importlib.import_module(module)
        except ModuleNotFoundError as error:
            if error.name is None or not module.startswith(error.name):
                raise
            continue
        for part in parts[length:]:
            if not hasattr(found, part):
                return f"{module} has no {part}"
            found = getattr(found, part)
        return ""
    return f"no module {name}"


def missing_paths(text, made=()):
    """Paths below FOLDERS and source files that are mentioned and not there.  made : paths that a guide writes"""
    files = {path.relative_to(ROOT).as_posix() for folder in FOLDERS for path in (ROOT / folder).rglob("*.*")}
    known = {*files, *made, *MADE, "setup.py"}
    wrong = []
    for found in PATH.findall(text):
        path = found.rstrip(".,")
        if not re.search(r"[<>*{}]|\bNAME\b", path) and path not in known and not (ROOT / path).exists():
            wrong.append(path)
    ends = {"/".join(path.split("/")[-depth:]) for path in known for depth in range(1, path.count("/") + 2)}
    return [*wrong, *(file for file in FILE.findall(text) if file not in ends)]


def anchors(text):
    """Names of the headings of a Markdown text, as GitHub makes them."""
    bare = re.sub(r"^```.*?^```$", "", text, flags=re.DOTALL | re.MULTILINE)
    headings = re.findall(r"^#+ (.*)$", bare, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower().replace("&lt;", "").replace("&gt;", "")).replace(" ", "-")
            for heading in headings}  # fmt: skip


def broken_links(page):
    wrong = []
    for target in LINK.findall(text_of(page)):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        file = (ROOT / page).parent / path if path else ROOT / page
        if not file.exists() or (anchor and anchor not in anchors(file.read_text(encoding="utf-8"))):
            wrong.append(target)
    return wrong


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_somewhere(page):
    assert broken_links(page) == []


@pytest.mark.parametrize("page", PAGES)
def test_paths_are_there(page):
    made = {path for section in sections(text_of(page)).values() for path in section.files}
    made |= {"winsor_gyro.py"} if page == "docs/extending.md" else set()
    assert missing_paths(text_of(page), made) == []


@pytest.mark.parametrize("page", PAGES)
def test_names_are_there(page):
    made = {
        path.removesuffix(".py").replace("/", ".") for one in sections(text_of(page)).values() for path in one.files
    }
    names = set(NAME.findall(text_of(page))) - NO_MODULES
    wrong = {name: missing_name(name) for name in names if not any(name.startswith(other) for other in made)}
    assert {name: why for name, why in wrong.items() if why} == {}


def test_what_is_gone_is_seen():
    assert missing_name("vgyro.units.deg_s") == ""
    assert missing_name("vgyro.fusion.motion.models.Motion.dynamics") == ""
    assert missing_name("vgyro.fusion.motion_models.Motion") == "vgyro.fusion has no motion_models"
    assert missing_name("vgyro.units.parsecs") == "vgyro.units has no parsecs"
    gone = "in `vgyro/fusion/motion_models.py`, `vgyro/units.py`, tests/fusion/, of models.py and smoother_choice.py."
    assert missing_paths(gone) == [
        "vgyro/fusion/motion_models.py",
        "vgyro/fusion/motion_models.py",
        "smoother_choice.py",
    ]
    assert missing_paths("config/boards/<board>.yaml and vgyro/engine/native/<domain>.py") == []
    assert anchors("# A new r_t\n\n## Two: words\n```\n# no heading\n```\n") == {"a-new-r_t", "two-words"}
