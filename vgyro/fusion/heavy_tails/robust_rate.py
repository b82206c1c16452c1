"""A rate that single samples far off cannot move, and each gyro's deviation from it, sample by sample.

y_i(t) = w(t) + m_i(t) + s_i(t)·x_i(t). A gyro's own offset m and size s are followed over short windows; x has a
mixture of normal densities (vgyro.fusion.heavy_tails.scale_mixture). The rate given the gyros is normal, of mean ŵ and
variance v, by variational Bayes: each sample has the precision that its own square (y - m - ŵ)² + v leaves it.
The neighbours in time are one more witness, as good as they predicted nearby: of slow motion good, of fast motion
worthless.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from vgyro.arrays import Floats
from vgyro.fusion.heavy_tails.scale_mixture import ScaleMixture

CENTRE_S, FEWEST_CENTRE = 0.5, 16
"""Window of a gyro's offset, which follows its bias, and its scale error in motion; samples in it, at least."""
SIZE_S, FEWEST_SIZE = 1.0, 64
"""Window of a gyro's size, which follows its volatility, and bursts."""
LEAST_SIZE = 0.25
"""A gyro is nowhere less noisy than this part of its usual size."""
FEWEST_SHARE = 0.25
"""Where fewer of the samples of a window are used, the size is the usual one."""
REACHES = (2, 5, 12)
"""Neighbours on either side from which a parabola predicts a sample."""
UNSURE = 4.0
"""A sample of so many times the usual variance is no evidence for its neighbours."""
SURE = 0.05
"""The neighbours' prediction is never better than this part of the variance of the gyros' own combination."""
FAR = 25.0
"""A square so many times the usual one is far off."""
ENOUGH = 4096
"""Samples that a median over time is taken of, about."""
NOTHING = 1e12
"""Variance of a prediction that is none, over that of the gyros."""
MAD = 1.4826


@dataclass(frozen=True)
class RateSamples:
    """Samples of N gyros that are looked at together, perhaps from several gap-free stretches one after the other.

    values  : [N, n], deg/s;  used : [N, n] of bool, the sample counts
    borders : places among the n samples at which a new stretch begins
    """

    values: np.ndarray
    used: np.ndarray
    borders: np.ndarray


@dataclass(frozen=True)
class RateSetting:
    """What is assumed of the gyros of a recording while the rate is looked for that samples far off cannot move.

    densities : [N], density of each gyro's noise x, in units of its size
    usual     : [N], deg/s, size of each gyro's noise in most of the recording
    offset    : [N], deg/s, what each gyro is off from the others by in most of the recording
    centre    : samples of the window over which an offset is followed;  size : of the window for the size of the noise
    reach     : samples on either side from which a sample is predicted; 0: the rate is from the gyros alone
    """

    densities: Sequence[ScaleMixture]
    usual: np.ndarray
    offset: np.ndarray
    centre: int
    size: int
    reach: int = 0


class Estimate(NamedTuple):
    """Mean [n] and variance [n] of a rate, deg/s and (deg/s)²."""

    mean: np.ndarray
    variance: np.ndarray


@dataclass(frozen=True)
class Local:
    """The rate, and what each of N gyros is off from it by, at n samples.

    rate     : [n], deg/s, mean ŵ of the rate given gyros and neighbours in time;  variance : [n], (deg/s)², v of it
    alone    : [n], deg/s, mean from the gyros' own samples;  own : [n], (deg/s)², its variance; infinite where no gyro
               is used
    size     : [N, n], deg/s, size s of each gyro's noise near the sample
    residual : [N, n], deg/s, y - m - ŵ;  centre : [N, n], deg/s, the offset m
    """

    rate: np.ndarray
    variance: np.ndarray
    alone: np.ndarray
    own: np.ndarray
    centre: np.ndarray
    size: np.ndarray
    residual: np.ndarray


def first_setting(
    looks: Sequence[RateSamples], rate_hz: float, density: ScaleMixture, least: np.ndarray
) -> RateSetting:
    """Offsets and sizes by medians; least [N] : of the sizes, deg/s."""
    values, used = (
        np.concatenate(parts, axis=1) for parts in zip(*((one.values, one.used) for one in looks), strict=True)
    )
    common = np.median(values, axis=0)
    offset = np.array([_median((one - common)[good]) for one, good in zip(values, used, strict=True)])
    common = np.median(values - offset[:, None], axis=0)
    # Of the steps from sample to sample, so that what is slow does not count.
    pairs = used[:, 1:] & used[:, :-1]
    steps = np.abs(np.diff(values - common, axis=1))
    usual = MAD / np.sqrt(2.0) * np.array([_median(one[good]) for one, good in zip(steps, pairs, strict=True)])
    stand_in = _median(usual[usual > 0]) or _median(least[least > 0]) or 1.0
    usual = np.maximum(np.where(usual > 0, usual, stand_in), least)
    windows = (max(FEWEST_CENTRE, round(CENTRE_S * rate_hz)), max(FEWEST_SIZE, round(SIZE_S * rate_hz)))
    return RateSetting([density] * len(values), usual, offset, *windows)


