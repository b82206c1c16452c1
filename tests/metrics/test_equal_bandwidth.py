"""1σ at one bandwidth, against closed forms."""

import math

import numpy as np
import pytest
from scipy.signal import lfilter

from vgyro.config import MetricsOptions
from vgyro.fusion import ArrayNoise, ArrayRates, FilterParameters, select
from vgyro.metrics import Equaliser, LowPass, Sampling, common_bandwidth
from vgyro.metrics.static.figures import static_figures

RATE_HZ = 100.0
OPTIONS = MetricsOptions(bootstrap=60)


def keep_of(bandwidth_hz: float) -> float:
    return math.exp(-2 * math.pi * bandwidth_hz / RATE_HZ)


def low_passed(signal: np.ndarray, bandwidth_hz: float, gain: float = 1.0) -> np.ndarray:
    """The low-pass by scipy, from the first sample on."""
    keep = keep_of(bandwidth_hz)
    return lfilter([(1 - keep) * gain], [1, -keep], signal, zi=[keep * signal[0]])[0]


def test_white_noise_after_the_low_pass():
    # Closed form: a one-pole low-pass leaves (1 - k)/(1 + k) of the variance of white noise.
    values = np.random.default_rng(1).standard_normal(400_000)
    equaliser = Equaliser.of(2.0, RATE_HZ, np.zeros(len(values), int))
    found = equaliser.apply(values, LowPass())
    keep = keep_of(2.0)
    # 400,000 samples hold 400,000·π·2/100 ≈ 25,000 independent ones: 1σ to 0.45 %.
    assert np.std(found) == pytest.approx(math.sqrt((1 - keep) / (1 + keep)), rel=0.015)
    assert len(found) == len(values) - equaliser.settling


@pytest.mark.parametrize("own", [None, 0.5, 2.0, 10.0], ids=["not limited", "narrower", "the same", "wider"])
def test_whatever_a_series_went_through_it_ends_at_the_same(own):
    # The same white noise, after a low-pass of any bandwidth and gain: sample by sample the same series.
    white = np.random.default_rng(2).standard_normal(5000)
    equaliser = Equaliser.of(2.0, RATE_HZ, np.zeros(len(white), int))
    wanted = low_passed(white, 2.0)[equaliser.settling :]
    given = white if own is None else low_passed(white, own, 0.7)
    found = equaliser.apply(given, LowPass(own, 1.0 if own is None else 0.7))
    # e^-8: what is left of a start that differs.
    np.testing.assert_allclose(found, wanted, atol=2e-3)
    np.testing.assert_allclose(found[1000:], wanted[1000:], atol=1e-9)


def both_ways(signal: np.ndarray, bandwidth_hz: float, gain: float = 1.0) -> np.ndarray:
    """The low-pass by scipy, forward and back; bandwidth of both: 1/(1 + (f/a)²)² is 1/2 at f = a·√(√2 - 1)."""
    own = bandwidth_hz / math.sqrt(math.sqrt(2) - 1)
    return gain * low_passed(low_passed(signal, own)[::-1], own)[::-1]


@pytest.mark.parametrize("own", [0.5, 2.0, 10.0], ids=["narrower", "the same", "wider"])
def test_a_smoother_ends_at_the_same_bandwidth(own):
    # The same white noise, smoothed forward and back with any bandwidth: inside, sample by sample the same series.
    white = np.random.default_rng(2).standard_normal(5000)
    equaliser = Equaliser.of(2.0, RATE_HZ, np.zeros(len(white), int), back=True)
    kept = slice(equaliser.settling, len(white) - equaliser.settling)
    found = equaliser.apply(both_ways(white, own, 0.7), LowPass(own, 0.7, 2))
    assert len(found) == len(white) - 2 * equaliser.settling
    wanted = both_ways(white, 2.0)[kept]
    np.testing.assert_allclose(found, wanted, atol=2e-3)
    np.testing.assert_allclose(found[1000:-1000], wanted[1000:-1000], atol=1e-9)


def test_half_of_the_power_passes_at_the_common_bandwidth():
    # Tones at 2 Hz and far below through a wider smoother, then the equaliser: their amplitudes stand as 1 to √2.
    time = np.arange(20_000) / RATE_HZ
    for frequency, share in ((0.02, 1.0), (2.0, 0.5)):
        smoothed = both_ways(np.sin(2 * np.pi * frequency * time), 8.0)
        equaliser = Equaliser.of(2.0, RATE_HZ, np.zeros(len(time), int), back=True)
        found = equaliser.apply(smoothed, LowPass(8.0, 1.0, 2))
        # The discrete pole differs from the continuous one by (2πa/rate)²/12 or so.
        assert 2 * np.mean(found**2) == pytest.approx(share, rel=0.01)


