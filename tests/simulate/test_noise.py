"""Sample statistics of the noise against closed forms, within Monte-Carlo error, and against allantools and scipy."""

import allantools
import numpy as np
import pytest
from scipy import signal

from vgyro.simulate.noise import (
    ModulatedWhite,
    UnitRandomWalk,
    Volatility,
    correlation_matrix,
    pole_of_motion,
    pole_of_noise,
    unit_flicker,
)

RATE = 200.0


def volatility(n: int, alpha: float = 0.0, beta: float = 0.0, a: float = 0.0, b: float = 0.0, rho: float = 0.0):
    variance = 0.1**2
    return Volatility(
        np.full(n, variance * (1 - alpha - beta)), np.full(n, alpha), np.full(n, beta), a, b, correlation_matrix(rho, n)
    )


def unit(samples: int, gyros: int, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((samples, gyros))


def test_white_noise_has_n_root_rate_a_sample() -> None:
    # Closed form: variance N²·rate; that of a sample variance of T normal numbers is 2/T.
    samples = 400_000
    noise = ModulatedWhite(RATE, volatility(1)).next(unit(samples, 1)).noise
    assert noise.var() == pytest.approx(0.1**2 * RATE, rel=5 * np.sqrt(2 / samples))


def test_white_noise_reads_n_at_one_second() -> None:
    noise = ModulatedWhite(RATE, volatility(1)).next(unit(400_000, 1)).noise[:, 0]
    _, deviation, _, _ = allantools.oadev(noise, rate=RATE, data_type="freq", taus=[1.0])
    assert deviation[0] == pytest.approx(0.1, rel=0.05)  # 2000 s: 1.4 % s.d.


def test_white_noise_has_the_correlation_asked_for() -> None:
    matrix = ((1.0, 0.4, -0.2), (0.4, 1.0, 0.1), (-0.2, 0.1, 1.0))
    asked = Volatility(np.full(3, 0.01), np.zeros(3), np.zeros(3), 0.0, 0.0, correlation_matrix(matrix, 3))
    noise = ModulatedWhite(RATE, asked).next(unit(200_000, 3)).noise
    assert np.corrcoef(noise.T) == pytest.approx(np.array(matrix), abs=5 / np.sqrt(200_000))


def test_one_second_means_follow_the_garch_recursion_exactly() -> None:
    # The path of h is computed again here from the block means alone (Liu et al. 2015, eq. 1).
    asked = volatility(2, 0.1, 0.8, 0.05, 0.9, 0.3)
    white = ModulatedWhite(20.0, asked).next(unit(500 * 20, 2))
    means = white.noise.reshape(500, 20, 2).mean(axis=1)
    h = asked.omega / (1 - asked.alpha - asked.beta)
    for second in range(500):
        assert white.sd[second] == pytest.approx(np.sqrt(h), rel=1e-10)
        h = asked.omega + asked.alpha * means[second] ** 2 + asked.beta * h


def test_garch_moments() -> None:
    # Bollerslev (1986): variance ω/(1-α-β), autocorrelation of squares ρ1 = α(1-αβ-β²)/(1-2αβ-β²), then (α+β)ρ.
    alpha, beta, blocks = 0.1, 0.8, 40_000
    white = ModulatedWhite(2.0, volatility(2, alpha, beta)).next(unit(2 * blocks, 2))
    square = white.noise.reshape(blocks, 2, 2).mean(axis=1) ** 2
    assert square.mean() == pytest.approx(0.01, rel=0.05)
    first = alpha * (1 - alpha * beta - beta**2) / (1 - 2 * alpha * beta - beta**2)
    centred = square - square.mean(axis=0)
    for lag in (1, 2, 5, 10):
        found = (centred[lag:] * centred[:-lag]).mean() / (centred**2).mean()
        assert found == pytest.approx(first * (alpha + beta) ** (lag - 1), abs=0.03)


def test_dcc_whitens_to_independent_numbers() -> None:
    # With Q recomputed here from the block means, R^-½ D^-1 r must be standard normal and white (Liu, eq. 4-6).
    asked = volatility(3, 0.05, 0.9, 0.05, 0.9, 0.3)
    blocks = 10_000
    white = ModulatedWhite(4.0, asked).next(unit(4 * blocks, 3))
    epsilon = white.noise.reshape(blocks, 4, 3).mean(axis=1) / white.sd
    q, z, correlations = asked.target.copy(), np.empty((blocks, 3)), np.empty(blocks)
    for block in range(blocks):
        scale = np.sqrt(np.diag(q))
        r = q / np.outer(scale, scale)
        z[block], correlations[block] = np.linalg.solve(np.linalg.cholesky(r), epsilon[block]), r[0, 1]
        q = 0.05 * asked.target + 0.05 * np.outer(epsilon[block], epsilon[block]) + 0.9 * q
    assert np.cov(z.T) == pytest.approx(np.eye(3), abs=5 * np.sqrt(2 / blocks))
    assert np.corrcoef(epsilon.T)[0, 1] == pytest.approx(0.3, abs=0.05)
    assert correlations.std() > 0.05  # it does change


def test_flicker_density_and_floor() -> None:
    # Closed forms: two-sided density B²/(2πf), Allan floor B·√(2 ln2/π) = 0.664·B.
    series = [unit_flicker(2**15, np.random.default_rng(seed)) for seed in range(30)]
    densities = [signal.welch(one, fs=RATE, nperseg=4096, window="hann") for one in series]
    frequency, density = densities[0][0], np.mean([power / 2 for _, power in densities], axis=0)
    inner = (frequency > 0.5) & (frequency < 90)
    ratio = density[inner] * 2 * np.pi * frequency[inner]
    assert np.mean(ratio) == pytest.approx(1.0, rel=0.01)
    slope = np.polyfit(np.log(frequency[inner]), np.log(density[inner]), 1)[0]
    assert slope == pytest.approx(-1.0, abs=0.02)
    short = [unit_flicker(2**12, np.random.default_rng(seed)) for seed in range(300)]
    for samples, tolerance in ((8, 0.01), (64, 0.025), (400, 0.05)):  # about 4 s.d. of 300 stretches
        tau = samples / RATE
        curve = [allantools.oadev(one, rate=RATE, data_type="freq", taus=[tau])[1][0] ** 2 for one in short]
        assert np.sqrt(np.mean(curve)) == pytest.approx(0.6643, rel=tolerance)
    assert max(abs(one.mean(dtype=float)) for one in series) < 1e-7  # single precision


def test_random_walk_has_slope_one_half() -> None:
    # Closed form: σ² = K²τ/3.
    walks = [UnitRandomWalk(10.0, np.random.default_rng(seed)).next(20_000) for seed in range(20)]
    for tau in (10.0, 40.0, 160.0):
        found = [allantools.oadev(walk, rate=10.0, data_type="freq", taus=[tau])[1][0] ** 2 for walk in walks]
        assert np.mean(found) == pytest.approx(tau / 3, rel=0.15)
    assert all(walk[0] == 0.0 for walk in walks)


def test_noise_behind_the_pole_is_a_sampled_analogue_one() -> None:
    # Closed forms of a sampled Ornstein-Uhlenbeck process: correlation e^-2πf/rate, and the density at rest kept at N².
    samples, phi = 400_000, np.exp(-2 * np.pi * 40 / RATE)
    noise = pole_of_noise(40.0, RATE).next(unit(samples, 1) * np.sqrt(RATE))[:, 0]
    assert noise.var() == pytest.approx(RATE * (1 - phi) / (1 + phi), rel=0.02)
    assert np.corrcoef(noise[1:], noise[:-1])[0, 1] == pytest.approx(phi, abs=0.01)
    frequency, density = signal.welch(noise, fs=RATE, nperseg=2000)
    low = (frequency > 0.2) & (frequency < 4)
    assert density[low].mean() / 2 == pytest.approx(1.0, rel=0.05)


def test_motion_behind_the_pole_equals_the_analogue_filter() -> None:
    # 1/(1 + s·Tc): 1/√2 and 45° at its frequency, delay Tc for a ramp.
    rate, pole = 4000.0, 40.0
    time = np.arange(8000) / rate
    tone = pole_of_motion(pole, rate).next(np.sin(2 * np.pi * pole * time))
    expected = np.sin(2 * np.pi * pole * time - np.pi / 4) / np.sqrt(2)
    assert tone[2000:] == pytest.approx(expected[2000:], abs=5e-4)
    assert pole_of_motion(pole, RATE).next(np.full(100, 7.0)) == pytest.approx(7.0)
    ramp = np.arange(4000) / RATE
    assert ramp[-1] - pole_of_motion(pole, RATE).next(ramp)[-1] == pytest.approx(1 / (2 * np.pi * pole), rel=1e-9)


def test_blocks_of_a_rate_that_is_no_whole_number() -> None:
    white = ModulatedWhite(62.5, volatility(1, 0.05, 0.9)).next(unit(6250, 1))
    assert white.block_index[-1] == 99
    assert set(np.bincount(white.block_index)) == {62, 63}
