"""A recording that is declared static: the board moves in the middle of it, or it does not."""

import numpy as np
import pytest
from task_chain import RATE_HZ, SIGMA, Chain, white

from vgyro.storage.tables import read_columns
from vgyro.tasks.fusion.array_inputs import in_motion
from vgyro.tasks.fusion.noise import source_of
from vgyro.tasks.pages.rates import read_rates

GYROS = ("g1", "g2")
N = SIGMA / np.sqrt(RATE_HZ)


def moves_in_the_middle() -> np.ndarray:
    """At rest 0-18 s and 42-60 s, turned to and fro in between."""
    rate = white(60, 2)
    time = np.arange(len(rate)) / RATE_HZ
    there = (time >= 18) & (time < 42)
    rate[there] += 12 * np.sin(2 * np.pi * 0.7 * (time[there] - 18))[:, None]
    return rate


@pytest.fixture(scope="module")
def moved(tmp_path_factory):
    chain = Chain(tmp_path_factory.mktemp("moved"), GYROS, volatility=True)
    chain.frames(moves_in_the_middle())
    chain.all()
    return chain


@pytest.fixture(scope="module")
def still(tmp_path_factory):
    chain = Chain(tmp_path_factory.mktemp("still"), GYROS, volatility=True)
    chain.frames(white(60, 2))
    chain.all()
    return chain


def test_only_its_rests_are_at_rest(moved, still):
    rest = moved.table("rates")["at_rest"]
    np.testing.assert_array_equal(rest, np.r_[np.ones(1700), np.zeros(2600), np.ones(1700)].astype(bool))
    assert moved.metadata("rates")["moved"] == {"share": 0.4, "stretches": [[18.0, 42.0]]}
    assert still.table("rates")["at_rest"].all()
    assert "moved" not in still.metadata("rates")


def test_figures_at_rest_are_those_of_the_rests(moved):
    # Truth: white noise of N = 0.005 deg/s/√Hz, which the motion of 12 deg/s would make a thousand times as large.
    figures = moved.metrics()
    for gyro in GYROS:
        assert figures[gyro, "arw"][0] == pytest.approx(60 * N, rel=0.15)
        assert figures[gyro, "sigma"][0] == pytest.approx(SIGMA, rel=0.05)
        assert moved.noise()["arw"][gyro] == pytest.approx(N, rel=0.15)
    assert moved.noise()["method"] == "samples at rest"
    assert moved.table("allan")["tau"].max() < 18
    assert np.abs(moved.table("series")["g1"]).max() < 2
    assert "rest and used" in moved.metadata("series")["use"]


def test_it_is_fused_as_what_moves(moved, still):
    bandwidth = {
        chain: dict(zip(chain.table("methods")["method"], chain.table("methods")["bandwidth_hz"], strict=True))
        for chain in (moved, still)
    }
    assert bandwidth[moved]["chang_2012"] == pytest.approx(5.0)
    assert bandwidth[still]["chang_2012"] == pytest.approx(1.0)
    # No constant rate is added to what turns by itself.
    assert set(read_columns(moved.folder / "moved.parquet")) == {"time", "segment"}
    assert len(read_columns(still.folder / "moved.parquet")) > 2


def test_decided_by_what_was_found_and_not_by_clipped_samples():
    clipped, whole = np.array([True, False, True]), np.ones(3, dtype=bool)
    assert not in_motion("static", clipped, moved=False)
    assert in_motion("thermal", clipped, moved=True)
    assert in_motion("free", clipped, moved=False)
    assert not in_motion("free", whole, moved=False)
    assert in_motion("sinusoid", whole, moved=False)


def test_the_noise_is_taken_from_a_recording_that_did_not_move(moved, still):
    paths = [chain.folder / "rates.parquet" for chain in (moved, still)]
    assert source_of(paths) == paths[1]
    assert source_of(paths[:1]) == paths[0]


def test_what_a_page_is_told(moved, still):
    assert read_rates(moved.folder / "rates.parquet", list(GYROS)).moved == moved.metadata("rates")["moved"]
    assert read_rates(still.folder / "rates.parquet", list(GYROS)).moved is None


def test_no_rest_no_figures_at_rest(tmp_path):
    # A rest of 4 s is too short to be one.
    rate = white(60, 2)
    time = np.arange(len(rate)) / RATE_HZ
    there = (time < 28) | (time >= 32)
    rate[there] += 12 * np.sin(2 * np.pi * 0.7 * time[there])[:, None]
    chain = Chain(tmp_path, GYROS, volatility=True)
    chain.frames(rate)
    chain.all()
    assert not chain.table("rates")["at_rest"].any()
    assert not any(metric in ("arw", "sigma") for _, metric in chain.metrics())
    assert len(chain.table("series")["time"]) == 0
    assert "differences" in chain.noise()["method"]
