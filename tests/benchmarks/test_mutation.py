"""The mutation run: on a toy module, and whether the committed sample still fits the code."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks.mutation.modules import ROOT, deciding
from benchmarks.mutation.run import Outcome, read_outcomes, run_all, write_outcomes
from benchmarks.mutation.sample import Entry, all_mutants, drawn, read_sample, write_sample
from benchmarks.mutation.selection import Calls, chosen_tests
from benchmarks.mutation.sites import mutants
from benchmarks.mutation.table import as_markdown, interval

MODULE = "vgyro/fusion/toy.py"
TOY = '''"""Numbers like 1 < 2 in a text are no rule."""

LIMIT = 3.0


def far(size: float) -> bool:
    """Whether 5 is far."""
    return size > LIMIT


def untold(size):
    if size < 7:
        return "small"
    return f"{size + 1}"
'''
TESTS = """
import sys

import pytest
from vgyro.fusion.toy import far, untold


@pytest.mark.parametrize(("size", "expected"), [(4.0, True), (2.9, False)])
def test_far(size, expected):
    assert far(size) is expected


def test_that_ends_the_tracing():
    sys.settrace(None)


def test_untold():
    assert untold(1) == "small"
"""


@pytest.fixture
def toy(tmp_path: Path) -> Path:
    """A repository of one deciding module and its tests."""
    files = {MODULE: TOY, "vgyro/__init__.py": "", "vgyro/fusion/__init__.py": "", "tests/test_toy.py": TESTS}
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    subprocess.run(["git", "init", "-q"], cwd=tmp_path, check=True)
    return tmp_path


def test_sites_of_the_toy() -> None:
    # By hand: LIMIT in four ways, > in two, the value returned in two; 7 in four, < in two, if in two.
    found = mutants(MODULE, TOY)
    changes = [(one.function, one.kind, one.change) for one in found]
    assert changes == [
        *(("", "named", f"3.0 → {word}") for word in ("×2", "×0.5", "+1", "0")),
        ("far", "returned", "return → True"),
        ("far", "returned", "return → False"),
        ("far", "comparison", "> → >="),
        ("far", "comparison", "> → <"),
        ("untold", "condition", "if → True"),
        ("untold", "condition", "if → False"),
        ("untold", "comparison", "< → <="),
        ("untold", "comparison", "< → >"),
        *(("untold", "constant", f"7 → {word}") for word in ("×2", "×0.5", "+1", "0")),
    ]
    assert "    return (size >= LIMIT)\n" in found[6].applied(TOY)
    assert found[6].applied(TOY).replace("(size >= LIMIT)", "size > LIMIT") == TOY


def test_a_mutant_is_killed_and_a_survivor_is_reported(toy: Path) -> None:
    # By hand: 3.0 → 6.0, and every call of `far` forced, are seen by the tests at 4.0 and 2.9; >= and 7 → 8 are not.
    (toy / "calls").mkdir()
    subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "benchmarks.mutation.recorder",
         "--calls-to", "calls/all.json", "tests"],
        cwd=toy, env=os.environ | {"PYTHONPATH": f"{toy}{os.pathsep}{ROOT}"}, check=True, capture_output=True,
    )  # fmt: skip
    calls = Calls.read(toy / "calls")
    assert calls.functions["tests/test_toy.py::test_untold"] == {f"{MODULE}::untold"}
    wanted = [
        ("", "3.0 → ×2"), ("far", "> → >="), ("far", "return → True"), ("untold", "7 → +1"), ("untold", "if → False"),
    ]  # fmt: skip
    by_name = {(one.function, one.change): one for one in all_mutants(toy)}
    entries = [Entry(number, by_name[name].name) for number, name in enumerate(wanted, 1)]
    outcomes: dict[int, Outcome] = {}
    tests = {one.mutant: chosen_tests(by_name[wanted[one.mutant - 1]], calls, toy, 60.0) for one in entries}
    assert [test.split("::")[1][:8] for test in tests[1]] == ["test_far", "test_far"]
    assert tests[4] == ["tests/test_toy.py::test_untold"]
    work = [(one.mutant, by_name[wanted[one.mutant - 1]], tests[one.mutant], 1.0) for one in entries]
    run_all(toy, work, 1, lambda one: outcomes.update({one.mutant: one}))
    assert [outcomes[number].how for number in range(1, 6)] == ["killed", "survived", "killed", "survived", "killed"]
    assert outcomes[5].by == "tests/test_toy.py::test_untold"
    assert (toy / MODULE).read_text(encoding="utf-8") == TOY
    text = as_markdown([*entries[:3], Entry(4, entries[3].name, "the toy says so"), entries[4]], outcomes)
    assert "| all | 3 | 4 | 75 % |" in text
    assert "| 2 | vgyro/fusion/toy.py | far | > → >= | `return size > LIMIT` | 2 |" in text
    assert "7 → +1" not in text
    assert "1 of 5 are equivalent" in text
    write_outcomes(toy / "outcomes.jsonl", outcomes.values())
    assert read_outcomes(toy / "outcomes.jsonl") == outcomes


def test_a_mutant_that_does_not_end_is_killed(toy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("benchmarks.mutation.run.START_S", 2.0)
    source = "def wait(steps):\n    while steps:\n        steps = steps - 1\n"
    (toy / MODULE).write_text(source, encoding="utf-8")
    (toy / "tests/test_toy.py").write_text(
        "from vgyro.fusion.toy import wait\n\n\ndef test_wait():\n    wait(3)\n", encoding="utf-8"
    )
    endless = next(one for one in mutants(MODULE, source) if one.change == "- → +")
    found: list[Outcome] = []
    run_all(toy, [(1, endless, ["tests/test_toy.py::test_wait"], 0.1)], 1, found.append)
    assert [one.how for one in found] == ["timeout"]
    assert found[0].killed


def test_interval_of_a_share() -> None:
    # Expected: Clopper & Pearson's closed forms of all and of none, 1 - 0.025^(1/n), and scipy's for the rest.
    from scipy.stats import binomtest

    assert interval(0, 10) == pytest.approx((0.0, 1 - 0.025**0.1))
    assert interval(10, 10) == pytest.approx((0.025**0.1, 1.0))
    assert interval(170, 200) == pytest.approx(tuple(binomtest(170, 200).proportion_ci(method="exact")), rel=1e-9)


def test_a_sample_outlives_a_moved_line(tmp_path: Path) -> None:
    # By hand: two lines above change no name; an edited line is lost, and another of its kind takes its number.
    shares = {"comparison": 2, "named": 1}
    before = drawn(mutants(MODULE, TOY), shares=shares)
    assert [one.mutant for one in before] == [1, 2, 3]
    write_sample(before, tmp_path / "sample.csv")
    assert read_sample(tmp_path / "sample.csv") == before
    moved = mutants(MODULE, TOY.replace("LIMIT = 3.0\n", "FIRST = None\n\nLIMIT = 3.0\n"))
    assert drawn(moved, before) == before
    edited = mutants(MODULE, TOY.replace("LIMIT = 3.0", "LIMIT = 4.0"))
    after = drawn(edited, before)
    changed = [(old, new) for old, new in zip(before, after, strict=True) if old != new]
    assert [(old.mutant, old.name[2]) for old, _ in changed] == [(new.mutant, "named") for _, new in changed]
    assert len(changed) == 1


def test_every_site_of_the_sample_is_in_the_code() -> None:
    known = {one.name for one in all_mutants(ROOT)}
    lost = [one.mutant for one in read_sample() if one.name not in known]
    assert not lost, f"mutants {lost} are no longer in the code: python -m benchmarks.mutation sample"
    assert {one.name[0] for one in read_sample()} <= set(deciding(ROOT))
    assert len(read_sample()) == 200
