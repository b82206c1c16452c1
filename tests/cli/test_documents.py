"""Documents that are written from the code may not drift away from it."""

import re

import pytest

from vgyro.cli.documents import DOCUMENTS, write_documents
from vgyro.cli.entry import COMMANDS
from vgyro.storage.schemas import SCHEMAS


@pytest.mark.parametrize("name", DOCUMENTS)
def test_a_document_is_what_the_code_says(root, name):
    assert (root / name).read_text() == DOCUMENTS[name](), "run python -m vgyro.cli.documents"


def test_documents_are_written_where_they_belong(tmp_path):
    write_documents(tmp_path)
    assert sorted(path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*.*")) == sorted(DOCUMENTS)


def test_every_column_is_in_the_formats_guide():
    text = DOCUMENTS["docs/file-formats.md"]()
    for schema in SCHEMAS.values():
        section = text.split(f"## {schema.name}, version {schema.version}\n")[1].split("\n## ")[0]
        for column in schema.columns:
            assert f"| `{column.name}` | {column.unit} |" in section


def test_links_between_documents_lead_somewhere(root):
    pages = [root / "README.md", *(root / "docs").glob("*.md"), root / "config/examples/README.md"]
    broken = []
    for page in pages:
        for target in re.findall(r"\]\(([^)#:]+)", page.read_text()):
            if not (page.parent / target).exists() and not target.endswith(".png"):
                broken.append(f"{page.name}: {target}")
    assert broken == []


def test_the_commands_named_in_the_guides_exist(root):
    named = set()
    for page in [root / "README.md", *(root / "docs").glob("*.md"), *root.glob("*/README.md")]:
        named |= set(re.findall(r"(?:^|\s|`)vgyro ([a-z][a-z-]+)", page.read_text()))
    assert named & set(COMMANDS) == set(COMMANDS)
    assert {word for word in named if "-" in word} <= set(COMMANDS)
