"""Table of methods: which table a recording gets, how cells read."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vgyro.report.methods import dynamic_table, rest_table
from vgyro.report.model import ArrayPart, DatasetPart
from vgyro.tasks.common import Task
from vgyro.tasks.report import read_dataset_part


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
    assert rest_table(dataset, moving) == ""
    html = dynamic_table(dataset, moving)
    assert "Errors against the reference rate" in html
    assert "IF of 1σ" in html


def test_a_recording_at_rest_has_no_errors(dataset: DatasetPart) -> None:
    array = array_of(dataset, "rest-x")
    assert dynamic_table(dataset, array) == ""
    html = rest_table(dataset, array)
    # The low-pass's own figures, and that the others do not limit the bandwidth.
    assert ">1.05<" in html
    assert "not limited" in html
    # K touches zero: an upper limit, not a figure.
    assert "&lt; 31" in html


def test_a_factor_whose_interval_holds_one_is_grey(dataset: DatasetPart) -> None:
    html = rest_table(dataset, array_of(dataset, "rest-x"))
    assert '<td class="number muted" title="not significant">1.10' in html


def test_one_gyro_has_a_table_without_methods(dataset: DatasetPart) -> None:
    html = rest_table(dataset, array_of(dataset, "rest-z"))
    assert "solo" in html
    assert "Methods" not in html
    assert "Improvement factor" not in html
