"""Rows of the smoother: one fused rate, its variance a sample, and a model of the motion.

In motion the model of the rate and its parameters are chosen from the data, once for all rows
(vgyro.fusion.motion.smoother).
In a recording that is at rest as a whole the process noise would become zero and the virtual gyro deaf: there the
smoother is the first-order low-pass of `bandwidth_hz`, run forward and back.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from vgyro import engine as engines
from vgyro.fusion.baselines.fixed import median
from vgyro.fusion.blocks import SampleWeights, combined
from vgyro.fusion.motion.activity import find_activity
from vgyro.fusion.motion.choice import AtRest, beside_fixed
from vgyro.fusion.motion.models import Activity, Motion
from vgyro.fusion.motion.noisy_rate import NoisyRate, Standstill
from vgyro.fusion.motion.shared import shared_lines
from vgyro.fusion.motion.smoother import Smoothed, fixed_bandwidth, mean_variance, smooth
from vgyro.fusion.noise.parity import Variances, shared_variances
from vgyro.fusion.ours.array_estimate import analysed, shared_motion
from vgyro.fusion.papers.conditional import conditional
from vgyro.fusion.types import ArrayRates, CannotRun, FilterParameters, Fused, cannot_run

MEAN_HALF_POWER = 0.443
"""-3 dB bandwidth of a mean over T, times T: sin(πx)/(πx) = 1/√2."""
BELOW_POLE = 0.5
"""A low-pass is undone on what passes below this part of its frequency, where that costs less than 1 dB of noise."""
DCC = ("dcc", "in_sample", "residual")
REST_NOTE = "at rest as a whole: a fixed bandwidth, forward and back"


@dataclass(frozen=True)
class Signal:
    """A fused rate before it is smoothed.

    rate     : [T], deg/s;  variance : of its white noise, (deg/s)² a sample, one number or [T]
    colour   : correlation of that noise from one sample to the next
    weights  : as in Fused;  note : what to know of them
    slow_variance : [T] of its slow error, (deg/s)², which no smoothing takes away; None: not known
    late_s   : how late the rate is, s, by its sensors' low-pass: undone on the smoothed rate; 0: not known
    """

    rate: np.ndarray
    variance: float | np.ndarray
    colour: float
    weights: np.ndarray | SampleWeights | None
    note: str
    slow_variance: np.ndarray | None = None
    late_s: float = 0.0


def average_smoothed(array: ArrayRates, parameters: FilterParameters) -> Fused:
    """The average, smoothed. Its variance is that of the gyros' constant variances (parity)."""
    variances, gyros = shared_variances(array, parameters, False), array.rate.shape[1]
    equal = np.full(gyros, 1.0 / gyros)
    variance = float(np.mean(variances.combined_variance(equal)))
    signal = Signal(combined(array.rate, equal), variance, variances.colour(equal), equal, "")
    return smoothed(array, parameters, signal)


def median_smoothed(array: ArrayRates, parameters: FilterParameters) -> Fused:
    """The median of the gyros, smoothed.

    Its variance is that of the minimum-variance combination plus that of the difference between the two, because a
    difference between gyros is not correlated with the minimum-variance combination.
    """
    variances = shared_variances(array, parameters, False)
    rate = median(array, parameters).rate
    weights = variances.sample_weights()
    difference = rate - weights.combine(array.rate)[0]
    colour = variances.colour()
    extra = float(np.mean(np.square(np.diff(difference)))) / (2.0 * (1.0 - colour))
    variance = float(np.mean(variances.combined_variance())) + extra
    return smoothed(array, parameters, Signal(rate, variance, colour, None, ""))


def parity_smoothed(array: ArrayRates, parameters: FilterParameters) -> Fused:
    """Minimum-variance weights of the constant parity variances, smoothed."""
    return smoothed(array, parameters, _weighted(array, shared_variances(array, parameters, False)))


def residual_smoothed(array: ArrayRates, parameters: FilterParameters) -> Fused:
    """Minimum-variance weights of the changing residual variances R_t, smoothed with R_t; faults are left out."""
    return smoothed(array, parameters, _weighted(array, shared_variances(array, parameters, True)))


def _weighted(array: ArrayRates, variances: Variances) -> Signal:
    weights = variances.sample_weights()
    variance = variances.combined_variance()[variances.block_of_sample()]
    return Signal(weights.combine(array.rate)[0], variance, variances.colour(), weights, variances.note)


