"""The rules of the verdict on a gyro, each on both sides, on evidence that is given."""

import math

import numpy as np
import pytest

from vgyro.volatility.effects.kinds import (
    EffectEvidence,
    Episode,
    GarchEffect,
    Sampled,
    SeenTone,
    _attract,
    _drift,
    _episodes,
    _neighbours,
    _Noise,
    _tone,
)
from vgyro.volatility.effects.verdicts import _sentence, verdict_of
from vgyro.volatility.effects.whiten import SeriesLine, Whitened, whiten

SAMPLED = Sampled(np.arange(3600.0), 1.0, 200, 0.015)


def evidence(**found):
    """A gyro that passes every test, but for what is given."""
    passed, none = (0.5, 0.5), (math.nan, math.nan)
    usual = {
        "lags": 1, "level": passed, "detrended": passed, "whitened": passed, "standardised": none,
        "standardised_long": none, "calm": passed, "calm_long": (9.0, 0.6), "attract": True, "attract_long": True,
        "kurtosis": 3.0, "calm_kurtosis": 3.0, "drift": None, "moved": 0.1, "tone": None, "episodes": (),
        "neighbours": None,
    }  # fmt: skip
    return EffectEvidence(**(usual | found))


def sentence(one, sampled=SAMPLED, others=None, garch=None):
    return _sentence(one, others or [one], sampled, garch)


@pytest.mark.parametrize(("p_value", "changes"), [(0.0199, True), (0.0201, False)])
def test_either_test_at_two_percent_with_squares_that_attract(p_value, changes):
    for name in ("calm", "calm_long"):
        assert evidence(**{name: (8.0, p_value)}).heteroskedastic == changes
    assert not evidence(calm=(8.0, p_value), attract=False).heteroskedastic
    assert not evidence(calm_long=(8.0, p_value), attract_long=False).heteroskedastic


@pytest.mark.parametrize(("size", "named"), [(20.0, False), (20.1, True)])
def test_beside_changing_variance_a_knock_is_more_than_twenty_deviations(size, named):
    knock = (Episode(7.0, size),)
    assert verdict_of(evidence(episodes=knock)) == "disturbance at t = 7 s"
    found = verdict_of(evidence(episodes=knock, calm=(90.0, 1e-9)))
    assert found == ("heteroskedastic + disturbance at t = 7 s" if named else "heteroskedastic")


def test_the_less_likely_of_the_two_tests_is_said():
    rest = "no change of variance is left (ARCH-LM, "
    assert f"{rest}1 lag: 3.0, p = 0.08" in sentence(evidence(calm=(3.0, 0.08), calm_long=(9.0, 0.6)))
    assert f"{rest}12 lags: 18.0, p = 0.11" in sentence(evidence(calm=(0.1, 0.7), calm_long=(18.0, 0.11)))
    assert "no change of variance" not in sentence(evidence(calm=(30.0, 1e-3)))
    still = "ARCH-LM with"
    assert f"{still} 1 lag still is 30.0, p = 0.001" in sentence(evidence(calm=(30.0, 1e-3), calm_long=(30.0, 2e-3)))
    assert f"{still} 12 lags still is 30.0, p = 0.001" in sentence(evidence(calm=(30.0, 2e-3), calm_long=(30.0, 1e-3)))
    repelled = evidence(calm=(30.0, 1e-3), attract=False, calm_long=(30.0, 2e-3))
    assert f"{still} 12 lags still is 30.0, p = 0.002" in sentence(repelled)


@pytest.mark.parametrize(("few", "many", "said"), [(0.3, 0.6, "4.0, p = 0.3"), (0.6, 0.3, "5.0, p = 0.3")])
def test_whether_garch_explains_it_is_said_of_the_worse_test(few, many, said):
    one = evidence(calm=(30.0, 1e-3), standardised=(4.0, few), standardised_long=(5.0, many))
    assert f"explains it (standardised: {said})" in sentence(one, garch=GarchEffect(1.0, 0.1, 0.8))


@pytest.mark.parametrize(("statistic", "said"), [(0.9, False), (1.0, True)])
def test_what_a_tone_makes_alone_is_said_from_one_on(statistic, said):
    tone = SeenTone(6.5, 4.0, 0.5, 0.2, True, 0.3, statistic)
    assert ("alone makes ARCH-LM about" in sentence(evidence(tone=tone))) == said


def test_where_a_tone_is_seen():
    # Rule: elsewhere than in the rate only in means of several samples, and no nearer than it is known.
    where = "is seen at 0.5 Hz as 0.2 deg/s, "
    far, near = (SeenTone(frequency, 4.0, 0.5, 0.2, True, 0.3, 9.0) for frequency in (6.5, 0.51))
    assert where in sentence(evidence(tone=far))
    assert where not in sentence(evidence(tone=near))
    assert where not in sentence(evidence(tone=far), Sampled(SAMPLED.time, 1.0, 1, 0.015))


def test_in_how_many_gyros():
    knock, elsewhere = (Episode(100.0, 9.0),), (Episode(110.1, 9.0),)
    one = evidence(episodes=knock)
    others = [one, evidence(episodes=(Episode(110.0, 9.0),)), evidence(episodes=elsewhere), None]
    assert "in 2 of 4 gyros at the same time" in sentence(one, others=others)
    assert "in this gyro alone" in sentence(one, others=[one, evidence(episodes=elsewhere)])