def test_a_smoother_of_another_shape_is_left_out_and_sets_no_bandwidth():
    # Two gyros, their average, low-passed at 1 Hz; a smoother; and a running mean over 2 s, -3 dB at about 0.22 Hz.
    gyros = np.random.default_rng(5).standard_normal((40_000, 2))
    average = gyros.mean(axis=1)
    running = np.convolve(average, np.full(200, 1 / 200), mode="same")
    series = [*gyros.T, low_passed(average, 1.0), both_ways(average, 1.0), running]
    filters = [LowPass(), LowPass(), LowPass(1.0), LowPass(1.0, passes=2), LowPass(0.22, passes=0)]
    sampling = Sampling.of(RATE_HZ, np.zeros(len(average), int))
    found = static_figures(series, sampling, 2, filters, OPTIONS).readings
    alone = static_figures(series[:4], sampling, 2, filters[:4], OPTIONS).readings
    for row, other in zip(found[:4], alone, strict=True):
        assert row["sigma_equal"].value == other["sigma_equal"].value
        assert row["sigma_equal"].note.startswith("low-passed to 1 Hz")
    assert math.isnan(found[4]["sigma_equal"].value)
    assert found[4]["sigma_equal"].note == "its smoother has another shape"
    assert "if_sigma_equal" not in found[4]
    for name in ("arw", "arw_1s"):
        assert found[4][name].note.startswith("band-limited")
        assert "the low-pass takes part" in found[4][f"if_{name}"].note
        assert found[4][name].flags >= {"band_limited"}
        assert found[4][f"if_{name}"].flags >= {"takes_part"}
        assert "band-limited" not in found[3]["arw"].note
        assert not found[3]["arw"].flags & {"band_limited", "takes_part"}
    # Closed form: the noise bandwidths of the two shapes of one -3 dB bandwidth are π/2·B and π/4·B/√(√2 - 1).
    share = math.sqrt(1 / (2 * math.sqrt(math.sqrt(2) - 1)))
    assert found[3]["sigma_equal"].value / found[2]["sigma_equal"].value == pytest.approx(share, rel=0.02)
    assert f"{share:.2f} of the 1σ" in found[3]["sigma_equal"].note
    assert f"{share:.2f} of the 1σ" in found[3]["if_sigma_equal"].note


def test_each_stretch_begins_anew_and_loses_its_settling():
    values = np.concatenate([np.full(500, 3.0), np.full(40, 9.0), np.full(500, -1.0)])
    equaliser = Equaliser.of(2.0, RATE_HZ, np.repeat([0, 1, 2], [500, 40, 500]))
    assert equaliser.settling == math.ceil(8 * RATE_HZ / (4 * math.pi))
    found = equaliser.apply(values, LowPass())
    assert [stop - start for start, stop in equaliser.cuts] == [500 - equaliser.settling] * 2
    np.testing.assert_allclose(found, np.repeat([3.0, -1.0], 500 - equaliser.settling))


def test_the_common_bandwidth():
    assert common_bandwidth([LowPass(), LowPass(1.0), LowPass(0.3)], None) == 0.3
    assert common_bandwidth([LowPass(), LowPass(1.0)], 5.0) == 5.0
    assert common_bandwidth([LowPass(), LowPass()], None) is None
    assert common_bandwidth([LowPass(), LowPass(0.1, passes=0), LowPass(0.3, passes=2)], None) == 0.3
    assert common_bandwidth([LowPass(0.1, passes=0)], None) is None


def test_filters_and_a_low_passed_average_have_the_same_sigma():
    # For a constant rate a Kalman filter of equal gyros is their average after a low-pass: no better than that.
    rate = 0.5 + np.random.default_rng(3).standard_normal((60_000, 4))
    at_rest, segment = np.ones(len(rate), bool), np.zeros(len(rate), np.int32)
    array = ArrayRates(rate, RATE_HZ, segment, at_rest, ArrayNoise(np.full(4, 0.1), np.full(4, 1e-3), np.eye(4)))
    methods = select(["average", "jiang_markov", "jiang_random_walk", "xue_2012", "chang_2012"])
    fused = [method.fuse(array, FilterParameters(bandwidth_hz=1.0, tau_s=20.0)) for method in methods]
    filters = [LowPass()] * 4
    filters += [LowPass(one.bandwidth_hz if math.isfinite(one.bandwidth_hz) else None, one.dc_gain) for one in fused]
    series = [*rate.T, *(one.rate for one in fused)]
    found = static_figures(series, Sampling.of(RATE_HZ, segment), 4, filters, OPTIONS).readings
    raw = [row["sigma"].value for row in found[4:]]
    equal = [row["sigma_equal"].value for row in found[4:]]
    assert max(raw) > 4 * min(raw)
    np.testing.assert_allclose(equal, equal[0], rtol=1e-3)
    for row in found[4:]:
        assert "low-passed to 1 Hz" in row["sigma_equal"].note
        # √4 for independent gyros.
        assert row["if_sigma_equal"].low <= 2 <= row["if_sigma_equal"].high
    assert found[5]["if_sigma"].low > 2.5


def test_where_nothing_limits_the_band_there_is_nothing_to_compare():
    values = np.random.default_rng(4).standard_normal((3000, 3))
    sampling = Sampling.of(RATE_HZ, np.zeros(3000, int))
    assert "sigma_equal" not in static_figures(values.T, sampling, 2, [LowPass()] * 3, OPTIONS).readings[0]
    short = static_figures(values.T, sampling, 2, [LowPass()] * 2 + [LowPass(0.01)], OPTIONS).readings
    assert math.isnan(short[0]["sigma_equal"].value)
    assert "long enough" in short[0]["sigma_equal"].note
