"""Samples that are missing: all are counted where they can be seen, none is invented."""

import numpy as np
import pytest
from stamps import run

from vgyro.storage.clocks.evenness import judge
from vgyro.storage.clocks.losses import TAIL

K = np.arange(20_000)


def without(rows):
    return np.delete(K, rows)


@pytest.mark.parametrize("jitter", [0, 0.0001, 0.0008])
def test_dense_losses_are_counted_one_by_one(rng, jitter):
    kept = np.concatenate([[0], 1 + np.flatnonzero(rng.random(len(K) - 2) > 0.08), [K[-1]]])
    result = run(kept / 100 + rng.normal(0, jitter, len(kept)), unit="s")
    assert result.record.lost == len(K) - len(kept)
    assert result.end_rate == pytest.approx(100, rel=2e-4)
    if not jitter:
        np.testing.assert_array_equal(result.placed.counter, kept)
        np.testing.assert_array_equal(np.diff(result.placed.segment), np.diff(kept) > 1)


def test_long_gaps_keep_their_length():
    stamps = np.concatenate([K[:9000], K[9000:] + 17_280_000]) / 100
    record, placed = run(stamps, unit="s")
    assert record.lost == 17_280_000
    assert placed.counter[-1] == K[-1] + 17_280_000
    assert record.gaps[0].duration == pytest.approx(172_800)


@pytest.mark.parametrize(("jump", "restarts"), [(0.9e9, 0), (1.1e9, 1)])
def test_a_jump_of_a_thousand_million_periods_is_a_clock_that_was_set(jump, restarts):
    stamps = np.concatenate([K[:9000], K[9000:] + int(jump)]) / 100
    record = run(stamps, unit="s").record
    assert record.restarts == restarts
    assert (record.lost > 0) == (not restarts)


@pytest.mark.parametrize("lost", [1, 2, 3, 40, 3000])
@pytest.mark.parametrize("kind", ["exponential", "bursts"])
def test_arrival_stamps_show_a_lasting_step(rng, lost, kind):
    kept = without(np.arange(8000, 8000 + lost))
    if kind == "exponential":
        stamps = kept / 200 + rng.exponential(0.02, len(kept))
    else:
        stamps = np.ceil((kept + 1) / 3.17) * 3.17 / 200 + kept % 4 * 1e-4
    result = run(stamps, unit="s")
    assert (result.record.meaning, result.record.lost, len(result.record.gaps)) == ("arrival", lost, 1)
    assert result.record.gaps[0].time == pytest.approx(8000 / 200, abs=0.06)
    assert result.end_rate == pytest.approx(200, rel=2e-4)


def test_many_losses_of_arrival_stamps(rng):
    kept = without(np.sort(rng.choice(np.arange(100, len(K) - 200), 20, replace=False)))
    result = run(kept / 100 + rng.exponential(0.003, len(kept)), unit="s")
    assert result.record.lost == 20
    assert np.abs(result.placed.counter - kept).mean() < 0.05


@pytest.mark.parametrize(("after", "lost"), [(TAIL - 1, 0), (TAIL, 1)])
def test_a_loss_of_arrival_stamps_shows_if_enough_rows_follow(after, lost):
    arrival = np.ceil((K + 1) / 4) * 0.02 + K % 4 * 1e-4
    assert run(np.delete(arrival, len(K) - after - 1), unit="s").record.lost == lost


def test_a_stall_at_the_end_is_no_loss():
    stamps = K / 100 + np.random.default_rng(1).exponential(0.004, len(K))
    stamps[-300:] = np.maximum(stamps[-300:], stamps[-300] + 4)
    assert run(stamps, unit="s").record.lost == 0


@pytest.mark.parametrize("seed", range(5))
def test_jitter_hides_a_loss_and_the_record_says_so(seed):
    """Latency that wanders: its floor itself moves by a few periods."""
    rng = np.random.default_rng(seed)
    floor = np.repeat(rng.uniform(0, 0.03, len(K) // 250), 250)
    record = run(without([8000])[: len(floor) - 1] / 200 + floor[:-1] + rng.exponential(0.004, len(floor) - 1)).record
    assert record.lost == 0
    assert record.least_loss is None or record.least_loss > 1
    assert record.warnings


@pytest.mark.parametrize(
    ("step", "lost", "warned"), [(0.75, 1, False), (0.6, 0, True), (1.4, 0, True), (1.25, 1, False)]
)
def test_a_lasting_step_of_no_whole_period_is_a_clock_that_was_set(rng, step, lost, warned):
    stamps = K / 100 + rng.exponential(0.003, len(K))
    stamps[9000:] += step * 0.01
    record = run(stamps, unit="s").record
    assert record.lost == lost
    assert any("was set" in text for text in record.warnings) == warned


@pytest.mark.parametrize(("pause", "gaps"), [(0.075, 0), (0.2, 1)])
def test_a_pause_of_a_poll_loop(rng, pause, gaps):
    """Steps of 8 to 30 ms: 5 mean steps are 95 ms, twice the usual largest 60 ms."""
    steps = rng.uniform(0.008, 0.03, 8000)
    steps[4000] = pause
    record, placed = run(np.cumsum(steps), unit="s")
    assert (record.even, len(record.gaps)) == (False, gaps)
    assert record.lost == (round(pause / steps.mean()) - 1 if gaps else 0)
    assert placed.time[-1] == pytest.approx(steps[1:].sum())


@pytest.mark.parametrize(("steps", "lost"), [([4.9] * 1, 0), ([5.3] * 1, 4)])
def test_a_pause_is_more_than_five_mean_steps(rng, steps, lost):
    base = rng.uniform(0.7, 1.3, 8000)
    base[3000 : 3000 + len(steps)] = steps
    judgement = judge(np.cumsum(base), 1e-9, 1e-9, "auto")
    assert not judgement.even
    assert judgement.pause == pytest.approx(5, rel=0.01)
    assert run(np.cumsum(base), unit="s").record.lost == lost


def test_no_more_than_a_thousand_gaps_are_listed():
    kept = np.concatenate([[0], 1 + np.flatnonzero(np.random.default_rng(1).random(len(K) - 1) > 0.07)])
    record = run(kept * 1.0, unit="ms").record
    gaps = int((np.diff(kept) > 1).sum())
    assert (len(record.gaps), record.gaps_not_listed) == (1000, gaps - 1000)
