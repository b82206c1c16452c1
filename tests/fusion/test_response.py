"""Gain, bandwidth and delay of every method: injected motion against the analytic row and against closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from vgyro.fusion import METHODS, FilterParameters, Fused, SampleWeights, measured_response

SAMPLES, RATE_HZ = 140_000, 200.0
FILTERS = ("jiang_markov", "jiang_random_walk", "xue_2012", "chang_2012")
SMOOTHERS = [name for name in METHODS if name.endswith("_smoothed")] + ["recommended"]
ADAPTIVE = ("bayard_ploen", "chang_2008", "stubberud_2008", "al_majed")  # see their own tests
# At rest as a whole these look at the rates themselves, so that a motion of a tenth of the noise is noise to them.
SEE_RATES_AT_REST = ("residual_weights", "recommended_unsmoothed", "residual_smoothed", "recommended")
MOMENTS = ("rolling_moment", "ewma_causal", "ewma_two_sided")
NARROW = FilterParameters(bandwidth_hz=1.05)
WIDE = FilterParameters(bandwidth_hz=5.0, tau_s=0.05)  # the Markov filter's DC gain is 0.36


@pytest.fixture
def array(make_array):
    """Four gyros at 200 Hz, correlated, one of them poor; weights that change each second, for each definition."""
    correlation = np.full((4, 4), 0.2) + 0.8 * np.eye(4)
    rng = np.random.default_rng(4)
    seconds, block = int(SAMPLES / RATE_HZ), (np.arange(SAMPLES) // int(RATE_HZ)).astype(np.int32)
    weights = {
        (model, mode, "level"): SampleWeights.of(rng.dirichlet(np.ones(4), seconds), block)
        for model in ("dcc", "ccc")
        for mode in ("in_sample", "causal")
    }
    return make_array(SAMPLES, [0.1, 0.1, 0.12, 0.3], correlation=correlation, weights=weights)


DECLARED = [name for name in METHODS if name not in (*FILTERS, *MOMENTS, *SMOOTHERS, *ADAPTIVE)]


@pytest.mark.parametrize("name", DECLARED)
def test_weights_of_sum_one_pass_a_motion_as_it_is(array, name):
    # Rounding of differences of rates of some deg/s leaves 1e-12 of a motion of 0.2 deg/s.
    parameters = replace(NARROW, definition="level", in_motion=name in SEE_RATES_AT_REST)
    array = replace(array, at_rest=np.full(SAMPLES, name not in SEE_RATES_AT_REST))
    declared = METHODS[name].fuse(array, parameters)
    found = measured_response(METHODS[name].fuse, array, parameters)
    np.testing.assert_allclose(found.gain, 1.0, atol=1e-9)
    assert found.dc_gain == pytest.approx(declared.dc_gain, abs=1e-9) == 1.0
    assert found.delay_s == pytest.approx(declared.delay_s, abs=1e-9) == 0.0
    for figures in (found, declared):
        assert math.isnan(figures.bandwidth_hz)
        assert math.isnan(figures.noise_bandwidth_hz)


@pytest.mark.parametrize("name", SMOOTHERS)
def test_smoothers_at_rest_have_the_response_they_declare(array, name):
    # Closed form: first-order low-pass of pole a forward and back, |1/(1 + i·f/a)|² brought to samples; -3 dB of both
    # passes together at the bandwidth asked for; no delay.
    deviations = {key: SampleWeights.of(np.full((700, 4), 0.1), one.block) for key, one in array.weights.items()}
    residual = {("dcc", "in_sample", "residual"): array.weights["dcc", "in_sample", "level"]}
    known = dict.fromkeys(residual, deviations["dcc", "in_sample", "level"])
    array = replace(array, weights=residual, deviations=known)
    declared = METHODS[name].fuse(array, NARROW)
    found = measured_response(METHODS[name].fuse, array, NARROW)
    assert declared.passes == 2
    assert declared.bandwidth_hz == pytest.approx(NARROW.bandwidth_hz, rel=1e-3)
    own = name not in SEE_RATES_AT_REST
    # Weights that follow the motion, of either sign, add noise of some 0.04 to the gain.
    assert found.bandwidth_hz == pytest.approx(declared.bandwidth_hz, rel=3e-3 if own else 0.03)
    assert found.noise_bandwidth_hz == pytest.approx(declared.noise_bandwidth_hz, rel=3e-3 if own else 0.03)
    # Lines that stand out are passed at rest, too: of the sinusoids that measure the response a few do.
    assert found.dc_gain == pytest.approx(1.0, abs=1e-5 if own else 1e-3)
    # Weights that follow the motion add noise of some 0.04 to the gain of each frequency: at 0.5 Hz that is 12 ms.
    assert found.delay_s == pytest.approx(0.0, abs=1e-4 if own else 0.015)
    pole = declared.bandwidth_hz / math.sqrt(math.sqrt(2) - 1)
    slow = found.frequency < 5
    np.testing.assert_allclose(
        found.gain[slow], 1 / (1 + (found.frequency[slow] / pole) ** 2), atol=2e-3 if own else 0.04
    )


@pytest.mark.parametrize("name", MOMENTS)
def test_weights_of_moments_pass_a_motion_but_for_what_it_does_to_them(array, name):
    # The motion is in the moments, too, which the analytic row leaves out (that is what moved.parquet is for): at a
    # tenth of the noise it weakens a constant by less than 2 %. Weights that change add noise to the gain of each of
    # 144 frequencies, some 0.1; their mean has 0.01.
    found = measured_response(METHODS[name].fuse, array, NARROW)
    assert METHODS[name].fuse(array, NARROW).dc_gain == 1.0
    assert found.dc_gain == pytest.approx(1.0, abs=0.02)
    assert abs(found.gain.mean() - 1) < 0.04
    assert math.isnan(found.bandwidth_hz)


@pytest.mark.parametrize("name", FILTERS)
@pytest.mark.parametrize("parameters", [NARROW, WIDE])
def test_filters_have_the_response_they_declare(array, name, parameters):
    # Bandwidth and noise bandwidth are those of continuous time (Jiang eq. 18): samples change them by (sT)²/24 and
    # (sT)²/12, 0.1 % and 0.2 % at 5 Hz. Gain and delay are those of the recursion itself.
    declared = METHODS[name].fuse(array, parameters)
    found = measured_response(METHODS[name].fuse, array, parameters)
    assert found.dc_gain == pytest.approx(declared.dc_gain, rel=1e-9)
    assert found.bandwidth_hz == pytest.approx(declared.bandwidth_hz, rel=3e-3)
    assert found.noise_bandwidth_hz == pytest.approx(declared.noise_bandwidth_hz, rel=3e-3)
    assert found.delay_s == pytest.approx(declared.delay_s, rel=1e-4)
    keep = math.exp(-2 * math.pi * declared.bandwidth_hz / RATE_HZ)
    turn = np.exp(-2j * math.pi * found.frequency / RATE_HZ)
    np.testing.assert_allclose(found.gain, declared.dc_gain * (1 - keep) / (1 - keep * turn), atol=1e-9)


def boxcar(length: int, ahead: int):
    """A running mean that declares nothing, `ahead` samples of it later than its own."""

    def fuse(array, parameters):  # noqa: ARG001
        mean = array.rate.mean(axis=1)
        padded = np.pad(mean, (length - 1 - ahead, ahead), mode="edge")
        return Fused(np.convolve(padded, np.full(length, 1 / length), mode="valid"))

    return fuse


@pytest.mark.parametrize("ahead", [0, 10])
def test_running_mean_that_declares_nothing(array, ahead):
    # Closed form of a mean of 21 samples: delay of 10 samples less those ahead, -3 dB where |sin(21x)/(21 sin x)|² is
    # 1/2, noise bandwidth 1/21 of the whole band. Between its zeros the gain is not followed: 2 %.
    found = measured_response(boxcar(21, ahead), array, NARROW)
    assert found.dc_gain == pytest.approx(1.0, rel=1e-9)
    assert found.delay_s == pytest.approx((10 - ahead) / RATE_HZ, abs=1e-6)
    x = math.pi * found.bandwidth_hz / RATE_HZ
    assert math.sin(21 * x) / (21 * math.sin(x)) == pytest.approx(math.sqrt(0.5), rel=2e-3)
    assert found.noise_bandwidth_hz == pytest.approx(RATE_HZ / 2 / 21, rel=0.02)


def test_short_recordings_are_stood_in_for_by_noise(make_array):
    array = make_array(900, [0.1, 0.2], rate_hz=50.0)
    declared = METHODS["chang_2012"].fuse(array, NARROW)
    found = measured_response(METHODS["chang_2012"].fuse, array, NARROW)
    assert found.bandwidth_hz == pytest.approx(declared.bandwidth_hz, rel=3e-3)
    assert found.delay_s == pytest.approx(declared.delay_s, rel=2e-3)


def test_part_of_a_recording_keeps_its_weights(make_array):
    rng = np.random.default_rng(6)
    block = np.repeat(np.arange(-1, 9), 10).astype(np.int32)
    weights = SampleWeights.of(rng.dirichlet(np.ones(3), 9), block)
    array = make_array(100, [0.1, 0.1, 0.1], weights={("dcc", "causal", "level"): weights})
    part = array.part(slice(37, 74))
    np.testing.assert_array_equal(part.rate, array.rate[37:74])
    whole, some = (one.weights["dcc", "causal", "level"].combine(one.rate)[0] for one in (array, part))
    np.testing.assert_array_equal(some, whole[37:74])
