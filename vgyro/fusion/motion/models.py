"""Models of the rate: how it moves from one sample to the next.

All states are in deg/s: the k-th derivative of the rate is multiplied by the k-th power of the sample period. In closed
form, from dx = A·x·dt + G·dβ: F = e^(A·T) and Q = q·∫ e^(A·s) G G' e^(A'·s) ds over one period.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np

from vgyro.arrays import Floats
from vgyro.errors import DataError

UNLIMITED = "none"
"""The model of a rate of which the neighbours say nothing: no smoothing."""

HALF_POWER = math.sqrt(0.5)

UNITS = {"frequency_hz": " Hz", "damping": "", "second_hz": " Hz", "second_damping": "", "sd": " deg/s", "tau_s": " s"}
NARROW = 1e-4
"""Damping of an oscillation that is a sinusoid: what drives it does not count."""
Q_UNITS = {"random_walk": " deg²/s³", "acceleration": " deg²/s⁵", "jerk": " deg²/s⁷", "oscillator": " deg²/s³"}


@dataclass(frozen=True)
class SpectralLine:
    """A narrow line of the motion, a vibration: x'' + 2ζω·x' + ω²·x = white noise.

    damping : ζ; at most NARROW: a sinusoid, which nothing drives;  sd : of the oscillation, deg/s
    """

    frequency_hz: float
    damping: float
    sd: float

    @property
    def text(self) -> str:
        kind = "sinusoid" if self.damping <= NARROW else f"line, damping {self.damping:.2g}"
        return f"{kind}, {self.frequency_hz:.4g} Hz, {self.sd:.3g} deg/s"


@dataclass(frozen=True)
class MotionCandidate:
    """One of the models that were compared, and how well it smooths the recording.

    model, parameters, lines : as in Motion
    risk : estimated squared error of its smoother, summed over the recording, in units of the variance of the noise
    cost : risk plus what its parameters cost; the model of the least cost is taken
    """

    model: str
    parameters: Mapping[str, float]
    lines: tuple[SpectralLine, ...]
    risk: float
    cost: float


@dataclass(frozen=True)
class Motion:
    """A model of the rate with its parameters.

    model      : random_walk, acceleration, jerk, oscillator, markov; none: no smoothing
    parameters : q, deg²/s³, deg²/s⁵, deg²/s⁷ of the white noise that drives the rate, its first and second derivative;
                 oscillator: frequency_hz, damping, sd (deg/s) of the oscillation, q of the random walk below it, or,
                 where it drives a second one, second_hz and second_damping of that, and no random walk;
                 markov: tau_s, sd (deg/s)
    rate_hz    : of the samples
    table      : the models that it was chosen from
    calibration : what the variance of the smoothed rate is multiplied by
    lines      : that the rate has besides
    """

    model: str
    parameters: Mapping[str, float]
    rate_hz: float
    table: tuple[MotionCandidate, ...] = ()
    calibration: float = 1.0
    lines: tuple[SpectralLine, ...] = ()

    @property
    def text(self) -> str:
        if self.model == UNLIMITED:
            return "no smoothing"
        units = UNITS | {"q": Q_UNITS.get(self.model, "")}
        values = ", ".join(f"{name} = {value:.4g}{units.get(name, '')}" for name, value in self.parameters.items())
        return " + ".join([f"{self.model}: {values}", *(line.text for line in self.lines)])

    def dynamics(self) -> Dynamics:
        found = dynamics(self.model, self.parameters, 1.0 / self.rate_hz)
        for line in self.lines:
            found = found.beside(resonator(line.frequency_hz, line.damping, line.sd, 1.0 / self.rate_hz))
        return found


@dataclass(frozen=True)
class Activity:
    """How lively the rate is from time to time, beside what its model says.

    level : [T] of uint8, number of the level of each sample
    width : [M], for each level the factor by which the bandwidth of the smoother changes, about; 1: as the model says
    order : the bandwidth goes with the 2·order-th root of the process noise, which therefore changes by width^(2·order)
    """

    level: np.ndarray
    width: np.ndarray
    order: int

    @classmethod
    def even(cls, samples: int, width: float = 1.0, order: int = 1) -> Activity:
        """The same throughout."""
        return cls(np.zeros(samples, dtype=np.uint8), np.array([width]), order)

    @property
    def factor(self) -> np.ndarray:
        """What the process noise is multiplied by at each level [M]."""
        return self.width ** (2.0 * self.order)

    @property
    def text(self) -> str:
        other = float(np.mean(self.width[self.level] != 1.0))
        used = self.width[np.unique(self.level)]
        if not other:
            return ""
        return f"{100.0 * other:.0f} % of the time with {used.min():.2g} to {used.max():.2g} times the bandwidth"


@dataclass(frozen=True)
class Dynamics:
    """How the rate moves from one sample to the next: a linear model of n states, all in deg/s.

    transition : [n, n], F: the state at a sample is F times the one before, plus noise of the covariance `process`
    process    : [n, n], (deg/s)², Q
    reads      : [n], h: the rate is h'·state
    stationary : [n, n], (deg/s)², covariance of the states that have one in the long run; NaN on the diagonal for a
                 state that wanders without a limit
    order      : [n], which derivative of the rate a state is: 0 for a part of the rate itself, 1 for its derivative
                 times the sample period, and so on
    """

    transition: np.ndarray
    process: np.ndarray
    reads: np.ndarray
    stationary: np.ndarray = field(repr=False)
    order: np.ndarray = field(repr=False)

    def beside(self, other: Dynamics) -> Dynamics:
        """The sum of two rates that know nothing of each other."""
        return Dynamics(
            _blocks(self.transition, other.transition),
            _blocks(self.process, other.process),
            np.append(self.reads, other.reads),
            _blocks(self.stationary, other.stationary),
            np.append(self.order, other.order),
        )


def _blocks(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    whole = np.zeros((len(first) + len(second),) * 2)
    whole[: len(first), : len(first)], whole[len(first) :, len(first) :] = first, second
    return whole


def dynamics(model: str, parameters: Mapping[str, float], period: float) -> Dynamics:
    """How the rate moves from sample to sample, by a model of vgyro.fusion.motion.search.FAMILIES.

    parameters : of the model, as Motion.parameters;  period : of the samples, s
    raises     : DataError for a model that is not known, or other parameters than its own
    """
    from vgyro.fusion.motion.search import FAMILIES  # The table is made of what is here.

    kinds = [family for family in FAMILIES.values() if family.model == model]
    for family in kinds:
        if set(family.names) == set(parameters):
            return family.dynamics(**parameters, period=period)
    if not kinds:
        known = dict.fromkeys(family.model for family in FAMILIES.values())
        raise DataError(f"unknown motion model {model!r}", remedy=f"Known: {', '.join(known)}")
    takes = ", or ".join(", ".join(family.names) for family in kinds)
    raise DataError(f"the motion model {model} has the parameters {takes}", remedy=f"not {', '.join(parameters)}")


_DRIVEN = (
    np.ones((1, 1)),
    np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]]),
    np.array([[1 / 20, 1 / 8, 1 / 6], [1 / 8, 1 / 3, 1 / 2], [1 / 6, 1 / 2, 1.0]]),
)
"""Of rates whose highest derivative is a random walk, of 1, 2 and 3 states: Q in units of q·T^(2n-1)."""


def driven(order: int) -> Callable[..., Dynamics]:
    """The dynamics of a rate that is white noise integrated `order` times, 1 to 3: states rate and derivatives."""
    shape, each = _DRIVEN[order - 1], np.arange(order)
    lags = np.subtract.outer(each, each).T
    F = np.array([[1.0 / math.factorial(lag) if lag >= 0 else 0.0 for lag in row] for row in lags.tolist()])

    def made(q: float, period: float) -> Dynamics:
        Q = q * period ** (2 * order - 1) * shape
        return Dynamics(F, Q, np.eye(order)[0], np.diag(np.full(order, math.nan)), each)

    return made


def markov(tau_s: float, sd: float, period: float) -> Dynamics:
    """First order about a mean that does not move: states deviation and mean."""
    return Dynamics(
        np.diag([math.exp(-period / tau_s), 1.0]),
        np.diag([-(sd**2) * math.expm1(-2.0 * period / tau_s), 0.0]),
        np.ones(2),
        np.diag([sd**2, math.nan]),
        np.zeros(2, dtype=int),
    )


def oscillator(frequency_hz: float, damping: float, sd: float, q: float, period: float) -> Dynamics:
    """A resonator about a random walk: states level, x, x'·T."""
    return driven(1)(q, period).beside(resonator(frequency_hz, damping, sd, period))


