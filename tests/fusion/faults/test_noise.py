"""More noise than usual, function by function: closed forms, and noise of known size."""

import math

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import norm

from vgyro.fusion.faults.candidate import lengths_up_to, running_sum, spread
from vgyro.fusion.faults.noise import (
    NoiseLevel,
    _farthest,
    _unbroken,
    _usual,
    least_ratio,
    mean_level,
    noise_level,
    ratio_of,
)
from vgyro.fusion.faults.residuals import Residuals


def residuals(variance, expected=2.0, sigma2=1.5):
    """One gyro at rest whose residual has this variance in each block [B]."""
    shape = (len(variance), 1)
    nothing = np.zeros(shape)
    return Residuals(
        nothing, np.asarray(variance, dtype=float)[:, None], np.full(shape, expected), nothing, nothing, nothing,
        np.array([expected - sigma2]), np.array([sigma2]), np.zeros(len(variance), dtype=bool),
    )  # fmt: skip


def test_spread_is_the_standard_deviation():
    # Expected: scipy's quantile of the normal law: half of the values are within 0.6745 standard deviations.
    assert spread(3.0 * norm.ppf((np.arange(9999) + 0.5) / 9999)) == pytest.approx(3.0, rel=1e-3)
    assert spread(np.zeros(0)) == 0.0


def test_usual_level_of_noise_that_wanders():
    # Truth: levels of median 0 and s.d. 1 that wander, neighbours all but equal (AR(1) of 0.9): the difference of
    # neighbours would show 0.4 of the scatter, and the level would lie at -0.6. A third of the blocks at fault changes
    # it by less than the scatter.
    rng = np.random.default_rng(1)
    level = lfilter([math.sqrt(1 - 0.9**2)], [1, -0.9], rng.standard_normal(20_000))
    assert _usual(level) == pytest.approx(0.0, abs=0.1)
    assert abs(_usual(np.where(np.arange(20_000) < 6000, level + 9.0, level))) < 0.6


def test_share_of_the_gyros_own_noise():
    # By hand: 1.5 of 2 are the gyro's own; where its usual noise makes 4 of these 2, the others' 0.5 are an eighth.
    everywhere = np.ones(100, dtype=bool)
    assert noise_level(residuals(np.full(100, 2.0)), 0, everywhere, everywhere).share == pytest.approx(0.75)
    assert noise_level(residuals(np.full(100, 4.0)), 0, everywhere, everywhere).share == pytest.approx(0.875)


@pytest.mark.parametrize(("healthy", "there"), [(15, False), (16, True)])
def test_health_is_seen_in_sixteen_blocks(healthy, there):
    # Rule: with fewer healthy blocks all that count say what is usual. Truth: a variance of 2, and of 8 elsewhere.
    blocks = np.arange(400)
    found = noise_level(residuals(np.where(blocks < healthy, 2.0, 8.0)), 0, blocks >= 0, blocks < healthy)
    assert found.level[-1] == pytest.approx(math.log(4.0) if there else 0.0, abs=1e-9)


def state_of(level, sd=0.5):
    level = np.asarray(level, dtype=float)
    spreads = {length: sd / math.sqrt(length) for length in lengths_up_to(len(level))}
    return NoiseLevel(level, np.ones(len(level), dtype=bool), spreads, 1.0)


def test_evidence_of_a_stretch():
    # By hand: twelve blocks of 2 in noise of 0.5 a block: 2/(0.5/√12) standard deviations; what does not count behind
    # it belongs to it.
    level = np.where((np.arange(200) >= 50) & (np.arange(200) < 62), 2.0, 0.0)
    state = state_of(level)
    evidence, (first, last), mean = _farthest(state, 1.0, 6.0)
    assert (first, last) == (50, 62)
    assert mean == pytest.approx(2.0)
    assert evidence == pytest.approx(2.0 / 0.5 * math.sqrt(12.0))
    assert _farthest(state, 1.0, 1.01 * evidence) is None
    for stop, end in ((65, 65), (200, 200)):
        state.counts[62:stop] = False
        assert _farthest(state, 1.0, 6.0)[1][1] == end


@pytest.mark.parametrize(("usual", "apart"), [(3, False), (4, True), (7, True)])
def test_two_parts_are_apart_by_four_usual_blocks(usual, apart):
    # Rule: four blocks of usual noise, where the two parts gain the square of the price: the stronger one is kept.
    level = np.concatenate([np.full(10, 2.0), np.full(usual, -1.0), np.full(20, 2.0)])
    found = _unbroken(running_sum(level), 0, len(level), 1.0)
    assert found == ((10 + usual, 30 + usual) if apart else (0, 30 + usual))
    assert _unbroken(running_sum(level), 0, len(level), 100.0) == (0, 30 + usual)


def test_ratios():
    # By definition: 2 up to a minute, 1.25 for hours; a residual of four times the variance of which half is the
    # gyro's own: √(1 + 3/0.5).
    assert [least_ratio(seconds) for seconds in (1.0, 60.0, 120.0, 1e9)] == pytest.approx([2.0, 2.0, 1.625, 1.25])
    assert ratio_of(math.log(4.0), 0.5) == pytest.approx(math.sqrt(7.0))
    state = state_of([0.0, 3.0, 1.0, 0.0])
    state.counts[3] = False
    assert mean_level(state, 1, 4) == pytest.approx(2.0)
