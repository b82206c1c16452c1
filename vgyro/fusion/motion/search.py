"""The models of the rate that smooth best: starts on a grid, then Gauss and Newton with Levenberg's damping.

Everything is in closed form on some hundred bands of one spectrum: a try costs microseconds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Floats
from vgyro.fusion.motion import density, models
from vgyro.fusion.motion.density import LINE, PAIR, MotionFamily, of_line, pair_power
from vgyro.fusion.motion.evidence import RateSpectrum
from vgyro.fusion.motion.models import SpectralLine

PRICE = 4.0
"""What a parameter costs, in units of the noise: 2 for the fall of the estimated risk with it where there is nothing to
find, and as much for the error that it really makes."""
FASTEST, LINES_END = 0.2, 0.45
"""Highest frequency of an oscillation, and of a line, over the sample rate: faster is the noise's own colour."""
DAMPING, LINE_DAMPING = (1e-3, 20.0), (1e-6, 1.0)
NEAR = 1.1
"""How far a line may be from where it was found, as a factor."""
KEPT = 3
"""Starts of a grid from which the search goes on."""
STEPS, ENOUGH = 30, 0.01
"""Steps of one search at most; it ends where one lowers the risk by less."""
WIDEST = 1.5
"""Change of the logarithm of a parameter in a step."""


@dataclass(frozen=True)
class MotionFit:
    """A model of the rate, and lines that have a width, fitted together to the spectrum of one recording.

    family : name in FAMILIES; "": a rate that does not move but for the lines;  values : its parameters by name
    lines  : vibrations beside it;  signal : [F], deg²/s, two-sided density of all of it at the bands of the spectrum
    risk   : estimated squared error of its smoother, in units of the variance of the noise;  price : of its parameters
    """

    family: str
    values: Mapping[str, float]
    lines: tuple[SpectralLine, ...]
    signal: np.ndarray
    risk: float
    price: float

    @property
    def cost(self) -> float:
        return self.risk + self.price


def still(spectrum: RateSpectrum, lines: tuple[SpectralLine, ...] = ()) -> MotionFit:
    """A rate that does not move, but for the lines."""
    signal = _of_lines(spectrum, lines)
    return MotionFit("", {}, lines, signal, float(spectrum.risk(signal)), _price(spectrum, (), len(lines)))


def search(spectrum: RateSpectrum, family: str, lines: tuple[SpectralLine, ...], crossing: float) -> MotionFit:
    """Fit a model to a spectrum: try all its starts, go on from the KEPT best, and return the fit of the least cost.

    spectrum : of the fused rate, in bands;  family : name in FAMILIES
    lines    : vibrations beside the model, whose parameters are fitted with it
    crossing : frequency in Hz at which rate and noise are alike, about, from which starts are made
    """
    beside = _of_lines(spectrum, lines)
    kind = FAMILIES[family]
    grid = kind.starts(spectrum, crossing)
    values = {name: grid[:, [place]] for place, name in enumerate(kind.names)}
    signals = kind.density(values, spectrum.frequency, spectrum.rate_hz)
    risks = spectrum.risk(signals + beside)
    return min(
        (refine(spectrum, family, grid[place], lines) for place in np.argsort(risks)[:KEPT].tolist()),
        key=lambda fit: fit.cost,
    )


def refine(
    spectrum: RateSpectrum,
    family: str,
    start: np.ndarray,
    lines: tuple[SpectralLine, ...],
    beside: np.ndarray | None = None,
) -> MotionFit:
    """Go down from one start to the least risk, with the parameters of a model and of the lines together.

    spectrum : of the fused rate, in bands;  family : name in FAMILIES; "": the lines alone
    start    : [parameters of the family], where the search begins;  lines : where theirs begins
    beside   : [F], deg²/s, density of another part of the motion that stays as it is; None: there is none
    returns  : MotionFit, whose signal contains `beside`
    """
    kind = FAMILIES.get(family)
    names = kind.names if kind else ()
    bounds = bounds_of(spectrum)
    ends = [bounds[name] for name in names] + [one for line in lines for one in _linebounds_of(spectrum, line)]
    low, high = np.log(ends).T
    logs = np.clip(np.log([*start, *(getattr(line, name) for line in lines for name in LINE)]), low, high)

    def signal(logs: np.ndarray) -> np.ndarray:
        found = _signal(spectrum, kind, _lines(np.exp(logs[len(names) :])), np.exp(logs[: len(names)]))
        return found if beside is None else found + beside

    logs, found, risk = _descend(spectrum, signal, logs, low, high)
    values = dict(zip(names, np.exp(logs[: len(names)]).tolist(), strict=True))
    return MotionFit(
        family, values, _lines(np.exp(logs[len(names) :])), found, risk, _price(spectrum, names, len(lines))
    )


