"""Uneven sampling: its effect on the Allan deviation stays within the bound that the record states."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from vgyro.config import IntegrityOptions
from vgyro.dataset import Recording
from vgyro.log import Log, LogArray, board_of_log
from vgyro.metrics import allan_deviation
from vgyro.storage import open_recording
from vgyro.storage.frames import gather
from vgyro.storage.logs.uneven import MOST_UNEVEN, allan_bound, smeared_above_hz, uneven_note

RATE = 100.0
ROWS = 20_000
WHITE, WALK = 0.05, 0.5  # deg/s a sample; deg/s/√s
TIMES = np.array([1, 4, 16, 64, 256, 1024])  # samples


def steps_of(uneven: float, rng: np.random.Generator) -> np.ndarray:
    """Steps of a poll loop, s: gamma distributed, independent, none below 0."""
    return rng.gamma(1 / uneven**2, uneven**2 / RATE, ROWS - 1)


def rates_at(steps: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """White noise and a random walk, read at the end of each step."""
    walk = np.concatenate([[0.0], np.cumsum(WALK * np.sqrt(steps) * rng.standard_normal(len(steps)))])
    return walk + WHITE * rng.standard_normal(len(walk))


def curve(rate: np.ndarray) -> np.ndarray:
    return allan_deviation(rate, RATE, TIMES / RATE).deviation


@pytest.mark.parametrize("uneven", [0.1, 0.3, 0.5])
def test_the_allan_deviation_is_off_by_less_than_the_bound(uneven):
    even, odd = [], []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        even.append(curve(rates_at(np.full(ROWS - 1, 1 / RATE), rng)) ** 2)
        odd.append(curve(rates_at(steps_of(uneven, rng), rng)) ** 2)
    even, odd = np.array(even), np.array(odd)
    ratio = np.sqrt(odd.mean(axis=0) / even.mean(axis=0))
    # Half of the relative errors of two mean variances.
    spread = 0.5 * np.hypot(*(one.std(axis=0) / one.mean(axis=0) / np.sqrt(len(one)) for one in (even, odd)))
    assert np.all(np.abs(ratio - 1) < allan_bound(uneven, TIMES) + 3 * spread)
    # The test can tell an error of 1 % up to 64 samples.
    assert spread[:4].max() < 0.01


@pytest.fixture
def record(tmp_path):
    """What the reader makes of a poll loop with an unevenness; 0: even."""

    def run(uneven: float):
        rng = np.random.default_rng(8)
        steps = steps_of(uneven, rng) if uneven else np.full(ROWS - 1, 1 / RATE)
        # This loop's own spread, exactly.
        steps = 1 / RATE + (steps - steps.mean()) * (uneven / RATE / steps.std() if uneven else 0)
        time = np.concatenate([[0.0], np.cumsum(steps)])
        path = tmp_path / "a.parquet"
        pq.write_table(pa.table({"t": time, "gz": rates_at(np.abs(steps), rng)}), path)
        array = LogArray(gyros=[{"name": "gz", "axis": "z", "unit": "deg/s"}])
        board = board_of_log(array, "log", "")
        log = Log(time={"column": "t", "unit": "s", "meaning": "sampled"})
        recording = Recording(name="a", kind="static", files=("a.parquet",), log=log)
        reader = open_recording([path], recording, board, IntegrityOptions(), array=array)
        gather(reader, board)
        return reader.integrity

    return run


def test_even_sampling_has_no_warning(record):
    found = record(0)
    assert (found.status, found.clocks[0]["uneven"]) == ("good", 0)
    assert not any("unevenly" in text for text in found.warnings)


@pytest.mark.parametrize(("uneven", "status"), [(0.3, "good"), (0.48, "good"), (0.52, "suspect")])
def test_the_record_states_the_bound_and_is_suspect_above_it(record, uneven, status):
    found = record(uneven)
    measured = found.clocks[0]["uneven"]
    assert measured == pytest.approx(uneven, rel=0.02)
    assert found.status == status
    assert found.rate_hz == pytest.approx(RATE, rel=2e-4)
    (warning,) = [text for text in found.warnings if "is sampled unevenly" in text]
    assert warning == uneven_note(measured, found.rate_hz, "a.parquet")
    assert f"at most {100 * measured**2:.2g} % at 0.01 s" in warning
    assert any("so unevenly" in text for text in found.reasons) == (measured > MOST_UNEVEN)


@pytest.mark.parametrize(("uneven", "smeared"), [(0.0310, False), (0.0325, True)])
def test_spectra_are_smeared_where_that_is_below_nyquist(uneven, smeared):
    # 100 Hz / (2π · 0.0318) / 10 = 50 Hz.
    assert (smeared_above_hz(uneven, RATE) < RATE / 2) == smeared
    assert ("spectra above" in uneven_note(uneven, RATE, "a.csv")) == smeared


def test_a_sinusoid_at_the_stated_frequency_loses_half_a_percent():
    uneven = 0.2
    frequency = smeared_above_hz(uneven, RATE)
    rng = np.random.default_rng(4)
    late = uneven / RATE * rng.standard_normal(1_000_000)
    kept = abs(np.exp(2j * np.pi * frequency * late).mean())
    assert 1 - kept == pytest.approx(0.005, rel=0.02)
