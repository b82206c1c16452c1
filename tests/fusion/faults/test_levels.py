"""Levels of residuals, function by function: what the temperature does, the white part, contrasts of means."""

import math

import numpy as np
import pytest

from vgyro.fusion.faults.candidate import SuspectedFault
from vgyro.fusion.faults.levels.alike import of_the_array
from vgyro.fusion.faults.levels.bias import _contrast, suspect_bias
from vgyro.fusion.faults.levels.drift_variance import Slow, slow_part
from vgyro.fusion.faults.levels.health import WALKS, _coarse, changes_of_level, healthy_array
from vgyro.fusion.faults.levels.temperature import block_temperature, without_temperature
from vgyro.fusion.faults.residuals import Residuals

WHITE = 0.01


def slow(mean, white=WHITE, counts=None, flicker=0.0, walk=0.0):
    mean = np.asarray(mean, dtype=float)
    counts = np.ones(len(mean), dtype=bool) if counts is None else counts
    return Slow(mean, np.full(len(mean), white), counts, np.zeros(len(mean), dtype=int), flicker, walk)


@pytest.mark.parametrize("blocks", [63, 64])
def test_temperature_of_blocks(blocks):
    # Expected: by definition: moving means over 15 blocks on each side, fewer at the ends; none of less than 64 blocks.
    temperature = np.random.default_rng(1).standard_normal(4 * blocks)
    found = block_temperature(temperature, 4 * np.arange(blocks + 1))
    if blocks < 64:
        assert found is None
        return
    means = temperature.reshape(blocks, 4).mean(axis=1)
    half = np.minimum(np.minimum(np.arange(blocks), blocks - 1 - np.arange(blocks)), 15)
    expected = [means[place - one : place + one + 1].mean() for place, one in enumerate(half)]
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_a_slope_of_the_temperature_is_taken_off():
    # Truth: 0.02 deg/s/K and a bias of -5 deg/s; noise that no temperature explains stays as it is.
    temperature = 20.0 + 8.0 * np.sin(np.arange(1000) / 100.0)
    run, healthy = np.zeros(1000, dtype=int), np.ones(1000, dtype=bool)
    found = without_temperature(0.02 * temperature - 5.0, temperature, healthy, run)
    np.testing.assert_allclose(found, 0.02 * temperature[0] - 5.0, atol=1e-9)
    noise = np.random.default_rng(1).standard_normal(1000)
    np.testing.assert_array_equal(without_temperature(noise, temperature, healthy, run), noise)