def parts_of(residual, disturbed=None, lines=(), tones=None, autoregression=()):
    zero = np.zeros(len(residual))
    none = np.zeros(len(residual), dtype=bool)
    return Whitened(
        residual, residual, zero, zero if tones is None else tones, lines, np.array(autoregression),
        none if disturbed is None else disturbed,
    )  # fmt: skip


@pytest.mark.parametrize(("seconds", "short"), [(20, True), (30, True), (31, False)])
def test_an_episode_lasts_for_half_a_minute(seconds, short):
    residual = np.random.default_rng(1).standard_normal(3600)
    disturbed = np.zeros(3600, dtype=bool)
    disturbed[1000 : 1001 + seconds : 1] = True
    found, calm = _episodes(parts_of(residual, disturbed), SAMPLED)
    assert len(found) == (1 if short else 0)
    assert calm.all() == (not short)


def test_pauses_part_episodes_and_there_are_five_at_most():
    residual = np.random.default_rng(1).standard_normal(3600)
    for apart, many in ((10, 1), (11, 2)):
        disturbed = np.zeros(3600, dtype=bool)
        disturbed[[1000, 1000 + apart]] = True
        assert len(_episodes(parts_of(residual, disturbed), SAMPLED)[0]) == many
    for number, many in ((5, 5), (6, 0)):
        disturbed = np.zeros(3600, dtype=bool)
        disturbed[100 * np.arange(1, number + 1)] = True
        assert len(_episodes(parts_of(residual, disturbed), SAMPLED)[0]) == many


def test_arch_lm_of_a_component():
    # Truth: cov(e²_t, e²_{t+1})/var(e²) of a sinusoid in 400,000 samples of normal noise.
    samples = 400_000
    component = 2.0 * np.sin(2 * np.pi * 0.01 * np.arange(samples))
    square = (component + np.random.default_rng(2).standard_normal(samples)) ** 2
    correlation = np.corrcoef(square[1:], square[:-1])[0, 1]
    noise = _Noise(1.0, 3.0, 1.0, 3600)
    assert noise.arch_lm(component) == pytest.approx(3600 * correlation**2, rel=0.05)
    # By definition: what the noise gives is taken off the covariance, to nothing.
    assert noise.arch_lm(component, 1e6) == 0.0
    half = 0.5 * float(np.cov(component[1:] ** 2, component[:-1] ** 2)[0, 1])
    assert noise.arch_lm(component, half) == pytest.approx(noise.arch_lm(component) / 4, rel=1e-6)


def test_squares_attract_without_what_is_left_out():
    # By hand: squares 1 and 4 in turn repel; a pair far off would attract.
    series = np.tile([1.0, 2.0], 50)
    keep = np.ones(100, dtype=bool)
    assert not _attract(series, 1, keep)
    series[[40, 41]] = 100.0
    assert _attract(series, 1, keep)
    keep[[40, 41]] = False
    assert not _attract(series, 1, keep)
    # By hand: squares over their mean -1 and +1 in turn, every second left out: nothing is left to attract.
    keep = np.arange(100) % 2 == 0
    assert not _attract(np.tile([1.0, 2.0], 50), 1, keep)


@pytest.mark.parametrize(("samples", "told"), [(182, False), (183, True)])
def test_a_drift_shows_in_three_spans(samples, told):
    # Truth: steps of a hundred standard deviations.
    steps = 100.0 * (np.arange(samples) // 61 % 2)
    parts = whiten(np.random.default_rng(1).standard_normal(samples), 1.0, 61)
    moved = Whitened(parts.residual, parts.quiet, steps, parts.tones, (), np.empty(0), parts.disturbed)
    found = _drift(moved, np.zeros(samples), _Noise(1.0, 3.0, 1.0, samples), 61)
    assert (found is not None) == told


def test_the_strongest_tone_is_named():
    time = np.arange(3600)
    lines = (SeriesLine(0.1, 1.0, 1e-9), SeriesLine(0.2, 3.0, 1e-9), SeriesLine(0.3, 2.0, 1e-9))
    tones = sum(one.amplitude * np.sin(2 * np.pi * one.frequency * time) for one in lines)
    found = _tone(parts_of(np.zeros(3600), lines=lines, tones=tones), _Noise(1.0, 3.0, 1.0, 3600), SAMPLED, [], 1.0)
    assert (found.frequency, found.amplitude, found.known) == (0.2, 3.0, False)
    # By hand: 3²/2 of 1 + (1 + 9 + 4)/2.
    assert found.share == pytest.approx(4.5 / 8.0, rel=1e-3)


@pytest.mark.parametrize(("order", "p_value", "told"), [(1, 0.009, True), (1, 0.011, False), (0, 0.009, False)])
def test_correlation_is_named_where_the_detrended_series_fails(order, p_value, told):
    # Truth: neighbours correlate by 0.5: 3600·0.5⁴ = 225, far above 6.6, the 1 % of chi².
    rest = np.convolve(np.random.default_rng(1).standard_normal(3601), [1.0, 1.0], mode="valid")
    found = _neighbours(rest, parts_of(rest, autoregression=[0.5] * order), p_value, 3600)
    assert found == (pytest.approx(0.5, abs=0.05) if told else None)
    assert _neighbours(rest, parts_of(rest, autoregression=[0.5]), 0.0, 90) is None
