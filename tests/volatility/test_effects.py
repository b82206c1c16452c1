"""The verdict on each gyro, on simulated series of which it is known what their ARCH effect is."""

from collections import Counter
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from scipy.signal import lfilter

from vgyro.metrics.spectra.tones import find_tones
from vgyro.metrics.spectra.welch import spectral_density
from vgyro.volatility import block_means, fit_garch
from vgyro.volatility.effects.kinds import GarchEffect, RateTone, Sampled, alias, gather_evidence
from vgyro.volatility.effects.verdicts import Effect, explain_array
from vgyro.volatility.effects.whiten import block_gain

SIGMA = 0.04  # deg/s, of the 1 Hz means
T = 3600
RATE_HZ = 200.0
SPAN = 61
TIME = np.arange(float(T))


def white(rng: np.random.Generator, samples: int = T) -> np.ndarray:
    return SIGMA * rng.standard_normal(samples)


def garch(rng: np.random.Generator, alpha: float, beta: float) -> np.ndarray:
    """GARCH(1,1) of standard deviation SIGMA."""
    noise, series, variance = rng.standard_normal(T), np.empty(T), 1.0
    for t in range(T):
        series[t] = noise[t] * np.sqrt(variance)
        variance = 1 - alpha - beta + alpha * series[t] ** 2 + beta * variance
    return SIGMA * series


def random_walk(rng: np.random.Generator, step: float = 0.0025) -> np.ndarray:
    return step * np.cumsum(rng.standard_normal(T))


def warming() -> np.ndarray:
    """Temperature drift of 0.3 deg/s with a time constant of 900 s."""
    return 0.3 * (1 - np.exp(-TIME / 900))


def seen_tone(frequency: float, amplitude: float) -> np.ndarray:
    return amplitude * np.sin(2 * np.pi * frequency * TIME + 0.8)


def explain(
    values: np.ndarray, tones: list[RateTone] | None = None, model: GarchEffect | None = None, block: int = 200
) -> Effect:
    """The effect of a series [T], or of the first of several [T, N]."""
    values = values[:, None] if values.ndim == 1 else values
    gyros = [f"g{column + 1}" for column in range(values.shape[1])]
    sampled = Sampled(np.arange(len(values), dtype=float), 1.0, block, 0.015)
    models = {"g1": model} if model else {}
    return explain_array(values, gyros, sampled, SPAN, 1, {"g1": tones or []}, models)[0]


def kinds(verdict: str) -> str:
    """Verdict without the times of disturbances."""
    return " + ".join("disturbance" if word.startswith("disturbance") else word for word in verdict.split(" + "))


def verdicts(make, seeds: int, tones: list[RateTone] | None = None) -> Counter:
    return Counter(kinds(explain(make(np.random.default_rng(seed)), tones).verdict) for seed in range(seeds))


def holding(found: Counter, word: str) -> float:
    return sum(count for verdict, count in found.items() if word in verdict) / sum(found.values())


def test_white_noise_is_nothing():
    # The figure to reach: any verdict in at most 5 %; of 60, no more than 7 (99 % binomial limit).
    assert verdicts(white, 60)["nothing"] >= 53


@pytest.mark.full
@pytest.mark.parametrize("samples", [120, 360, 3600])
@pytest.mark.parametrize("mean", [0.0, 0.2])
def test_false_alarms_on_white_noise(samples: int, mean: float):
    # The figure to reach: a false alarm of any verdict in <= 5 % of 800 seeds.
    found = verdicts(lambda rng: mean + white(rng, samples), 800)
    assert found["nothing"] / 800 >= 0.95


# Measured power at T = 3600 over 400 seeds, stated in explain_array; see test_power.
@pytest.mark.parametrize(("alpha", "beta"), [(0.1, 0.8), (0.05, 0.9), (0.2, 0.75)])
def test_garch_is_heteroskedastic(alpha: float, beta: float):
    found = verdicts(lambda rng: garch(rng, alpha, beta), 15)
    assert holding(found, "heteroskedastic") == 1
    assert holding(found, "drift") == holding(found, "tone") == 0


POWER = [
    (0.1, 0.8, 0.99), (0.05, 0.9, 0.98), (0.2, 0.75, 0.99), (0.1, 0.3, 0.97), (0.02, 0.97, 0.80), (0.03, 0.9, 0.70),
    (0.05, 0.5, 0.60),
]  # fmt: skip