def dcc_smoothed(array: ArrayRates, parameters: FilterParameters) -> Fused:
    """Liu's in-sample DCC weights of the residual, smoothed with the variance that the model gives them."""
    weighed = conditional(*DCC[:2])(array, FilterParameters(definition=DCC[2]))
    if DCC not in array.deviations:
        raise CannotRun(array.no_weights.get(DCC, "there are no conditional deviations of the residual"))
    assert isinstance(weighed.weights, SampleWeights)
    variances = shared_variances(array, parameters, False)
    length = max(1, round(array.rate_hz / parameters.block_hz))
    variance = _of_blocks(weighed.weights, array.deviations[DCC], length)
    unknown = ~np.isfinite(variance)
    variance[unknown] = variances.combined_variance(np.full(variances.gyros, 1.0 / variances.gyros)).mean()
    return smoothed(
        array, parameters, Signal(weighed.rate, variance, variances.colour(), weighed.weights, weighed.note)
    )


def _of_blocks(weights: SampleWeights, deviations: SampleWeights, length: int) -> np.ndarray:
    """Variance [T] of a sample of Σw·y, from the standard deviations of means over `length` samples; NaN: not known."""
    variance, first = np.empty(len(weights.block)), 0
    for share, deviation in zip(weights.pieces(), deviations.pieces(), strict=True):
        rows = slice(first, first + len(share))
        variance[rows] = length * np.einsum("ti,ti->t", share**2, deviation**2)
        first = rows.stop
    variance[weights.block < 0] = math.nan
    return variance


def smoothed(array: ArrayRates, parameters: FilterParameters, signal: Signal) -> Fused:
    """Smooth a fused rate.  raises : CannotRun where no model of the motion can be fitted"""
    with cannot_run():
        if parameters.in_motion:
            result = _in_motion(array, parameters, signal)
            variance = result.variance
        else:
            result, variance = _at_rest(array, parameters, signal)
    slow, sd = signal.slow_variance, None
    if slow is not None:
        sd = np.sqrt(variance + slow, dtype=np.float32)
    notes = [result.parameters, REST_NOTE if not parameters.in_motion else "", signal.note]
    rate, lead_s = result.rate, signal.late_s if parameters.in_motion else 0.0
    if lead_s and not result.bandwidth_hz < BELOW_POLE / (2.0 * math.pi * abs(lead_s)):
        notes.insert(1, f"the smoother passes more than {BELOW_POLE} of the low-pass: its delay stays")
        lead_s = 0.0
    if lead_s:
        rate = without_pole(array, rate, lead_s)
    seconds = max(part.stop - part.start for part in array.stretches()) * array.period
    return Fused(
        rate,
        signal.weights,
        dc_gain=1.0,
        # Nothing is smoothed over more than a stretch.
        bandwidth_hz=not_below(result.bandwidth_hz, MEAN_HALF_POWER / seconds),
        noise_bandwidth_hz=not_below(result.noise_bandwidth_hz, 0.5 / seconds),
        delay_s=-lead_s,
        note="; ".join(note for note in notes if note),
        passes=result.passes if result.bandwidth_hz > MEAN_HALF_POWER / seconds else 0,
        sd=sd,
    )


def not_below(value: float, least: float) -> float:
    """The greater of both; NaN stays."""
    return value if math.isnan(value) else max(value, least)


def without_pole(array: ArrayRates, rate: np.ndarray, time_s: float) -> np.ndarray:
    """The rate [T] before a first-order low-pass of time constant `time_s`: rate + time_s·d(rate)/dt.

    The derivative is that of the parabola through three samples; of a rate far below the pole's frequency.
    """
    undone = rate.copy()
    for part in array.stretches():
        if part.stop - part.start > 2:
            undone[part] += time_s * np.gradient(rate[part], array.period, edge_order=2)
    return undone


def _in_motion(array: ArrayRates, parameters: FilterParameters, signal: Signal) -> Smoothed:
    motion, activity = shared_motion(array, parameters), shared_activity(array, parameters)
    level = _level(array, signal.rate, signal.variance, motion)
    noisy = NoisyRate(signal.rate - level, signal.variance, array.segment, array.rate_hz, signal.colour)
    found = smooth(noisy, motion, parameters.engine, _standstill(array, parameters, signal.variance), activity)
    return replace(found, rate=found.rate + level)


