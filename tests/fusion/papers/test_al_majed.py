"""The bank of filters as a method: which member it finds, what it tells, what it refuses."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from vgyro.engine.reference.kalman import kalman_filter
from vgyro.fusion import CannotRun, FilterParameters, design
from vgyro.fusion.papers.al_majed import DIFFUSE, al_majed

BANK = FilterParameters()
UNEQUAL = np.array([0.05, 0.1, 0.1, 0.3])


def correlated(correlation, gyros=6):
    return (1.0 - correlation) * np.eye(gyros) + correlation


def of_member(make_array, correlation, multiple, samples=20_000, seed=1):
    """A rate that is the random walk of one member, and noise of its correlation; bandwidth 1 Hz is ×1."""
    D = design.information(0.01 * correlated(correlation))
    steps = multiple * math.sqrt(design.q_for_bandwidth(D, 1.0) / 200.0)
    truth = np.cumsum(np.random.default_rng(seed + 100).normal(0.0, steps, samples))
    return make_array(samples, np.full(6, 0.1), truth=truth, correlation=correlated(correlation), seed=seed), truth


def probabilities(note):
    """Label → (at the end, on average)."""
    found = re.findall(r"([ρ×] [\d.]+): ([\d.]+) \(([\d.]+)\)", note)
    return {label: (float(last), float(mean)) for label, last, mean in found}


@pytest.mark.parametrize("correlation", BANK.bank_correlations)
@pytest.mark.parametrize("multiple", BANK.bank_bandwidths)
def test_the_member_that_the_data_are_of_is_found(make_array, correlation, multiple):
    # Expected: the simulated truth. q differs by 25 between neighbours, the correlation by 0.25.
    array, _ = of_member(make_array, correlation, multiple)
    p = probabilities(al_majed(array, BANK).note)
    assert p[f"ρ {correlation:g}"][1] > 0.95
    assert p[f"× {multiple:g}"][1] > 0.9


def test_it_is_nearly_as_good_as_the_right_filter(make_array):
    # Expected: P of the random-walk filter, √(q/D), for each of the bandwidths, within 10 %.
    for multiple in BANK.bank_bandwidths:
        errors = []
        for seed in range(4):
            array, truth = of_member(make_array, 0.25, multiple, seed=seed)
            errors.append((al_majed(array, BANK).rate - truth)[4000:].std())
        D = design.information(0.01 * correlated(0.25))
        best = math.sqrt(design.steady_variance(D, multiple**2 * design.q_for_bandwidth(D, 1.0)))
        assert np.mean(errors) == pytest.approx(best, rel=0.1)


def test_bank_of_one_is_that_kalman_filter(make_array):
    # Expected: filterpy, with R of the one correlation and the start of the method.
    array = make_array(300, UNEQUAL, truth=20.0)
    alone = replace(BANK, bank_correlations=(0.3,), bank_bandwidths=(2.0,), q=0.5)
    R = np.outer(UNEQUAL, UNEQUAL) * correlated(0.3, 4) / array.period
    start = array.rate[0].mean(), DIFFUSE**2 * R.diagonal().max()
    expected, _ = kalman_filter(array.rate, 1.0, 4.0 * 0.5 * array.period, R, *start)
    np.testing.assert_allclose(al_majed(array, alone).rate, expected, atol=1e-8)


def test_engines_agree_over_gaps(make_array):
    segment = np.repeat([0, 1, 2], [150, 1, 49]).astype(np.int32)
    array = make_array(200, UNEQUAL, truth=20.0, segment=segment)
    native, reference = (al_majed(array, replace(BANK, engine=name)) for name in ("native", "reference"))
    np.testing.assert_allclose(native.rate, reference.rate, atol=1e-8)
    assert native.note == reference.note


def test_after_a_gap_the_rate_starts_anew_and_the_probabilities_are_kept(make_array):
    array, _ = of_member(make_array, 0.5, 5.0)
    segment = np.repeat([0, 1], [19_999, 1]).astype(np.int32)
    rate = array.rate.copy()
    rate[-1] = 400.0 + np.arange(6) / 10
    fused = al_majed(replace(array, rate=rate, segment=segment), BANK)
    assert fused.rate[-1] == pytest.approx(rate[-1].mean(), rel=1e-4)
    # One sample says little of the correlation, and nothing of q.
    assert probabilities(fused.note)["ρ 0.5"][0] > 0.9
    assert probabilities(fused.note)["× 5"][0] > 0.9


def test_a_constant_rate_adds_itself(make_array):
    array = make_array(3000, UNEQUAL, segment=np.repeat([0, 1], [1000, 2000]).astype(np.int32))
    still, turned = al_majed(array, BANK), al_majed(replace(array, rate=array.rate + 0.05), BANK)
    np.testing.assert_allclose(turned.rate - 0.05, still.rate, atol=1e-12)
    assert turned.note == still.note


def test_correlations_that_cannot_be(make_array):
    # Expected: C(ρ) of N gyros is positive definite for -1/(N-1) < ρ < 1.
    array = make_array(100, np.full(6, 0.1))
    for correlation in (-0.2, -0.5, 1.0):
        with pytest.raises(CannotRun, match=f"6 gyros cannot all have the correlation {correlation:g}.*above -0.2"):
            al_majed(array, replace(BANK, bank_correlations=(0.0, correlation)))
    assert np.isfinite(al_majed(array, replace(BANK, bank_correlations=(-0.19,))).rate).all()


def test_reason_when_the_noise_is_not_known(make_array):
    array = make_array(10, UNEQUAL)
    array = replace(array, noise=replace(array.noise, arw=np.array([0.1, np.nan, 0.1, 0.1])))
    with pytest.raises(CannotRun, match=r"angle random walk.*gyro 2 of 4"):
        al_majed(array, BANK)
    assert np.isfinite(al_majed(array, replace(BANK, arw=0.1)).rate).all()
