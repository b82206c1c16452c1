"""Chang 2008, level 1, against filterpy and closed forms."""

import math
from dataclasses import replace

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from walking_gyros import RRW, walking

from vgyro.fusion import CannotRun, FilterParameters, design
from vgyro.fusion.papers.chang_2008 import chang_2008

PARAMETERS = FilterParameters(q=40.0)


@pytest.fixture
def turning(make_array):
    """turning(samples, …): white gyros with random walks and a rate that is one."""
    return walking(make_array, lambda rng, samples: 5.0 + np.cumsum(rng.normal(0, math.sqrt(40.0 / 200.0), samples)))


def by_filterpy(array, q, start, lost=()):
    """w of filterpy's filter of N + 1 states, after each update."""
    noise, n = array.noise, len(array.noise.arw)
    filter_ = KalmanFilter(dim_x=n + 1, dim_z=n)
    filter_.F, filter_.H = np.eye(n + 1), np.hstack([np.eye(n), np.ones((n, 1))])
    growth = np.zeros((n + 1, n + 1))
    growth[:n, :n], growth[n, n] = np.outer(noise.rrw, noise.rrw) * noise.correlation, q
    filter_.P, filter_.R = growth * start, noise.R / array.period
    found = []
    for k, y in enumerate(array.rate):
        filter_.predict(Q=growth * array.period * (1 + (lost[k] if len(lost) else 0)))
        filter_.update(y[:, None])
        found.append(filter_.x[n, 0])
    return np.array(found)


@pytest.mark.parametrize("start", [0.0, 1.0, 30.0])
def test_against_filterpy(turning, start):
    array = turning(800)
    np.testing.assert_allclose(chang_2008(array, PARAMETERS, start).rate, by_filterpy(array, 40.0, start), atol=1e-8)


def test_gap(turning):
    array = turning(400, segment=np.repeat([0, 1], [170, 230]))
    array = replace(array, stretch_time=np.array([7.0, 7.0 + 320 / 200.0]))
    lost = np.zeros(400)
    lost[170] = 150
    np.testing.assert_allclose(chang_2008(array, PARAMETERS, 1.0).rate, by_filterpy(array, 40.0, 1.0, lost), atol=1e-8)


def test_nothing_known_of_the_start(turning):
    # Expected: generalised least squares on the sum 1·w + b, its start unknown, w its share of it; and filterpy with a
    # start at 1e7 s, which differs by the share R_d/(1e7 s · walk).
    array = turning(60)
    fused = chang_2008(array, PARAMETERS).rate
    np.testing.assert_allclose(fused, by_filterpy(array, 40.0, 1e7), atol=1e-4)
    noise, order = array.noise, np.arange(60)
    both = np.outer(noise.rrw, noise.rrw) * noise.correlation + 40.0
    walk = np.kron(np.minimum.outer(order, order), both * array.period)
    covariance = walk + np.kron(np.eye(60), noise.R / array.period)
    start = np.tile(np.eye(4), (60, 1))
    weighted = np.linalg.solve(covariance, start)
    y = array.rate.ravel()
    first = np.linalg.solve(start.T @ weighted, weighted.T @ y)
    last = first + (walk @ np.linalg.solve(covariance, y - start @ first))[-4:]
    assert fused[-1] == pytest.approx(40.0 * np.sum(np.linalg.solve(both, last)), abs=1e-8)


def test_gain_for_a_constant_rate(turning):
    # Expected: qE/(1 + qE), E = 1'Q⁻¹1, at every sample; a noise-free array shows it.
    array = turning(500)
    array = replace(array, rate=np.full_like(array.rate, 10.0))
    noise = array.noise
    E = np.sum(np.linalg.inv(np.outer(noise.rrw, noise.rrw) * noise.correlation))
    expected = 40.0 * E / (1 + 40.0 * E)
    fused = chang_2008(array, PARAMETERS)
    assert fused.dc_gain == pytest.approx(expected, rel=1e-12)
    np.testing.assert_allclose(fused.rate, 10.0 * expected, rtol=1e-10)
    assert 1 - expected > 1e-7


