"""A recording that is declared static, and moved: said first, in red, and marked in its row and in the overview."""

from __future__ import annotations

from dataclasses import replace

import pytest

from vgyro.report.conclusions.section import conclude, main_arrays
from vgyro.report.dataset_page import headline, render_dataset
from vgyro.report.model import DatasetPart
from vgyro.report.recordings.section import recordings_part
from vgyro.report.sentences import moved_words
from vgyro.tasks.common import Task
from vgyro.tasks.pages.report import read_dataset_part

MOVED = {"share": 0.4, "stretches": [[18.0, 42.0]]}
SAID = (
    "is declared static, but the board moved from 18 s to 42 s (40\u2009% of it): its figures at rest come from its "
    "rests alone; set kind: free"
)


@pytest.fixture(scope="module")
def dataset(report_task: Task) -> DatasetPart:
    found = read_dataset_part(report_task)
    good = [replace(one, integrity={**one.integrity, "status": "good", "reasons": []}) for one in found.recordings]
    return replace(found, recordings=tuple(good))


@pytest.fixture(scope="module")
def moved(dataset: DatasetPart) -> DatasetPart:
    recordings = [
        replace(one, rates=replace(one.rates, moved=MOVED)) if one.name == "rest" else one for one in dataset.recordings
    ]
    return replace(dataset, recordings=tuple(recordings))


def test_it_is_the_first_conclusion(dataset: DatasetPart, moved: DatasetPart) -> None:
    first = conclude(moved)[0]
    assert first.text == f"Recording rest {SAID}."
    assert first.tone == "bad"
    assert not any("but the board moved" in one.text for one in conclude(dataset))


def test_its_row_and_the_overview_call_it_suspect(dataset: DatasetPart, moved: DatasetPart) -> None:
    assert headline(moved)["status"] == "suspect"
    assert headline(dataset)["status"] == "good"
    table = str(recordings_part(moved))
    assert "the board moved<" in table
    assert f"rest {SAID}." in table
    assert "suspect" in table
    assert "the board moved" not in str(recordings_part(dataset))
    page = render_dataset(moved)
    assert page.index(SAID) < page.rindex("What was measured")


def test_it_is_no_main_recording_where_another_one_rests(moved: DatasetPart) -> None:
    # By its kind it would be the first; now it counts as a free one, and it is the only one at rest.
    assert [array.recording for array in main_arrays(moved)] == ["rest"] * len(main_arrays(moved))
    rest = moved.recording("rest")
    other = replace(rest, name="thermal", kind="thermal", rates=replace(rest.rates, moved=None))
    other = replace(other, arrays=tuple(replace(array, recording="thermal") for array in rest.arrays))
    both = replace(moved, recordings=(*moved.recordings, other))
    assert {array.recording for array in main_arrays(both)} == {"thermal"}


def test_many_stretches_and_no_rest() -> None:
    text = moved_words("thermal", {"share": 1.0, "stretches": [[10.0 * place, 10.0 * place + 5] for place in range(5)]})
    assert "from 0 s to 5 s, from 10 s to 15 s, from 20 s to 25 s and 2 times more" in text
    assert "its figures at rest are not known" in text