@pytest.mark.full
@pytest.mark.parametrize(("alpha", "beta", "power"), POWER)
def test_power(alpha: float, beta: float, power: float):
    """How often GARCH is seen at T = 3600. Where α is small the truth may be missed: stated, not hidden."""
    found = verdicts(lambda rng: garch(rng, alpha, beta), 400)
    assert holding(found, "heteroskedastic") >= power
    assert holding(found, "drift") <= 0.05
    assert holding(found, "tone") <= 0.05


@pytest.mark.parametrize("drift", [random_walk, lambda _: warming()])
def test_drift_is_no_changing_variance(drift):
    found = verdicts(lambda rng: white(rng) + drift(rng), 30)
    # A random walk may stay small by chance: then there is no ARCH effect of the level to explain.
    assert holding(found, "drift") >= 0.9
    assert holding(found, "heteroskedastic") <= 0.1


@pytest.mark.full
@pytest.mark.parametrize("drift", [random_walk, lambda _: warming(), lambda _: 0.1 * (TIME > 1500)])
def test_drift_over_many_seeds(drift):
    found = verdicts(lambda rng: white(rng) + drift(rng), 400)
    assert holding(found, "drift") >= 0.95
    assert holding(found, "heteroskedastic") <= 0.05


def test_garch_and_drift():
    found = verdicts(lambda rng: garch(rng, 0.1, 0.85) + random_walk(rng), 20)
    assert found["heteroskedastic + drift"] >= 18


def test_garch_and_tone():
    found = verdicts(lambda rng: garch(rng, 0.1, 0.85) + seen_tone(0.23, 0.03), 15)
    assert found["heteroskedastic + tone at 0.23 Hz"] >= 14


def test_an_aliased_tone_is_named_by_its_own_frequency():
    # 6.503 Hz in 200 Hz data: seen in the 1 Hz means at 0.497 Hz, with the gain of the mean of 200 samples (closed
    # form), 0.049. From the samples on, as the pipeline does it.
    time = np.arange(T * int(RATE_HZ)) / RATE_HZ
    for seed in range(2):
        rng = np.random.default_rng(seed)
        rate = 0.1 * np.sqrt(RATE_HZ) * rng.standard_normal(time.size) + 4 * np.sin(2 * np.pi * 6.503 * time)
        tones = [RateTone(line.frequency, line.amplitude) for line in find_tones(spectral_density(rate, RATE_HZ))]
        effect = explain(block_means(rate[:, None], RATE_HZ, 1.0).values, tones)
        assert effect.verdict == "tone at 6.5 Hz"
        assert effect.tone_frequency == pytest.approx(6.503, abs=0.002)
        assert effect.tone_amplitude == pytest.approx(4, rel=0.02)
        assert effect.tone_seen_at == pytest.approx(0.497, abs=0.001)
        assert effect.p_level < 1e-6
        assert effect.p_whitened > 0.001
        assert "is seen at 0.497 Hz as 0.2 deg/s" in effect.sentence
        assert "alone makes ARCH-LM about" in effect.sentence


@pytest.mark.parametrize(("frequency", "seen"), [(6.5, 0.5), (6.503, 0.497), (93.77, 0.23)])
def test_where_an_alias_is_seen(frequency: float, seen: float):
    assert alias(frequency, 1.0) == pytest.approx(seen)


@pytest.mark.parametrize("frequency", [6.5, 6.503])
def test_a_tone_is_named_if_its_amplitude_fits(frequency: float):
    amplitude = 0.03 / abs(block_gain(frequency / RATE_HZ, 200))
    seen = alias(frequency, 1.0)
    tones = [RateTone(frequency, amplitude), RateTone(30 + frequency, 0.3 * amplitude)]
    found = verdicts(lambda rng: white(rng) + seen_tone(seen, 0.03), 15, tones)
    assert found["tone at 6.5 Hz"] >= 14
    # What is ten times too small in the rate is not what is seen: the tone keeps the frequency of the series.
    other = explain(white(np.random.default_rng(0)) + seen_tone(seen, 0.03), [RateTone(frequency, amplitude / 10)])
    assert other.verdict == f"tone at {seen:.3g} Hz"
    assert other.tone_amplitude == pytest.approx(0.03, rel=0.2)


def knock(rng: np.random.Generator) -> np.ndarray:
    values = white(rng)
    values[2000] += 1.0
    return values


