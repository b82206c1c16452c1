"""Every log of tests/cases through `vgyro new-dataset` alone, or with the one option it asks for: rate, losses, means.

Expected values: tests/cases/logs/EXPECTED.json, the simulated truth of each file.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from vgyro.config import IntegrityOptions
from vgyro.storage import open_recording
from vgyro.storage.frames import gather
from vgyro.storage.inputs import read_dataset

CASES = Path(__file__).resolve().parents[1] / "cases" / "logs"
EXPECTED = json.loads((CASES / "EXPECTED.json").read_text())
OPTIONS = {
    "labelled.txt": ["--rate", "100"],
    "counts.csv": ["--scale", "1/16.4"],
}
RATE = 2e-4


class Read:
    """What new-dataset printed and wrote, and what the pipeline's reader makes of it."""

    def __init__(self, outcome, manifest, board, frames, integrity):
        self.outcome, self.manifest, self.board = outcome, manifest, board
        self.frames, self.integrity = frames, integrity
        self.means = [np.nanmean(np.asarray(frames.counts[gyro.field], dtype=float)) for gyro in board.gyros]


@pytest.fixture
def read(project, vgyro):
    """Files → what new-dataset and the reader make of them."""

    def run(*files, options=()):
        outcome = vgyro("new-dataset", *files, "--name", "case", *options)
        assert outcome.code == 0, outcome.err
        manifest, board = read_dataset(project / "raw/case/dataset.yaml", project / "config/boards")
        assert len(manifest.recordings) == 1
        recording = manifest.recordings[0]
        base = project / "raw/case" / manifest.folder
        paths = [base / name for name in recording.files]
        reader = open_recording(paths, recording, board, IntegrityOptions(), array=manifest.array)
        return Read(outcome, manifest, board, gather(reader, board), reader.integrity)

    return run


MEANS = 5e-6
"""Of the means: those expected are of the numbers before they were printed, with four or five decimals; five standard
deviations of the mean of 500 roundings to 1e-4 are 6.5e-6, of 2000 half that."""


@pytest.mark.parametrize("name", [name for name in EXPECTED if "*" not in name])
def test_a_case_comes_out_as_it_is(read, name):
    expected = EXPECTED[name]
    found = read(CASES / name, options=OPTIONS.get(name, ()))
    record = found.integrity
    assert record.frames.good == expected["samples"]
    assert record.frames.lost == expected.get("lost", 0)
    if expected["rate_hz"] is not None:
        tolerance = 0.05 / 99.3 if name == "host_bursts.csv" else RATE
        assert record.rate_hz == pytest.approx(expected["rate_hz"], rel=tolerance)
    if "gaps" in expected:
        assert len(record.gaps) == expected["gaps"]
    if "duration_s" in expected:
        # From the first sample to the last: the record counts one period more.
        assert found.frames.time[-1] - found.frames.time[0] == pytest.approx(
            expected["duration_s"], abs=0.5 / record.rate_hz
        )
    for key in ("mean", "mean_deg_s", "mean_counts"):
        if key in expected:
            assert found.means == pytest.approx(expected[key], abs=MEANS)


def test_missing_values_of_one_gyro_and_text_columns(read):
    expected = EXPECTED["quoted_text_empty.csv"]
    found = read(CASES / "quoted_text_empty.csv")
    assert found.integrity.channels["GyroA"].missing == expected["missing"]["GyroA"]
    assert found.integrity.channels["GyroB"].missing == 0
    assert found.means[1] == pytest.approx(expected["mean_GyroB"][0], abs=MEANS)
    assert [one.name for one in found.board.temperatures] == ["Temp"]


def test_a_clock_that_restarts_and_a_line_that_is_cut(read):
    found = read(CASES / "restart.csv")
    assert found.integrity.restarts == EXPECTED["restart.csv"]["restarts"]
    assert found.integrity.frames.bad == EXPECTED["restart.csv"]["truncated_lines"]


def test_units(read):
    assert {gyro.unit for gyro in read(CASES / "uneven_poll_ms.csv").manifest.array.gyros} == {"rad/s"}


def test_counts_have_the_scale_that_was_given(read):
    found = read(CASES / "counts.csv", options=["--scale", "1/16.4"])
    assert [gyro.scale for gyro in found.board.gyros] == pytest.approx([1 / 16.4] * 4)
    assert found.integrity.values == "counts"


@pytest.mark.parametrize("name", ["labelled.txt", "counts.csv"])
def test_what_the_file_does_not_tell_is_asked_for_in_one_line(vgyro, project, name):
    outcome = vgyro("new-dataset", CASES / name, "--name", "case")
    assert outcome.code == 2
    assert OPTIONS[name][0] in outcome.err
    assert len(outcome.err.strip().splitlines()) == 1
    assert not (project / "raw/case").exists()


def test_a_recording_that_moves_is_not_called_static(read):
    found = read(CASES / "moves_in_the_middle.csv")
    assert found.manifest.recordings[0].kind == "free"
    assert "% at rest, moves from 18" in found.outcome.out


def test_a_recording_at_rest_is_static(read):
    assert read(CASES / "decimal_comma.csv").manifest.recordings[0].kind == "static"


def test_ids_are_gyros_of_one_array_brought_to_one_time(read):
    found = read(CASES / "id_column.csv")
    assert len(found.board.gyros) == EXPECTED["id_column.csv"]["gyros"]
    skew = [clock["alignment"].get("offset_s", 0.0) for clock in found.integrity.clocks]
    assert skew == pytest.approx([1e-6 * us for us in EXPECTED["id_column.csv"]["skew_us"]], abs=1e-6)


def test_files_on_clocks_of_their_own_become_one_array(read):
    expected = EXPECTED["own_clock_*.csv"]
    found = read(*(CASES / name for name in expected["files"]), options=["--rate", "100"])
    truths = list(expected["files"].values())
    for clock, truth in zip(found.integrity.clocks[1:], truths[1:], strict=True):
        assert clock["alignment"]["offset_s"] == pytest.approx(truth["offset_s"], abs=0.002)
        assert clock["alignment"]["drift_ppm"] == pytest.approx(truth["ppm"], abs=15)
    assert found.means == pytest.approx([np.mean(found.means) + truth["bias"] + 1 / 30 for truth in truths], abs=0.01)
    assert "by the motion in common" in found.outcome.out
