"""What leads from one sample to the next where the rate is livelier or calmer, stands still, or jumps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vgyro.arrays import Floats, Ints
from vgyro.errors import DataError
from vgyro.fusion.motion.models import NARROW, Activity, Dynamics, Motion, SpectralLine
from vgyro.fusion.motion.noisy_rate import NoisyRate, Standstill
from vgyro.runs import runs

JUMP = 5.0
"""Means on both sides that differ by so many standard deviations: a jump."""


class AfterRest(NamedTuple):
    """How the motion begins after a standstill.

    jumps : [J], samples to which the rate may go anywhere;  free : variance of such a step, (deg/s)²
    lines : numbers of the lines of the motion that are not there in a standstill
    """

    jumps: Ints
    free: float
    lines: tuple[int, ...] = ()


@dataclass(frozen=True)
class Regimes:
    """The dynamics of the rate where they change from sample to sample: M kinds of steps between the n states.

    transition  : [M, n, n], F of each kind of step;  process : [M, n, n], (deg/s)², Q of each
    of_step     : [T] of uint8, which kind of step leads to each sample
    calibration : [K], factors for the variance of the smoothed rate;  of_sample : [T] of uint8, which of them holds
    """

    transition: np.ndarray
    process: np.ndarray
    of_step: np.ndarray
    calibration: np.ndarray
    of_sample: np.ndarray

    @classmethod
    def of(cls, motion: Motion, dynamics: Dynamics, samples: int, activity: Activity | None) -> Regimes:
        """One for each level of the process noise. The calibration is that of a model that holds throughout."""
        levels = activity or Activity.even(samples)
        F = np.stack([dynamics.transition] * len(levels.factor))
        # A line is as narrow as it is.
        own = np.arange(len(dynamics.reads)) < len(dynamics.reads) - 2 * len(motion.lines)
        Q = np.where(np.outer(own, own), levels.factor[:, None, None], 1.0) * dynamics.process
        calibration = np.full(len(F), motion.calibration if activity is None else 1.0)
        return cls(F, Q, levels.level, calibration, levels.level)

    def with_rest(
        self,
        motion: Motion,
        dynamics: Dynamics,
        standstill: Standstill,
        density: float,
        after: AfterRest,
    ) -> Regimes:
        """In a standstill the rate is the random walk of its motion; density : of the noise, deg²/s."""
        at_rest, rest = standstill
        still, slowed = _at_rest(dynamics, motion, rest, density)
        for line in after.lines:
            _end(dynamics, len(dynamics.reads) - 2 * (len(motion.lines) - line), still, slowed)
        freed = slowed.copy()
        freed[0, 0] += after.free
        of_sample = np.where(at_rest, len(self.calibration), self.of_sample).astype(np.uint8)
        of_step = np.where(at_rest, len(self.transition), self.of_step).astype(np.uint8)
        of_step[after.jumps] = len(self.transition) + 1
        return Regimes(
            np.concatenate([self.transition, [still, still]]),
            np.concatenate([self.process, [slowed, freed]]),
            of_step,
            np.append(self.calibration, rest.calibration),
            of_sample,
        )


def lines_that_end(noisy: NoisyRate, lines: Sequence[SpectralLine], at_rest: np.ndarray) -> tuple[int, ...]:
    """Numbers of the lines of a motion that are not there in its standstill; at_rest : [T] of bool.

    A sinusoid of the line's frequency is fitted to each gap-free stretch at rest, in pieces over which the line keeps
    its phase, 1/(ζω). Less than half of the line's s.d. in all of them, what the noise does to it allowed for: it ends.
    A stretch shorter than a period says nothing, and if no other does the line ends, for the board does not stand
    still in the midst of a swing.
    """
    z, r = np.asarray(noisy.z), np.broadcast_to(noisy.r, np.shape(noisy.z))
    seen = at_rest & np.isfinite(r)
    stretches = [slice(start, stop) for start, stop in runs(seen, noisy.segment).tolist() if seen[start]]
    ending = []
    for number, line in enumerate(lines):
        period = noisy.rate_hz / line.frequency_hz
        steady = max(period, period / (2.0 * math.pi * line.damping)) if line.damping > NARROW else math.inf
        power = samples = 0.0
        for stretch in stretches:
            length = stretch.stop - stretch.start
            if length < period:
                continue
            for part in np.array_split(np.arange(stretch.start, stretch.stop), max(1, math.ceil(length / steady))):
                swing = np.exp(-2j * math.pi / period * np.arange(len(part))) @ (z[part] - z[part].mean())
                power += 2.0 * (abs(swing) ** 2 / len(part) - float(r[part].mean()))
            samples += length
        if samples == 0.0 or power < 0.25 * line.sd**2 * samples:
            ending.append(number)
    return tuple(ending)


def jumps_at_ends(
    z: np.ndarray, r: np.ndarray, segment: np.ndarray, phi: float, at_rest: np.ndarray, size: int
) -> np.ndarray:
    """First samples [J] after those ends of standstill at which the rate jumps.

    z, r, segment, phi : as in NoisyRate;  at_rest [T] : the standstill
    size : samples on both sides that are compared
    """
    ends = np.flatnonzero((np.diff(at_rest.astype(np.int8)) != 0) & (np.diff(segment) == 0)) + 1
    r = np.broadcast_to(r, z.shape)
    found = []
    for end in ends.tolist():
        sides = slice(max(end - size, 0), end), slice(end, end + size)
        told = [np.isfinite(r[side]) for side in sides]
        if not all(one.any() for one in told):
            continue
        means = [float(z[side][one].mean()) for side, one in zip(sides, told, strict=True)]
        noise = sum(float(r[side][one].mean()) / one.sum() for side, one in zip(sides, told, strict=True))
        if (means[1] - means[0]) ** 2 > JUMP**2 * noise * (1.0 + phi) / (1.0 - phi):
            found.append(end)
    return np.array(found, dtype=np.int64)


def _at_rest(dynamics: Dynamics, motion: Motion, rest: Motion, density: float) -> tuple[np.ndarray, np.ndarray]:
    """Transition and process of a step to a sample at rest, of the states of `motion`.

    The rate as a whole goes on as the random walk `rest`, and its lines as they are; derivatives and oscillation end,
    and begin about zero with what the filter of white noise of this density (deg²/s) knows of them while it moves.
    """
    if rest.model != "random_walk":
        raise DataError(f"the rate at rest is a random walk, not {rest.model}")
    states = len(dynamics.reads) - 2 * len(motion.lines)
    F, Q = dynamics.transition.copy(), dynamics.process.copy()
    F[:states, :states], Q[:states, :states] = np.eye(states), 0.0
    Q[0, 0] = rest.parameters["q"] / rest.rate_hz
    if dynamics.order[:states].any():
        F[1:states, :states] = 0.0
        F[0, :states] = dynamics.reads[:states]
        Q[1:states, 1:states] = np.diag(_known_derivatives(motion, dynamics, density)[1:states])
    if _in_full_swing(motion):
        _end(dynamics, 1, F, Q)
    return F, Q


def _end(dynamics: Dynamics, place: int, F: np.ndarray, Q: np.ndarray) -> None:
    """An oscillation of the states x, x'·T at `place` is not there at rest, and begins again as if it had never ended.

    Changes F and Q of a step to a sample at rest. State 0 takes over what the oscillation had of the rate, and makes up
    for the x with which it begins, so that the rate goes on.
    """
    own = slice(place, place + 2)
    F[own], F[0, place] = 0.0, 1.0
    Q[own], Q[:, own] = 0.0, 0.0
    x, slope = np.diagonal(dynamics.stationary)[own]
    Q[0, 0] += x
    Q[0, place] = Q[place, 0] = -x
    Q[place, place], Q[place + 1, place + 1] = x, slope


def _in_full_swing(motion: Motion) -> bool:
    """Is the motion an oscillation that would take longer than a period to grow by what drives it, 1/(2ζω) > 2π/ω?

    A table that begins to swing does so at once.
    """
    values = motion.parameters
    return motion.model == "oscillator" and "second_hz" not in values and values["damping"] < 0.25 / math.pi


def _known_derivatives(motion: Motion, dynamics: Dynamics, density: float) -> Floats:
    """Variances [n] of derivatives of the rate in the steady filter of white noise N², each times T^(2k).

    With w = (q/N²)^(1/2n) they are N²·√2·(w, w³) for n = 2, N²·(2w, 3w³, 2w⁵) for n = 3. An oscillation begins at zero;
    of two of them, and of other models, all that is known is how large the derivatives are.
    """
    values = motion.parameters
    if "second_hz" in values or motion.model not in ("acceleration", "jerk", "oscillator"):
        return np.diagonal(dynamics.stationary)
    if motion.model == "oscillator":
        q = 4.0 * values["damping"] * (2.0 * math.pi * values["frequency_hz"]) ** 3 * values["sd"] ** 2
        factors = np.array([0.0, 0.0, math.sqrt(2.0)])
    else:
        q = values["q"]
        factors = np.array([2.0, 3.0, 2.0]) if motion.model == "jerk" else np.full(2, math.sqrt(2.0))
    w = (q / density) ** (1.0 / (6.0 if motion.model == "jerk" else 4.0))
    order = dynamics.order[: len(factors)]  # The states of lines come after those of the model.
    known: Floats = density * factors * w ** (2 * order + 1) / motion.rate_hz ** (2 * order)
    return known
