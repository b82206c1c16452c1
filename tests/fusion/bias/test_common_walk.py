"""What all gyros drift together, from the Allan covariances of a record at rest: closed forms, and simulated truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import f as fisher

from vgyro.fusion import METHODS, FilterParameters
from vgyro.fusion.bias.common_walk import SIGNIFICANCE, common_note, common_walk, walk_correlation
from vgyro.fusion.types import AllanScales, ArrayNoise

GYROS, LENGTH_S = 6, 1024.0
TAU = 2.0 ** np.arange(-6, 9)
"""To a quarter of the record."""
WHITE, WALK = 1e-3, 1e-7
"""n², (deg/s)²/Hz, and K², (deg/s)²/s, of each gyro."""


def scales(common: np.ndarray | float, white_correlation: float = 0.0, tau: np.ndarray = TAU) -> AllanScales:
    """White noise n²/τ, walks K²τ/3, and an Allan variance that all gyros share."""
    alike = np.full((GYROS, GYROS), white_correlation) + (1.0 - white_correlation) * np.eye(GYROS)
    own = WHITE / tau[:, None, None] * alike + WALK * tau[:, None, None] / 3.0 * np.eye(GYROS)
    return AllanScales(tau, own + np.broadcast_to(common, tau.shape)[:, None, None], LENGTH_S / tau - 1.0)


def test_a_common_walk_is_found() -> None:
    """Closed form: K²τ/3."""
    assert common_walk(scales(1e-5 * TAU / 3.0)) == pytest.approx(1e-5, rel=1e-6)


def test_a_common_ramp_is_a_walk_as_large_at_a_quarter_of_the_record() -> None:
    """Closed form: a²τ²/2 at T/4, whatever the last τ is."""
    expected = 3.0 * (1e-4 * LENGTH_S / 4) ** 2 / 2.0 / (LENGTH_S / 4)
    assert common_walk(scales((1e-4 * TAU) ** 2 / 2.0)) == pytest.approx(expected, rel=1e-6)
    shorter = TAU[:-1]
    assert common_walk(scales((1e-4 * shorter) ** 2 / 2.0, tau=shorter)) == pytest.approx(expected, rel=1e-6)


def test_neither_white_noise_that_all_share_nor_walks_of_each_are_a_common_walk() -> None:
    assert common_walk(scales(0.0)) == 0.0
    assert common_walk(scales(0.0, white_correlation=0.9)) == 0.0
    # At 1/8 s white noise that all share is far above what the gyros have each by itself: it falls with 1/τ.
    assert common_walk(scales(0.0, white_correlation=0.9, tau=TAU[:4])) == 0.0
    assert common_walk(None) == 0.0
    assert common_note(0.0) == ""


@pytest.mark.parametrize(("times", "found"), [(0.99, False), (1.01, True)])
def test_the_bound_is_an_f_test(times: float, found: bool) -> None:
    """The mean's variance at the longest τ over that of independent gyros, at the quantile of F(3, 15)."""
    own = (WHITE / TAU[-1] + WALK * TAU[-1] / 3.0) / GYROS
    quantile = fisher.isf(SIGNIFICANCE, 3, 3 * (GYROS - 1))
    common = own * (times * quantile - 1.0)
    assert (common_walk(scales(common * TAU / TAU[-1])) > 0.0) == found


def test_the_deviation_holds_what_all_gyros_drift_together(make_array) -> None:
    """Simulated truth: six gyros that drift together by a walk; the rate is 0, the recording in motion."""
    values = {True: [], False: []}
    for seed in range(6):
        array = make_array(30_000, [0.1] * GYROS, rate_hz=50.0, seed=seed)
        steps = np.random.default_rng(seed).normal(size=len(array.rate)) * 2e-3 / np.sqrt(50.0)
        rate = array.rate + np.cumsum(steps)[:, None] + 20.0 * np.sin(np.arange(len(array.rate)) / 80.0)[:, None]
        truth = 20.0 * np.sin(np.arange(len(array.rate)) / 80.0)
        record = AllanScales(TAU, scales(4e-6 * TAU / 3.0).covariance, LENGTH_S / TAU - 1.0)
        moving = np.zeros(len(rate), dtype=bool)
        known = replace(array, rate=rate, at_rest=moving, noise=replace(array.noise, scales=record))
        for without in (frozenset(), frozenset({"slow_common"})):
            fused = METHODS["recommended"].fuse(known, FilterParameters(in_motion=True, without=without))
            values[not without].append(np.mean(((fused.rate - truth) / fused.sd)[500:-500] ** 2))
    assert 0.4 < np.mean(values[True]) < 2.0
    assert np.mean(values[False]) > 3.0


C = np.array([[1.0, 0.6, 0.6], [0.6, 1.0, 0.6], [0.6, 0.6, 1.0]])


def noise_of(walks: np.ndarray, size: float = 1.0, rrw: tuple[float, ...] = (1e-3, 2e-3, 1e-3)) -> ArrayNoise:
    """A record whose last Allan covariance, over 150 s, is its expectation with this correlation of the walks."""
    noise = ArrayNoise(np.array([0.02, 0.03, 0.02]), np.array(rrw), C)
    last = noise.R / 150.0 + size * np.outer(noise.rrw, noise.rrw) * walks * 150.0 / 3.0
    return replace(noise, scales=AllanScales(np.array([1.0, 150.0]), np.stack([noise.R, last]), np.array([599.0, 3.0])))


@pytest.mark.parametrize("size", [0.3, 1.0, 3.0])
def test_walks_are_correlated_as_the_noise_or_not_at_all(size: float) -> None:
    assert (walk_correlation(noise_of(C, size)) == C).all()
    assert (walk_correlation(noise_of(np.eye(3), size)) == np.eye(3)).all()


def test_halfway_between_the_more_likely_one() -> None:
    """Between ρ = .06 and .51 the likelihood turns."""
    assert (walk_correlation(noise_of(0.85 * C + 0.15 * np.eye(3))) == C).all()
    assert (walk_correlation(noise_of(0.1 * C + 0.9 * np.eye(3))) == np.eye(3)).all()


def test_what_the_record_does_not_say_stays_as_it_was() -> None:
    unknown = replace(noise_of(np.eye(3)), scales=None)
    assert (walk_correlation(unknown) == C).all()
    alone = noise_of(np.eye(3))
    assert alone.scales is not None
    alone.scales.covariance[:, 1:], alone.scales.covariance[:, :, 1:] = np.nan, np.nan
    assert (walk_correlation(alone) == C).all()
    copies = replace(noise_of(np.eye(3), rrw=(0.0, 0.0, 0.0)), correlation=np.ones((3, 3)))
    assert (walk_correlation(copies) == 1.0).all()