def _median(values: np.ndarray) -> float:
    return float(np.median(values)) if values.size else 0.0


def start(look: RateSamples, setting: RateSetting) -> Local:
    """Where the rounds begin: at the middle of the gyros."""
    centre = np.repeat(setting.offset[:, None], look.values.shape[1], axis=1)
    size = np.repeat(setting.usual[:, None], look.values.shape[1], axis=1)
    rate = _middle(look, centre)
    own = np.full(len(rate), 1.0 / np.sum(setting.usual**-2.0))
    return Local(rate, own, rate, own, centre, size, look.values - centre - rate)


def _middle(look: RateSamples, centre: np.ndarray) -> np.ndarray:
    """Median [n] of the gyros that are used, or of all where none is."""
    values = look.values - centre
    if look.used.all():
        return np.asarray(np.median(values, axis=0))
    return np.asarray(np.nanmedian(np.where(look.used | ~look.used.any(axis=0), values, np.nan), axis=0))


def improved(look: RateSamples, setting: RateSetting, local: Local) -> Local:
    """One more round: the rate by the gyros, then with the neighbours; offsets and sizes given the rate."""
    precision = _precision(look, setting, local.size, local.residual, local.variance)
    total = precision.sum(axis=0)
    seen = total > 0
    own = np.divide(1.0, total, out=np.full(len(total), np.inf), where=seen)
    mean = np.sum(precision * (look.values - local.centre), axis=0)
    alone = np.where(seen, mean / np.where(seen, total, 1.0), local.rate)
    rate, variance = _with_neighbours(look, alone, own, setting, local)
    known = np.where(seen, variance, 0.0)
    parts = [
        _of_gyro(gyro, look, setting, precision[gyro], Estimate(rate, known), local.size[gyro])
        for gyro in range(len(look.values))
    ]
    centre, size, residual = (np.stack(one) for one in zip(*parts, strict=True))
    return Local(rate, variance, alone, own, centre, size, residual)


def _precision(
    look: RateSamples, setting: RateSetting, size: np.ndarray, residual: np.ndarray, variance: np.ndarray
) -> np.ndarray:  # fmt: skip
    """What each sample counts [N, n], 1/(deg/s)², by its residual [N, n] from a rate of some variance [n]."""
    precision = np.zeros_like(size)
    for gyro, density in enumerate(setting.densities):
        used = look.used[gyro]
        square = (residual[gyro] ** 2 + np.where(used, variance, 0.0)) / size[gyro] ** 2
        precision[gyro] = np.where(used, density.weight(square) / size[gyro] ** 2, 0.0)
    return precision


