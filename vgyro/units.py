"""Every unit conversion of vgyro, in this file alone.

Inside vgyro a rate is in deg/s, a time in s, a temperature in °C and a white-noise coefficient in deg/s/√Hz, two-sided.
Figures for people carry the units of the field:

    N, angle random walk   [deg/√h]    = 60 · N [deg/s/√Hz, two-sided]
    B, bias instability    [deg/h]     = 3600 · B [deg/s]
    K, rate random walk    [deg/h/√h]  = 216 000 · K [deg/s/√s]
    R, rate ramp           [deg/h²]    = 12 960 000 · R [deg/s²]

Every function takes a float or an array and returns the same shape.
"""

from __future__ import annotations

import math
from typing import TypeVar

import numpy as np

Quantity = TypeVar("Quantity", float, np.ndarray)

SECONDS_PER_HOUR = 3600.0
ROOT_SECONDS_PER_HOUR = 60.0
EARTH_RATE_DEG_H = 15.04


def arw_deg_rt_h(n: Quantity) -> Quantity:
    """Angle random walk, deg/s/√Hz (two-sided) → deg/√h."""
    return n * ROOT_SECONDS_PER_HOUR


def arw_deg_s_rt_hz(n: Quantity) -> Quantity:
    """Angle random walk, deg/√h → deg/s/√Hz (two-sided)."""
    return n / ROOT_SECONDS_PER_HOUR


def deg_h(rate: Quantity) -> Quantity:
    """Rate or bias, deg/s → deg/h."""
    return rate * SECONDS_PER_HOUR


def deg_s(rate: Quantity) -> Quantity:
    """Rate or bias, deg/h → deg/s."""
    return rate / SECONDS_PER_HOUR


def rrw_deg_h_rt_h(k: Quantity) -> Quantity:
    """Rate random walk, deg/s/√s → deg/h/√h."""
    return k * (SECONDS_PER_HOUR * ROOT_SECONDS_PER_HOUR)


def rrw_deg_s_rt_s(k: Quantity) -> Quantity:
    """Rate random walk, deg/h/√h → deg/s/√s."""
    return k / (SECONDS_PER_HOUR * ROOT_SECONDS_PER_HOUR)


def ramp_deg_h2(r: Quantity) -> Quantity:
    """Rate ramp, deg/s² → deg/h²."""
    return r * SECONDS_PER_HOUR**2


def one_sided(density: Quantity) -> Quantity:
    """Amplitude density, two-sided → one-sided, same unit."""
    return density * math.sqrt(2.0)


def two_sided(density: Quantity) -> Quantity:
    """Amplitude density, one-sided → two-sided, same unit."""
    return density / math.sqrt(2.0)


def deg_from_rad(angle: Quantity) -> Quantity:
    """Angle or rate, rad → deg."""
    return angle * (180.0 / math.pi)


def deg_s_from_mdps(rate: Quantity) -> Quantity:
    """Rate, 0.001 deg/s → deg/s."""
    return rate / 1000.0


def parts_per_million(ratio: Quantity) -> Quantity:
    """Dimensionless ratio → ppm."""
    return ratio * 1e6


def hours(seconds: Quantity) -> Quantity:
    """Time, s → h."""
    return seconds / SECONDS_PER_HOUR


def earth_rate_deg_s(latitude_deg: float) -> float:
    """Earth rate on a vertical axis, deg/s, at a latitude in deg."""
    return EARTH_RATE_DEG_H / SECONDS_PER_HOUR * math.sin(math.radians(latitude_deg))
