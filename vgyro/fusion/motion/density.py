"""Spectral densities of the models of the rate, in closed form, of many sets of parameters at once.

All are two-sided, deg²/s, as sampled: of a density that falls at least with f^-4 the nearest images are enough.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Floats
from vgyro.fusion.motion.models import SpectralLine

Values = Mapping[str, np.ndarray]


@dataclass(frozen=True)
class DensityFamily:
    """Models of one kind.

    model   : as Motion.model;  names : of the parameters
    density : (values [G, 1] by name, frequency [F] Hz, rate_hz) → [G, F]
    """

    model: str
    names: tuple[str, ...]
    density: Callable[[Values, np.ndarray, float], np.ndarray]


def _images(one: Callable[[Floats], Floats], frequency: Floats, rate_hz: float) -> Floats:
    places = (frequency, rate_hz - frequency, rate_hz + frequency)
    return one(places[0]) + one(places[1]) + one(places[2])


def _walk(values: Values, frequency: np.ndarray, rate_hz: float) -> np.ndarray:
    return values["q"] / (2.0 * rate_hz * np.sin(math.pi * frequency / rate_hz)) ** 2


def _driven(order: int) -> Callable[[Values, np.ndarray, float], np.ndarray]:
    def density(values: Values, frequency: Floats, rate_hz: float) -> Floats:
        return values["q"] * _images(lambda f: (2.0 * math.pi * f) ** (-2 * order), frequency, rate_hz)

    return density


def _markov(values: Values, frequency: Floats, rate_hz: float) -> Floats:
    steps = 1.0 / (rate_hz * values["tau_s"])
    keep = np.exp(-steps)
    power = -np.expm1(-2.0 * steps) * values["sd"] ** 2 / rate_hz
    density: Floats = power / ((1.0 - keep) ** 2 + 4.0 * keep * np.sin(math.pi * frequency / rate_hz) ** 2)
    return density


def _section(own: Floats, damping: Floats, frequency: Floats) -> Floats:
    square = (frequency / own) ** 2
    return 1.0 / ((1.0 - square) ** 2 + 4.0 * damping**2 * square)


def _resonance(values: Values, frequency: Floats, rate_hz: float) -> Floats:
    own, damping = values["frequency_hz"], values["damping"]
    lowest = values["sd"] ** 2 * 4.0 * damping / (2.0 * math.pi * own)
    return lowest * _images(lambda f: _section(own, damping, f), frequency, rate_hz)


def _oscillator(values: Values, frequency: Floats, rate_hz: float) -> Floats:
    density: Floats = _resonance(values, frequency, rate_hz) + _walk(values, frequency, rate_hz)
    return density


def _pair(values: Values, frequency: Floats, rate_hz: float) -> Floats:
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
FAMILIES = {
    "random_walk": DensityFamily("random_walk", ("q",), _walk),
    "acceleration": DensityFamily("acceleration", ("q",), _driven(2)),
    "jerk": DensityFamily("jerk", ("q",), _driven(3)),
    "markov": DensityFamily("markov", ("tau_s", "sd"), _markov),
    "resonance": DensityFamily("oscillator", LINE, _resonance),
    "oscillator": DensityFamily("oscillator", (*LINE, "q"), _oscillator),
    "pair": DensityFamily("oscillator", PAIR, _pair),
}


def of_line(line: SpectralLine, frequency: np.ndarray, rate_hz: float) -> np.ndarray:
    """Density [F] of a line."""
    values = {name: np.array(getattr(line, name)) for name in LINE}
    return _resonance(values, frequency, rate_hz)
