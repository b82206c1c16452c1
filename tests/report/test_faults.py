"""What a page says of faults; the events here are made up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vgyro.report.conclusions.section import conclude
from vgyro.report.dataset_page import render_dataset
from vgyro.report.model import ArrayPart, DatasetPart
from vgyro.report.recordings.faults import fault_sentences, fault_times, faults_part
from vgyro.tasks.common import Task
from vgyro.tasks.pages.report import read_dataset_part

INF, NAN = float("inf"), float("nan")
DRIFT = ("g2", "drift", 600.0, 1199.9, 10.7, 1.59, "deg/s", "g2: the bias drifts by up to +1.59 deg/s, from 600 s "
         "to the end (10.7 σ).")  # fmt: skip
NOISE = (
    "g2",
    "noise",
    601.0,
    1199.9,
    48.8,
    2.83,
    "1",
    "g2: 2.83 times the usual noise, from 601 s to the end (48.8 σ).",
)
STUCK = ("g1", "stuck", 300.0, 302.0, INF, NAN, "", "g1: one value is repeated, from 300 s to 302 s.")
NAMES = ("gyro", "kind", "start", "stop", "evidence", "size", "unit", "sentence")
ABOUT = {"note": "", "looked_for": "drift, step", "threshold": 7.0}


@pytest.fixture(scope="module")
def dataset(report_task: Task) -> DatasetPart:
    return read_dataset_part(report_task)


def with_faults(dataset: DatasetPart, rows: tuple[tuple, ...], about: dict | None = None) -> DatasetPart:
    """The data set with events in the array rest-x, and nothing looked for in the others."""
    columns = zip(*rows, strict=True) if rows else ((),) * len(NAMES)
    table = {name: np.array(column, dtype=object) for name, column in zip(NAMES, columns, strict=True)}
    recordings = []
    for recording in dataset.recordings:
        arrays = tuple(
            replace(array, tables={**array.tables, "faults": table}) if array.anchor == "rest-x" else array
            for array in recording.arrays
        )
        recordings.append(replace(recording, arrays=arrays))
    sources = {**dataset.sources, "rest/x/faults.parquet": about or ABOUT}
    return replace(dataset, recordings=tuple(recordings), sources=sources)


def rest_of(dataset: DatasetPart) -> ArrayPart:
    return next(array for array in dataset.arrays if array.anchor == "rest-x")


def test_the_gyro_that_fails_is_named_with_its_time_and_kinds(dataset: DatasetPart) -> None:
    faulty = with_faults(dataset, (STUCK, DRIFT, NOISE))
    short, lasting = fault_sentences(faulty)
    assert short.text == "g1 fails from 300 s (rest, axis x): one value is repeated, from 300 s to 302 s."
    assert lasting.text.startswith("g2 fails from 600 s (rest, axis x): the bias drifts by up to +1.59 deg/s")
    assert "; 2.83 times the usual noise, from 601 s to the end (48.8 σ)." in lasting.text
    assert (short.tone, lasting.tone) == ("warn", "bad")
    assert short.anchor == "rest-x"
    assert lasting in conclude(faulty)


def test_a_faulty_gyro_is_not_called_healthy(dataset: DatasetPart) -> None:
    # g4 of these artefacts is bad by its figures, too: the sentence of the rule for bad gyros stays.
    texts = [found.text for found in conclude(with_faults(dataset, (DRIFT,)))]
    assert not [text for text in texts if "Axis x" in text and "are healthy" in text]
    assert [text for text in texts if "g4 (" in text]


def test_nothing_found_is_said_with_what_was_looked_for(dataset: DatasetPart) -> None:
    (found,) = fault_sentences(with_faults(dataset, ()))
    assert found.text == "No fault found (axis x, rest); looked for: drift, step."
    assert found.tone == "good"
    assert "No fault found. Looked for: drift, step; evidence of 7 σ or more." in faults_part(
        with_faults(dataset, ()), rest_of(with_faults(dataset, ()))
    )


def test_what_could_not_be_looked_for_is_no_good_news(dataset: DatasetPart) -> None:
    limited = with_faults(dataset, (), {"note": "fewer than three gyros"})
    (found,) = fault_sentences(limited)
    assert (found.text, found.tone) == ("Faults (axis x, rest): fewer than three gyros.", "")
    assert "No fault found" not in faults_part(limited, rest_of(limited))


def test_events_are_a_table_and_marks(dataset: DatasetPart) -> None:
    faulty = with_faults(dataset, (STUCK, DRIFT, NOISE))
    html = str(faults_part(faulty, rest_of(faulty)))
    assert "certain" in html  # no number stands for a value that repeats exactly
    assert "2.83 ×" in html
    assert "+1.59 deg/s" in html
    assert fault_times(rest_of(faulty)) == [300.0, 302.0, 600.0, 601.0, 1199.9]
    assert "dashed: begin and end of faults" in render_dataset(faulty)
    assert "dashed: begin and end of faults" not in render_dataset(dataset)


def test_without_the_table_nothing_is_said(dataset: DatasetPart) -> None:
    assert fault_sentences(dataset) == []
    assert faults_part(dataset, rest_of(dataset)) == ""