def movement(rng: np.random.Generator) -> np.ndarray:
    values = white(rng)
    values[2000:2006] += [0.3, -0.6, 0.9, -0.9, 0.6, -0.3]
    return values


@pytest.mark.parametrize("disturb", [knock, movement])
def test_a_knock_is_no_changing_variance(disturb):
    found = verdicts(disturb, 15)
    assert holding(found, "disturbance") == 1
    # False alarms of the test of variance: 2 %; of 15, no more than 2.
    assert holding(found, "heteroskedastic") <= 2 / 15
    effect = explain(disturb(np.random.default_rng(1)))
    assert effect.verdict.startswith("disturbance at t = 200")
    assert "not ARCH" in effect.sentence
    assert effect.kurtosis > 20


def test_what_moved():
    rng = np.random.default_rng(1)
    moved = np.column_stack([movement(rng), white(rng), movement(rng)])
    assert "in 2 of 3 gyros at the same time" in explain(moved).sentence
    alone = np.column_stack([knock(rng), white(rng)])
    assert "in this gyro alone" in explain(alone).sentence


def test_a_knock_in_a_gyro_of_changing_variance():
    values = garch(np.random.default_rng(2), 0.1, 0.85)
    values[2000] += 2.0
    assert explain(values).verdict == "heteroskedastic + disturbance at t = 2000 s"


def test_correlated_noise_is_no_changing_variance():
    found = verdicts(lambda rng: lfilter([SIGMA], [1, -0.6], rng.standard_normal(T)), 20)
    assert found["correlation"] >= 17


def test_squares_that_repel_each_other_are_no_arch():
    # A known truth: the variance alternates, so neighbouring squares correlate negatively; no ARCH(1), α >= 0, does so.
    values = white(np.random.default_rng(3)) * np.tile([1.0, 2.0], T // 2)
    evidence = gather_evidence(values, Sampled(TIME, 1.0, 200, 0.015), SPAN, 1, [], None)
    assert evidence.calm[1] < 1e-6
    assert not evidence.attract


@pytest.mark.parametrize(("true", "said"), [(True, "explains it"), (False, "does not explain it")])
def test_whether_garch_explains_it(true: bool, said: str):
    # Its own model explains a GARCH series; a model of constant variance does not.
    values = garch(np.random.default_rng(4), 0.1, 0.85)
    fit = fit_garch(values[:, None])
    model = GarchEffect(*(float(each[0]) for each in (fit.omega, fit.alpha, fit.beta)))
    effect = explain(values, model=model if true else GarchEffect(SIGMA**2, 0.0, 0.0))
    assert f"{said} (standardised: " in effect.sentence
    assert (effect.p_standardised > 0.01) is true
    assert np.isnan(explain(values).p_standardised)


def test_one_sentence():
    for make in (white, knock, lambda rng: garch(rng, 0.2, 0.75) + random_walk(rng) + seen_tone(0.23, 0.1)):
        sentence = explain(make(np.random.default_rng(5))).sentence
        assert sentence[0].isupper()
        assert sentence.endswith(".")
        assert ". " not in sentence


@pytest.mark.parametrize(
    ("series", "verdict"),
    [(np.full(400, 0.1), "no variance"), (np.ones(30), "too short: 30 samples"), (np.empty(0), "too short: 0 samples")],
)
def test_no_verdict(series: np.ndarray, verdict: str):
    effect = explain(series)
    assert effect.verdict == verdict
    assert effect.sentence.startswith("No verdict")
    assert np.isnan(effect.p_level)


@pytest.mark.parametrize("recording", ["rec2", "rec3", "rec4"])
@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_adis_drifts_and_moves(shared_data: Path, recording: str, axis: str):
    # METHODS.md: on two real boards nearly all of the ARCH effect was drift or aliased tones. SOURCE.md and a look at
    # the data: recording 4 has a movement at 3957 s, on x and y.
    table = pq.read_table(shared_data / "adis16405-static" / f"{recording}.parquet")
    rate = table.column(f"gyro_{axis}").to_numpy() * 0.05
    effect = explain(rate.reshape(-1, 100).mean(axis=1), block=100)
    assert "drift" in effect.verdict
    assert "heteroskedastic" not in effect.verdict
    moved = recording == "rec4" and axis in "xy"
    assert ("disturbance at t = 395" in effect.verdict) is moved