def test_covariance_of_what_is_not_seen_grows(turning):
    # Expected: filterpy: from P_0 ∝ walks, the variance along (b, w) = (1, -1) grows by q·1/(1 + qE) a second.
    array = turning(1)
    noise, one = array.noise, np.ones(4)
    Q = np.outer(noise.rrw, noise.rrw) * noise.correlation
    P, growth = np.zeros((5, 5)), np.zeros((5, 5))
    growth[:4, :4], growth[4, 4] = Q, 40.0
    H, R = np.hstack([np.eye(4), np.ones((4, 1))]), noise.R / array.period
    spreads = []
    for _ in range(3000):
        P = P + growth * array.period
        gain = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
        P = P - gain @ H @ P
        spreads.append(P[4, 4])
    E = one @ np.linalg.solve(Q, one)
    per_second = (spreads[-1] - spreads[-1001]) / 1000 / array.period
    assert per_second == pytest.approx(40.0 / (1 + 40.0 * E), rel=1e-3)


@pytest.mark.parametrize("rrw", [np.zeros(4), np.full(4, 1e-7)])
def test_without_random_walks_it_is_the_discrete_filter_of_a_rate(turning, rrw):
    # Expected: the engine's own Kalman filter of a scalar random walk; its first sample is u'y.
    from vgyro.engine.reference.kalman import kalman_filter

    array = turning(400)
    array = replace(array, noise=replace(array.noise, rrw=rrw))
    fused = chang_2008(array, PARAMETERS, 10.0)
    expected, _ = kalman_filter(array.rate, 1.0, 40.0 / 200, array.noise.R * 200, 0.0, 400.0)
    np.testing.assert_allclose(fused.rate, expected, atol=1e-8)


def test_response(turning):
    # Expected: measured with noise-free sinusoids: 1/√2 at the bandwidth; the delay below 1/(2π·6 s), the slowest mode.
    array = turning(200_000)
    time = np.arange(200_000) / 200.0
    fused = chang_2008(array, PARAMETERS)

    def measured(frequency):
        sine = np.sin(2 * np.pi * frequency * time)
        rate = chang_2008(replace(array, rate=np.repeat(sine[:, None], 4, axis=1)), PARAMETERS).rate
        late = time > 500
        basis = np.column_stack([sine, np.cos(2 * np.pi * frequency * time)])[late]
        (a, b), *_ = np.linalg.lstsq(basis, rate[late])
        return math.hypot(a, b), math.atan2(-b, a) / (2 * np.pi * frequency)

    gain, _ = measured(fused.bandwidth_hz)
    assert gain / fused.dc_gain == pytest.approx(math.sqrt(0.5), rel=1e-6)
    _, delay = measured(0.002)
    assert fused.delay_s == pytest.approx(delay, rel=1e-2)
    # Expected: random walks that are small against q leave the bandwidth that q was made for.
    array = replace(array, noise=replace(array.noise, rrw=RRW / 1000))
    q = design.q_for_bandwidth(design.information(array.noise.R), 2.0)
    designed = chang_2008(array, FilterParameters(bandwidth_hz=2.0))
    assert f"q = {q:.4g}" in designed.note
    assert designed.bandwidth_hz == pytest.approx(2.0, rel=1e-3)
    assert designed.noise_bandwidth_hz == pytest.approx(math.pi / 2 * designed.bandwidth_hz, rel=1e-3)


def test_level_2_cannot_run(turning):
    assert "level 2 needs three axes" in chang_2008(turning(10), PARAMETERS).note


def test_reason(turning):
    array = turning(10)
    with pytest.raises(CannotRun, match="gyro 1, 3 of 4"):
        chang_2008(replace(array, noise=replace(array.noise, rrw=np.array([np.nan, 0.1, np.nan, 0.1]))), PARAMETERS)
