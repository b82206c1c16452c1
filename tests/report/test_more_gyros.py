"""How many more gyros would help: where it stands, what it says."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from vgyro.fusion import ArrayNoise, FilterParameters
from vgyro.more_gyros import MeanCorrelation, analyse
from vgyro.report.fusion.more_gyros import TITLE, more_gyros_part, sentence
from vgyro.report.model import ArrayPart, DatasetPart
from vgyro.tasks.common import Task
from vgyro.tasks.pages.report import read_dataset_part


@pytest.fixture(scope="module")
def dataset(report_task: Task) -> DatasetPart:
    return read_dataset_part(report_task)


def array_of(dataset: DatasetPart, anchor: str) -> ArrayPart:
    return next(array for array in dataset.arrays if array.anchor == anchor)


def summary(gyros: int, value: float, low: float, high: float) -> dict[str, Any]:
    noise = ArrayNoise(np.full(gyros, 0.1), np.full(gyros, 1e-3), np.eye(gyros))
    return analyse(noise, MeanCorrelation(value, low, high), FilterParameters(), 8).summary


def test_only_where_the_noise_was_taken_and_of_more_than_one_gyro(dataset: DatasetPart) -> None:
    assert TITLE in more_gyros_part(dataset, array_of(dataset, "rest-x"))
    assert more_gyros_part(dataset, array_of(dataset, "sine-x")) == ""
    assert more_gyros_part(dataset, array_of(dataset, "rest-z")) == ""


def test_plot_and_table(dataset: DatasetPart) -> None:
    html = more_gyros_part(dataset, array_of(dataset, "rest-x"))
    shown = re.findall(r'data-series="([^"]+)"', html)
    assert shown == ["measured", "ρ = 0", "ρ = 0.1", "ρ = 0.3", "ρ = 0.5", "this array"]
    # g4 is three times as noisy: the array's own weights leave it out, which lies above the curve of alike gyros.
    assert "not told from none" in html
    # Expected: √10 and more is out of reach at ρ = 0.1 only; for the measured one, near 0, a factor of 2 needs 4 gyros.
    cells = re.findall(r"<td[^>]*>(.*?)</td>", html, re.S)
    assert "4" in cells[0]


def test_sentence_of_a_positive_correlation() -> None:
    # Expected: √(6/1.1) = 2.3355, √(12/1.22) = 3.1363, 1/√0.02 = 7.07; for ρ = 0.025 and 0.015 √(6/1.125) = 2.3094 and
    # √(6/1.075) = 2.3625, √(12/1.275) = 3.0679. The array's own matrix is without correlation: √6 = 2.449.
    text = sentence(summary(6, 0.02, 0.015, 0.025))
    assert text.startswith("6 gyros with ρ = 0.0200 (0.0150 … 0.0250) give 2.335 (2.309 … 2.362) over one of them")
    assert "This array itself, weighted by its own covariance, has 2.45. With" in text
    assert "12 would give 3.136 (3.068 … 3.2" in text
    assert "adds less than 1" in text
    assert "no number of them gives more than 7.07 (6.32 … 8.16)" in text


def test_sentence_of_a_negative_correlation() -> None:
    text = sentence(summary(4, -0.2, -0.22, -0.18))
    assert "8 cannot all have so negative a correlation" in text
    assert "no more than 5 gyros can have" in text
    assert "from 50 gyros on" in text
    assert "none, from 50 gyros on" in sentence(summary(4, -0.01, -0.05, 0.03))


def test_limits_beyond_what_so_many_gyros_can_have() -> None:
    # Expected: at the lower limit, -0.2, six gyros have no bound: their noise could vanish.
    text = sentence(summary(6, 0.1, -0.2, 0.4))
    assert "… ∞)" in text


def test_without_a_correlation(dataset: DatasetPart) -> None:
    assert "not known" in sentence({"gyros": 6, "correlation": None})
    array = array_of(dataset, "rest-x")
    rows = ~np.isin(
        array.tables["more_gyros"]["correlation"],
        dataset.sources["rest/x/more_gyros.parquet"]["summary"]["correlation"],
    )
    table = {name: column[rows] for name, column in array.tables["more_gyros"].items()}
    source = {"summary": {"gyros": 4, "correlation": None, "present_factor": None, "little": 0.01}}
    html = more_gyros_part(
        replace(dataset, sources={"rest/x/more_gyros.parquet": source}),
        replace(array, tables={**array.tables, "more_gyros": table}),
    )
    assert "not known" in html
    assert "this array" not in re.findall(r'data-series="([^"]+)"', html)
