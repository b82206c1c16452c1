"""Motion models: transition and process in closed form, block means, and the gain of the steady smoother."""

import math

import numpy as np
import pytest
from scipy.integrate import quad_vec
from scipy.linalg import expm

from vgyro import engine
from vgyro.engine.linear import StateSpace
from vgyro.errors import DataError
from vgyro.fusion.motion.models import Motion, SpectralLine, SteadyGain, dynamics, fixed_bandwidth, random_walk_keep

MODELS = [
    ("random_walk", {"q": 3.0}),
    ("acceleration", {"q": 40.0}),
    ("jerk", {"q": 500.0}),
    ("markov", {"tau_s": 0.8, "sd": 2.0}),
    ("oscillator", {"frequency_hz": 0.5, "damping": 0.1, "sd": 2.0, "q": 0.01}),
    ("oscillator", {"frequency_hz": 0.4, "damping": 0.3, "second_hz": 0.9, "second_damping": 0.06, "sd": 2.0}),
]


def driven(order):
    """A and b of a rate whose derivative of this order is white."""
    return np.diag(np.ones(order - 1), 1), np.eye(order)[order - 1]


def integrated(A, b, period):
    """e^(A·T) and ∫ e^(A·s) b b' e^(A'·s) ds over one period, by quadrature."""

    def drive(s):
        column = expm(A * s) @ b
        return np.outer(column, column)

    return expm(A * period), quad_vec(drive, 0.0, period, epsabs=0.0, epsrel=1e-12)[0]


