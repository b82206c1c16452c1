"""Spectral densities of the models of the rate, in closed form, of many sets of parameters at once.

All are two-sided, deg²/s, as sampled: of a density that falls at least with f^-4 the nearest images are enough.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Floats
from vgyro.fusion.motion.evidence import RateSpectrum
from vgyro.fusion.motion.models import Dynamics, SpectralLine

Values = Mapping[str, np.ndarray]


@dataclass(frozen=True)
class MotionFamily:
    """A model of the rate, and how its parameters are searched for: an entry of vgyro.fusion.motion.search.FAMILIES.

    model    : as Motion.model
    names    : of the parameters, all above zero; vgyro.fusion.motion.search.bounds_of has the range of each name
    dynamics : (a keyword for each parameter, period in s) → Dynamics of the sampled rate
    density  : (values [G, 1] by name, frequency [F] in Hz, rate_hz) → [G, F], two-sided density of the sampled rate,
               deg²/s
    starts   : (spectrum of the fused rate, frequency in Hz at which rate and noise are alike, about) → [G, parameters],
               sets of parameters from which the search starts
    order    : the bandwidth of the model's smoother goes with the 2·order-th root of its process noise
    """

    model: str
    names: tuple[str, ...]
    dynamics: Callable[..., Dynamics]
    density: Callable[[Values, np.ndarray, float], np.ndarray]
    starts: Callable[[RateSpectrum, float], np.ndarray]
    order: int


def _images(one: Callable[[Floats], Floats], frequency: Floats, rate_hz: float) -> Floats:
    places = (frequency, rate_hz - frequency, rate_hz + frequency)
    return one(places[0]) + one(places[1]) + one(places[2])


def walk(values: Values, frequency: np.ndarray, rate_hz: float) -> np.ndarray:
    """Density of a random walk, of the parameter q in deg²/s³; arguments and result as MotionFamily.density."""
    return values["q"] / (2.0 * rate_hz * np.sin(math.pi * frequency / rate_hz)) ** 2


def driven(order: int) -> Callable[[Values, np.ndarray, float], np.ndarray]:
    """The density of a rate that is white noise integrated `order` times, 2 or more; q in deg²/s^(2·order + 1)."""

    def density(values: Values, frequency: Floats, rate_hz: float) -> Floats:
        return values["q"] * _images(lambda f: (2.0 * math.pi * f) ** (-2 * order), frequency, rate_hz)

    return density


def markov(values: Values, frequency: Floats, rate_hz: float) -> Floats:
    """Density of a first-order Markov rate, of tau_s in s and sd in deg/s; the rest as MotionFamily.density."""
    steps = 1.0 / (rate_hz * values["tau_s"])
    keep = np.exp(-steps)
    power = -np.expm1(-2.0 * steps) * values["sd"] ** 2 / rate_hz
    density: Floats = power / ((1.0 - keep) ** 2 + 4.0 * keep * np.sin(math.pi * frequency / rate_hz) ** 2)
    return density


def _section(own: Floats, damping: Floats, frequency: Floats) -> Floats:
    square = (frequency / own) ** 2
    return 1.0 / ((1.0 - square) ** 2 + 4.0 * damping**2 * square)


def resonance(values: Values, frequency: Floats, rate_hz: float) -> Floats:
    """Density of one oscillation, of the parameters LINE: Hz, 1 and deg/s; the rest as MotionFamily.density."""
    own, damping = values["frequency_hz"], values["damping"]
    lowest = values["sd"] ** 2 * 4.0 * damping / (2.0 * math.pi * own)
    return lowest * _images(lambda f: _section(own, damping, f), frequency, rate_hz)


def oscillator(values: Values, frequency: Floats, rate_hz: float) -> Floats:
    """Density of an oscillation about a random walk, the sum of both; arguments as MotionFamily.density."""
    density: Floats = resonance(values, frequency, rate_hz) + walk(values, frequency, rate_hz)
    return density


def pair(values: Values, frequency: Floats, rate_hz: float) -> Floats:
    """Density of an oscillation that another one drives, of the parameters PAIR; the rest as MotionFamily.density."""
    own, damping, second, loss = (values[name] for name in PAIR[:-1])
    lowest = values["sd"] ** 2 / pair_power(own, damping, second, loss)
    return lowest * _images(lambda f: _section(own, damping, f) * _section(second, loss, f), frequency, rate_hz)


def pair_power(own: Floats, damping: Floats, second: Floats, loss: Floats) -> Floats:
    """∫ of the product of both sections over all frequencies, Hz.

    James, Nichols & Phillips (1947), Theory of Servomechanisms, appendix: the integral of four poles.
    """
    first, other = 2.0 * math.pi * own, 2.0 * math.pi * second
    a = 2.0 * (damping * first + loss * other)
    b = first**2 + other**2 + 4.0 * damping * loss * first * other
    c = 2.0 * first * other * (damping * other + loss * first)
    d = (first * other) ** 2
    power: Floats = d * (a * b - c) / (2.0 * (a * b * c - c**2 - a**2 * d))
    return power


PAIR = ("frequency_hz", "damping", "second_hz", "second_damping", "sd")
LINE = ("frequency_hz", "damping", "sd")


def of_line(line: SpectralLine, frequency: np.ndarray, rate_hz: float) -> np.ndarray:
    """Density [F] of a line."""
    values = {name: np.array(getattr(line, name)) for name in LINE}
    return resonance(values, frequency, rate_hz)
