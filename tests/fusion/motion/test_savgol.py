"""The polynomial smoother against scipy.signal, to the bit."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import savgol_coeffs, savgol_filter

from vgyro.fusion.motion.savgol import savgol, savgol_coefficients

ORDER, PERIOD = 3, 0.005


@pytest.mark.parametrize("window", [5, 21, 201])
@pytest.mark.parametrize("derivative", [0, 1, 2, 3])
def test_the_bits_of_scipy(window: int, derivative: int) -> None:
    rng = np.random.default_rng(window)
    for samples in (window, window + 1, 3 * window + 7):
        values = np.cumsum(rng.standard_normal(samples))
        found = savgol(values, window, ORDER, derivative, PERIOD)
        np.testing.assert_array_equal(found, savgol_filter(values, window, ORDER, deriv=derivative, delta=PERIOD))
    taps = savgol_coefficients(window, ORDER, derivative, PERIOD)
    np.testing.assert_array_equal(taps, savgol_coeffs(window, ORDER, deriv=derivative, delta=PERIOD))


def test_a_cubic_passes_unchanged_to_the_ends() -> None:
    time = np.arange(60) * PERIOD
    cubic = 2.0 - 3.0 * time + 40.0 * time**2 - 5.0 * time**3
    np.testing.assert_allclose(savgol(cubic, 11, ORDER, 0, PERIOD), cubic, rtol=1e-10)
    np.testing.assert_allclose(savgol(cubic, 11, ORDER, 1, PERIOD), -3.0 + 80.0 * time - 15.0 * time**2, rtol=1e-8)