@pytest.mark.parametrize("period", [0.002, 0.7])
@pytest.mark.parametrize(("model", "order"), [("random_walk", 1), ("acceleration", 2), ("jerk", 3)])
def test_driven_models_against_quadrature(model, order, period):
    # Expected: the integral of the matrix exponential, states scaled by powers of the period.
    F, Q = integrated(*driven(order), period)
    scale = period ** np.arange(order)
    found = dynamics(model, {"q": 3.0}, period)
    np.testing.assert_allclose(found.transition, F * np.outer(scale, 1 / scale), rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(found.process, 3.0 * Q * np.outer(scale, scale), rtol=1e-10)


@pytest.mark.parametrize("period", [0.002, 0.05, 1.0])
@pytest.mark.parametrize("damping", [1e-6, 0.02, 0.5, 0.999999, 1.0, 3.0])
def test_oscillator_against_quadrature(damping, period):
    # Expected: as above; the driving density of a stationary s.d. is 4ζω³·sd².
    omega = 2 * math.pi * 0.3
    F, Q = integrated(np.array([[0.0, 1.0], [-(omega**2), -2 * damping * omega]]), np.array([0.0, 1.0]), period)
    scale = np.array([1.0, period])
    found = dynamics("oscillator", {"frequency_hz": 0.3, "damping": damping, "sd": 2.0, "q": 0.5}, period)
    np.testing.assert_allclose(found.transition[1:, 1:], F * np.outer(scale, 1 / scale), rtol=1e-9, atol=1e-12)
    expected = 4 * damping * omega**3 * 4.0 * Q * np.outer(scale, scale)
    np.testing.assert_allclose(found.process[1:, 1:], expected, rtol=1e-7, atol=1e-12 * expected.max())
    assert found.process[0, 0] == 0.5 * period


@pytest.mark.parametrize("period", [0.002, 0.3])
def test_pair_of_oscillators(period):
    # Expected: eigenvalues e^(λT) of both sections, the integral of the matrix exponential, and the s.d. asked for.
    parameters = {"frequency_hz": 0.2, "damping": 0.3, "second_hz": 0.45, "second_damping": 0.03, "sd": 20.0}
    found = dynamics("oscillator", parameters, period)
    sections = [[1, 2 * z * w, w * w] for w, z in ((2 * math.pi * 0.2, 0.3), (2 * math.pi * 0.45, 0.03))]
    polynomial = np.convolve(*sections)
    expected = np.exp(np.roots(polynomial) * period)
    assert np.sort_complex(np.linalg.eigvals(found.transition)) == pytest.approx(np.sort_complex(expected), abs=1e-6)
    A = np.diag(np.ones(3), 1)
    A[3] = -polynomial[:0:-1]
    F, Q = integrated(A, np.eye(4)[3], period)
    scale = period ** np.arange(4)
    np.testing.assert_allclose(found.transition, F * np.outer(scale, 1 / scale), rtol=1e-9, atol=1e-14)
    ratio = found.process / (Q * np.outer(scale, scale))
    np.testing.assert_allclose(ratio, ratio[3, 3], rtol=1e-6)
    assert found.stationary[0, 0] == pytest.approx(400.0)
    kept = found.transition @ found.stationary @ found.transition.T + found.process
    size = np.sqrt(np.outer(np.diag(kept), np.diag(kept)))
    np.testing.assert_allclose(kept / size, found.stationary / size, atol=1e-12)


@pytest.mark.parametrize("phi", [0.0, 0.6])
@pytest.mark.parametrize(("model", "parameters"), MODELS)
def test_gain_is_that_of_the_smoother(model, parameters, phi):
    # Expected: the spectrum of what the smoother makes of an impulse in the middle of a long stretch.
    rate_hz, samples, r = 20.0, 8192, 0.09
    motion = Motion(model, parameters, rate_hz)
    space = motion.dynamics()
    known = np.where(np.isnan(space.stationary), 1e4, space.stationary)
    z = np.zeros(samples)
    z[samples // 2] = 1.0
    state = StateSpace(
        space.transition, space.process, space.reads, space.reads, np.zeros(len(space.reads)), known, phi
    )
    answer, variance = engine.get("native").statespace.smooth(z, r, state)
    steady = SteadyGain(motion, r, phi)
    spectrum = np.fft.rfft(np.roll(answer, -samples // 2))
    frequency = np.fft.rfftfreq(samples, 1 / rate_hz)[20:]
    assert np.max(np.abs(spectrum.imag)) < 1e-5
    np.testing.assert_allclose(spectrum.real[20:], steady.at(frequency), atol=2e-4)
    assert steady.noise_bandwidth_hz() == pytest.approx(0.5 * rate_hz * np.sum(answer**2), rel=2e-3)
    bandwidth = steady.bandwidth_hz()
    if math.isnan(bandwidth):
        assert spectrum.real[-1] > math.sqrt(0.5)
    else:
        assert float(steady.at(np.array([bandwidth]))[0]) == pytest.approx(math.sqrt(0.5), abs=1e-9)
    # The posterior variance is ∫ G·S_v.
    noise = r * (1 - phi**2) / np.abs(1 - phi * np.exp(-2j * math.pi * frequency / rate_hz)) ** 2 / rate_hz
    power = 2 * np.trapezoid(steady.at(frequency) * noise, frequency) + 2 * frequency[0] * noise[0]
    assert variance[samples // 2] == pytest.approx(power, rel=0.01)


@pytest.mark.parametrize("bandwidth_hz", [1e-4, 0.05, 1.0, 30.0, 79.9])
def test_fixed_bandwidth(bandwidth_hz):
    # Expected: closed forms of the two-sided exponential, whose gain at the bandwidth is √½.
    rate_hz, r = 200.0, 0.25
    motion = fixed_bandwidth(bandwidth_hz, r, rate_hz)
    steady = SteadyGain(motion, r)
    keep = random_walk_keep(motion.parameters["q"] / rate_hz / r)
    turn = np.exp(2j * math.pi * bandwidth_hz / rate_hz)
    assert (1 - keep) ** 2 / abs(1 - keep * turn) ** 2 == pytest.approx(math.sqrt(0.5), rel=1e-9)
    assert steady.bandwidth_hz() == pytest.approx(bandwidth_hz, rel=1e-9)
    left = ((1 - keep) / (1 + keep)) ** 2 * (1 + keep**2) / (1 - keep**2)
    assert steady.noise_bandwidth_hz() == pytest.approx(0.5 * rate_hz * left, rel=1e-9)
    assert motion.calibration * r * (1 - keep) / (1 + keep) == pytest.approx(r * left, rel=1e-9)


def test_fixed_bandwidth_beyond_what_can_be_smoothed():
    assert fixed_bandwidth(80.1, 0.25, 200.0).model == "none"
    for bandwidth_hz, r in ((0.0, 1.0), (1.0, 0.0), (1.0, math.inf), (math.nan, 1.0)):
        with pytest.raises(DataError, match="no smoother"):
            fixed_bandwidth(bandwidth_hz, r, 200.0)


def test_limits_of_the_gain():
    # Expected: by definition; a constant rate lets nothing through, a rate faster than the samples everything.
    still = SteadyGain(Motion("acceleration", {"q": 0.0}, 200.0), 1.0)
    assert (still.bandwidth_hz(), still.noise_bandwidth_hz()) == (0.0, 0.0)
    fast = Motion("random_walk", {"q": 1e9}, 200.0)
    assert math.isnan(SteadyGain(fast, 1.0).bandwidth_hz())
    assert math.isnan(SteadyGain(fast, 1.0, 0.1).bandwidth_hz())
    assert SteadyGain(fast, 1.0).noise_bandwidth_hz() == pytest.approx(100.0, rel=1e-3)


def test_unknown_model():
    with pytest.raises(DataError, match="unknown motion model 'snap'"):
        dynamics("snap", {"q": 1.0}, 0.1)


def test_lines_beside_a_model():
    # Expected: of independent parts the covariances of the rate add, at every lag.
    period, lines = 0.02, (SpectralLine(5.0, 1e-3, 2.0), SpectralLine(11.0, 1e-9, 0.5))
    whole = Motion("markov", {"tau_s": 0.8, "sd": 2.0}, 1 / period, lines=lines).dynamics()
    parts = [dynamics("markov", {"tau_s": 0.8, "sd": 2.0}, period)]
    parts += [
        dynamics(
            "oscillator",
            {"frequency_hz": one.frequency_hz, "damping": one.damping, "sd": one.sd, "q": 0.0},
            period,
        )
        for one in lines
    ]
    for lag in (0, 1, 7, 60):
        expected = sum(covariance_at(one, lag) for one in parts)
        assert covariance_at(whole, lag) == pytest.approx(expected, rel=1e-9)
    # x'' + 2ζωx' + ω²x = white: a sinusoid keeps its phase.
    assert covariance_at(parts[2], 50) == pytest.approx(0.25 * math.cos(2 * math.pi * 11.0), rel=1e-5)


def covariance_at(model, lag):
    known = np.nan_to_num(model.stationary)
    return float(model.reads @ np.linalg.matrix_power(model.transition, lag) @ known @ model.reads)
