"""How far a bias wanders in health: simulated flicker and walk of known size, with and without a change of level."""

from dataclasses import replace

import numpy as np
import pytest

from vgyro.config import FaultOptions
from vgyro.fusion.faults.levels.change import lasting_change
from vgyro.fusion.faults.levels.drift_variance import Slow
from vgyro.fusion.faults.levels.health import FLICKERS, WALKS, covariances, healthy_array, likelihood_of
from vgyro.simulate.noise import UnitRandomWalk, unit_flicker

BLOCKS, GYROS = 1200, 6
WHITE, FLICKER, WALK = 0.01, 1.2e-4, 1.0e-6
"""(deg/s)², of a block, of the difference of neighbouring means, and of a step a block."""
ALLAN_OF_FLICKER = 2.0 * np.log(2.0) / np.pi


def array(seed, blocks=BLOCKS, flicker=FLICKER, walk=WALK, walks=(1.0,) * GYROS):
    """Healthy gyros of one kind but for their walks' variances, over WALK."""
    rng = np.random.default_rng(seed)
    # An Allan variance is half the variance of a difference.
    size = np.sqrt(0.5 * flicker / ALLAN_OF_FLICKER)
    parts = []
    for times in walks:
        mean = np.sqrt(WHITE) * rng.standard_normal(blocks) + size * unit_flicker(blocks, rng)
        mean += np.sqrt(times * walk) * UnitRandomWalk(1.0, rng).next(blocks)
        parts.append(Slow(mean, np.full(blocks, WHITE), np.ones(blocks, dtype=bool), np.zeros(blocks, dtype=int)))
    return parts


def over_truth(found, length=256, flicker=FLICKER, walk=WALK):
    return np.array([part.wander(length) for part in found]) / (flicker + walk * length * 2.0 / 3.0)


def drift(seconds=600, start=300, size=0.5):
    return size * np.clip((np.arange(BLOCKS) - start) / seconds, 0.0, 1.0)


def test_covariances_are_those_of_flicker_and_walk():
    # Closed forms: neighbouring means differ by the variance 1 (flicker: our unit; its Allan variance 2·ln2/π·B² is the
    # same at every length) and 2/3·q (walk of variance q a mean).
    flicker, walk = covariances(64)
    for length in (1, 4, 16):
        weights = np.zeros(64)
        weights[8 : 8 + length], weights[8 + length : 8 + 2 * length] = -1.0 / length, 1.0 / length
        assert weights @ flicker @ weights == pytest.approx(1.0)
        assert weights @ walk @ weights == pytest.approx(2.0 / 3.0 * length)
    assert np.linalg.eigvalsh(flicker).min() > 0


def test_covariance_of_the_simulated_flicker():
    # Truth: unit_flicker, whose density is 1/(2πf). Squared contrasts of 8 means of 50 over 400 stretches.
    rng = np.random.default_rng(1)
    means = np.array([unit_flicker(400, rng).reshape(8, 50).mean(axis=1) for _ in range(400)])
    flicker, _ = covariances(8)
    for apart in (1, 3, 6):
        weights = np.zeros(8)
        weights[0], weights[apart] = -1.0, 1.0
        expected = 2.0 * ALLAN_OF_FLICKER * weights @ flicker @ weights
        assert np.mean((means @ weights) ** 2) == pytest.approx(expected, rel=0.15)


def test_the_likelihood_is_greatest_at_the_truth():
    # Truth: simulated. Over 60 gyros the sum has its peak within a step of the grid, a factor of four.
    found = [likelihood_of(part) for seed in range(10) for part in array(seed)]
    total = np.sum([one.table for one in found], axis=0)
    flicker, walk = np.unravel_index(np.argmax(total), total.shape)
    assert 0.25 < FLICKERS[flicker] * found[0].unit / FLICKER < 4.0
    assert 0.25 < WALKS[walk] * found[0].unit / found[0].length / WALK < 4.0


def test_the_wander_of_half_an_hour_and_of_a_day():
    # Truth: simulated. Standard deviations within a factor of two for 20 minutes, of 1.3 for a day.
    short = np.sqrt([over_truth(healthy_array(array(seed))) for seed in range(10)])
    assert 0.5 < np.median(short) < 1.5
    assert np.mean((short > 0.5) & (short < 2.0)) > 0.9
    long = np.sqrt(over_truth(healthy_array(array(3, 86400)), 4096))
    assert ((long > 1 / 1.3) & (long < 1.3)).all()


def test_a_drift_is_no_wander():
    # Truth: 5 σ in 600 s and there to the end. As a walk it would be of more than ten times the variance.
    ratio = []
    for seed in range(10):
        parts = array(seed)
        parts[2] = replace(parts[2], mean=parts[2].mean + drift())
        ratio.append(over_truth(healthy_array(parts))[2])
    assert np.sqrt(np.median(ratio)) < 1.5
    assert np.sqrt(np.max(ratio)) < 4.0


def test_a_gyro_of_another_kind_keeps_its_wander():
    # Truth: one gyro's walk has 25 or 100 times the variance of the others' (5 or 10 times the s.d.).
    for times in (25.0, 100.0):
        found = [healthy_array(array(seed, walks=(1, 1, 1, 1, 1, times))) for seed in range(10)]
        odd = [part[5].wander(256) / (FLICKER + times * WALK * 256 * 2 / 3) for part in found]
        assert np.sqrt(np.median(odd)) > 0.6
        assert max(lasting_change(part[5], 0, BLOCKS).evidence for part in found) < FaultOptions().threshold
        others = [over_truth(part[:5]) for part in found]
        assert np.sqrt(np.median(others)) < 2.0


def test_runs_have_levels_of_their_own_and_holes_do_not_count():
    # Truth: simulated wander; between the runs the bias is another by 3 deg/s, in the hole it is 10 deg/s off.
    parts = []
    for part in array(5):
        mean, counts = part.mean.copy(), part.counts.copy()
        mean[700:] += 3.0
        mean[300:340], counts[300:340] = 10.0, False
        parts.append(replace(part, mean=mean, counts=counts, run=(np.arange(BLOCKS) >= 700).astype(int)))
    ratio = np.sqrt(over_truth(healthy_array(parts)))
    assert ((ratio > 0.3) & (ratio < 2.5)).all()


@pytest.mark.parametrize("seconds", [0, 60, 300, 600])
def test_where_a_lasting_change_lies(seconds):
    # Truth: 5 σ from 300 s on. What is known of the wander is the truth, too.
    found = []
    for seed in range(10):
        part = replace(array(seed)[0], flicker=FLICKER, walk=WALK)
        change = lasting_change(replace(part, mean=part.mean + drift(max(seconds, 1))), 0, BLOCKS)
        found.append((change.first, change.last, change.size, change.evidence))
    first, last, size, evidence = np.median(found, axis=0)
    assert first == pytest.approx(300, abs=3 + 0.1 * seconds)
    assert last == pytest.approx(300 + seconds, abs=3 + 0.1 * seconds)
    assert size == pytest.approx(0.5, rel=0.1)
    assert evidence > 10


def test_health_has_no_clear_change():
    # Truth: no change. Evidence is in standard deviations, the greatest of some thousand ramps.
    found = [replace(part, flicker=FLICKER, walk=WALK) for seed in range(5) for part in array(seed)]
    assert max(lasting_change(part, 0, BLOCKS).evidence for part in found) < 5
