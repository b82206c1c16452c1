"""The extended Kalman filter of scale errors as a method: closed forms, a known scale error, gaps."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are, solve_discrete_are
from scipy.signal import freqz, lfilter

from vgyro.fusion import CannotRun, FilterParameters, design
from vgyro.fusion.papers.stubberud import Steady, bandwidth, drive, natural_frequency, q_for_bandwidth, stubberud_2008
from vgyro.fusion.response import measured_response

UNEQUAL = np.array([0.05, 0.1, 0.1, 0.3])
MOVING = FilterParameters(bandwidth_hz=5.0, in_motion=True)


def without_walk(array):
    return replace(array, noise=replace(array.noise, rrw=np.zeros_like(array.noise.rrw)))


def test_closed_form_of_the_continuous_filter():
    # Expected: scipy's solution of the Riccati equation, and the power gain of its filter at the bandwidth.
    D, q = 611.0, 40.0
    omega, F, C = natural_frequency(D, q), np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[1.0, 0.0]])
    P = solve_continuous_are(F.T, C.T, np.diag([0.0, q]), np.array([[1.0 / D]]))
    closed = np.array([[math.sqrt(2) * omega, omega**2], [omega**2, math.sqrt(2) * omega**3]]) / D
    np.testing.assert_allclose(P, closed, rtol=1e-9)
    K = P @ C.T * D
    s = 2j * math.pi * bandwidth(D, q)
    gain = (C @ np.linalg.solve(s * np.eye(2) - F + K @ C, K)).item()
    assert abs(gain) ** 2 == pytest.approx(0.5, rel=1e-9)
    assert bandwidth(D, q_for_bandwidth(D, 3.0)) == pytest.approx(3.0, rel=1e-12)


@pytest.mark.parametrize("bandwidth_hz", [0.01, 1.0, 5.0, 20.0, 60.0, 1000.0])
def test_closed_form_of_the_sampled_filter(bandwidth_hz):
    # Expected: the gain from scipy's discrete Riccati equation; the power gain 1/2 at the bandwidth; the
    # noise bandwidth from the energy of the impulse response.
    D, period = 600.0, 1 / 200
    q = q_for_bandwidth(D, bandwidth_hz)
    steady = Steady.of(D, q, period)
    F, C, R = np.array([[1.0, period], [0.0, 1.0]]), np.array([[1.0], [0.0]]), 1 / (D * period)
    P = solve_discrete_are(F.T, C, drive(q, period), np.array([[R]]))
    K = P @ C[:, 0] / (P[0, 0] + R)
    np.testing.assert_allclose([steady.alpha, steady.beta], K * [1.0, period], rtol=1e-7)
    a, b = steady.alpha, steady.beta
    coefficients = [a, b - a], [1.0, a + b - 2.0, 1.0 - a]
    if bandwidth_hz == 1000.0:
        assert math.isnan(steady.bandwidth_hz)
    else:
        _, gain = freqz(*coefficients, [steady.bandwidth_hz], fs=1 / period)
        assert abs(gain[0]) ** 2 == pytest.approx(0.5, rel=1e-6)
    impulse = lfilter(*coefficients, np.arange(400_000) == 0)
    assert np.sum(impulse**2) / (2 * period) == pytest.approx(steady.noise_bandwidth_hz, rel=1e-6)


def test_the_sampled_filter_is_near_the_continuous_one():
    # Expected: as T → 0 the bandwidth asked for, and noise bandwidth 3ω/(4√2).
    D = 600.0
    q = q_for_bandwidth(D, 1.0)
    steady = Steady.of(D, q, 1e-4)
    assert steady.bandwidth_hz == pytest.approx(1.0, rel=2e-4)
    assert steady.noise_bandwidth_hz == pytest.approx(3 * natural_frequency(D, q) / (4 * math.sqrt(2)), rel=5e-4)


@pytest.mark.parametrize("bandwidth_hz", [1.0, 5.0])
def test_bandwidth_and_delay_are_those_measured(make_array, bandwidth_hz):
    # Expected: what an added motion shows, of the whole filter with its biases and scale errors.
    array, parameters = make_array(1 << 17, np.full(6, 0.1)), replace(MOVING, bandwidth_hz=bandwidth_hz)
    fused, measured = stubberud_2008(array, parameters), measured_response(stubberud_2008, array, parameters)
    assert fused.bandwidth_hz == pytest.approx(measured.bandwidth_hz, rel=5e-3)
    assert fused.noise_bandwidth_hz == pytest.approx(measured.noise_bandwidth_hz, rel=5e-3)
    assert (fused.dc_gain, fused.delay_s) == (1.0, 0.0)
    assert measured.dc_gain == pytest.approx(1.0, abs=1e-3)
    assert measured.delay_s == pytest.approx(0.0, abs=2e-3)


def moving(make_array, arw, scale, samples=40_000, seed=1):
    """0.5 Hz, 60 deg/s; scale [N] errors; biases."""
    truth = 60.0 * np.sin(math.pi * np.arange(samples) / 200.0)
    array = make_array(samples, arw, truth=truth, seed=seed, at_rest=False)
    biases = np.random.default_rng(seed).normal(0.0, 0.5, len(arw))
    return replace(array, rate=array.rate + truth[:, None] * scale + biases - biases.mean()), truth


def scales_of(note):
    """[N, 2]: scale errors and their standard deviations, from the note, as shares."""
    pairs = [one.split(" ± ") for one in note.split("): ")[1].split(", ")]
    return np.array(pairs, dtype=float) / 100.0


def test_scale_error_of_one_gyro_is_found_in_motion(make_array):
    # Expected: the simulated truth, 1 % of gyro 3: less the mean, 5/6 % for it and -1/6 % for the others.
    errors, spreads = [], []
    truth = 0.01 * (np.arange(6) == 2)
    for seed in range(8):
        array, _ = moving(make_array, np.full(6, 0.1), truth, seed=seed)
        found = scales_of(stubberud_2008(array, MOVING).note)
        errors.append(found[:, 0] - (truth - truth.mean()))
        spreads.append(found[:, 1])
    # The note has two digits of a per cent: 3e-5 of rounding.
    assert np.abs(errors).max() < 4 * np.max(spreads) + 5e-5
    assert np.max(spreads) < 5e-4
    assert np.abs(np.mean(errors, axis=0)).max() < 4 * np.max(spreads) / math.sqrt(8) + 5e-5


def test_known_scale_errors_make_the_rate_better(make_array):
    # Gyro 1 has most of the weight and reads 3 % too much, in the mean over the gyros nothing: without scale errors in
    # the state the amplitude is off by most of that, with them by less than half of it. Not by nothing: an amplitude
    # that the rate model does not expect looks like a scale error where gyros are not alike.
    array, truth = moving(make_array, UNEQUAL, np.array([0.03, -0.01, -0.01, -0.01]))
    late = slice(20_000, None)
    without, known = (
        np.polyfit(truth[late], stubberud_2008(array, replace(MOVING, scale_sd=sd)).rate[late], 1)[0]
        / gain_at(0.5, array)
        - 1.0
        for sd in (1e-9, 0.03)
    )
    assert without > 0.01
    assert abs(known) < without / 2


def gain_at(frequency, array):
    """In-phase gain of the steady filter."""
    D = design.information(array.noise.R)
    steady = Steady.of(D, q_for_bandwidth(D, MOVING.bandwidth_hz), array.period)
    a, b = steady.alpha, steady.beta
    return freqz([a, b - a], [1.0, a + b - 2.0, 1.0 - a], [frequency], fs=array.rate_hz)[1][0].real


def test_a_constant_rate_passes_and_biases_are_their_mean(make_array):
    # Expected: rate + mean of the biases, the part that cannot be told from the rate, without noise to 1e-6.
    array = without_walk(make_array(2000, UNEQUAL))
    array = replace(array, rate=np.full_like(array.rate, 10.0) + np.array([1.0, 2.0, -2.0, 3.0]))
    assert stubberud_2008(array, FilterParameters()).rate[-1] == pytest.approx(11.0, abs=1e-6)


def test_biases_are_kept_over_gaps(make_array):
    # Expected: after a long stretch the biases are known, and the first sample of another has the variance 1/(D·T);
    # alone it would have that of the plain mean, 4.3 times as much. 500 tries: 6.3 %, three sigma 19 %.
    singles = 500
    segment = np.concatenate([np.zeros(200_000, dtype=np.int32), 1 + np.arange(singles, dtype=np.int32)])
    array = without_walk(make_array(len(segment), UNEQUAL, segment=segment))
    fused = stubberud_2008(array, FilterParameters()).rate
    expected = 1.0 / (design.information(array.noise.R) * array.period)
    assert np.mean(fused[200_000:] ** 2) == pytest.approx(expected, rel=0.19)
    alone = stubberud_2008(array.part(slice(200_000, 200_001)), FilterParameters())
    assert alone.rate[0] == pytest.approx(array.rate[200_000].mean(), rel=1e-3)


def test_biases_walk_on_in_a_gap_of_known_length(make_array):
    # Expected: after a gap in which the biases may have walked by far more than a sample's noise, the estimate of the
    # first sample is that of a start: the plain mean. After one without time it is not.
    segment = np.repeat([0, 1], [20_000, 1]).astype(np.int32)
    array = make_array(20_001, UNEQUAL, segment=segment)
    array = replace(array, noise=replace(array.noise, rrw=np.full(4, 0.01)))
    plain = array.rate[-1].mean()
    times = {gap: np.array([0.0, 100.0 + gap]) for gap in (0.0, 1e9)}
    last = {
        gap: stubberud_2008(replace(array, stretch_time=time), FilterParameters()).rate[-1]
        for gap, time in times.items()
    }
    assert last[1e9] == pytest.approx(plain, abs=1e-3)
    assert abs(last[0.0] - plain) > 0.05


def test_engines_agree(make_array):
    segment = np.repeat([0, 1, 2], [300, 1, 99]).astype(np.int32)
    array = make_array(400, UNEQUAL, segment=segment, truth=20.0)
    native, reference = (stubberud_2008(array, replace(MOVING, engine=name)) for name in ("native", "reference"))
    np.testing.assert_allclose(native.rate, reference.rate, atol=1e-8)
    assert native.note == reference.note


def test_q_gives_the_bandwidth_of_a_random_walk_filter(make_array):
    array = make_array(500, UNEQUAL)
    given = stubberud_2008(array, FilterParameters(q=0.5))
    same = FilterParameters(bandwidth_hz=design.bandwidth(design.information(array.noise.R), 0.5))
    np.testing.assert_array_equal(given.rate, stubberud_2008(array, same).rate)


def test_at_rest_there_are_no_scale_errors(make_array):
    array = make_array(20_000, UNEQUAL)
    fused, other = (stubberud_2008(array, FilterParameters(scale_sd=sd)) for sd in (0.001, 0.1))
    assert "held at zero" in fused.note
    np.testing.assert_array_equal(fused.rate, other.rate)


def test_reasons(make_array):
    array = make_array(10, UNEQUAL)
    for name, text in (("arw", "noise covariance"), ("rrw", r"rate random walk.*gyro 2 of 4")):
        unknown = replace(array, noise=replace(array.noise, **{name: np.array([0.1, np.nan, 0.1, 0.1])}))
        with pytest.raises(CannotRun, match=text):
            stubberud_2008(unknown, FilterParameters())
