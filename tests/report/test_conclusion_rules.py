"""Rules of the conclusions that a function shows by itself."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from vgyro.report.conclusions.crosscheck import _row
from vgyro.report.conclusions.section import _above, _unfitted, main_arrays


@pytest.mark.parametrize(
    ("passed", "difference", "verdict"),
    [
        (True, 0.1, "passed"), (True, 2.0, "passed: theirs is worse"), (True, math.nan, "passed"),
        (False, 2.0, "FAILED"), (False, math.nan, "FAILED: one side has no figure"),
    ],
)  # fmt: skip
def test_verdict_of_a_comparison(passed: bool, difference: float, verdict: str) -> None:
    row = {"check": "c", "against": "a", "window": 3, "series": "g1", "ours": 1.0, "theirs": 1.0, "unit": "1",
           "difference": difference, "tolerance": 1.0, "passed": passed}  # fmt: skip
    found = _row(row)
    assert found.cells[-1].text == verdict
    assert found.tone == ("" if passed else "bad")


def part(recording: str, axis: str) -> SimpleNamespace:
    return SimpleNamespace(recording=recording, axis=axis)


def test_one_array_an_axis() -> None:
    # Rule: static before thermal before free, one in which the board moved as free; the longest of its kind.
    kinds = {
        "short": ("static", None, 60.0), "long": ("static", None, 600.0), "moved": ("static", "moved", 6000.0),
        "warm": ("thermal", None, 9000.0), "walk": ("free", None, 1e5), "turn": ("sinusoid", None, 1e6),
    }  # fmt: skip
    records = {
        name: SimpleNamespace(kind=kind, moved=moved, integrity={"duration_s": seconds})
        for name, (kind, moved, seconds) in kinds.items()
    }

    def main(*arrays: SimpleNamespace) -> list[tuple[str, str]]:
        dataset = SimpleNamespace(
            arrays=list(arrays), recording=records.__getitem__, board=SimpleNamespace(axes=["x", "y", "z"])
        )
        return [(one.recording, one.axis) for one in main_arrays(dataset)]

    every = [part(name, axis) for axis in "zx" for name in records]
    assert main(*every) == [("long", "x"), ("long", "z")]
    assert main(part("walk", "z"), part("warm", "z"), part("moved", "x"), part("turn", "y")) == [
        ("moved", "x"),
        ("warm", "z"),
    ]
    assert main(part("moved", "x"), part("walk", "x")) == [("walk", "x")]


@pytest.mark.parametrize(("low", "bad"), [(2.9, False), (3.1, True)])
def test_a_gyro_is_bad_with_its_whole_interval(low: float, bad: bool) -> None:
    known = {"g1": (1.0, 0.9), "g2": (1.0, 0.9), "g3": (5.0, low)}
    array = SimpleNamespace(axis="z", recording="r")
    assert [one.gyro for one in _above(array, "1σ", 3.0, known)] == (["g3"] if bad else [])
    assert _above(array, "1σ", 3.0, dict.fromkeys(known, (0.0, 0.0))) == []


@pytest.mark.parametrize(("lost", "said"), [(2, False), (3, True)])
def test_windows_without_a_model(lost: int, said: bool) -> None:
    # Rule: more than one window in a hundred, by the definition where it is worst; none of no window.
    def garch(windows: int, statuses: dict[str, int]) -> SimpleNamespace:
        return SimpleNamespace(garch=[SimpleNamespace(gyro="g1", windows=windows, statuses=statuses)])

    array = SimpleNamespace(
        recording="r", axis="z", anchor="r-z",
        volatility={"level": garch(200, {"failed": lost}), "residual": garch(0, {}), "difference": garch(9, {})},
    )  # fmt: skip
    found = _unfitted(array)
    assert bool(found) == said
    if said:
        assert "g1 1.5\u2009% of the windows, mostly failed (definition level)" in found[0].text