def resonator(frequency_hz: float, damping: float, sd: float, period: float) -> Dynamics:
    """x'' + 2ζω·x' + ω²·x = white noise, of stationary s.d. `sd`: states x, x'·T."""
    omega, scale = 2.0 * math.pi * frequency_hz, np.array([1.0, period])
    stationary = sd**2 * np.array([1.0, (omega * period) ** 2])
    rise, slope, stay = _impulse_response(np.array([period]), omega, damping)
    F = np.array([[stay[0], rise[0] / period], [-(omega**2) * rise[0] * period, slope[0]]])
    if damping * omega * period > 0.5:
        Q = np.diag(stationary) - F * stationary @ F.T
    else:
        # The difference above would cancel; the integral of a square does not. Its integrand is smooth over a period.
        nodes, weights = _gauss(24)
        rise, slope, _ = _impulse_response(0.5 * period * (nodes + 1.0), omega, damping)
        rows = scale[:, None] * np.array([rise, slope])
        Q = 4.0 * damping * omega**3 * sd**2 * 0.5 * period * (rows * weights) @ rows.T
    return Dynamics(F, Q, np.array([1.0, 0.0]), np.diag(stationary), np.array([0, 1]))


def pair(
    frequency_hz: float, damping: float, second_hz: float, second_damping: float, sd: float, period: float
) -> Dynamics:
    """An oscillator driven by an oscillator, of stationary s.d. `sd` about zero: states x and three derivatives.

    Its density falls with the 8th power of the frequency: a rate that is limited to a band. F and Q by the matrix
    exponential (Van Loan 1978, IEEE Trans. Autom. Control 23, 395-404), in units of time that make its entries alike.
    """
    from scipy.linalg import expm, solve_continuous_lyapunov

    omega = 2.0 * math.pi * math.sqrt(frequency_hz * second_hz)
    first, second = (
        [1.0, 2.0 * loss * 2.0 * math.pi * own / omega, (2.0 * math.pi * own / omega) ** 2]
        for own, loss in ((frequency_hz, damping), (second_hz, second_damping))
    )
    A = np.diag(np.ones(3), 1)
    A[3] = -np.convolve(first, second)[:0:-1]
    drive = np.diag([0.0, 0.0, 0.0, 1.0])
    stationary = solve_continuous_lyapunov(A, -drive)
    stationary *= sd**2 / stationary[0, 0]
    strength = -2.0 * float(A[3] @ stationary[3])
    scale = (omega * period) ** np.arange(4)
    step = A * np.outer(scale, 1.0 / scale) * omega * period
    system = np.zeros((8, 8))
    system[:4, :4], system[4:, 4:], system[3, 7] = -step, step.T, 1.0
    power = expm(system)
    F = power[4:, 4:].T
    Q = F @ power[:4, 4:] * strength * omega * period * scale[3] ** 2
    return Dynamics(
        F, 0.5 * (Q + Q.T), np.eye(4)[0], 0.5 * (stationary + stationary.T) * np.outer(scale, scale), np.arange(4)
    )


