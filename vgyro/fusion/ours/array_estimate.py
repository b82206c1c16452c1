"""What an array's own differences say of a recording, estimated once for all methods that need it.

R_t, the white noise of each gyro: constant, changing with a time constant, gyro by gyro, by
predictive likelihood of the differences; at rest as a whole, of the rates themselves less their slow part, correlation
included (vgyro.fusion.noise.parity). Slow errors b: vgyro.fusion.bias.estimate.
The motion: vgyro.fusion.motion.smoother.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from vgyro.arrays import Floats
from vgyro.fusion.bias.blocks import SlowBlocks
from vgyro.fusion.bias.estimate import SlowErrors, combined_without, slow_errors
from vgyro.fusion.blocks import SampleWeights
from vgyro.fusion.motion.lowpass import ArrayDelay, array_delay
from vgyro.fusion.motion.models import Motion
from vgyro.fusion.motion.noisy_rate import NoisyRate
from vgyro.fusion.motion.relative import Relative, relative_variance
from vgyro.fusion.motion.shared import shared_lines
from vgyro.fusion.motion.smoother import choose_motion
from vgyro.fusion.noise.parity import Variances, shared_variances
from vgyro.fusion.noise.reference_rate import smoothed
from vgyro.fusion.ours.prepared import prepared
from vgyro.fusion.samples.missing import unseen
from vgyro.fusion.samples.quantised import grid, lasting_of_mean, least_variance
from vgyro.fusion.samples.unseen import StandIn
from vgyro.fusion.types import ArrayRates, FilterParameters


@dataclass(frozen=True)
class Analysed:
    """What is known of a recording.

    array : as prepared;  variances : R_t;  weights : of least variance for it;  slow : b;  note : what was chosen
    relative : answers of the gyros to the motion, taken off; None: not known
    late_s : how late the array is, s, where that is known; 0: as late as its gyros;  late_sd : of it, s, or NaN
    guess : what is likely where no gyro says anything; None: there are no such samples, or nothing is known
    """

    array: ArrayRates
    variances: Variances
    weights: SampleWeights
    slow: SlowErrors
    note: str
    relative: Relative | None = None
    late_s: float = 0.0
    late_sd: float = math.nan
    guess: StandIn | None = None

    def rate(self) -> np.ndarray:
        """u(t)'(y - b) [T], deg/s, as late as the array is."""
        return combined_without(self.array, self.weights, self.slow)

    @property
    def undone_s(self) -> float:
        """`late_s` where no model smooths: 0 where the motion is too fast for a derivative without noise."""
        return self.late_s if self.relative is not None and self.relative.window > 1 else 0.0

    def in_time(self, rate: np.ndarray) -> np.ndarray:
        """The rate [T] without the array's delay, where it is known: late by little against the motion's time."""
        if not self.undone_s or self.relative is None:
            return rate
        return rate + self.undone_s * smoothed(self.array, rate, self.relative.window, 1)

    def variance(self) -> np.ndarray:
        """Variance u'R_t·u of its white noise [T], (deg/s)² a sample; infinite where no gyro says anything."""
        return self.at_samples(self.variances.combined_variance())

    def answer_variance(self, weights: np.ndarray) -> np.ndarray | float:
        """Variance [T], (deg/s)², of what scale factors, delays and poles leave in the rate; weights [M, N]."""
        if self.relative is None:
            return 0.0
        shares = self.variances.shares @ weights / len(self.array.rate)
        return relative_variance(self.array, self.relative, shares, self.late_sd)

    def at_samples(self, variance: Floats) -> Floats:
        """Variances [M] of the blocks at the samples [T]; infinite where no gyro says anything."""
        found: Floats = variance[self.variances.block_of_sample()]
        lost = unseen(self.array)
        if lost is not None:
            found[lost] = np.inf
        return found

    def at_least(self, variance: np.ndarray, weights: np.ndarray, parameters: FilterParameters) -> np.ndarray:
        """Variance [T] of the slow error with, at rest, no less than rounding leaves; weights [M, N]."""
        known = grid(self.array)
        if not parameters.has("quantised") or not known.step.any() or not self.array.at_rest.any():
            return variance
        shares = self.variances.shares / len(self.array.rate)
        usual = shares @ shared_variances(self.array, parameters, True).variance
        least = lasting_of_mean(known, usual, self.slow.bias.mean(axis=0), shares @ weights)
        return np.where(self.array.at_rest, np.maximum(variance, least), variance)

    def noisy_rate(self) -> NoisyRate:
        """The best fused rate, with its variance."""
        array = self.array
        return NoisyRate(self.rate(), self.variance(), array.segment, array.rate_hz, self.variances.colour())

    def bridged(self, rate: np.ndarray, variance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A rate and its variance [T] as a smoother takes them: with what is likely where no gyro says anything."""
        return (rate, variance) if self.guess is None else self.guess.put(rate, variance)


def analysed(array: ArrayRates, parameters: FilterParameters) -> Analysed:
    """R_t and b of a recording.  raises : CannotRun, as parity_variances"""
    return array.once(("analysed", parameters), lambda: _analysed(array, parameters))


def shared_motion(array: ArrayRates, parameters: FilterParameters) -> Motion:
    """How the rate moves: from the best fused rate, for every row that is smoothed.  raises : DataError, CannotRun"""

    def choose() -> Motion:
        known = analysed(array, parameters)
        moving = ~array.at_rest if array.at_rest.any() else None
        lost = unseen(known.array)
        if lost is not None:
            moving = ~lost if moving is None else moving & ~lost
        shared = shared_lines(known.array.rate, array.segment, array.rate_hz)
        return choose_motion(
            known.noisy_rate(), parameters.motion_models, parameters.engine, moving, shared, parameters.has("lines")
        )

    return array.once(("motion", parameters), choose)


def _analysed(raw: ArrayRates, parameters: FilterParameters) -> Analysed:
    ready = prepared(raw, parameters)
    array = ready.array
    variances = _not_below(shared_variances(array, parameters, True), ready.step)
    blocks = SlowBlocks.of(array)
    lasting = variances.variance * (1.0 + variances.phi) / (1.0 - variances.phi)
    white = blocks.mean_of(variances.start, lasting)
    white[blocks.mean_of(variances.start, variances.excluded.astype(float)) > 0] = np.inf
    slow = slow_errors(array, parameters, white, variances.correlation, blocks)
    if not parameters.has("slow"):
        slow = replace(slow, bias=np.zeros_like(slow.bias))
    late = _late(array, parameters, ready.relative, variances.phi)
    left_out = f"{len(array.faults)} faults left out" if array.faults else ""
    notes = [*ready.notes, variances.note, slow.note, late.note, left_out]
    weights = variances.sample_weights(parameters.engine)
    note = "; ".join(one for one in notes if one)
    return Analysed(array, variances, weights, slow, note, ready.relative, late.late_s, late.sd, ready.guess)


def _late(
    array: ArrayRates, parameters: FilterParameters, relative: Relative | None, phi: np.ndarray
) -> ArrayDelay:  # fmt: skip
    if not parameters.has("pole"):
        return ArrayDelay()
    declared = np.full(len(phi), np.nan) if array.lowpass_hz is None else array.lowpass_hz
    return array_delay(relative, phi, array.period, declared)


def _not_below(variances: Variances, step: np.ndarray) -> Variances:
    """No gyro is better than its step [N], deg/s, allows."""
    least = least_variance(step)
    if not (variances.variance < least).any():
        return variances
    return replace(variances, variance=np.maximum(variances.variance, least))
