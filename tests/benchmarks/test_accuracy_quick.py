"""A quick run of the accuracy benchmark keeps within the bounds of every line; what it writes can be read."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.accuracy import bounds
from benchmarks.accuracy.markdown import document
from benchmarks.accuracy.page import page
from benchmarks.accuracy.plan import Task, tasks
from benchmarks.accuracy.results import read, run_all
from benchmarks.accuracy.run import score, score_variants
from benchmarks.accuracy.scenario import load, names
from benchmarks.accuracy.summary import summarised
from vgyro.fusion import METHODS, ArrayRates, FilterParameters, Fused, Method

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.timeout(1800)
def test_a_quick_run_keeps_within_its_bounds(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "benchmarks.accuracy", "--quick", "--processes", "1", "--out", str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, "\n".join(done.stderr.splitlines()[-40:])
    rows = read(tmp_path / "quick" / "results.parquet")
    assert {row["scenario"] for row in rows} == set(names())
    assert "SIMULATED" in (tmp_path / "quick" / "accuracy.html").read_text(encoding="utf-8")
    assert "**simulated**" in (tmp_path / "quick" / "accuracy.md").read_text(encoding="utf-8")


def test_every_line_has_bounds() -> None:
    wanted = {name if part == "motion" else f"{name}, at rest" for name in names() for part in load(name).score}
    known = bounds.read()
    assert set(known) == wanted
    for bound in known.values():
        assert set(bound) == {"recommended", "recommended_unsmoothed", "nees", "faults"}
        assert set(bound["faults"]) == set(bounds.FAULTS)


def small(name: str, methods: tuple[str, ...], variants: tuple[tuple[str, ...], ...] = ((),)) -> Task:
    return Task(load(name).shorter(40.0, 60.0), (1,), methods, variants)


def test_a_run_is_taken_up_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    chosen = [small("plain", ("average", "median")), small("stuck", ("average", "median"))]
    rows = run_all(chosen, tmp_path, 1)
    assert [(row["scenario"], row["method"]) for row in rows] == [
        ("plain", "average"), ("plain", "median"), ("stuck", "average"), ("stuck", "median"),
    ]  # fmt: skip
    monkeypatch.setattr("benchmarks.accuracy.results.score_variants", None)
    assert [row["sd"] for row in run_all(chosen, tmp_path, 1)] == [row["sd"] for row in rows]
    with pytest.raises(TypeError):
        run_all([small("plain", ("average",))], tmp_path, 1)


def test_pages_of_a_small_run(tmp_path: Path) -> None:
    lines = summarised(run_all([small("plain", ("average", "median", "recommended_unsmoothed"))], tmp_path, 1))
    text, html = document(lines), page(lines)
    for method in ("average", "median", "recommended_unsmoothed"):
        assert method in text
        assert f"<th>{method}</th>" in html


def test_the_average_is_as_good_as_itself() -> None:
    [row] = score(load("gaps").shorter(40.0, 60.0), 1, ["average"])
    assert row["sd"] == pytest.approx(row["average_sd"])
    assert row["oracle_sd"] < row["average_sd"] < row["best_gyro_sd"]


def test_parts_are_left_out() -> None:
    rows = score_variants(
        load("stuck").shorter(100.0, 200.0), 1, ["recommended_unsmoothed"], [frozenset(), frozenset({"faults"})]
    )
    usual, without = rows
    assert (usual["without"], without["without"]) == ("", "faults")
    assert "faults left out" in usual["note"]
    assert "faults left out" not in without["note"]


def test_a_method_that_fails_is_a_row_that_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(_: ArrayRates, __: FilterParameters) -> Fused:
        raise np.linalg.LinAlgError("singular")

    def mine(array: ArrayRates, _: FilterParameters) -> Fused:
        return Fused.undelayed(array.rate[:, 0].copy())

    monkeypatch.setitem(METHODS, "broken", Method("broken", "", "", True, (), broken))
    monkeypatch.setitem(METHODS, "mine", Method("mine", "", "", True, (), mine))
    rows = score(load("plain").shorter(40.0, 60.0), 1, ["broken", "mine"])
    assert [row["state"] for row in rows] == ["failed", "ran"]
    assert "LinAlgError: singular" in rows[0]["note"]
    assert rows[1]["sd"] > 0


def test_a_quick_task_is_short_and_the_digest_knows_its_scenario() -> None:
    quick, usual = tasks(["plain"], quick=True)[0], tasks(["plain"])[0]
    assert (quick.scenario.motion_s, quick.seeds, usual.seeds) == (180.0, (7,), tuple(range(1, 9)))
    assert quick.digest != usual.digest
    assert usual.digest == tasks(["plain"])[0].digest
