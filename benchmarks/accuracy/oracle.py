"""The oracle: the smoother that knows the noise covariance of every sample, the walks, and the spectrum of the motion.

1. What it knows beside (scale errors, poles, delays, slow errors that are no random walk, a line) is taken off.
2. Biases: the samples' differences from one another, in which the rate w(t) cancels, say of the biases b over a block
   P = Σ (R⁻¹ - R⁻¹1 1'R⁻¹/1'R⁻¹1) and P·b = Σ (…)·y. A Kalman filter and RTS smoother of random walks over the blocks.
3. z(t) = u'(y - b), u = R⁻¹1/1'R⁻¹1, is w(t) with noise of variance 1/1'R⁻¹1. The motion is white noise e through
   poles in a row, (1 - a·B)^p w = e. Its posterior is that of a banded precision matrix: the smoother over all samples.
The variances of 2 and 3 add up: the rate says next to nothing of the common part of the biases. Between stretches of
motion the rate is known to be zero, and the samples say everything of the biases: there P = R⁻¹.
Where all gyros are clipped the rate is beyond the end of their range: the posterior of 3 is cut off there.
In a recording at rest step 3 is left out: an oracle that knew the rate to be zero would be of no use.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from math import comb

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import cholesky_banded, solveh_banded
from scipy.stats import norm

from benchmarks.accuracy.scenario import Motion, Scenario
from benchmarks.accuracy.signals import decay_of, delay, on_circle, pole
from benchmarks.accuracy.trial import Known, Recording

BLOCK_S = 0.5
"""Length of the blocks within which biases count as constant, s."""
SMOOTHED_HZ = 100.0
"""The motion of a fraction of a Hz is smoothed at no higher rate: at 1000 Hz its precision matrix is near singular."""
LEAST = 1e-2
"""Added to what each sample says of the motion, of 1/variance of it: without data the matrix is near singular."""


@dataclass(frozen=True)
class Estimate:
    """rate, sd : [T] deg/s"""

    rate: np.ndarray
    sd: np.ndarray


@dataclass(frozen=True)
class Biases:
    """Posterior of the biases at the middles of the blocks.  time [B] s;  mean [B, N];  covariance [B, N, N]"""

    time: np.ndarray
    mean: np.ndarray
    covariance: np.ndarray


def oracle(recording: Recording, scenario: Scenario) -> Estimate:
    """The best estimate of the true rate of a recording."""
    known = recording.known
    values = (_without_poles(recording, scenario) - known.offset) / (1.0 + known.scale) - known.line[:, None]
    inverse = _inverse_covariance(known, known.deviation / np.abs(1.0 + known.scale))
    row = inverse.sum(axis=2)
    information = row.sum(axis=1)
    shares = row / np.where(information > 0, information, 1.0)[:, None]
    biases = _biases(recording, values, inverse, row, information)
    bias = np.column_stack([np.interp(recording.time, biases.time, one) for one in biases.mean.T])
    combined = np.einsum("tn,tn->t", shares, values - bias)
    block = np.clip(np.searchsorted(biases.time, recording.time), 0, len(biases.time) - 1)
    slow = np.einsum("ti,tij,tj->t", shares, biases.covariance[block], shares)
    if recording.kind == "static":
        variance = 1.0 / np.where(information > 0, information, np.inf)
        return Estimate(combined + known.line, np.sqrt(variance + slow))
    smooth = _smooth(recording, scenario.motion, combined, information)
    if scenario.full_scale:
        smooth = _beyond(smooth, information == 0, recording.known.values.mean(axis=1))
    return Estimate(smooth.rate + known.line, np.sqrt(smooth.sd**2 + slow * (known.moving != 0.0)))


def _without_poles(recording: Recording, scenario: Scenario) -> np.ndarray:
    """The values [T, N] as they would be without low-pass and delay, where the motion passes these."""
    known, filters = recording.known, scenario.bandwidth
    if filters is None or not filters.motion:
        return known.values
    undone = np.empty_like(known.values)
    for gyro, column in enumerate(known.values.T):
        mirrored = np.concatenate([column, column[::-1]])
        undo = partial(_undo, decay=known.poles[gyro], late=known.late[gyro], many=filters.oversample)
        undone[:, gyro] = on_circle(mirrored, undo)[: len(column)]
    return undone


def _undo(frequency: np.ndarray, decay: float, late: float, many: int) -> np.ndarray:
    return 1.0 / (pole(decay)(frequency / many) * delay(late)(frequency))


def _inverse_covariance(known: Known, deviation: np.ndarray) -> np.ndarray:
    """R⁻¹ [T, N, N] of each sample over its usable gyros; 0 for the others."""
    samples, gyros = deviation.shape
    size = known.usable / deviation
    if known.block is not None:
        root = np.linalg.inv(known.correlation)[known.block]
    else:
        root = np.empty((samples, gyros, gyros))
        patterns, which = np.unique(known.usable, axis=0, return_inverse=True)
        for number, used in enumerate(patterns):
            inside = np.zeros((gyros, gyros))
            inside[np.ix_(used, used)] = np.linalg.inv(known.correlation[np.ix_(used, used)])
            root[which.reshape(-1) == number] = inside
    return root * size[:, :, None] * size[:, None, :]


def _biases(
    recording: Recording, values: np.ndarray, inverse: np.ndarray, row: np.ndarray, information: np.ndarray
) -> Biases:
    """Posterior of the biases from the differences between the gyros.

    values [T, N];  inverse : R⁻¹ [T, N, N];  row : R⁻¹1 [T, N];  information : 1'R⁻¹1 [T]
    """
    length = max(round(BLOCK_S * recording.rate_hz), 1)
    slot = np.rint(recording.time * recording.rate_hz).astype(int) // length
    starts = np.flatnonzero(np.diff(slot, prepend=-1))
    there = np.where(information > 0, information, np.inf)
    precision = inverse - row[:, :, None] * row[:, None, :] / there[:, None, None]
    if recording.kind != "static":
        stands = recording.known.moving == 0.0
        precision[stands] = inverse[stands]
    told = np.einsum("tij,tj->ti", precision, values)
    count = np.diff(np.append(starts, len(slot)))
    middle = np.add.reduceat(recording.time, starts) / count
    variance = np.cumsum(recording.known.walk**2, axis=0)
    at_middle = variance[np.minimum(starts + count // 2, len(slot) - 1)]
    steps = np.diff(at_middle, axis=0, prepend=0.0)
    return _walked(
        middle, np.add.reduceat(precision, starts, axis=0), np.add.reduceat(told, starts, axis=0), steps,
        recording.known.bias_sd,
    )  # fmt: skip


def _walked(time: np.ndarray, precision: np.ndarray, told: np.ndarray, steps: np.ndarray, bias_sd: float) -> Biases:
    """Kalman filter and RTS smoother of independent random walks.

    precision [B, N, N], told [B, N] : what each block says;  steps [B, N] : variance of the walks before each block
    """
    blocks, gyros = told.shape
    mean, cov = np.zeros((blocks, gyros)), np.empty((blocks, gyros, gyros))
    ahead = np.empty_like(cov)
    m, V = np.zeros(gyros), np.eye(gyros) * bias_sd**2
    for block in range(blocks):
        ahead[block] = V = V + np.diag(steps[block])
        gain = np.linalg.inv(np.eye(gyros) + V @ precision[block])
        m, V = m + gain @ V @ (told[block] - precision[block] @ m), gain @ V
        V = 0.5 * (V + V.T)
        mean[block], cov[block] = m, V
    for block in range(blocks - 2, -1, -1):
        back = np.linalg.solve(ahead[block + 1], cov[block]).T
        mean[block] += back @ (mean[block + 1] - mean[block])
        cov[block] += back @ (cov[block + 1] - ahead[block + 1]) @ back.T
    return Biases(time, mean, cov)


def _smooth(recording: Recording, motion: Motion, values: np.ndarray, information: np.ndarray) -> Estimate:
    """Posterior of the motion from values [T] with white noise of variance 1/information [T]."""
    factor, rate_hz = recording.known.moving, recording.rate_hz
    slot = np.rint(recording.time * rate_hz).astype(int)
    many = max(round(rate_hz / SMOOTHED_HZ), 1)
    place, count = slot // many, int(slot[-1]) // many + 1
    middle = (np.arange(count) + 0.5 * (many - 1) / many) * many / rate_hz
    if many == 1:
        middle = np.arange(count) / rate_hz
    band = _precision(motion, decay_of(motion.pole_hz, rate_hz / many), count)
    weight = np.bincount(place, factor**2 * information, count)
    band[0] += weight + LEAST / motion.sd**2
    moments = recording.time
    estimate, off = np.zeros(count), np.zeros(len(slot))
    # What the motion does between a sample's own moment and the middle of its place is put right in a second round.
    for _ in range(2):
        told = np.bincount(place, factor * information * (values - factor * off), count)
        estimate = solveh_banded(band, told, lower=True)
        curve = CubicSpline(middle, estimate)
        off = curve(moments) - estimate[place]
    variance = _inverse_diagonal(band)[place]
    return Estimate(factor * curve(moments), np.abs(factor) * np.sqrt(variance))


def _beyond(smooth: Estimate, clipped: np.ndarray, values: np.ndarray) -> Estimate:
    """The estimate where all gyros are clipped [T] bool: the rate is known to be beyond the end of the range.

    values [T] : what the gyros say there, deg/s.  Mean and s.d. of the normal distribution cut off at that value.
    """
    side = np.sign(values[clipped])
    sd = smooth.sd[clipped]
    start = (np.abs(values[clipped]) - side * smooth.rate[clipped]) / sd
    hazard = np.exp(norm.logpdf(start) - norm.logsf(start))
    rate, known = smooth.rate.copy(), smooth.sd.copy()
    rate[clipped] = side * (side * smooth.rate[clipped] + sd * hazard)
    known[clipped] = sd * np.sqrt(np.clip(1.0 + start * hazard - hazard**2, 1e-6, 1.0))
    return Estimate(rate, known)


def _precision(motion: Motion, decay: float, count: int) -> np.ndarray:
    """Bands [p + 1, T] of the precision of p poles in a row: A'A/q with (1 - a·B)^p and the first p samples' variance.

    q is such that the variance of the motion is motion.sd².
    """
    order = motion.poles
    reach = int(60.0 / (1.0 - decay))
    answer = np.array([float(comb(lag + order - 1, order - 1)) for lag in range(reach)]) * decay ** np.arange(reach)
    q = motion.sd**2 / np.sum(answer**2)
    taps = np.array([comb(order, lag) * (-decay) ** lag for lag in range(order + 1)])
    band = np.zeros((order + 1, count))
    for lag in range(order + 1):
        for first in range(order + 1 - lag):
            # Equation t (t ≥ p) has tap `first` at sample t - first.
            at = np.arange(order, count) - first - lag
            np.add.at(band[lag], at, taps[first] * taps[first + lag] / q)
    band[0, :order] += 1.0 / motion.sd**2
    return band


def _inverse_diagonal(band: np.ndarray) -> np.ndarray:
    """Diagonal [T] of the inverse of a banded matrix [p + 1, T] (lower form), from its Cholesky factor.

    Takahashi's recursion, from the last column to the first: Z_ij = δ_ij/L_jj² - Σ_k L_kj·Z_ki/L_jj.
    """
    factor = cholesky_banded(band, lower=True)
    order, count = band.shape[0] - 1, band.shape[1]
    diagonal, window = np.empty(count), np.zeros((order, order))
    ratio = factor[1:] / factor[0]
    own = 1.0 / factor[0] ** 2
    for column in range(count - 1, -1, -1):
        share = ratio[:, column]
        beside = -window @ share
        diagonal[column] = own[column] - share @ beside
        window[1:, 1:] = window[:-1, :-1].copy()
        window[0, 0] = diagonal[column]
        window[0, 1:] = window[1:, 0] = beside[:-1]
    return diagonal
