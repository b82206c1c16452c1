"""The choice of a motion model, on simulated rates whose truth is known."""

import math
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from vgyro.engine.native import statespace as native
from vgyro.errors import DataError, EngineError, TooShort
from vgyro.fusion.motion import choice
from vgyro.fusion.motion.choice import _compared
from vgyro.fusion.motion.evidence import gather
from vgyro.fusion.motion.models import Motion
from vgyro.fusion.motion.noisy_rate import NoisyRate
from vgyro.fusion.motion.search import MotionFit
from vgyro.fusion.motion.smoother import choose_motion, smooth

POLE = math.exp(-2 * math.pi * 40 / 500)
"""Of a sensor of 40 Hz at 500 Hz."""
DRIVEN = ("random_walk", "acceleration", "jerk")


def white(seed, samples):
    return np.random.default_rng(seed).standard_normal(samples)


def coloured(seed, samples, phi=POLE):
    """AR(1) noise of variance 1."""
    return lfilter([1.0], [1.0, -phi], math.sqrt(1 - phi**2) * white(seed, samples + 200))[200:]


def band_limited(seed, samples, rate_hz, sd, bandwidth_hz):
    """Gaussian, flat up to the bandwidth and nothing above; half a period."""
    frequency = np.fft.rfftfreq(2 * samples, 1 / rate_hz)
    lines = white(seed, len(frequency)) + 1j * white(seed + 1000, len(frequency))
    lines[(frequency == 0) | (frequency > bandwidth_hz)] = 0.0
    return np.fft.irfft(lines)[:samples] * sd * samples / math.sqrt(np.count_nonzero(lines))


def one_stretch(z):
    return np.zeros(len(z), dtype=np.int32)


def nees(truth, noise, r, rate_hz, phi=0.0, models=DRIVEN):
    """Normalised squared error of the smoother whose model is chosen on the same samples."""
    z = truth + noise
    motion = choose_motion(NoisyRate(z, r, one_stretch(z), rate_hz, phi), models)
    found = smooth(NoisyRate(z, r, one_stretch(z), rate_hz, phi), motion)
    return float(np.mean((found.rate - truth) ** 2 / found.variance))


def test_nees_of_a_random_walk():
    # Known truth: the model is right. Mean over 8 seeds between 0.9 and 1.15.
    found = [
        nees(
            np.cumsum(white(seed, 6000)) * 0.3, 2.0 * white(seed + 50, 6000), 4.0, 100.0, models=("random_walk", "jerk")
        )
        for seed in range(8)
    ]
    assert 0.9 < np.mean(found) < 1.15


def test_nees_of_band_limited_motion():
    # Known truth, of which no model is right: 20 deg/s flat up to 0.5 Hz. Mean over 8 seeds between 0.9 and 1.15.
    found = [
        nees(band_limited(seed, 12000, 100.0, 20.0, 0.5), 1.0 * white(seed + 50, 12000), 1.0, 100.0, models=("jerk",))
        for seed in range(8)
    ]
    assert 0.9 < np.mean(found) < 1.15


@pytest.mark.full
@pytest.mark.parametrize("phi", [0.0, POLE])
@pytest.mark.parametrize("samples", [30_000, 200_000])
def test_nees_at_500_hz(samples, phi):
    # As above with all models, the noise of one gyro at 500 Hz, white and through the sensor's pole.
    found = [
        nees(
            band_limited(seed, samples, 500.0, 20.0, 0.5), 2.4 * coloured(seed + 50, samples, phi), 2.4**2, 500.0, phi,
            (*DRIVEN, "oscillator", "markov"),
        )
        for seed in range(8)
    ]  # fmt: skip
    assert 0.9 < np.mean(found) < 1.15


