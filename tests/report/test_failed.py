"""Methods that ended with an error, and those of other packages: their rows, what is concluded, the overview."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vgyro.fusion import rest_scales
from vgyro.report.conclusions.best import FROM_ITSELF, best_of_all
from vgyro.report.conclusions.section import conclude
from vgyro.report.dataset_page import headline
from vgyro.report.fusion.failed import failed_sentences
from vgyro.report.fusion.methods import rest_tables
from vgyro.report.index_page import render_index
from vgyro.report.model import ArrayPart, DatasetPart, RecordingPart
from vgyro.tasks.common import Task
from vgyro.tasks.pages.report import read_dataset_part

NOTE = "failed: LinAlgError: Singular matrix (a bug in vgyro; the traceback is in the log)"


@pytest.fixture(scope="module")
def dataset(report_task: Task) -> DatasetPart:
    return read_dataset_part(report_task)


def with_methods(dataset: DatasetPart, change: dict[str, dict[str, str]], anchors: tuple[str, ...]) -> DatasetPart:
    """The data set with other cells in the rows of some methods, in some arrays."""

    def changed(array: ArrayPart) -> ArrayPart:
        if array.anchor not in anchors:
            return array
        table = {name: column.astype(object) for name, column in array.tables["methods"].items()}
        table["state"] = np.where(table["column"] == "", "cannot run", "ran").astype(object)
        for method, cells in change.items():
            for name, value in cells.items():
                table[name][table["method"] == method] = value
        return replace(array, tables={**array.tables, "methods": table})

    recordings = [
        replace(recording, arrays=[changed(array) for array in recording.arrays]) for recording in dataset.recordings
    ]
    return replace(dataset, recordings=recordings)


def failed(*methods: str) -> dict[str, dict[str, str]]:
    return {method: {"state": "failed", "column": "", "note": NOTE} for method in methods}


def test_a_row_says_that_it_failed(dataset: DatasetPart) -> None:
    broken = with_methods(dataset, failed("median"), ("rest-x",))
    array = next(one for one in broken.arrays if one.anchor == "rest-x")
    html = rest_tables(broken, array)
    assert NOTE in html
    assert f"not run: {NOTE}" not in html
    assert "not run: no RRW was found for g1" in html


def test_what_is_concluded(dataset: DatasetPart) -> None:
    assert failed_sentences(dataset) == []
    broken = with_methods(dataset, failed("median", "recommended"), ("rest-x", "sine-x"))
    first, second = failed_sentences(broken)
    reason = "LinAlgError: Singular matrix (a bug in vgyro; the traceback is in the log)."
    assert first.text == f"The method 'Recommended' failed (rest, axis x; sine, axis x): {reason}"
    assert (first.tone, first.anchor) == ("bad", "rest-x")
    assert second.text == f"The method 'Median' failed (rest, axis x; sine, axis x): {reason}"
    assert second.tone == "warn"
    assert {first, second} <= set(conclude(broken))


def calm(recording: RecordingPart) -> RecordingPart:
    """A recording of which nothing is suspected."""
    return replace(recording, integrity={**recording.integrity, "status": "good"})


def test_the_overview_warns_where_the_recommended_method_failed(dataset: DatasetPart) -> None:
    good = replace(dataset, recordings=[calm(one) for one in dataset.recordings if one.usable])
    assert headline(good)["status"] == "good"
    other = with_methods(good, failed("median"), ("rest-x",))
    ours = with_methods(good, failed("recommended"), ("rest-x",))
    for one, seen in ((other, False), (ours, True)):
        record = headline(one)
        assert record["recommended_failed"] is seen
        assert ("recommended method failed" in render_index([record])) is seen
    assert headline(ours)["status"] == "suspect"


def test_methods_of_other_packages_have_their_own_heading(dataset: DatasetPart) -> None:
    array = next(one for one in dataset.arrays if one.anchor == "rest-x")
    assert "Methods of other packages" not in rest_tables(dataset, array)
    source = "Tukey (1962); package winsor-gyro 1.0"
    found = with_methods(dataset, {"median": {"family": "other", "source": source}}, ("rest-x",))
    html = rest_tables(found, next(one for one in found.arrays if one.anchor == "rest-x"))
    assert "Methods of other packages" in html
    assert source in html


def test_weights_made_from_the_recording_are_not_its_best(dataset: DatasetPart) -> None:
    array = next(one for one in dataset.arrays if one.anchor == "rest-x")
    best = best_of_all(array)
    assert best is not None
    made = with_methods(dataset, {best.method: {"note": f"drift of 1 deg/s/√s; {FROM_ITSELF}"}}, ("rest-x",))
    other = best_of_all(next(one for one in made.arrays if one.anchor == "rest-x"))
    assert other is not None
    assert other.method != best.method
    assert rest_scales.FROM_ITSELF == FROM_ITSELF
