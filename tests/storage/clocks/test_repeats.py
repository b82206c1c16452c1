"""Rows sent twice, and readings held over several rows."""

import numpy as np
import pytest
from stamps import run, same_as_before

from vgyro.storage.clocks.repeats import Keeper, KeepRule, _held, keep_rule

K = np.arange(20_000)


def test_repeated_rows_are_dropped(rng):
    rows = np.sort(np.concatenate([K, rng.choice(K, 300, replace=False)]))
    result = run(rows * 10, same_as_before(rows), unit="ms")
    assert (result.record.repeated, result.record.samples, result.record.lost) == (300, len(K), 0)
    np.testing.assert_allclose(result.placed.time, K / 100, atol=1e-9)
    np.testing.assert_array_equal(result.placed.keep, ~same_as_before(rows))


def test_coarse_stamps_and_coarse_values_are_no_repeats(rng):
    """At 2 kHz stamps in ms come twice, and a still sensor's counts often too."""
    result = run(np.round(K / 2000, 3), same_as_before(rng.integers(0, 3, len(K))), unit="s")
    assert (result.record.repeated, result.record.samples) == (0, len(K))
    assert result.end_rate == pytest.approx(2000, rel=2e-4)


@pytest.mark.parametrize(("equal", "drop"), [(398, False), (402, True)])
def test_twice_what_chance_explains(equal, drop):
    """A third of the rows that advance are equal, 400 with the same stamp are not: chance explains 200."""
    advancing = np.tile([True, False, False], 2000)
    same = np.concatenate([advancing, np.ones(equal, dtype=bool), np.zeros(400, dtype=bool)])
    stamps = np.concatenate([np.arange(6000), np.full(equal + 400, 5999)])
    # The first row has none before it.
    same[0] = False
    stamps, same = np.concatenate([[-1], stamps]), np.concatenate([[False], same])
    same[1] = True
    assert keep_rule(stamps, same).drop_repeats == drop


@pytest.mark.parametrize(("logger", "sensor"), [(300, 100), (200, 120), (100, 90), (1000, 33.3), (200, 101)])
def test_each_held_reading_is_kept_once(logger, sensor):
    reading = np.floor(K * sensor / logger + 1e-9).astype(int)
    result = run(K / logger, same_as_before(reading), unit="s")
    record = result.record
    assert record.held == pytest.approx(logger / sensor, rel=1e-3)
    assert record.samples == reading[-1] + 1
    assert record.rate_hz == pytest.approx(sensor, rel=2e-4)
    assert result.end_rate == pytest.approx(sensor, rel=2e-4)
    assert (record.lost, record.repeated) == (0, 0)
    first = np.flatnonzero(~same_as_before(reading))
    np.testing.assert_array_equal(np.flatnonzero(result.placed.keep), first)
    assert any("each is kept once" in text for text in record.warnings)


def test_a_reading_equal_to_the_one_before_is_kept(rng):
    values = rng.integers(0, 12, len(K) // 3)
    result = run(np.arange(3 * len(values)) / 300, same_as_before(np.repeat(values, 3)), unit="s")
    assert result.record.held == 3
    assert result.record.samples == len(values)
    assert result.end_rate == pytest.approx(100, rel=2e-4)


@pytest.mark.parametrize("chance", [0.05, 0.3, 0.577, 0.8, 0.95])
def test_counts_that_repeat_by_chance_are_no_held_readings(rng, chance):
    record = run(K / 100, rng.random(len(K)) < chance, unit="s").record
    assert (record.held, record.samples) == (1, len(K))


@pytest.mark.parametrize(("share", "held"), [(0.79, False), (0.81, True)])
def test_share_of_two_adjacent_lengths(share, held):
    others = round(1000 * (1 - share))
    lengths = np.concatenate([np.full(1000 - others, 3), np.resize([1, 5, 6, 7, 8, 9], others)])
    assert (_held(lengths)[0] > 1) == held


@pytest.mark.parametrize(("runs", "held"), [(19, False), (20, True)])
def test_runs_that_are_needed(runs, held):
    assert (_held(np.full(runs, 3))[0] > 1) == held


@pytest.mark.parametrize(("noise", "held"), [(1.0, True), (2.5, False)])
def test_a_beat_varies_less_than_chance(rng, noise, held):
    """Runs of two every tenth time; the tenth wanders: against a chance variance of 16, one of about 1, or 5."""
    rows = np.concatenate([[0], np.cumsum(np.maximum(2, np.rint(rng.normal(10, noise, 3000))))]).astype(int)
    lengths = np.ones(rows[-1], dtype=int)
    lengths[rows[:-1]] = 2
    if not held:
        rng.shuffle(lengths)
    assert (_held(lengths)[0] > 1) == held


def test_keeping_does_not_depend_on_blocks(rng):
    same = same_as_before(np.floor(K * 0.37))
    whole = Keeper(KeepRule(True, 1 / 0.37)).feed(K, same)
    keeper, parts, low = Keeper(KeepRule(True, 1 / 0.37)), [], 0
    while low < len(K):
        size = int(rng.integers(0, 9))
        parts.append(keeper.feed(K[low : low + size], same[low : low + size]))
        low += size
    np.testing.assert_array_equal(np.concatenate(parts), whole)