def _descend(
    spectrum: RateSpectrum,
    signal: Callable[[np.ndarray], np.ndarray],
    logs: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, float]:
    """Logarithms of the parameters, S and risk, where it is least."""
    here, damping = signal(logs), 1e-2
    risk = float(spectrum.risk(here))
    for _ in range(STEPS):
        total = here + spectrum.noise
        small = np.array([signal(logs + 1e-4 * one) - here for one in np.eye(len(logs))]) * 1e4
        gain = small * spectrum.noise / total**2
        slope = gain @ (2.0 * spectrum.weight * (1.0 - spectrum.power / total))
        curve = (gain * (2.0 * spectrum.weight * total / spectrum.noise)) @ gain.T
        while damping < 1e6:
            sides = np.diag(curve) + 1e-9
            step = np.linalg.solve(curve + damping * np.diag(sides), -slope)
            there = np.clip(logs + np.clip(step, -WIDEST, WIDEST), low, high)
            other = signal(there)
            less = risk - float(spectrum.risk(other))
            if less > 0.0:
                break
            damping *= 5.0
        else:
            break
        logs, here, risk, damping = there, other, risk - less, max(damping / 5.0, 1e-6)
        if less < ENOUGH:
            break
    return logs, here, risk


def _signal(
    spectrum: RateSpectrum, kind: MotionFamily | None, lines: tuple[SpectralLine, ...], values: np.ndarray
) -> np.ndarray:
    whole = _of_lines(spectrum, lines)
    if kind is None:
        return whole
    named = dict(zip(kind.names, values, strict=True))
    found: np.ndarray = whole + kind.density(named, spectrum.frequency, spectrum.rate_hz)
    return found


def _of_lines(spectrum: RateSpectrum, lines: tuple[SpectralLine, ...]) -> np.ndarray:
    return sum((of_line(one, spectrum.frequency, spectrum.rate_hz) for one in lines), np.zeros(len(spectrum.power)))


def _lines(values: np.ndarray) -> tuple[SpectralLine, ...]:
    return tuple(SpectralLine(*one) for one in values.reshape(-1, len(LINE)).tolist())


def _price(spectrum: RateSpectrum, names: tuple[str, ...], lines: int) -> float:
    return PRICE * len(names) + line_price(spectrum) * lines


def line_price(spectrum: RateSpectrum) -> float:
    """What a line costs, in units of risk: three parameters, and 2·ln(frequencies), as it is the best of so many."""
    return len(LINE) * PRICE + 2.0 * math.log(max(0.5 * float(spectrum.weight.sum()), 1.0))


def signal_of(spectrum: RateSpectrum, fit: MotionFit, lines: tuple[SpectralLine, ...]) -> np.ndarray:
    """S [F] of a fit with these lines at other frequencies than it was made on."""
    return _signal(spectrum, FAMILIES.get(fit.family), lines, np.array(list(fit.values.values())))


def bounds_of(spectrum: RateSpectrum) -> dict[str, tuple[float, float]]:
    """Least and greatest value of a parameter, by its name, for a recording with this spectrum."""
    lowest = spectrum.frequency[0]
    hertz = (0.01 * lowest, FASTEST * spectrum.rate_hz)
    size = math.sqrt(float(spectrum.noise.mean()) * spectrum.rate_hz)
    return {
        "q": (1e-60, 1e60), "tau_s": (1.0 / (2.0 * math.pi * hertz[1]), 1e3 / lowest), "sd": (1e-9 * size, 1e9 * size),
        "frequency_hz": hertz, "second_hz": hertz, "damping": DAMPING, "second_damping": DAMPING,
    }  # fmt: skip


def _linebounds_of(spectrum: RateSpectrum, line: SpectralLine) -> tuple[tuple[float, float], ...]:
    """Of frequency, damping and s.d.: a line stays where it was found."""
    middle = min(max(line.frequency_hz, spectrum.frequency[0]), LINES_END * spectrum.rate_hz)
    return (middle / NEAR, middle * NEAR), LINE_DAMPING, bounds_of(spectrum)["sd"]


def crossing_of(spectrum: RateSpectrum, signal: np.ndarray) -> float:
    """Highest frequency at which the signal is above the noise, Hz; the lowest there is where it never is."""
    above = np.flatnonzero(signal >= spectrum.noise)
    return float(spectrum.frequency[above[-1]]) if above.size else float(spectrum.frequency[0])


