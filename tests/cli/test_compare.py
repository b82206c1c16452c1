"""vgyro compare: figures made by hand, so that each verdict is known beforehand."""

import json

import pytest

from vgyro.storage.tables import Provenance, write_table

NAN = float("nan")
ROWS = {  # metric: (value, low, high)
    "arw": (6.0, 5.5, 6.5),
    "mean": (0.01, -0.02, 0.04),
    "delay": (0.03, NAN, NAN),
    "rrw": (NAN, NAN, NAN),
}


def write(path, rows, unit="deg/√h", recording="rest", rates=None):
    columns = {
        "recording": [recording] * len(rows),
        "axis": ["z"] * len(rows),
        "method": ["average"] * len(rows),
        "definition": [""] * len(rows),
        "metric": list(rows),
        "value": [row[0] for row in rows.values()],
        "low": [row[1] for row in rows.values()],
        "high": [row[2] for row in rows.values()],
        "unit": [unit] * len(rows),
        "note": [""] * len(rows),
    }
    if rates is not None:
        columns["true_rate"] = rates
    write_table(path, columns, "metrics", Provenance({}, "", ""))
    return path


@pytest.fixture
def pair(tmp_path):
    """Two runs of the same figures; the second is written by the test."""
    a = write(tmp_path / "a/rest/z/metrics.parquet", ROWS)
    return a, tmp_path / "b/rest/z/metrics.parquet"


def test_a_run_equals_itself(pair, vgyro):
    outcome = vgyro("compare", pair[0], pair[0])
    assert outcome == (0, "4 figures: 4 same\n", "")


def test_each_change_has_its_verdict(pair, vgyro):
    a, b = pair
    write(b, {"arw": (6.3, 5.8, 6.8), "mean": (0.08, 0.05, 0.11), "delay": (0.03, NAN, NAN), "sigma": (1.0, NAN, NAN)})
    outcome = vgyro("compare", a.parents[2], b.parents[2])
    assert outcome.code == 1
    assert outcome.out.splitlines() == [
        "rest z average arw: 6 → 6.3 deg/√h (+4.76%), within the intervals",
        "rest z average mean: 0.01 → 0.08 deg/√h (+87.50%), beyond the intervals",
        "rest z average rrw: – → – deg/√h, only in A",
        "rest z average sigma: – → 1 deg/√h, only in B",
        "5 figures: 1 same, 1 within the intervals, 1 beyond the intervals, 1 only in A, 1 only in B",
    ]


def test_only_what_is_beyond_the_intervals_may_count(pair, vgyro):
    a, b = pair
    write(b, {**ROWS, "arw": (6.3, 5.8, 6.8)})
    assert vgyro("compare", a, b).code == 1
    outcome = vgyro("compare", a, b, "--significant")
    assert outcome == (0, "4 figures: 3 same, 1 within the intervals\n", "")


def test_without_an_interval_any_change_counts(pair, vgyro):
    a, b = pair
    write(b, {**ROWS, "delay": (0.031, NAN, NAN)})
    assert vgyro("compare", a, b, "--significant").code == 1


def test_the_tolerance_is_relative_to_the_larger_figure(pair, vgyro):
    a, b = pair
    write(b, {**ROWS, "arw": (6.0 * (1 + 1e-6), 5.5, 6.5)})
    assert vgyro("compare", a, b).code == 1
    assert vgyro("compare", a, b, "--tolerance", "1e-5").code == 0
    assert vgyro("compare", a, b, "--tolerance", "5e-7").code == 1


def test_a_figure_that_became_undefined_counts(pair, vgyro):
    a, b = pair
    write(b, {**ROWS, "arw": (NAN, NAN, NAN)})
    outcome = vgyro("compare", a, b, "--significant")
    assert outcome.code == 1
    assert outcome.out.startswith("rest z average arw: 6 → – deg/√h, beyond the intervals\n")


def test_another_unit_counts_even_with_the_same_number(pair, vgyro):
    a, b = pair
    write(b, ROWS, unit="deg/h")
    assert vgyro("compare", a, b).code == 1


def test_data_sets_are_told_apart_by_their_folders(tmp_path, vgyro):
    for run, value in (("a", 6.0), ("b", 7.0)):
        write(tmp_path / run / "one/rest/z/metrics.parquet", {"arw": (6.0, NAN, NAN)})
        write(tmp_path / run / "two/rest/z/metrics.parquet", {"arw": (value, NAN, NAN)})
    outcome = vgyro("compare", tmp_path / "a", tmp_path / "b")
    assert outcome.out.splitlines()[0].startswith("two rest z average arw: 6 → 7")


def test_figures_at_another_rate_are_figures_of_their_own(tmp_path, vgyro):
    for run, rate in (("a", 0.05), ("b", 0.1)):
        write(tmp_path / run / "metrics.parquet", {"arw": (6.0, NAN, NAN), "mean": (0.1, NAN, NAN)}, rates=[0.0, rate])
    lines = vgyro("compare", tmp_path / "a/metrics.parquet", tmp_path / "b/metrics.parquet").out.splitlines()
    assert lines[0].startswith("rest z average mean at 0.05 deg/s: 0.1 → –")
    assert lines[-1] == "3 figures: 1 same, 1 only in A, 1 only in B"


def test_json_holds_every_figure(pair, vgyro):
    a, b = pair
    write(b, {**ROWS, "arw": (6.3, 5.8, 6.8)})
    record = json.loads(vgyro("compare", a, b, "--json").out)
    assert record["differs"] is True
    first = record["figures"][0]
    assert first["figure"] == "rest z average arw"
    assert first["difference"] == pytest.approx(0.3)
    assert first["relative"] == pytest.approx(0.3 / 6.3)
    assert record["figures"][3] == {
        "figure": "rest z average rrw",
        "a": None,
        "b": None,
        "difference": None,
        "relative": None,
        "unit": "deg/√h",
        "verdict": "same",
    }


def test_a_place_without_figures_is_refused(tmp_path, pair, vgyro):
    outcome = vgyro("compare", tmp_path / "nowhere", pair[0])
    assert outcome.code == 4
    assert outcome.err.startswith(f"vgyro: {tmp_path}/nowhere: no such file or folder.")
    (tmp_path / "empty").mkdir()
    assert "no metrics.parquet in it" in vgyro("compare", pair[0], tmp_path / "empty").err


def test_another_table_is_refused(tmp_path, pair, vgyro):
    other = tmp_path / "allan.parquet"
    write_table(other, {"series": ["g1"], "tau": [1.0]}, "allan", Provenance({}, "", ""))
    assert vgyro("compare", other, pair[0]).code == 4
