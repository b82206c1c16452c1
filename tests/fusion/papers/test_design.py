"""Design formulas of the filters, against printed numbers, limits and an independent Riccati solver."""

import math

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are, solve_discrete_are

from vgyro.errors import DataError
from vgyro.fusion import design

ARW = 6.17 / 60.0
R = np.eye(6) * ARW**2
D = design.information(R)
Q = 0.0772


def test_static_design_of_jiang():
    # Expected: closed form of docs/fusion.md, N = 6.17 °/√h, q = 0.0772 deg²/s³ (Jiang et al. 2012, section 3.3).
    assert pytest.approx(567.4, abs=0.05) == D
    assert design.pole(D, Q) == pytest.approx(6.618, abs=5e-4)
    assert design.bandwidth(D, Q) == pytest.approx(1.053, abs=5e-4)
    assert design.allan_ratio(1.0, design.pole(D, Q)) == pytest.approx(0.880, abs=5e-4)


@pytest.mark.parametrize(("q", "hz"), [(0.0772, 1.00), (1.929, 5.00)])
def test_process_noise_of_jiang_is_a_bandwidth(q, hz):
    # Expected: the two printed q are bandwidths of 1.00 and 5.00 Hz at 0.1083 deg/s/√Hz, six alike gyros.
    information = design.information(np.eye(6) * 0.1083**2)
    assert design.bandwidth(information, q) == pytest.approx(hz, abs=0.01)
    assert design.q_for_bandwidth(information, hz) == pytest.approx(q, rel=0.003)


def test_pole_of_a_markov_rate():
    # Closed forms: without noise of the process the rate fades with τ; with it s² = 1/τ² + D·q.
    assert design.pole(D, 0.0, 0.25) == pytest.approx(4.0)
    assert design.pole(16.0, 1.0, 1.0 / 3.0) == pytest.approx(5.0)


@pytest.mark.parametrize("x", [0.01, 1.0, 30.0])
def test_allan_deviation_behind_a_low_pass(x):
    # Expected: by quadrature: 4·∫ sin⁴(πfτ)/(πfτ)²/(1 + (2πf/s)²) df over that without the low-pass, 1/τ.
    f = (np.arange(4_000_000) + 0.5) * 1e-4
    share = np.sin(np.pi * f) ** 4 / (np.pi * f) ** 2 / (1.0 + (2 * np.pi * f / x) ** 2)
    assert design.allan_ratio(1.0, x) == pytest.approx(math.sqrt(4.0 * share.sum() * 1e-4), rel=2e-3)


def test_chang_reads_q_off_the_bandwidth():
    # Expected: √q = 2π·BW/√D.
    assert math.sqrt(design.q_for_bandwidth(D, 2.0)) == pytest.approx(2 * math.pi * 2.0 / math.sqrt(D), rel=1e-14)


@pytest.mark.parametrize("tau", [0.5, 500.0, math.inf])
def test_bandwidth_and_process_noise_are_inverse(tau):
    assert design.bandwidth(D, design.q_for_bandwidth(D, 3.0, tau), tau) == pytest.approx(3.0, rel=1e-12)


@pytest.mark.parametrize("tau", [0.05, 0.5, 500.0])
def test_steady_variance_against_riccati(tau):
    # Expected: scipy's solver of the continuous algebraic Riccati equation (eq. 10).
    one = np.ones((6, 1))
    expected = solve_continuous_are(np.array([[-1 / tau]]), one.T, np.array([[Q]]), R)[0, 0]
    assert design.steady_variance(D, Q, tau) == pytest.approx(expected, rel=1e-9)


def test_markov_tends_to_the_random_walk():
    assert design.steady_variance(D, Q, 1e9) == pytest.approx(design.steady_variance(D, Q), rel=1e-9)
    assert design.steady_variance(D, Q) == pytest.approx(math.sqrt(Q / D), rel=1e-14)
    assert design.dc_gain(D, Q, 1e12) == pytest.approx(1.0, abs=1e-12)
    # With τ = 500 s the two bandwidths differ by 5e-8 of themselves (docs/fusion.md).
    assert design.bandwidth(D, Q, 500.0) / design.bandwidth(D, Q) - 1 == pytest.approx(5e-8, rel=0.1)