@pytest.mark.parametrize("phi", [0.0, POLE])
def test_sinusoid(phi):
    """Known truth: 63 deg/s at 0.25 Hz in 2.4 deg/s at 500 Hz: the amplitude within 0.5 %, no delay (0.2°), and the
    oscillator is found."""
    time = np.arange(16_000) / 500.0
    z = 63.0 * np.sin(2 * math.pi * 0.25 * time) + 2.4 * coloured(7, len(time), phi)
    motion = choose_motion(NoisyRate(z, 2.4**2, one_stretch(z), 500.0, phi))
    found = smooth(NoisyRate(z, 2.4**2, one_stretch(z), 500.0, phi), motion)
    basis = np.column_stack([np.sin(2 * math.pi * 0.25 * time), np.cos(2 * math.pi * 0.25 * time)])
    inphase, quadrature = np.linalg.lstsq(basis, found.rate, rcond=None)[0]
    assert math.hypot(inphase, quadrature) == pytest.approx(63.0, rel=0.005)
    assert abs(math.degrees(math.atan2(quadrature, inphase))) < 0.2
    assert motion.model == "oscillator"
    assert motion.parameters["frequency_hz"] == pytest.approx(0.25, rel=0.002)
    assert motion.table[0].cost == min(row.cost for row in motion.table)


def test_colour_is_not_taken_for_motion():
    """Known truth: a random walk of q = 50 deg²/s³ in noise through a pole of 40 Hz at 500 Hz. With the pole given the
    mean of 6 fits is within 15 % of q (each has 12 %); without it, more than twice q is found."""
    q, given, ignored = 50.0, [], []
    for seed in range(6):
        z = np.cumsum(white(seed, 10_000)) * math.sqrt(q / 500.0) + 2.4 * coloured(seed + 50, 10_000)
        for phi, into in ((POLE, given), (0.0, ignored)):
            motion = choose_motion(NoisyRate(z, 2.4**2, one_stretch(z), 500.0, phi), ("random_walk",))
            into.append(motion.parameters["q"])
    assert np.mean(given) == pytest.approx(q, rel=0.15)
    assert np.mean(ignored) > 2 * q


def test_a_constant_rate():
    """Known truth: 5 deg/s in white noise. The r.m.s. error of 6 tries is at most twice that of the average."""
    errors = []
    for seed in range(6):
        z = 5.0 + 0.3 * white(seed, 4000)
        motion = choose_motion(NoisyRate(z, 0.09, one_stretch(z), 200.0))
        errors.append(np.mean((smooth(NoisyRate(z, 0.09, one_stretch(z), 200.0), motion).rate - 5.0) ** 2))
    assert math.sqrt(np.mean(errors)) < 2 * 0.3 / math.sqrt(4000)


def test_few_samples_at_1_hz():
    # Known truth: a random walk of 300 samples; the fit beats the samples themselves and the constant.
    truth = np.cumsum(white(1, 300)) * 0.02
    z = truth + 0.05 * white(2, 300)
    motion = choose_motion(NoisyRate(z, 0.05**2, one_stretch(z), 1.0))
    error = smooth(NoisyRate(z, 0.05**2, one_stretch(z), 1.0), motion).rate - truth
    assert np.std(error) < 0.6 * 0.05


def test_a_long_recording_in_pieces():
    """Known truth: a random walk so slow that noise and rate are alike at 0.1 Hz, in 13 minutes at 500 Hz. The mean of
    4 fits is within 15 % of q: each has 1/√(800 s · ∫G² df) = 13 %, their mean 6 %."""
    rate_hz, samples, q = 500.0, 400_000, 4.0 * (2 * math.pi * 0.1) ** 2 / 500.0
    found = []
    for seed in range(4):
        z = np.cumsum(white(seed, samples)) * math.sqrt(q / rate_hz) + 2.0 * white(seed + 50, samples)
        motion = choose_motion(NoisyRate(z, 4.0, one_stretch(z), rate_hz), models=("random_walk",))
        found.append(motion.parameters["q"])
    assert np.mean(found) == pytest.approx(q, rel=0.15)
    assert [len(one.z) for one in gather(NoisyRate(z, 4.0, one_stretch(z), rate_hz))] == [200_000, 200_000]


def test_only_moving_samples_count():
    # Expected: the choice of the moving part by itself; what it does at rest has no say.
    moving = np.zeros(9000, dtype=bool)
    moving[3000:6000] = True
    z = 0.1 * white(3, 9000)
    z[moving] += np.cumsum(white(4, 3000)) * 0.05
    part = z[moving]
    whole = choose_motion(NoisyRate(z, 0.01, one_stretch(z), 100.0), models=DRIVEN, moving=moving)
    alone = choose_motion(NoisyRate(part, 0.01, one_stretch(part), 100.0), models=DRIVEN)
    assert (whole.model, whole.parameters) == (alone.model, alone.parameters)


