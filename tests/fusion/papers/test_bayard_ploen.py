"""Bayard & Ploen's virtual gyro, against recursions and posteriors written out in full."""

import math
from dataclasses import replace

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from walking_gyros import walking

from vgyro.fusion import CannotRun, FilterParameters
from vgyro.fusion.papers.bayard_ploen import bayard_ploen, bias_modes, differences

PARAMETERS = FilterParameters()


@pytest.fixture
def drifting(make_array):
    """drifting(samples, …): white gyros with random walks and a rate that jumps about."""
    return walking(make_array, lambda rng, samples: rng.normal(0, 30, samples))


def matrices(array):
    """R_d and Q·T."""
    noise = array.noise
    return noise.R / array.period, np.outer(noise.rrw, noise.rrw) * noise.correlation * array.period


def as_printed(array, start, lost=()):
    """The recursion of METHODS.md (b, P, K of every sample), written out. lost : samples before each sample."""
    R, Q = matrices(array)
    inverse, one = np.linalg.inv(R), np.ones(len(R))
    u = inverse @ one / (one @ inverse @ one)
    G = inverse - np.outer(inverse @ one, one @ inverse) / (one @ inverse @ one)
    b, P, rates, gains, spreads = np.zeros(len(R)), Q * start / array.period, [], [], []
    for k, y in enumerate(array.rate):
        P = P + Q * (1 + (lost[k] if len(lost) else 0))
        P = np.linalg.inv(np.linalg.inv(P) + G)
        K = P @ G
        b = b + K @ (y - b)
        rates.append(u @ (y - b))
        gains.append(K)
        spreads.append(P)
    return np.array(rates), np.array(gains), np.array(spreads)


@pytest.mark.parametrize("start", [0.0, 2.0])
def test_the_recursion_written_out(drifting, start):
    # Expected: the dense recursion with inverses. 0 s: P_0 = 0, which P⁻¹ needs replaced by a first step of Q·T.
    array = drifting(600)
    expected, _, _ = as_printed(array, start)
    np.testing.assert_allclose(bayard_ploen(array, PARAMETERS, start).rate, expected, atol=1e-8)


def with_a_white_rate(array, variance):
    """w of filterpy's filter on x = [b, w], w white."""
    R, Q = matrices(array)
    filter_ = KalmanFilter(dim_x=5, dim_z=4)
    filter_.F = np.diag([1.0, 1, 1, 1, 0])
    filter_.H = np.hstack([np.eye(4), np.ones((4, 1))])
    filter_.Q = np.zeros((5, 5))
    filter_.Q[:4, :4], filter_.Q[4, 4] = Q, variance
    filter_.P = np.zeros((5, 5))
    filter_.P[:4, :4] = Q * 2.0 * array.rate_hz
    filter_.R = R
    found = []
    for y in array.rate:
        filter_.predict()
        filter_.update(y[:, None])
        found.append(filter_.x[4, 0])
    return np.array(found)


def test_a_joint_filter_with_a_white_rate(drifting):
    # Expected: filterpy, the rate white with variances V and 2V of 1e5 (deg/s)²; what V still says is in 1/V, and is
    # taken off by going from the two to 1/V = 0.
    array = drifting(300)
    expected = 2 * with_a_white_rate(array, 2e5) - with_a_white_rate(array, 1e5)
    np.testing.assert_allclose(bayard_ploen(array, PARAMETERS, 2.0).rate, expected, atol=1e-8)


def posterior(array, samples):
    """w at the last of `samples`, from the joint Gaussian: every w free, the differences of the first b free."""
    R, Q = matrices(array)
    n, order = len(R), np.arange(samples)
    covariance = np.kron(np.minimum.outer(order, order), Q) + np.kron(np.eye(samples), R)
    rates = np.kron(np.eye(samples), np.ones((n, 1)))
    biases = np.tile(Q @ differences(n), (samples, 1))
    design = np.hstack([biases, rates])
    weighted = np.linalg.solve(covariance, design)
    return np.linalg.solve(design.T @ weighted, weighted.T @ array.rate[:samples].ravel())[-1]


def test_nothing_known_of_the_start(drifting):
    # Expected: generalised least squares on all samples so far, with the start of the biases as unknowns.
    array = drifting(120)
    fused = bayard_ploen(array, PARAMETERS).rate
    for samples in (1, 2, 3, 10, 50, 120):
        assert fused[samples - 1] == pytest.approx(posterior(array, samples), abs=1e-8)


def test_identical_equally_correlated_gyros_are_averaged(drifting):
    # Expected: METHODS.md: it IS the mean.
    correlation = 0.7 * np.eye(6) + 0.3
    array = drifting(3000, np.full(6, 0.1), np.full(6, 0.02), correlation)
    np.testing.assert_allclose(bayard_ploen(array, PARAMETERS).rate, array.rate.mean(axis=1), atol=1e-12)


