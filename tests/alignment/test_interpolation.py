"""Band-limited interpolation: its error, its borders, and what it does to noise."""

from __future__ import annotations

import numpy as np
import pytest

from vgyro.alignment import interpolate, noise_gain

T = 400


def sinusoid(share: float, at: np.ndarray) -> np.ndarray:
    """A sinusoid at a share of the Nyquist frequency."""
    return np.sin(np.pi * share * at + 0.4)


@pytest.mark.parametrize("share", [0.01, 0.1, 0.3, 0.5, 0.8, 0.85])
def test_a_sinusoid_comes_back_to_2e_4_up_to_85_percent_of_nyquist(share: float) -> None:
    at = np.random.default_rng(1).uniform(20, T - 20, 5000)
    assert np.abs(interpolate(sinusoid(share, np.arange(T)), at) - sinusoid(share, at)).max() < 2e-4


def test_beyond_85_percent_the_bound_does_not_hold() -> None:
    at = np.random.default_rng(1).uniform(20, T - 20, 5000)
    assert np.abs(interpolate(sinusoid(0.95, np.arange(T)), at) - sinusoid(0.95, at)).max() > 2e-3


@pytest.mark.parametrize(("room", "bound"), [(8, 1e-8), (4, 2e-7), (2, 3e-4), (1, 0.013)])
def test_near_a_border_shorter_kernels_take_over(room: int, bound: float) -> None:
    values = sinusoid(0.1, np.arange(T))
    at = room - 1 + np.linspace(0.01, 0.99, 50)
    assert np.abs(interpolate(values, at) - sinusoid(0.1, at)).max() < bound
    at = T - room - np.linspace(0.01, 0.99, 50)
    assert np.abs(interpolate(values, at) - sinusoid(0.1, at)).max() < bound


def test_positions_on_samples_give_the_samples_up_to_both_ends() -> None:
    values = np.random.default_rng(2).normal(size=T).astype(np.float32)
    np.testing.assert_allclose(interpolate(values, np.arange(T)), values, rtol=0, atol=1e-6)


def test_outside_is_nan_and_the_last_sample_is_not() -> None:
    result = interpolate(np.arange(10.0), np.array([-0.001, 0.0, 9.0, 9.001, np.nan, np.inf, -5, 1e12]))
    np.testing.assert_array_equal(np.isnan(result), [True, False, False, True, True, True, True, True])


def test_a_gap_is_not_bridged_and_does_not_change_the_other_side() -> None:
    values = np.random.default_rng(3).normal(size=60)
    segment = np.repeat([0, 1], 30)
    at = np.arange(0, 59, 0.25)
    whole = interpolate(values, at, segment)
    assert np.isnan(whole[(at > 29) & (at < 30)]).all()
    assert np.isfinite(whole[(at <= 29) | (at >= 30)]).all()
    np.testing.assert_allclose(interpolate(values[:30], at[at <= 29]), whole[at <= 29], atol=1e-12)
    np.testing.assert_allclose(interpolate(values[30:], at[at >= 30] - 30), whole[at >= 30], atol=1e-12)


def test_a_nan_is_a_gap_of_one_sample() -> None:
    values = np.linspace(0, 1, 50)
    values[20] = np.nan
    result = interpolate(values, np.array([18.5, 19.0, 19.5, 20.0, 20.5, 21.0, 21.5]))
    np.testing.assert_array_equal(np.isnan(result), [False, False, True, True, True, False, False])
    np.testing.assert_allclose(result[[0, 1, 5, 6]], np.array([18.5, 19, 21, 21.5]) / 49, atol=1e-9)


def test_an_empty_series_has_no_values() -> None:
    assert np.isnan(interpolate(np.zeros(0), np.array([0.0, 1.5]))).all()
    assert interpolate(np.arange(5.0), np.zeros(0)).shape == (0,)


def test_a_segment_of_another_length_is_refused() -> None:
    with pytest.raises(ValueError, match="segment has 3 entries for 4 values"):
        interpolate(np.zeros(4), np.zeros(1), np.zeros(3))


@pytest.mark.parametrize("fraction", [0.0, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5])
def test_the_gain_of_white_noise_is_the_table_s(fraction: float) -> None:
    noise = np.random.default_rng(4).normal(size=200_000)
    at = np.arange(100, 199_900) + fraction
    table = {0.0: 1.0, 0.05: 0.999, 0.1: 0.994, 0.2: 0.979, 0.3: 0.961, 0.4: 0.946, 0.5: 0.940}
    np.testing.assert_allclose(interpolate(noise, at).var(), noise.var() * table[fraction], rtol=0.004)
    np.testing.assert_allclose(noise_gain(at[:3]), table[fraction], atol=6e-4)
    np.testing.assert_allclose(noise_gain(np.floor(at[:3]) + 1 - fraction), table[fraction], atol=6e-4)


def test_the_mean_gain_over_a_drift_is_0_970() -> None:
    assert noise_gain(np.linspace(0, 1, 1001)).mean() == pytest.approx(0.970, abs=5e-4)


def test_the_gain_knows_the_borders() -> None:
    values = np.zeros(100)
    at = np.array([0.5, 1.5, 3.5, 7.5, 15.5, 50.5, -0.5, 98.5, 99.0])
    expected = [0.5, 0.641, 0.745, 0.820, 0.940, 0.940, np.nan, 0.5, 1.0]
    np.testing.assert_allclose(noise_gain(at, values), expected, atol=6e-4)


def test_a_complex_series_is_two_real_ones() -> None:
    rng = np.random.default_rng(5)
    values, at = rng.normal(size=100) + 1j * rng.normal(size=100), rng.uniform(0, 99, 200)
    result = interpolate(values, at)
    np.testing.assert_allclose(result.real, interpolate(values.real, at), atol=1e-12)
    np.testing.assert_allclose(result.imag, interpolate(values.imag, at), atol=1e-12)
