"""docs/extending.md is followed to the letter, section by section, each in its own copy of the repository."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from guide import Change, DoesNotFit, sections

from vgyro.board import parse_board

ROOT = Path(__file__).resolve().parents[2]
GUIDE = sections((ROOT / "docs/extending.md").read_text(encoding="utf-8"))
FOLLOWED = [title for title, section in GUIDE.items() if section.changes]
METHODS = "tests/fusion/test_methods.py"
BESIDE = {
    "A new family of logs": ["tests/storage/logs/test_families.py", "tests/cli/test_documents.py"],
    "A new fusion method": [
        f"{METHODS}::test_the_guide_names_every_method",
        f"{METHODS}::test_what_a_method_needs[trimmed_mean]",
        "tests/cli/test_documents.py",
    ],
    "A new model of the motion": ["tests/fusion/motion/test_spectrum.py"],
    "A new definition of r_t": ["tests/volatility/test_series.py"],
}
"""Tests that are there already and look at everything that is entered; run once after each section."""
COPIED = ("vgyro", "tests", "config", "docs", "workflow", "Snakefile", "pyproject.toml", "README.md")
NOT_COPIED = shutil.ignore_patterns("__pycache__", "*.png", "cases")


def run(folder, *arguments):
    """A program that sees the copy and not this repository."""
    environment = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(
        [sys.executable, *arguments], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    return done.returncode, done.stdout + done.stderr


@pytest.fixture
def copy(tmp_path):
    """The repository, without what no section touches."""
    for name in COPIED:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, tmp_path / name, ignore=NOT_COPIED)
        else:
            shutil.copy(ROOT / name, tmp_path / name)
    return tmp_path


def test_every_usual_wish_has_a_section():
    assert FOLLOWED == [
        "A new family of logs",
        "A new fusion method",
        "A new model of the motion",
        "A new course of the biases",
        "A new figure",
        "A new rule of the conclusions",
        "A new definition of r_t",
    ]
    for title in FOLLOWED:
        assert GUIDE[title].test.startswith("tests/"), title


@pytest.mark.parametrize("title", FOLLOWED)
def test_a_section_works_as_it_is_printed(copy, title):
    section = GUIDE[title]
    section.follow(copy)
    code, said = run(copy, "-m", "vgyro.cli.documents")
    assert code == 0, said
    tests = [section.test, *BESIDE.get(title, [])]
    code, said = run(copy, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", *tests)
    assert code == 0, said
    assert re.search(r"^\d+ passed", said, re.MULTILINE), said
    style = ["check", "--quiet", *section.files, *(change.path for change in section.changes)]
    code, said = run(copy, "-m", "ruff", "--config", str(ROOT / "pyproject.toml"), *style)
    assert code == 0, said


def test_the_documents_follow(copy):
    """What the guide says comes by itself: names in the guides that are written from the code."""
    for title in ("A new fusion method", "A new figure", "A new model of the motion", "A new family of logs"):
        GUIDE[title].follow(copy)
    code, said = run(copy, "-m", "vgyro.cli.documents")
    assert code == 0, said
    formats, keys = ((copy / "docs" / name).read_text() for name in ("file-formats.md", "configuration.md"))
    assert "| `trimmed_mean` | Trimmed mean |" in formats
    assert "| `neighbours` | Correlation of neighbours | 1 |" in formats
    assert "random_walk, acceleration, jerk, oscillator, markov, singer" in keys
    assert "numpy, matlab, arrow" in keys


def test_the_board_is_complete():
    (text,) = re.findall(r"```yaml\n(.*?)```", GUIDE["A new board"].text, re.DOTALL)
    board = parse_board(text, "two-gyros")
    assert [(gyro.name, gyro.axis) for gyro in board.gyros] == [("g1", "z"), ("g2", "z")]


def test_a_change_that_no_longer_fits_is_seen(tmp_path):
    (tmp_path / "a.py").write_text("one\ntwo\nthree\n")
    Change.of("--- a.py\n@@\n one\n-two\n+2\n@@\n three\n+four\n").make(tmp_path)
    assert (tmp_path / "a.py").read_text() == "one\n2\nthree\nfour\n"
    for gone in (" one\n-two\n+2\n", " o\n"):
        with pytest.raises(DoesNotFit, match=r"a\.py has this 0 times"):
            Change.of(f"--- a.py\n@@\n{gone}").make(tmp_path)