def _of_gyro(
    gyro: int, look: RateSamples, setting: RateSetting, precision: np.ndarray, rate: Estimate, before: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """m, s and y - m - ŵ [n] of one gyro from its precisions;  rate : ŵ, and v where it is known;  before : s so far"""
    off, known = look.values[gyro] - rate.mean, rate.variance * look.used[gyro]
    mass = box(precision, setting.centre)
    enough = mass > 1e-9 * float(precision.max(initial=0.0))
    centre = np.where(enough, box(precision * off, setting.centre) / np.where(enough, mass, 1.0), setting.offset[gyro])
    residual = off - centre
    square = precision * before**2 * (residual**2 + known)
    count = box(look.used[gyro].astype(float), setting.size)
    # One part in `centre` of the variance went with the offset.
    size = box(square, setting.size) / np.maximum(count, 1.0) * setting.centre / (setting.centre - 1.0)
    size[count < FEWEST_SHARE * setting.size] = setting.usual[gyro] ** 2
    return centre, np.sqrt(np.maximum(size, (LEAST_SIZE * setting.usual[gyro]) ** 2)), residual


def mean_log_variance(look: RateSamples, local: Local, setting: RateSetting, reach: int) -> float:
    """How well the neighbours in time predict a sample: the mean logarithm of the variance of their prediction.

    reach   : samples on either side from which a parabola predicts
    returns : mean of log(variance of the prediction / variance of the gyros' own combination), below 0 where the
              neighbours are the better witness; NaN where there are too few samples
    """
    if len(local.alone) <= 2 * reach:
        return float("nan")
    extra = _extra(_predicted(local.alone, local.own, reach) - local.alone, local.own, setting.size)
    told = ~_near(look.borders, len(extra), reach)
    return float(np.mean(np.log(extra[told] / _usual(local.own)))) if told.any() else float("nan")


def _with_neighbours(
    look: RateSamples, alone: np.ndarray, own: np.ndarray, setting: RateSetting, before: Local
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Mean and variance [n] of the rate from the gyros and from the samples before and after."""
    reach = setting.reach
    if not reach or len(alone) <= 2 * reach:
        return alone, own
    predicted = _predicted(alone, own, reach)
    extra = _extra(predicted - alone, own, setting.size)
    jumped = _jumped(look, predicted - alone, Estimate(predicted, extra), own, setting, before)
    extra[jumped | _near(look.borders, len(alone), reach)] = NOTHING * _usual(own)
    variance = 1.0 / (1.0 / own + 1.0 / extra)
    return variance * (alone / own + predicted / extra), variance


def _jumped(
    look: RateSamples, off: np.ndarray, others: Estimate, own: np.ndarray, setting: RateSetting, before: Local
) -> np.ndarray:
    """Samples [n] at which the gyros together are FAR from what the others predict;  off : how far they seem to be.

    What they say together is asked for without the prediction. Where they do not agree they say little, and no jump is
    seen.
    """
    jumped, (predicted, extra) = np.zeros(len(off), dtype=bool), others
    places = np.flatnonzero(off**2 > 0.25 * FAR * (_usual(own) + extra))
    if places.size:
        some = RateSamples(look.values[:, places], look.used[:, places], np.empty(0, dtype=np.int64))
        centre, size = before.centre[:, places], before.size[:, places]
        middle = _middle(some, centre)
        precision = _precision(some, setting, size, some.values - centre - middle, before.own[places])
        # The gyro in the middle agrees with itself.
        told = precision.sum(axis=0) - precision.max(axis=0)
        jumped[places] = (middle - predicted[places]) ** 2 * told > FAR * (1.0 + extra[places] * told)
    return jumped


def _usual(own: np.ndarray) -> float:
    some = _some(own)
    return _median(some[np.isfinite(some)]) or 1.0


def _some(values: np.ndarray) -> np.ndarray:
    """Enough of them for a median."""
    return values[:: 1 + len(values) // ENOUGH]


def _predicted(alone: np.ndarray, own: np.ndarray, reach: int) -> np.ndarray:
    """Each sample from its neighbours: a parabola, the sample itself left out; unsure samples are interpolated."""
    unsure = own > UNSURE * _usual(own)
    if unsure.any() and not unsure.all():
        places, sure = np.flatnonzero(unsure), np.flatnonzero(~unsure)
        alone = alone.copy()
        alone[places] = np.interp(places, sure, alone[sure])
    return np.convolve(np.pad(alone, reach, mode="edge"), _kernel(reach), mode="valid")


@lru_cache
def _kernel(reach: int) -> Floats:
    """Weights [2·reach + 1] of a parabola's value in the middle, by least squares without the middle."""
    x = np.arange(-reach, reach + 1) / reach
    design = np.stack([np.ones_like(x), x**2], axis=1)
    design[reach] = 0.0
    kernel: Floats = np.linalg.pinv(design)[0]
    return kernel


def _extra(left: Floats, own: Floats, window: int) -> Floats:
    """Variance [n] of a prediction about each place, from how far off it is [n]: with the sample's own taken off."""
    usual = np.minimum(own, UNSURE * _usual(own))
    square = np.minimum(left**2, FAR * np.maximum(np.median(_some(left**2)), usual))
    count = box(np.ones(len(left)), window)
    extra: Floats = np.maximum(box(square - usual, window), SURE * box(usual, window)) / count
    return extra


def _near(borders: np.ndarray, samples: int, reach: int) -> np.ndarray:
    """Samples [n] so near to the ends of a stretch that not all of their neighbours are there."""
    near = np.zeros(samples, dtype=bool)
    for border in [0, *borders.tolist(), samples]:
        near[max(border - reach, 0) : border + reach] = True
    return near


def box(values: np.ndarray, length: int) -> np.ndarray:
    """Sums [n] of values [n] over `length` samples about each, fewer at the ends."""
    from scipy.ndimage import uniform_filter1d

    return np.asarray(uniform_filter1d(values, length, mode="constant")) * length