@cache
def _gauss(nodes: int) -> tuple[np.ndarray, np.ndarray]:
    """Places and weights of Gauss and Legendre's rule on [-1, 1]."""
    places, weights = np.polynomial.legendre.leggauss(nodes)
    return places, weights


def _impulse_response(time: np.ndarray, omega: float, damping: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of x'' + 2ζω·x' + ω²·x = 0 at times [T]: g with g(0) = 0, g'(0) = 1; g'; and the x with x(0) = 1, x'(0) = 0."""
    decay = damping * omega
    square = (decay**2 - omega**2) * time**2
    root = np.sqrt(np.abs(square))
    tiny = np.abs(square) < 1e-3
    safe = np.where(tiny, 1.0, root)
    cosine = np.where(square < 0, np.cos(root), np.cosh(np.minimum(root, 700.0)))
    sine = np.where(square < 0, np.sin(root), np.sinh(np.minimum(root, 700.0))) / safe
    series = 1.0 + square / 6.0 * (1.0 + square / 20.0 * (1.0 + square / 42.0 * (1.0 + square / 72.0)))
    fade = np.exp(-decay * time)
    sine = fade * time * np.where(tiny, series, sine)
    return sine, fade * cosine - decay * sine, fade * cosine + decay * sine


@dataclass(frozen=True)
class SteadyGain:
    """What the steady two-sided smoother lets through: G(f) = S(f)/(S(f) + S_v(f)), without delay.

    r : variance of the noise, (deg/s)²;  phi : its AR(1) coefficient
    Wiener's smoother, for which the two-sided Kalman smoother is far from the ends.
    """

    motion: Motion
    r: float
    phi: float = 0.0

    def at(self, frequency: Floats) -> Floats:
        """G [F] at frequencies [F] above 0, Hz."""
        model = self.motion.dynamics()
        turn = np.exp(2j * math.pi * np.asarray(frequency, dtype=float) / self.motion.rate_hz)
        # A state that never changes is known from all the samples: it has no density.
        moves = np.diagonal(model.process) > 0
        if not moves.any():
            return np.zeros(len(turn))
        F, Q = (one[np.ix_(moves, moves)] for one in (model.transition, model.process))
        system = turn[:, None, None] * np.eye(len(F)) - F.T
        response = np.linalg.solve(system, np.broadcast_to(model.reads[moves][:, None], (len(turn), len(F), 1)))[..., 0]
        signal = np.einsum("fi,ij,fj->f", response, Q, response.conj()).real
        noise = self.r * (1.0 - self.phi**2) / np.abs(1.0 - self.phi / turn) ** 2
        gain: Floats = signal / (signal + noise)
        return gain

    def without_lines(self) -> SteadyGain:
        return replace(self, motion=replace(self.motion, lines=()))

    @property
    def random_walk_ratio(self) -> float | None:
        """Q/r of a random walk in white noise, whose gain has closed forms; None of any other."""
        if self.motion.model != "random_walk" or self.phi:
            return None
        return self.motion.parameters["q"] / self.motion.rate_hz / self.r

    def bandwidth_hz(self) -> float:
        """Highest frequency at which G is √½ (-3 dB), but for lines.

        NaN: it is above that up to half the sample rate; 0: never is.
        """
        from scipy.optimize import brentq

        ratio = self.random_walk_ratio
        if ratio is not None:
            square = 0.25 * ratio * (math.sqrt(2.0) - 1.0)
            return self.motion.rate_hz / math.pi * math.asin(math.sqrt(square)) if square < 1.0 else math.nan
        frequency = self.frequencies()
        bare = self.without_lines()
        above = np.flatnonzero(bare.at(frequency) >= HALF_POWER)
        if above.size == 0:
            return 0.0
        last = int(above[-1])
        if last == len(frequency) - 1:
            return math.nan
        edges = np.log(frequency[last : last + 2]).tolist()
        return math.exp(brentq(lambda log: float(bare.at(np.exp([log]))[0]) - HALF_POWER, *edges, xtol=1e-12))

    def noise_bandwidth_hz(self) -> float:
        """∫ G² df from 0 to half the sample rate, but for lines: of white noise r, 2·(this)/rate_hz·r is left."""
        ratio, half = self.random_walk_ratio, 0.5 * self.motion.rate_hz
        if ratio is not None:
            keep = random_walk_keep(ratio)
            return half * (1.0 - keep) * (1.0 + keep**2) / (1.0 + keep) ** 3
        frequency = self.frequencies()
        gain = self.without_lines().at(frequency)
        return float(np.trapezoid(gain**2, frequency) + gain[0] ** 2 * frequency[0])

    def frequencies(self) -> np.ndarray:
        """Dense where G changes: toward 0, and around the frequency of an oscillation."""
        half = 0.5 * self.motion.rate_hz
        frequency = half * np.logspace(-9.0, 0.0, 4000)
        peaks = [
            self.motion.parameters[name] for name in ("frequency_hz", "second_hz") if name in self.motion.parameters
        ]
        for own in [*peaks, *(line.frequency_hz for line in self.motion.lines)]:
            near = np.logspace(-9.0, -0.05, 1500)
            frequency = np.concatenate([frequency, own * (1.0 - near), [own], own * (1.0 + near)])
        frequency = np.unique(frequency)
        return frequency[frequency <= half]


def random_walk_keep(ratio: float) -> float:
    """Pole a of the smoother of a random walk, its answer to an impulse is (1-a)/(1+a)·a^|k|; ratio : Q/r."""
    # a + 1/a = 2 + Q/r; the smaller root, without cancellation
    return 2.0 / (2.0 + ratio + math.sqrt(ratio * (4.0 + ratio)))


def fixed_bandwidth(bandwidth_hz: float, r_mean: float, rate_hz: float) -> Motion:
    """The random walk whose steady two-sided smoother has this -3 dB bandwidth at the sample rate, exactly.

    G(f) = 1/(1 + (r/Q)·4·sin²(π·f/rate)) is √½ there: Q = r·4·sin²(π·f/rate)/(√2 - 1). Above 0.4 of the sample rate
    nothing is smoothed. It is for a board at rest, whose rate does not move with that bandwidth: the variance is that
    of the noise which is left, ∫ G²·S_v, not the ∫ G·S_v of a rate that does.
    r_mean : mean variance of the noise, (deg/s)²
    """
    if not (math.isfinite(bandwidth_hz) and bandwidth_hz > 0 and math.isfinite(r_mean) and r_mean > 0):
        raise DataError(f"no smoother has the bandwidth {bandwidth_hz:g} Hz with the variance {r_mean:g} (deg/s)²")
    if bandwidth_hz > 0.4 * rate_hz:
        return Motion(UNLIMITED, {}, rate_hz)
    Q = r_mean * 4.0 * math.sin(math.pi * bandwidth_hz / rate_hz) ** 2 / (math.sqrt(2.0) - 1.0)
    keep = random_walk_keep(Q / r_mean)
    return Motion("random_walk", {"q": Q * rate_hz}, rate_hz, calibration=(1.0 + keep**2) / (1.0 + keep) ** 2)