def _level(array: ArrayRates, rate: np.ndarray, variance: float | np.ndarray, motion: Motion) -> float:
    """Mean of the rate where it moves, deg/s, about which two oscillators in a row smooth; 0 for the other models.

    These have a mean among their states. A pair returns to zero, and would draw a constant rate there; its spectrum was
    chosen without the mean.
    """
    if "second_hz" not in motion.parameters:
        return 0.0
    told = ~array.at_rest & np.isfinite(variance)
    return float(np.mean(rate[told])) if told.any() else 0.0


def shared_activity(array: ArrayRates, parameters: FilterParameters) -> Activity | None:
    """How lively the rate is: from the best fused rate, for every row that is smoothed, as its model is."""

    def find() -> Activity | None:
        if not parameters.has("activity"):
            return None
        known, motion = analysed(array, parameters), shared_motion(array, parameters)
        rate, variance = known.bridged(known.rate(), known.variance())
        rate = rate - _level(array, rate, variance, motion)
        noisy = NoisyRate(rate, variance, array.segment, array.rate_hz, known.variances.colour())
        return find_activity(noisy, motion, _standstill(array, parameters, variance))

    return array.once(("activity", parameters), find)


def _standstill(array: ArrayRates, parameters: FilterParameters, variance: float | np.ndarray) -> Standstill | None:
    """Where the board stands still in a recording in motion, and how the rate moves there; None: nowhere."""
    if not array.at_rest.any():
        return None
    mean = mean_variance(np.asarray(variance))
    return Standstill(array.at_rest, fixed_bandwidth(parameters.bandwidth_hz, mean, array.rate_hz))


def _at_rest(array: ArrayRates, parameters: FilterParameters, signal: Signal) -> tuple[Smoothed, np.ndarray]:
    """The smoother of a fixed bandwidth, and the variance [T] of what it gives where the noise changes."""
    besides = shared_vibration(array, parameters)
    # At rest the variance of the samples is that of the noise, and of what vibrates.
    variance = np.asarray(signal.variance) * besides.noise
    mean = mean_variance(variance)
    motion = replace(fixed_bandwidth(parameters.bandwidth_hz, mean, array.rate_hz), lines=besides.lines)
    result = smooth(NoisyRate(signal.rate, mean, array.segment, array.rate_hz), motion, parameters.engine)
    # Where no gyro says anything the rate at rest is that of the samples about it.
    told = np.where(np.isfinite(variance), variance, mean)
    share = np.broadcast_to(told / mean, array.segment.shape)
    if math.isfinite(result.bandwidth_hz):
        # Far below the sensor's pole coloured noise is white noise of its long-run variance.
        colour = (1.0 + signal.colour) / (1.0 - signal.colour)
        share = colour * _around(array, share, result.bandwidth_hz, parameters.engine)
    return result, result.variance * share + besides.lost


def shared_vibration(array: ArrayRates, parameters: FilterParameters) -> AtRest:
    """What moves in a recording at rest: from the best fused rate, for every row that is smoothed."""

    def find() -> AtRest:
        if not parameters.has("lines"):
            return AtRest()
        known = analysed(array, parameters)
        mean = mean_variance(known.variance())
        fixed = fixed_bandwidth(parameters.bandwidth_hz, mean, array.rate_hz)
        return beside_fixed(known.noisy_rate(), fixed, shared_lines(known.array.rate, array.segment, array.rate_hz))

    return array.once(("vibration", parameters), find)


def _around(array: ArrayRates, values: np.ndarray, bandwidth_hz: float, engine: str) -> np.ndarray:
    """Mean of `values` [T] under the square of the smoother's two-sided exponential, in each stretch."""
    # Both passes together fall to -3 dB at bandwidth_hz where each has its pole at bandwidth_hz/√(√2 - 1).
    pole = 2.0 * math.pi * bandwidth_hz / math.sqrt(math.sqrt(2.0) - 1.0)
    keep = math.exp(-2.0 * pole * array.period)
    low_pass = engines.get(engine).kalman.low_pass
    around = np.empty(len(values))
    for part in array.stretches():
        piece = np.ascontiguousarray(values[part], dtype=float)
        forward = low_pass(piece, keep, 1.0 - keep, float(piece[0]))
        back = low_pass(piece[::-1], keep, 1.0 - keep, float(piece[-1]))[::-1]
        around[part] = (forward + back - (1.0 - keep) * piece) / (1.0 + keep)
    return around
