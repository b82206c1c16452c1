"""Table of methods: which table a recording gets, how cells read."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from vgyro.report.fusion.methods import dynamic_table, response_table, rest_tables
from vgyro.report.fusion.moved import moved_table
from vgyro.report.model import ArrayPart, DatasetPart
from vgyro.tasks.common import Task
from vgyro.tasks.pages.report import read_dataset_part


@pytest.fixture(scope="module")
def dataset(report_task: Task) -> DatasetPart:
    return read_dataset_part(report_task)


def without(array: ArrayPart, metrics: list[str]) -> ArrayPart:
    """The array with some figures left out."""
    table = array.tables["metrics"]
    kept = ~np.isin(table["metric"], metrics)
    return replace(array, tables={**array.tables, "metrics": {name: column[kept] for name, column in table.items()}})


def array_of(dataset: DatasetPart, anchor: str) -> ArrayPart:
    return next(array for array in dataset.arrays if array.anchor == anchor)


def test_a_recording_in_motion_has_one_table_with_its_factors(dataset: DatasetPart) -> None:
    moving = without(array_of(dataset, "sine-x"), ["sigma"])
    assert rest_tables(dataset, moving) == ""
    html = dynamic_table(dataset, moving)
    assert "Errors against the reference rate" in html
    assert "IF of 1σ" in html


def test_a_recording_at_rest_has_no_errors(dataset: DatasetPart) -> None:
    array = array_of(dataset, "rest-x")
    assert dynamic_table(dataset, array) == ""
    html = rest_tables(dataset, array)
    # K touches zero: an upper limit, not a figure.
    assert "&lt; 31" in html


def test_the_static_figures_are_in_three_tables_and_the_gyros_have_no_factors(dataset: DatasetPart) -> None:
    html = rest_tables(dataset, array_of(dataset, "rest-x"))
    tables = html.split("<table")[1:]
    titles = [re.search("<caption>(?:<[^>]*>)*(.*?) at rest", table).group(1) for table in tables]
    assert titles == ["Improvement", "Accuracy", "Noise coefficients"]
    assert [">g1<" in table for table in tables] == [False, True, True]
    # Figures that no series has make no column: bias_instability and rate_ramp are not in the artefacts.
    assert "Bias instability" not in html


def rows_with(html: str, text: str) -> list[str]:
    """Names of the rows that hold a text."""
    rows = [row for row in html.split("<tr") if text in row]
    return [re.search(r'scope="row"[^>]*>([^<]*)', row).group(1) for row in rows]


def test_what_a_low_pass_lowers_is_marked_where_it_stands_and_is_never_the_best(dataset: DatasetPart) -> None:
    html = rest_tables(dataset, array_of(dataset, "rest-x"))
    improvement, accuracy, _ = html.split("<table")[1:]
    # Raw IF of 1σ in the first table, 1σ and σ(1 s) in the second.
    assert rows_with(improvement, "band-limited") == ["Jiang 2012, random walk"]
    assert improvement.count('<span class="mark">band-limited') == 1
    assert accuracy.count('<span class="mark">band-limited') == 2
    # IF of 1σ is 5.27 with the low-pass; the best is the next, 4.81, as at equal bandwidth.
    best = re.findall(r'<td class="number best"[^>]*>([\d.]+)', improvement)
    assert best == ["5.3", "4.805", "4.805"]
    assert "N is fitted with the filter" in html


def test_what_was_left_out_and_how_a_method_answers(dataset: DatasetPart) -> None:
    html = response_table(dataset, array_of(dataset, "rest-x"))
    # The low-pass's own figures, and that the others do not limit the bandwidth.
    assert ">1.05<" in html
    assert "not limited" in html
    gyro = re.search(r">g1</th>(.*?)</tr>", html, re.S).group(1)
    assert re.findall(r">(\d+)<", gyro) == ["25", "3", "0"]


def test_figures_at_the_added_rate_stand_beside_those_at_rest_and_nowhere_else(dataset: DatasetPart) -> None:
    array = array_of(dataset, "rest-x")
    key = ("dcc_causal", "level")
    assert array.added_rate == 0.05
    assert (array.values()[key]["mean"].value, array.moved_values()[key]["mean"].value) == (0.001, -0.024)
    html = moved_table(dataset, array)
    assert html.count("at 0.05 deg/s</th>") == 4
    row = re.search(r">DCC weights, causal<.*?</tr>", html, re.S).group(0)
    # Mean and bias drift fail by the rule; 1σ is 1.1 times that at rest, N about 1.07 times.
    assert row.count('class="number bad"') == 2
    assert "DCC weights, causal (residual); Recommended: the same at any constant rate" in html
    assert "\u22120.024" not in rest_tables(dataset, array)


def test_a_recording_at_a_constant_rate_shows_its_own_figures(dataset: DatasetPart) -> None:
    array = array_of(dataset, "rest-x")
    table = {**array.tables["metrics"]}
    table["true_rate"] = np.full(len(table["true_rate"]), 30.0)
    turning = replace(array, kind="constant", tables={**array.tables, "metrics": table})
    assert turning.moved_values() == {}
    assert moved_table(dataset, turning) == ""
    assert turning.added_rate == 0
    assert turning.values()["g1", ""]["sigma"].value == 0.05


def test_a_factor_whose_interval_holds_one_is_grey(dataset: DatasetPart) -> None:
    html = rest_tables(dataset, array_of(dataset, "rest-x"))
    assert '<td class="number muted" title="not significant">1.10' in html


def test_one_gyro_has_a_table_without_methods(dataset: DatasetPart) -> None:
    html = rest_tables(dataset, array_of(dataset, "rest-z"))
    assert "solo" in html
    assert "Methods" not in html
    assert "Improvement factor" not in html


def headings(html: str) -> list[str]:
    return [re.sub("<[^>]*>", "", row).strip() for row in re.findall(r"<tr[^>]*heading.*?</tr>", html, re.S)]


def test_methods_stand_under_their_families(dataset: DatasetPart) -> None:
    html = response_table(dataset, array_of(dataset, "rest-x"))
    families = ["Methods of vgyro", "Baselines", "Methods of the papers"]
    assert [text for text in headings(html) if text in families] == families
    names = re.findall(r'scope="row"[^>]*>([^<]*)', html)
    methods = [name.strip() for name in names if name.strip() not in (*array_of(dataset, "rest-x").gyros, *families)]
    assert methods[:3] == ["Recommended", "Average", "Median"]


def test_forms_that_did_not_run_for_one_reason_share_a_row(dataset: DatasetPart) -> None:
    array = array_of(dataset, "rest-x")
    table = {name: np.array(values, dtype=object) for name, values in array.tables["methods"].items()}
    causal = table["method"] == "dcc_causal"
    table["column"][causal], table["note"][causal] = "", "no weights"
    html = response_table(dataset, replace(array, tables={**array.tables, "methods": table}))
    assert html.count("not run: no weights") == 1
    assert html.count("DCC weights, causal<") == 1
    assert "level, residual" in html


def test_what_a_method_costs_and_needs_and_what_was_inferred(dataset: DatasetPart) -> None:
    html = response_table(dataset, array_of(dataset, "rest-x"))
    row = re.search(r">Jiang 2012, random walk<.*?</tr>", html, re.S).group(0)
    # Two digits of 1234; all of them in the hint.
    assert ">1200<" in row
    assert "counted from the equations: 1234" in row
    assert ">causal<" in row
    assert ">H_t<" in row
    assert "inferred: one of &lt;two&gt; equations" in html
    offline = re.search(r">Recommended<.*?</tr>", html, re.S).group(0)
    assert ">offline<" in offline


def test_nees_stands_beside_the_errors(dataset: DatasetPart) -> None:
    array = array_of(dataset, "sine-x")
    assert "NEES" not in dynamic_table(dataset, array)
    table = {name: column.copy() for name, column in array.tables["metrics"].items()}
    (row,) = np.flatnonzero((table["method"] == "recommended") & (table["metric"] == "error_sigma"))
    note = "95.1 % of the samples within ±2 s.d.; bootstrap of blocks of 3 s"
    values = {"metric": "nees", "value": 1.02, "low": 0.97, "high": 1.07, "unit": "1", "note": note}
    longer = {
        name: np.append(column, [values.get(name, column[row])]).astype(column.dtype) for name, column in table.items()
    }
    html = dynamic_table(dataset, replace(array, tables={**array.tables, "metrics": longer}))
    recommended = re.search(r">Recommended<.*?</tr>", html, re.S).group(0)
    assert "1.020" in recommended
    assert "95.1 % of the samples" in recommended
    assert "gives no standard deviation" in re.search(r">Average<.*?</tr>", html, re.S).group(0)
    assert "NEES: mean of (error" in html
