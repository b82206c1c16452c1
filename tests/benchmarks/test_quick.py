"""The benchmarks run, and their figures hold. Never their times: those depend on the machine."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def contest(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """benchmarks.contest; the package is run from the repository, not installed."""
    monkeypatch.syspath_prepend(str(ROOT))
    from benchmarks import contest

    return contest


def test_a_quick_run_of_all_contests(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "benchmarks", "--quick", "--json", str(tmp_path / "results.json")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    record = json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))
    results = {result["name"]: result for result in record["results"]}
    assert set(results) == {
        "garch", "dcc", "dcc_stderr", "weights", "kalman", "rts", "fusion", "allan", "welch", "decode", "log",
        "log_frames", "log_read", "import",
    }  # fmt: skip
    for result in results.values():
        assert result["accurate"], result
        assert result["accuracy"]
        assert result["seconds"] > 0
        assert all(against["low"] <= against["figure"] <= against["high"] for against in result["against"])
        assert f"| {result['title']} |" in done.stdout
    assert record["threads"] == "1"


def test_an_unknown_contest_is_refused() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks", "--only", "garhc"], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 2
    assert "garch" in done.stderr


def test_verdicts_and_figures(contest: ModuleType) -> None:
    # Times of three rounds are given: ours 1, 2, 1 s, theirs 10, 30, 20 s: ratios 10, 15, 20, differences -9, -28, -19.
    side = contest.Side("x", lambda: None, 1)
    times = [[1.0, 10.0], [2.0, 30.0], [1.0, 20.0]]
    one = contest.Contest("n", "t", "fit", side, (contest.Rival(side, 15.0),), 0.0, list)
    found = contest._against(one, one.rivals[0], times, 1)
    assert (found.figure, found.low, found.high, found.seconds, found.passed) == (15, 10, 20, 20, True)
    assert not contest._against(one, contest.Rival(side, 15.1), times, 1).passed
    assert contest._against(one, contest.Rival(side), times, 1).passed
    excess = contest.Contest("n", "t", "fit", side, (), 0.0, list, difference=True)
    assert contest._against(excess, contest.Rival(side, -19.0), times, 1).passed
    assert not contest._against(excess, contest.Rival(side, -19.1), times, 1).passed
    assert contest.Accuracy("a", 1.0, 1.0).passed
    assert not contest.Accuracy("a", 1.1, 1.0).passed
    assert not contest.Accuracy("a", float("nan"), 1.0).passed