def _product(*sides: np.ndarray | tuple[float, ...]) -> np.ndarray:
    return np.stack([one.ravel() for one in np.meshgrid(*sides, indexing="ij")], axis=1)


def _driven_grid(order: int) -> Callable[[RateSpectrum, float], np.ndarray]:
    """The frequency at which rate and noise have the same density, q = N²·(2π·f)^(2·order)."""

    def grid(spectrum: RateSpectrum, crossing: float) -> Floats:  # noqa: ARG001
        places = np.geomspace(0.03 * spectrum.frequency[0], spectrum.rate_hz, 30)
        densities: Floats = (spectrum.noise[0] * (2.0 * math.pi * places) ** (2 * order))[:, None]
        return densities

    return grid


def _markov_grid(spectrum: RateSpectrum, crossing: float) -> np.ndarray:
    """Time constants, each with the variance for which rate and noise are alike at the crossing."""
    tau = np.geomspace(2.0 / spectrum.rate_hz, 100.0 / spectrum.frequency[0], 12)
    q = spectrum.noise[0] * (2.0 * math.pi * crossing) ** 2
    return np.stack([tau, np.sqrt(0.5 * q * tau)], axis=1)


def _level(spectrum: RateSpectrum, crossing: np.ndarray, *sections: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Density at 0 Hz of a product of sections which at the crossing is that of the noise."""
    level = np.full(len(crossing), spectrum.noise[0])
    for own, damping in sections:
        square = (crossing / own) ** 2
        level *= (1.0 - square) ** 2 + 4.0 * damping**2 * square
    return level


def _resonance_grid(spectrum: RateSpectrum, crossing: float) -> np.ndarray:
    """Below the crossing, and at the highest line."""
    peak = spectrum.frequency[int(np.argmax(spectrum.power * spectrum.weight))]
    hertz = np.minimum(np.append(crossing * np.array([0.1, 0.3, 0.6, 1.0]), peak), FASTEST * spectrum.rate_hz)
    own, damping, at = _product(hertz, (0.005, 0.02, 0.2, 0.6, 2.0), (crossing, 1.5 * crossing)).T
    level = _level(spectrum, at, (own, damping))
    return np.stack([own, damping, np.sqrt(level * 2.0 * math.pi * own / (4.0 * damping))], axis=1)


def _oscillator_grid(spectrum: RateSpectrum, crossing: float) -> np.ndarray:
    """The resonances about random walks of a hundredth to a half of their frequency."""
    place = np.repeat(_resonance_grid(spectrum, crossing), 3, axis=0)
    share = np.tile([0.01, 0.1, 0.5], len(place) // 3)
    q = spectrum.noise[0] * (2.0 * math.pi * share * place[:, 0]) ** 2
    return np.column_stack([place, q])


def _pair_grid(spectrum: RateSpectrum, crossing: float) -> np.ndarray:
    """Both below the crossing or at it, from sharp to wide."""
    first = np.minimum(crossing * np.array([0.3, 0.6, 0.9]), 0.4 * FASTEST * spectrum.rate_hz)
    own, ratio, damping, loss, at = _product(
        first, (0.5, 1.0, 2.0), (0.1, 0.4, 1.0), (0.01, 0.05, 0.3, 1.0), (crossing, 1.2 * crossing)
    ).T
    second = ratio * own
    power = _level(spectrum, at, (own, damping), (second, loss)) * pair_power(own, damping, second, loss)
    return np.stack([own, damping, second, loss, np.sqrt(power)], axis=1)


FAMILIES = {
    "random_walk": MotionFamily("random_walk", ("q",), models.driven(1), density.walk, _driven_grid(1), 1),
    "acceleration": MotionFamily("acceleration", ("q",), models.driven(2), density.driven(2), _driven_grid(2), 2),
    "jerk": MotionFamily("jerk", ("q",), models.driven(3), density.driven(3), _driven_grid(3), 3),
    "markov": MotionFamily("markov", ("tau_s", "sd"), models.markov, density.markov, _markov_grid, 1),
    "resonance": MotionFamily("oscillator", LINE, models.resonator, density.resonance, _resonance_grid, 2),
    "oscillator": MotionFamily("oscillator", (*LINE, "q"), models.oscillator, density.oscillator, _oscillator_grid, 2),
    "pair": MotionFamily("oscillator", PAIR, models.pair, density.pair, _pair_grid, 2),
}
"""The models of the rate, by the name of what is searched for: three of them are kinds of the model oscillator."""
