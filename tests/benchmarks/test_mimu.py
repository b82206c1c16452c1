"""The benchmark on real captures: its arithmetic, and ours against the best row on a small part of the captures."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from benchmarks import mimu
from vgyro.fusion.registry import select

WANTED = mimu.WITHIN
"""The better of ours over the best other row, in every column."""
ROWS = ("average", "inverse_variance_arw", "waegli_guerrier", "parity_weights", "recommended_unsmoothed", "recommended")


@pytest.fixture
def captures(shared_data: Path) -> Path:
    """The folder of the captures; the test skips where it is absent."""
    folder = shared_data / "mimu4444-array"
    if not folder.is_dir():
        pytest.skip(f"no captures at {folder}; set VGYRO_SHARED_DATA")
    return folder


def test_without_captures_it_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("VGYRO_SHARED_DATA", str(tmp_path))
    assert mimu.main([]) == mimu.ABSENT
    said = capsys.readouterr().err
    assert str(tmp_path) in said
    assert "VGYRO_SHARED_DATA" in said


def test_own_noise_and_errors_of_a_prediction() -> None:
    # Eight gyros of known noise, one with a scale and an alignment error: both are regressed away.
    rng, samples = np.random.default_rng(7), 200_000
    deviations = np.linspace(0.1, 0.8, 8)
    motion, others = 20.0 * rng.standard_normal(samples), 20.0 * rng.standard_normal((samples, 2))
    gyros = motion[:, None] + deviations * rng.standard_normal((samples, 8))
    gyros[:, 2] += 0.02 * motion + others @ [0.01, -0.03]
    own = mimu.own_noise(gyros, others)
    np.testing.assert_allclose(own, deviations**2, rtol=0.03, atol=1e-3)
    mean = np.delete(gyros, 2, axis=1).mean(axis=1)
    left = mimu.unexplained(gyros[:, [2]], mean, others)
    expected = 1.02**2 * float(np.sum(np.delete(deviations, 2) ** 2)) / 49.0
    assert float(np.mean(left**2)) - own[2] == pytest.approx(expected, rel=0.05)


def test_scatter_is_about_the_mean_of_each_piece() -> None:
    pieces = [np.tile([1.0, 3.0], 125), np.tile([9.0, 11.0], 125)]
    assert mimu.scatter(pieces, 0.0) == pytest.approx(500.0 / 498.0)
    assert mimu.scatter(pieces, 1.0) == pytest.approx(0.0)


def test_ratios_rank_and_tables() -> None:
    column = mimu.Column({"average": [4.0, 16.0], "median": [16.0, 16.0], "recommended": [4.0, 4.0], "half": [1.0]})
    column.filters.add("recommended")
    column.cases["recommended_unsmoothed"] = [9.0, 1.0]
    value, low, high = mimu.ratio([column], "recommended")
    assert value == pytest.approx(math.sqrt(0.5))
    assert low < value < high
    assert math.isnan(mimu.ratio([column], "half")[0])
    assert mimu.ours_over_best(column, True)[:2] == ("recommended", "average")
    assert mimu.ours_over_best(column, False) == ("recommended_unsmoothed", "average", pytest.approx(math.sqrt(0.5)))
    text = mimu.tables({("turns", "x"): column})
    assert "| half | – |" in text
    assert "| turns x | 0.632 (recommended / average) |" in text


def test_at_rest_ours_is_within_three_percent_of_the_best(captures: Path) -> None:
    columns = mimu.measured(captures, ["x"], ["exp_1"], ["rest"], select(ROWS))
    for one in columns.values():
        assert mimu.ours_over_best(one, True)[2] <= WANTED
    assert mimu.ours_over_best(columns["rest", "x"], False)[2] <= WANTED


@pytest.mark.parametrize(("part", "axis"), [("turns", "z"), ("hand", "x")])
def test_in_motion_ours_is_within_three_percent_of_the_best(captures: Path, part: str, axis: str) -> None:
    column = mimu.Column()
    mimu.in_motion(mimu.capture(captures, "exp_1"), axis, part, select(ROWS), column)
    assert set(column.cases) == set(ROWS)
    assert mimu.ours_over_best(column, True)[2] <= WANTED
