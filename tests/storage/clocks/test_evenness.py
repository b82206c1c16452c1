"""The test that tells a grid from a walk, on both sides of its bounds."""

import numpy as np
import pytest
from stamps import run

from vgyro.storage.clocks.evenness import judge

K = np.arange(8000)


def is_even(times):
    return judge(np.asarray(times), 1e-9, 1e-9, "auto").even


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("spread", [0.01, 0.05, 0.16, 0.3, 0.6])
def test_independent_steps_are_a_walk_and_jitter_is_not(seed, spread):
    rng = np.random.default_rng(seed)
    steps = np.maximum(rng.normal(1, spread, len(K)), 0.01)
    assert not is_even(np.cumsum(steps))
    assert is_even(K + rng.normal(0, spread / np.sqrt(2), len(K)))


@pytest.mark.parametrize(("spread", "even"), [(0.004, True), (0.008, False)])
def test_steps_that_hardly_vary_are_even(rng, spread, even):
    assert is_even(np.cumsum(rng.normal(1, spread, len(K)))) == even


@pytest.mark.parametrize(("spread", "even"), [(0.2, True), (0.35, False), (0.45, False)])
def test_few_rows(spread, even):
    steps = 1 + spread * np.array([1, -1, 1, 1, -1, -1, 1, -1] * 5)
    assert is_even(np.cumsum(steps)) == even


def test_a_walk_that_is_held_to_a_grid_is_even(rng):
    """Latency that goes on for ten rows: short lags look like a walk, long ones do not."""
    latency = np.zeros(len(K))
    for row in range(1, len(K)):
        latency[row] = 0.9 * latency[row - 1] + rng.exponential(0.5)
    assert is_even(K + latency)


def test_losses_do_not_make_a_walk(rng):
    kept = np.flatnonzero(rng.random(40_000) > 0.05)
    assert is_even(kept + rng.normal(0, 0.1, len(kept)))


@pytest.mark.parametrize(("tick", "time_from"), [(0.015, "stamps"), (0.03, "line")])
def test_rounding_counts_from_two_hundredths_of_a_period(tick, time_from):
    stamps = np.rint(K * 1.0037 / tick).astype(np.int64)
    assert judge(stamps * tick, tick, tick, "auto").time_from == time_from


@pytest.mark.parametrize(("extra", "time_from"), [(0.0, "line"), (0.06, "stamps")])
def test_rounded_stamps_do_not_stray_further_than_that(rng, extra, time_from):
    stamps = np.rint((K * 1.0037 + rng.normal(0, extra, len(K))) / 0.1) * 0.1
    assert judge(stamps, 0.1, 1e-9, "auto").time_from == time_from


@pytest.mark.parametrize("regular", [True, False])
def test_steps_of_one_tick_with_odd_ones(rng, regular):
    """1003 Hz or 997 Hz in ms give regular odd steps, lost samples do not."""
    rows = K[K % 91 != 50] if regular else np.delete(K, np.sort(rng.choice(K[1:-1], 87, replace=False)))
    record = run(rows, unit="ms").record
    assert record.lost == (0 if regular else 87)
    assert record.rate_hz == pytest.approx(1000 * 90 / 91 if regular else 1000, rel=2e-4)


def test_odd_steps_of_rounded_stamps_with_jitter(rng):
    stamps = np.rint(K / 997 * 1000 + rng.normal(0, 0.05, len(K)))
    result = run(stamps, unit="ms")
    assert result.record.lost == 0
    assert result.end_rate == pytest.approx(997, rel=2e-4)


@pytest.mark.parametrize(("spread", "beat"), [(0.25, True), (0.35, False)])
def test_how_regular_odd_steps_must_be(rng, spread, beat):
    scatter = rng.normal(size=30)
    scatter = (scatter - scatter.mean()) / scatter.std()
    apart = np.rint(260 * (1 + spread * scatter)).astype(int)
    rows = np.delete(K, np.cumsum(apart))
    assert (run(rows, unit="ms").record.lost == 0) == beat


def test_losses_among_regular_odd_steps():
    stamps = np.delete(np.floor(np.arange(30_000) / 997 * 1000 + 1e-6), [9000, 16_100, 23_300])
    result = run(stamps, unit="ms")
    assert result.record.lost == 3
    assert result.end_rate == pytest.approx(997, rel=2e-4)


@pytest.mark.parametrize("ratio", [1.98, 3.31, 5.96, 15.55])
def test_bursts_of_nearly_a_whole_number_of_samples(rng, ratio):
    """Locally the period seems to be a fraction of the burst's, with a sample lost, or doubled, now and then."""
    k = np.arange(25_000)
    stamps = np.ceil(k / ratio) * ratio / 500 + rng.exponential(0.0006, len(k))
    result = run(stamps, unit="s")
    assert (result.record.meaning, result.record.lost) == ("arrival", 0)
    assert result.end_rate == pytest.approx(500, rel=2e-4)


@pytest.mark.parametrize(("count", "beat"), [(8, False), (9, True)])
def test_how_many_odd_steps_are_needed(count, beat):
    rows = np.delete(K, (len(K) / count * (np.arange(count) + 0.5)).astype(int))
    assert (run(rows, unit="ms").record.lost == 0) == beat


def test_the_figures_of_the_test_are_told(rng):
    assert "independent steps" in run(np.cumsum(rng.uniform(8, 13, 5000)), unit="ms").record.why
