"""Plots and tables of the noise: estimators apart, tones with those that share them, pairs of gyros."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from vgyro.report.conclusions.section import bad_gyros
from vgyro.report.fusion.noise import MOST_PAIRS, PAIRS_SHOWN, allan_plot, cross_allan_plot, spectrum_plot, tones_table
from vgyro.report.model import ArrayPart, DatasetPart, Table
from vgyro.tasks.common import Task
from vgyro.tasks.pages.report import read_dataset_part


@pytest.fixture(scope="module")
def dataset(report_task: Task) -> DatasetPart:
    return read_dataset_part(report_task)


@pytest.fixture(scope="module")
def array(dataset: DatasetPart) -> ArrayPart:
    return next(array for array in dataset.arrays if array.anchor == "rest-x")


def entries(html: str) -> dict[str, bool]:
    """Series in the legend → whether they are shown."""
    found = re.findall(r'aria-pressed="(\w+)" data-series="([^"]+)"', html)
    return {name: pressed == "true" for pressed, name in found}


def with_table(array: ArrayPart, name: str, table: Table) -> ArrayPart:
    return replace(array, tables={**array.tables, name: table})


def test_other_estimators_are_hidden_curves_of_their_own(array: ArrayPart) -> None:
    shown = entries(allan_plot(array))
    assert shown["g1"]
    assert shown["g1 robust"] is False
    assert "average robust" not in shown, "the artefact has it for gyros only"


def test_another_estimator_does_not_make_a_gyro_bad(dataset: DatasetPart, array: ArrayPart) -> None:
    table = {name: column.copy() for name, column in array.tables["allan"].items()}
    for name in ("deviation", "low", "high"):
        table[name][(table["kind"] == "robust") & (table["series"] == "g1")] *= 10
    recordings = tuple(
        replace(part, arrays=tuple(with_table(one, "allan", table) if one is array else one for one in part.arrays))
        for part in dataset.recordings
    )
    assert [bad.gyro for bad in bad_gyros(replace(dataset, recordings=recordings))] == ["g4"]


def test_tones_are_listed_by_frequency_with_those_that_share_them(array: ArrayPart) -> None:
    rows = re.findall(r"<tr>\s*<td.*?</tr>", tones_table(array), re.S)
    texts = [re.sub(r"<[^>]+>", " ", row).split() for row in rows]
    assert [(row[0], row[1], row[-1]) for row in texts] == [
        ("6.500", "g1", "g3"), ("6.500", "g3", "g1"), ("12.25", "g2", "none"),
    ]  # fmt: skip
    assert "dashed: the tones" in spectrum_plot(array)


def test_no_tone_is_said(array: ArrayPart) -> None:
    none = {name: column[:0] for name, column in array.tables["tones"].items()}
    assert "No tones" in tones_table(with_table(array, "tones", none))
    assert "dashed" not in spectrum_plot(with_table(array, "tones", none))


def test_the_pair_that_has_noise_in_common_is_shown_first(array: ArrayPart) -> None:
    shown = entries(cross_allan_plot(array))
    # 6 pairs of 4 gyros; only g1 and g2 have limits that do not hold 0.
    assert len(shown) == 6
    assert next(iter(shown)) == "g1 · g2"
    assert list(shown.values()) == [True] * PAIRS_SHOWN + [False] * 3


def test_a_board_of_many_gyros_draws_only_the_pairs_that_stand_out(array: ArrayPart) -> None:
    names = [f"n{k:02}" for k in range(24)]
    pairs = [(a, b) for place, a in enumerate(names) for b in names[place:]]
    strength = np.array([0.5 if pair == ("n07", "n19") else 0.0 for pair in pairs])
    table = {
        "gyro": np.array([a for a, _ in pairs], dtype=object), "other": np.array([b for _, b in pairs], dtype=object),
        "tau": np.ones(len(pairs)), "correlation": strength, "low": strength - 0.1, "high": strength + 0.1,
    }  # fmt: skip
    many = with_table(replace(array, gyros=tuple(names)), "cross_allan", table)
    html = cross_allan_plot(many)
    shown = entries(html)
    assert next(iter(shown)) == "n07 · n19"
    assert len(shown) == MOST_PAIRS
    assert f"the {MOST_PAIRS} of 276 pairs" in html


def test_one_gyro_has_no_pairs(dataset: DatasetPart) -> None:
    assert cross_allan_plot(next(array for array in dataset.arrays if array.anchor == "rest-z")) == ""