@pytest.mark.parametrize("moving", [False, True])
def test_white_part_of_the_block_means(moving):
    # Truth: means of variance 0.01, a hundredth of that of the samples; in motion also of 4 % of the square of the
    # motion, which half of the blocks have. A quantile of 4000 blocks is off by some 4 %.
    rng, blocks = np.random.default_rng(3), 8000
    moves = (np.arange(blocks) // 50 % 2 == 1) & moving
    motion = np.where(moves, 5.0, 1e-6)
    sd = np.sqrt(0.01 + 0.04 * motion**2)
    mean = sd * rng.standard_normal(blocks)
    column, nothing = np.ones((blocks, 1)), np.zeros((blocks, 1))
    found = Residuals(
        mean[:, None], column, column, motion[:, None], nothing, nothing, np.ones(1), np.ones(1), moves
    )  # fmt: skip
    part = slow_part(found, 0, np.ones(blocks, dtype=bool), np.zeros(blocks, dtype=int), mean)
    np.testing.assert_allclose(part.white[~moves], 0.01, rtol=0.1)
    if moving:
        np.testing.assert_allclose(part.white[moves], 0.01 + 0.04 * 25.0, rtol=0.15)


def test_contrast_of_neighbouring_means():
    # By hand: a step of 1 in the middle of 64 blocks: difference 1, variance 2·0.01/n + flicker + 2/3·n·walk. With four
    # times as many blocks before, the length is half of both together.
    part = slow(np.where(np.arange(64) < 32, 0.0, 1.0), flicker=0.004, walk=0.0005)
    evidence, place, length = _contrast(part, 0.0)
    candidates = {n: 2 * WHITE / n + 0.004 + 0.0005 * n * 2 / 3 for n in (1, 2, 4, 8, 16, 32)}
    candidates |= {(n, 4 * n): WHITE / n + WHITE / (4 * n) + 0.004 + 0.0005 * 2.5 * n * 2 / 3 for n in (1, 2, 4)}
    best = min(candidates, key=candidates.get)
    assert place == 32
    assert length == (best if isinstance(best, int) else best[0])
    assert evidence == pytest.approx(1 / math.sqrt(candidates[best]))
    # What is weak is found, too, and what is too small is not.
    weak = slow(np.where(np.arange(64) < 32, 0.0, 0.1), white=1.0)
    assert _contrast(weak, 0.0)[0] == pytest.approx(0.1 / math.sqrt(2.0 / 32.0))
    assert _contrast(weak, 0.11) == (0.0, 0, 1)


def test_a_change_of_half_the_least_size_is_no_fault():
    # Rule: 2.5 standard deviations of a block mean, both sides; evidence is plenty of either.
    for times, found in ((2.2, False), (2.8, True)):
        rng = np.random.default_rng(4)
        part = slow(0.1 * (rng.standard_normal(800) + times * (np.arange(800) >= 500)))
        assert bool(suspect_bias(part, 0, 1.0, 8.0)) == found
    # A change that is there and back lasts for what it lasts; without the evidence there is none.
    part = slow(0.1 * (np.random.default_rng(4).standard_normal(800) + 5.0 * (np.arange(800) // 100 == 5)))
    (one,) = suspect_bias(part, 0, 1.0, 8.0)
    assert (one.kind, abs(one.first - 500) <= 2, abs(one.last - 600) <= 2) == ("step", True, True)
    assert suspect_bias(part, 0, 1.0, 1e3) == []
    # Less than twenty blocks have no lasting change.
    assert suspect_bias(slow(0.1 * np.random.default_rng(4).standard_normal(15)), 0, 1.0, 8.0) == []


def test_a_drift_late_in_a_later_run_does_not_settle():
    # Rule: of a drift in the first 5 % of its own run a tenth is asked of the others, else a fifth; here they do 0.13.
    run = np.repeat([0, 1], 400)
    for first, found in ((400, True), (600, False)):
        form = np.where(np.arange(800) >= first, np.exp(-(np.arange(800) - first) / 40.0), 0.0)
        form[first + 150 :] = 0.0
        parts = [
            Slow(size * form, np.full(800, 1e-6), np.ones(800, bool), run)
            for size in (1.0, 0.11, -0.11, 0.11, -0.11, 0.11)
        ]
        one = SuspectedFault(0, "drift", first, first + 150, 50.0, 1.0, "deg/s")
        assert of_the_array(one, parts) == found


def test_coarse_means():
    # By hand: means of two blocks less their median, over blocks that count; white parts add up as variances do.
    counts = np.ones(12, dtype=bool)
    counts[[4, 6, 7]] = False
    mean, white = _coarse(slow([1, 3, 5, 5, 9, 7, 9, 9, 0, 2, 3, 5], counts=counts), slice(0, 12), 2)
    level = np.median([2.0, 5.0, 7.0, 1.0, 4.0])
    np.testing.assert_allclose(mean, np.array([2.0, 5.0, 7.0, level, 1.0, 4.0]) - level)
    np.testing.assert_allclose(white, [WHITE / 2, WHITE / 2, WHITE, np.inf, WHITE / 2, WHITE / 2])


def test_forms_of_a_change():
    # By definition: ramps, jumps and visits, each a third of the probability; every ramp is one longer than a block.
    forms, log_prior = changes_of_level(24)
    np.testing.assert_allclose(np.exp(log_prior).sum(), 1.0)
    rising = [form for form in forms.T if (np.diff(form) >= 0).all()]
    ramps = [form for form in rising if ((form > 0) & (form < 1)).any()]
    jumps = [form for form in rising if not ((form > 0) & (form < 1)).any() and form.any()]
    assert len(jumps) >= 23
    assert len(ramps) > 23


@pytest.mark.parametrize("unit", [1e-4, 1.0])
def test_wander_is_in_the_units_of_the_means(unit):
    # Closed form: all times a number: flicker and walk times its square, whatever the unit; the walks that are tried
    # are those from 4⁻⁷ to 4⁶ of the white part of a mean.
    rng = np.random.default_rng(5)
    means = [rng.standard_normal(800) + np.cumsum(0.02 * rng.standard_normal(800)) for _ in range(4)]
    plain = healthy_array([slow(one, 1.0) for one in means])
    found = healthy_array([slow(math.sqrt(unit) * one, unit) for one in means])
    np.testing.assert_allclose([one.flicker for one in found], [unit * one.flicker for one in plain], rtol=1e-6)
    np.testing.assert_allclose([one.walk for one in found], [unit * one.walk for one in plain], rtol=1e-6)
    np.testing.assert_allclose(np.log2(WALKS), np.arange(-14.0, 14.0, 2.0))