def test_what_smooths_best_is_found():
    """Known truth: band-limited motion, which no jerk is. The true error of the smoother is at most 2 % above the least
    that any q gives, in the mean of 4 tries."""
    ratios = []
    for seed in range(4):
        truth = band_limited(seed, 12000, 100.0, 20.0, 0.5)
        z = truth + white(seed + 50, 12000)
        motion = choose_motion(NoisyRate(z, 1.0, one_stretch(z), 100.0), models=("jerk",))
        others = [replace(motion, parameters={"q": motion.parameters["q"] * 2.0**k}) for k in range(-4, 5)]
        errors = [
            np.std(smooth(NoisyRate(z, 1.0, one_stretch(z), 100.0), one).rate - truth) for one in (motion, *others)
        ]
        ratios.append(errors[0] / min(errors))
    assert np.mean(ratios) < 1.02


BROKEN = {"frequency_hz": 0.03995, "damping": 6.57, "second_hz": 1.603, "second_damping": 100.09, "sd": 1129.0}


def test_a_model_that_breaks_down_is_left_out(monkeypatch):
    # Expected: of two fits the better one cannot be smoothed with; the other is taken.
    z = np.cumsum(white(4, 3000)) * 0.1 + white(5, 3000)
    bad = MotionFit("pair", BROKEN, (), np.ones(1), -1e9, 0.0)

    def compared(*arguments):
        found = _compared(*arguments)
        return replace(found, fits=[replace(bad, signal=found.fits[0].signal), *found.fits])

    own = native.smooth

    def smoothing(z, r, model, *regime):
        if len(model.reads) == 4:
            raise EngineError("the smoothed rate is not finite")
        return own(z, r, model, *regime)

    monkeypatch.setattr(choice, "_compared", compared)
    monkeypatch.setattr(native, "smooth", smoothing)
    motion = choose_motion(NoisyRate(z, 1.0, one_stretch(z), 50.0))
    assert motion.table[0].parameters == BROKEN
    assert motion.parameters == motion.table[1].parameters


@pytest.mark.parametrize("r", [1e-3, 1e-12])
def test_parameters_that_broke_the_smoother(r):
    # Expected: a finite rate, or an error that is caught; never one that ends the job.
    z = 1e3 * np.cumsum(white(4, 3000))
    with suppress(EngineError, DataError):
        smoothed = smooth(NoisyRate(z, r, one_stretch(z), 50.0), Motion("oscillator", BROKEN, 50.0))
        assert np.isfinite(smoothed.rate).all()
    assert choose_motion(NoisyRate(z, r, one_stretch(z), 50.0)) is not None


def test_gaps_and_samples_that_say_nothing():
    # Known truth: a random walk with gaps; q within 30 % though a tenth of the samples is lost.
    segment = np.repeat([0, 1, 2], 4000)
    rng = np.random.default_rng(8)
    z = np.cumsum(0.1 * rng.standard_normal(12000)) + np.repeat([0.0, 50.0, -20.0], 4000) + rng.standard_normal(12000)
    r = np.ones(12000)
    lost = rng.random(12000) < 0.1
    r[lost], z[lost] = np.inf, np.nan
    motion = choose_motion(NoisyRate(z, r, segment, 100.0), models=("random_walk",))
    assert motion.parameters["q"] == pytest.approx(1.0, rel=0.3)


@pytest.mark.parametrize("value", [0.0, 3.5])
def test_data_without_noise(value):
    z = np.full(500, value)
    with pytest.raises(DataError, match="at every sample"):
        choose_motion(NoisyRate(z, 1.0, one_stretch(z), 100.0))
    with pytest.raises(DataError, match="sample 0: the variance of the noise is not above zero"):
        choose_motion(NoisyRate(white(1, 500), 0.0, one_stretch(z), 100.0))


def test_too_few_samples():
    z = white(1, 500)
    with pytest.raises(TooShort, match="0 samples"):
        choose_motion(NoisyRate(z[:31], 1.0, one_stretch(z[:31]), 100.0))
    with pytest.raises(TooShort, match="0 samples"):
        choose_motion(NoisyRate(z, 1.0, np.arange(500), 100.0))
    with pytest.raises(TooShort, match="say anything"):
        choose_motion(NoisyRate(z, np.full(500, np.inf), one_stretch(z), 100.0))