@pytest.mark.parametrize("rho", [-0.15, 0.0, 0.3])
def test_drift_factor(drifting, rho):
    # Expected: K·√((1 + (N-1)ρ)/N) is the random walk left in the rate: v'Qv, from the slow weights.
    correlation = (1 - rho) * np.eye(6) + rho
    array = drifting(10, np.full(6, 0.1), np.full(6, 0.02), correlation)
    expected = 0.02 * math.sqrt((1 + 5 * rho) / 6)
    assert f"bias {expected:.3g} deg/s/√s" in bayard_ploen(array, PARAMETERS).note


def test_the_gain_converges_while_the_covariance_grows(drifting):
    # Expected: the dense recursion: K comes to rest at the gain of the modes, P grows by v'Qv a second along 1.
    array = drifting(12000)
    _, gains, spreads = as_printed(array, 2.0)
    _, Q = matrices(array)
    u, found, walk = bias_modes(array, PARAMETERS)
    # b in the modes: Q·direction/λ; K = Σ that · p∞ · direction'.
    settled = (Q @ found.direction / found.step**2 * found.gain) @ found.direction.T
    np.testing.assert_allclose(gains[-1], settled, rtol=1e-6, atol=1e-9)
    solved = np.linalg.solve(Q, np.ones(4))
    v = solved / solved.sum()
    growth = (v @ spreads[-1] @ v - v @ spreads[-2001] @ v) / 2000
    assert growth == pytest.approx(v @ Q @ v, rel=1e-6)
    np.testing.assert_allclose(u + found.direction @ found.share, v, atol=1e-9)
    np.testing.assert_allclose(walk @ walk.T * array.period, Q, rtol=1e-12)


def test_less_drift_than_the_average(drifting):
    # Expected: simulated truth. Drift at the end over the seeds: the average has √(ΣK²)/N, the virtual gyro √(v'Qv).
    rrw, errors = np.array([0.4, 0.02, 0.1, 0.05]), []
    for seed in range(30):
        array = drifting(4000, np.full(4, 0.02), rrw, np.eye(4), seed)
        fused = bayard_ploen(array, PARAMETERS).rate
        truth = np.random.default_rng(seed).normal(0, 30, 4000)
        late = slice(3900, 4000)
        errors.append([(fused - truth)[late].mean(), (array.rate.mean(axis=1) - truth)[late].mean()])
    virtual, average = np.std(errors, axis=0)
    assert average == pytest.approx(math.sqrt(np.sum(rrw**2)) / 4 * math.sqrt(20), rel=0.35)
    assert virtual == pytest.approx(1 / math.sqrt(np.sum(1 / rrw**2)) * math.sqrt(20), rel=0.35)
    assert virtual < 0.3 * average


@pytest.mark.parametrize("known", [True, False])
def test_biases_are_kept_over_a_gap(drifting, known):
    # Expected: the dense recursion, with Q·T for each of the 150 samples that were lost, where their number is known.
    array = drifting(400, segment=np.repeat([0, 1], [170, 230]))
    lost = np.zeros(400)
    if known:
        lost[170] = 150
        array = replace(array, stretch_time=np.array([7.0, 7.0 + 320 / 200.0]))
    expected, _, _ = as_printed(array, 2.0, lost)
    np.testing.assert_allclose(bayard_ploen(array, PARAMETERS, 2.0).rate, expected, atol=1e-8)


def test_pieces_do_not_show(drifting, monkeypatch):
    array = drifting(1000)
    whole = bayard_ploen(array, PARAMETERS).rate
    monkeypatch.setattr("vgyro.fusion.papers.decoupled_walk.PIECE", 64)
    np.testing.assert_allclose(bayard_ploen(array, PARAMETERS).rate, whole, rtol=1e-11, atol=1e-11)


def test_both_engines(drifting):
    array = drifting(500)
    native, reference = (bayard_ploen(array, FilterParameters(engine=name)).rate for name in ("native", "reference"))
    np.testing.assert_allclose(native, reference, atol=1e-10)


def test_without_random_walks(drifting):
    # Expected: K = 0, so w = u'y; where one gyro does not walk, its own bias is the one that is left.
    array = drifting(200)
    fused = bayard_ploen(replace(array, noise=replace(array.noise, rrw=np.zeros(4))), PARAMETERS)
    np.testing.assert_allclose(fused.rate, array.rate @ fused.weights, atol=1e-12)
    one = replace(array, noise=replace(array.noise, rrw=np.array([0.4, 0.0, 0.1, 0.05])))
    u, found, _ = bias_modes(one, PARAMETERS)
    np.testing.assert_allclose(u + found.direction @ found.share, [0, 1, 0, 0], atol=1e-12)


@pytest.mark.parametrize(
    ("change", "reason"),
    [({"rrw": np.array([0.1, np.nan, 0.1, 0.1])}, "gyro 2 of 4"), ({"arw": np.full(4, np.nan)}, "noise covariance")],
)
def test_reasons(drifting, change, reason):
    array = drifting(10)
    with pytest.raises(CannotRun, match=reason):
        bayard_ploen(replace(array, noise=replace(array.noise, **change)), PARAMETERS)