def test_dc_gain():
    # Expected: 1 - 1/(τs), and the 0.71 of docs/fusion.md at τ = 0.5 s.
    s = design.pole(D, Q, 0.5)
    assert design.dc_gain(D, Q, 0.5) == pytest.approx(1 - 1 / (0.5 * s), rel=1e-12)
    assert design.dc_gain(D, Q, 0.5) == pytest.approx(0.71, abs=0.005)


@pytest.mark.parametrize("correlation", [-0.15, 0.0, 0.3])
def test_identical_gyros(correlation):
    # Expected: eq. 21 against eq. 20 with R of eq. 6.
    alike = ARW**2 * ((1 - correlation) * np.eye(6) + correlation)
    information = design.information(alike)
    expected = design.steady_variance_identical(Q, ARW, 6, correlation)
    assert design.steady_variance(information, Q) == pytest.approx(expected, rel=1e-12)
    np.testing.assert_allclose(design.gain_direction(alike), 1 / 6, atol=1e-15)


def test_hold_gain_against_the_discrete_optimum():
    # Expected: gain of the discrete filter from scipy's discrete Riccati solver; for a random walk it differs from
    # 1 - e^(-sT) by about (sT)²/24 of itself, which is what the module says.
    period = 0.02
    x = design.pole(D, Q) * period
    prior = solve_discrete_are(np.eye(1), np.ones((1, 6)), np.array([[Q * period]]), R / period)[0, 0]
    optimal = prior / (prior + 1 / (D * period))
    held = -math.expm1(-x)
    assert (optimal - held) / held == pytest.approx(-(x**2) / 24, rel=0.15)


@pytest.mark.parametrize("tau", [0.5, 500.0, math.inf])
def test_frequency_response(tau):
    # Expected: eq. 15: the array's Laplace transform, (s + √(…))⁻¹·K·1 with K = P∞·1'R⁻¹; 1/√2 of H(0) at eq. 18.
    frequency = np.array([0.0, 0.3, design.bandwidth(D, Q, tau)])
    gain = np.sum(design.steady_variance(D, Q, tau) * np.linalg.solve(R, np.ones(6)))
    expected = gain / (2j * np.pi * frequency + math.sqrt(1 / tau**2 + D * Q))
    found = design.response(frequency, D, Q, tau)
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    assert abs(found[2] / found[0]) == pytest.approx(math.sqrt(0.5))
    assert found[0].real == pytest.approx(design.dc_gain(D, Q, tau))


def test_attenuation():
    # Expected: at the bandwidth itself -3 dB and 45°.
    loss, lag = design.attenuation(1.0)
    assert loss == pytest.approx(1 - math.sqrt(0.5))
    assert lag == pytest.approx(math.pi / 4)


@pytest.mark.parametrize("wrong", [np.ones((3, 3)), np.diag([1.0, np.nan]), -np.eye(2)])
def test_useless_covariance(wrong):
    with pytest.raises(DataError, match="positive definite"):
        design.information(wrong)


def test_bandwidth_below_the_markov_rate():
    with pytest.raises(DataError, match="bandwidth"):
        design.q_for_bandwidth(D, 0.1, tau=0.5)


def test_what_makes_a_covariance_singular_is_named():
    R = np.eye(5) * ARW**2
    assert design.flaw(R) == ""
    copies = R.copy()
    copies[1, 3] = copies[3, 1] = ARW**2
    with pytest.raises(DataError, match=r"positive definite: gyros 2 and 4 are copies of each other"):
        design.information(copies)
    unknown = R.copy()
    unknown[2], unknown[:, 2], unknown[4, 4] = np.nan, np.nan, 0.0
    with pytest.raises(DataError, match="the noise of gyros 3, 5 is not known, or zero"):
        design.gain_direction(unknown)
    # g5 = (g1 + g2)/√2, but for a millionth of its noise that is its own.
    dependent = R.copy()
    dependent[4, :2] = dependent[:2, 4] = ARW**2 / math.sqrt(2)
    with pytest.raises(DataError, match="a combination of gyros 1, 2, 5 has no noise"):
        design.information(dependent)
    dependent[4, 4] *= 1 + 1e-6
    assert design.flaw(dependent) == ""
    dependent[4, 4] *= 0.9
    assert design.flaw(dependent) == "a combination of gyros 1, 2, 5 has a negative variance"


def test_scales_far_apart_are_no_flaw():
    variance = np.array([1e-12, 1.0, 1e12])
    assert design.flaw(np.diag(variance)) == ""
    assert design.information(np.diag(variance)) == pytest.approx((1 / variance).sum())
