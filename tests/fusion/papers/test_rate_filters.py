"""The Kalman filters: against filterpy, an integrated differential equation, closed forms and printed figures."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from vgyro.engine.independent import textbook_allan_deviation
from vgyro.engine.reference.kalman import constant_gain_filter, kalman_filter
from vgyro.fusion import METHODS, CannotRun, FilterParameters, design

ARW = 6.17 / 60.0
STATIC = FilterParameters(q=0.0772)
DYNAMIC = FilterParameters(q=1.929, in_motion=True)
FILTERS = ("jiang_markov", "jiang_random_walk", "xue_2012", "chang_2012")
UNEQUAL = np.array([0.05, 0.1, 0.1, 0.3])


@pytest.mark.parametrize(
    ("name", "tau"), [("jiang_markov", 0.5), ("jiang_markov", 500.0), ("jiang_random_walk", math.inf)]
)
def test_jiang_against_filterpy(make_array, name, tau):
    # Expected: filterpy's steady-state steps with F and K chosen so that F(1 - K1) = e^(-sT), K = (1 - e^(-sT))/s·K∞.
    array = make_array(2000, UNEQUAL, truth=3.0)
    D, u = design.information(array.noise.R), design.gain_direction(array.noise.R)
    s = design.pole(D, 0.5, tau)
    keep, gain = math.exp(-s / 200.0), design.steady_variance(D, 0.5, tau) * D / s
    total = (1 - keep) * gain
    expected = constant_gain_filter(array.rate, keep / (1 - total), total * u, array.rate[0] @ u)
    fused = METHODS[name].fuse(array, FilterParameters(q=0.5, tau_s=500.0 if math.isinf(tau) else tau))
    np.testing.assert_allclose(fused.rate, expected, atol=1e-8)


def test_recursion_as_printed(make_array):
    # Expected: eq. 11-14 of Jiang et al. (2012), written out; row k holds x_{k+1}, which Z_k yields.
    array = make_array(50, UNEQUAL, truth=2.0)
    tau, q, period, one = 0.5, 0.5, 1 / 200.0, np.ones(4)
    inverse = np.linalg.inv(array.noise.R)
    D = one @ inverse @ one
    steady = (-1 / tau + math.sqrt(1 / tau**2 + D * q)) / D
    K = steady * (one @ inverse)
    A = -(1 / tau + K @ one)
    x, expected = (one @ inverse @ array.rate[0]) / D, []
    for Z in array.rate:
        x = math.exp(A * period) * x + (math.exp(A * period) - 1) / A * (K @ Z)
        expected.append(x)
    fused = METHODS["jiang_markov"].fuse(array, FilterParameters(q=q, tau_s=tau))
    np.testing.assert_allclose(fused.rate, expected, rtol=1e-10)


def test_discrete_kalman_filter_settles_to_the_steady_state(make_array):
    # Expected: the exact discrete filter (filterpy) ends at nearly the same gain, hence at nearly the same estimate:
    # the gains differ by (sT)²/24 = 5e-5 of themselves.
    array = make_array(3000, np.full(6, ARW))
    period = array.period
    R = array.noise.R
    D = design.information(R)
    estimate, variance = kalman_filter(array.rate, 1.0, 0.0772 * period, R / period, 0.0, 1.0)
    fused = METHODS["jiang_random_walk"].fuse(array, STATIC).rate
    # The variance right after an update lies half a sample's process noise below P∞, which holds for all times.
    assert variance[-1] == pytest.approx(design.steady_variance(D, 0.0772) - 0.0772 * period / 2, rel=1e-3)
    np.testing.assert_allclose(fused[-500:], estimate[-500:], atol=2e-4 * np.abs(fused).max())


def test_markov_with_500_s_is_the_random_walk(make_array):
    array = make_array(4000, np.full(6, ARW), truth=40.0)
    markov, walk = METHODS["jiang_markov"].fuse(array, STATIC), METHODS["jiang_random_walk"].fuse(array, STATIC)
    assert markov.bandwidth_hz / walk.bandwidth_hz - 1 == pytest.approx(5e-8, rel=0.1)
    np.testing.assert_allclose(markov.rate, walk.rate * markov.dc_gain, atol=40.0 * 4e-4)
    # Expected: in the limit they are one.
    limit = METHODS["jiang_markov"].fuse(array, replace(STATIC, tau_s=1e12))
    np.testing.assert_allclose(limit.rate, walk.rate, rtol=1e-9)


@pytest.mark.parametrize("name", FILTERS)
def test_identical_gyros_share_the_gain_like_the_average(make_array, name):
    correlation = 0.7 * np.eye(6) + 0.3
    fused = METHODS[name].fuse(make_array(100, np.full(6, ARW), correlation=correlation), STATIC)
    np.testing.assert_allclose(fused.weights, 1 / 6, atol=1e-14)


def test_constant_rate_and_dc_gain(make_array):
    # Expected: 1 - 1/(τs) of Jiang et al. (2012), eq. 16; a noise-free array shows it directly.
    array = make_array(4000, np.full(6, ARW))
    array = replace(array, rate=np.full_like(array.rate, 10.0))
    fused = METHODS["jiang_markov"].fuse(array, FilterParameters(q=0.0772, tau_s=0.5))
    s = design.pole(design.information(array.noise.R), 0.0772, 0.5)
    assert fused.dc_gain == pytest.approx(1 - 1 / (0.5 * s))
    assert fused.rate[-1] == pytest.approx(10.0 * fused.dc_gain, rel=1e-9)
    for name in ("jiang_random_walk", "xue_2012", "chang_2012"):
        fused = METHODS[name].fuse(array, STATIC)
        assert fused.dc_gain == 1.0
        np.testing.assert_allclose(fused.rate, 10.0, rtol=1e-9)


def response(name, array, parameters, frequency):
    """Gain and delay that a noise-free sinusoid shows."""
    time = np.arange(len(array.rate)) / array.rate_hz
    sine = np.sin(2 * np.pi * frequency * time)
    fused = METHODS[name].fuse(replace(array, rate=np.repeat(sine[:, None], array.rate.shape[1], axis=1)), parameters)
    late = time > time[-1] / 2
    basis = np.column_stack([np.sin(2 * np.pi * frequency * time), np.cos(2 * np.pi * frequency * time)])[late]
    (in_phase, quadrature), *_ = np.linalg.lstsq(basis, fused.rate[late])
    return math.hypot(in_phase, quadrature), math.atan2(-quadrature, in_phase) / (2 * np.pi * frequency), fused


@pytest.mark.parametrize("name", FILTERS)
def test_bandwidth_and_delay_measured_with_a_sinusoid(make_array, name):
    # Expected: at the bandwidth the gain is 1/√2 of that at zero frequency; the sampled filter keeps it within 0.1 %.
    array = make_array(20000, np.full(6, ARW), rate_hz=500.0)
    bandwidth = METHODS[name].fuse(array, DYNAMIC).bandwidth_hz
    gain, _, fused = response(name, array, DYNAMIC, bandwidth)
    assert gain / fused.dc_gain == pytest.approx(math.sqrt(0.5), rel=1e-3)
    _, delay, fused = response(name, array, DYNAMIC, bandwidth / 50)
    assert fused.delay_s == pytest.approx(delay, rel=1e-3)


def test_noise_bandwidth(make_array):
    # Expected: variance of filtered white noise = two-sided density² · 2 · noise bandwidth, within Monte-Carlo error.
    array = make_array(400_000, np.full(6, ARW), seed=5)
    fused = METHODS["jiang_random_walk"].fuse(array, STATIC)
    expected = ARW / math.sqrt(6) * math.sqrt(2 * fused.noise_bandwidth_hz)
    assert fused.rate.std() == pytest.approx(expected, rel=0.03)


def test_jiang_table_3_sinusoid(make_array):
    # Expected: docs/fusion.md for 62.8·sin(1.57 t) at 500 Hz, q = 1.929, both models: amplitude 62.73, raw 1σ 2.04,
    # 1σ with the lag of 29 ms removed 0.174 (constant 1σ 0.167).
    time = np.arange(60 * 500) / 500.0
    truth = 62.8 * np.sin(1.57 * time)
    array = make_array(len(time), np.full(6, ARW), rate_hz=500.0, truth=truth, seed=9)
    late = time > 2.0
    for name in ("jiang_markov", "jiang_random_walk"):
        fused = METHODS[name].fuse(array, DYNAMIC)
        basis = np.column_stack([np.sin(1.57 * time), np.cos(1.57 * time)])[late]
        pair, *_ = np.linalg.lstsq(basis, fused.rate[late])
        assert np.hypot(*pair) == pytest.approx(62.73, abs=0.02)
        assert (fused.rate - truth)[late].std() == pytest.approx(2.04, abs=0.01)
        assert fused.delay_s == pytest.approx(0.029, abs=5e-4)
        aligned = 62.8 * np.sin(1.57 * (time - fused.delay_s))
        assert (fused.rate - aligned)[late].std() == pytest.approx(0.174, rel=0.05)


def test_allan_deviation_at_one_second(make_array):
    # Expected: ADEV(1 s) of the filter over that of the average is 0.880 (docs/fusion.md); 30 min leave it some 2 %.
    array = make_array(30 * 60 * 50, np.full(6, ARW), rate_hz=50.0, seed=3)
    filtered, mean = METHODS["jiang_random_walk"].fuse(array, STATIC).rate, array.rate.mean(axis=1)
    settled = slice(200, None)
    ratio = textbook_allan_deviation(filtered[settled][:20000], 50.0, 1.0) / textbook_allan_deviation(
        mean[settled][:20000], 50.0, 1.0
    )
    assert ratio == pytest.approx(0.880, rel=0.02)


def test_xue_against_the_differential_equation(make_array):
    # Expected: dP/dt = q - D·P² and dx/dt = P·D·(z - x), integrated by scipy over held samples.
    array = make_array(60, UNEQUAL, truth=1.0)
    D, u = design.information(array.noise.R), design.gain_direction(array.noise.R)
    q, period = 5.0, array.period
    combined = array.rate @ u
    state, expected = np.array([combined[0], 1 / (D * period)]), []
    for z in combined:
        step = solve_ivp(
            lambda _, y, z=z: [y[1] * D * (z - y[0]), q - D * y[1] ** 2], (0, period), state, rtol=1e-11, atol=1e-13
        )
        state = step.y[:, -1]
        expected.append(state[0])
    fused = METHODS["xue_2012"].fuse(array, FilterParameters(q=q))
    np.testing.assert_allclose(fused.rate, expected, atol=1e-8)


def test_xue_settles_to_the_random_walk_filter(make_array):
    array = make_array(6000, UNEQUAL, truth=-4.0)
    fused = METHODS["xue_2012"].fuse(array, STATIC).rate
    walk = METHODS["jiang_random_walk"].fuse(array, STATIC).rate
    np.testing.assert_allclose(fused[5000:], walk[5000:], atol=1e-9)


def test_xue_settles_faster(make_array):
    # Expected: after 8 samples its error is near that of their mean; the steady filter still holds the first sample.
    errors = {"xue_2012": [], "jiang_random_walk": []}
    for seed in range(100):
        array = make_array(8, UNEQUAL, seed=seed)
        for name, found in errors.items():
            found.append(METHODS[name].fuse(array, STATIC).rate[-1])
    settled, steady = (np.var(found) for found in errors.values())
    assert settled < steady / 2


@pytest.mark.parametrize("name", FILTERS)
def test_restart_in_each_stretch(make_array, name):
    segment = np.repeat([0, 1, 2], [700, 1, 299])
    array = make_array(1000, UNEQUAL, segment=segment)
    whole = METHODS[name].fuse(array, STATIC).rate
    for part in (slice(0, 700), slice(700, 701), slice(701, 1000)):
        alone = replace(array, rate=array.rate[part], segment=segment[part], at_rest=array.at_rest[part])
        np.testing.assert_allclose(METHODS[name].fuse(alone, STATIC).rate, whole[part], rtol=1e-12, atol=1e-14)


def test_chang_ignores_a_given_q(make_array):
    array = make_array(500, UNEQUAL)
    given, none = (METHODS["chang_2012"].fuse(array, FilterParameters(q=q, bandwidth_hz=2.0)) for q in (5.0, None))
    np.testing.assert_array_equal(given.rate, none.rate)
    assert given.bandwidth_hz == pytest.approx(2.0)
    walk = METHODS["jiang_random_walk"].fuse(array, FilterParameters(bandwidth_hz=2.0))
    np.testing.assert_allclose(walk.rate, none.rate, rtol=1e-12)


def test_one_arw_for_all_gyros(make_array):
    # The user's value overrides what was measured, for R and with it for D and the weights.
    fused = METHODS["jiang_markov"].fuse(make_array(10, UNEQUAL), replace(STATIC, arw=ARW))
    np.testing.assert_allclose(fused.weights, 0.25, atol=1e-14)
    assert fused.bandwidth_hz == pytest.approx(design.bandwidth(4 / ARW**2, 0.0772), rel=1e-6)


@pytest.mark.parametrize("name", FILTERS)
def test_a_gyro_whose_noise_is_not_known_is_left_out(make_array, name):
    array = make_array(10, UNEQUAL)
    partly, nothing = (np.array(arw) for arw in ([0.1, np.nan, 0.1, 0.1], [np.nan] * 4))
    fused = METHODS[name].fuse(replace(array, noise=replace(array.noise, arw=partly)), STATIC)
    np.testing.assert_allclose(fused.weights, np.array([1, 0, 1, 1]) / 3)
    assert fused.note.startswith("gyro 2 is left out: it has no measured angle random walk; ")
    with pytest.raises(CannotRun, match="noise covariance"):
        METHODS[name].fuse(replace(array, noise=replace(array.noise, arw=nothing)), STATIC)
