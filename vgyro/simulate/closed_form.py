"""What the noise coefficients of a twin imply, in closed form: the figures that an analysis of it should find."""

from __future__ import annotations

import math

import numpy as np

from vgyro.simulate.twin import GyroTruth
from vgyro.units import arw_deg_s_rt_hz, deg_s, rrw_deg_s_rt_s

FLICKER_FLOOR = 2.0 * math.log(2.0) / math.pi


def expected_allan(truth: GyroTruth, tau: np.ndarray) -> np.ndarray:
    """Allan deviation, deg/s, at the averaging times `tau`, s: σ² = N²/τ + (2 ln2/π)B² + K²τ/3.

    The flicker term is its asymptotic floor, right from a few samples on. No pole, no quantisation, no temperature.
    """
    n, b, k = arw_deg_s_rt_hz(truth.arw), deg_s(truth.bias_instability_deg_h), rrw_deg_s_rt_s(truth.rrw_deg_h_rt_h)
    return np.sqrt(n**2 / tau + FLICKER_FLOOR * b**2 + k**2 * tau / 3.0)


def allan_minimum(truth: GyroTruth) -> tuple[float, float]:
    """Lowest point of `expected_allan`: (τ in s, deviation in deg/s); τ is infinite where K = 0."""
    n, k = arw_deg_s_rt_hz(truth.arw), rrw_deg_s_rt_s(truth.rrw_deg_h_rt_h)
    tau = math.sqrt(3.0) * n / k if k > 0 else math.inf
    return tau, float(expected_allan(truth, np.array(tau)))
