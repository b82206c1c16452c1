"""Samples of which no gyro says anything: what the rest of the recording makes likely there.

A smoother must bridge them. A model of the motion without a limit would go anywhere in a long run of them, so each run
counts as about one measurement: of the rate's mean and variance or, where the gyros are at the ends of their range, of
those of a normal rate beyond the end. What is smoothed there may not lie within the range.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from vgyro.fusion.blocks import combined
from vgyro.fusion.samples.missing import unseen
from vgyro.fusion.types import ArrayRates, Fused
from vgyro.runs import true_runs

PART = 0.5
"""Each run counts as so many measurements: the excess over an end is larger, and surer, in a long run."""
LEAST_END = 0.5
"""An end is at least so many deviations of the rate from its mean."""


@dataclass(frozen=True)
class StandIn:
    """places [K] : samples;  rate [K], deg/s, and variance [K], (deg/s)² a sample, of what is likely there

    end [K] : the gyros' ends of the range there, deg/s, NaN where they are at none;  side [K] : of zero, 1 or -1
    excess [K] : r.m.s. of what a normal rate has beyond that end, deg/s
    """

    places: np.ndarray
    rate: np.ndarray
    variance: np.ndarray
    end: np.ndarray
    side: np.ndarray
    excess: np.ndarray

    def put(self, rate: np.ndarray, variance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A rate [T] and its variance [T] with these in their places."""
        rate, variance = rate.copy(), variance.copy()
        rate[self.places], variance[self.places] = self.rate, self.variance
        return rate, variance

    def beyond(self, fused: Fused) -> Fused:
        """A smoothed rate that lies within the range where all gyros are at its end: the end it is, with what a normal
        rate has beyond it as its deviation. The model of the motion is wrong there."""
        inside = self.side * (fused.rate[self.places] - self.end) < 0.0
        if not inside.any():
            return fused
        rate, sd, where = fused.rate.copy(), fused.sd, self.places[inside]
        rate[where] = self.end[inside]
        if sd is not None:
            sd = sd.copy()
            sd[where] = self.excess[inside]
        return replace(fused, rate=rate, sd=sd)


def stand_in(array: ArrayRates, lost: np.ndarray | None) -> StandIn | None:
    """What is likely where no gyro says anything; None: there are no such samples, or no others.

    array : with clipped samples missing;  lost [T] : samples that were missing before; of the others the ends of the
            gyros' ranges are the rate
    """
    gone = unseen(array)
    if gone is None or gone.all():
        return None
    mean = combined(array.rate, np.full(array.rate.shape[1], 1.0 / array.rate.shape[1]))
    known = mean[~gone]
    centre, variance = float(np.median(known)), float(np.var(known))
    edges = true_runs(gone)
    length = np.repeat(np.diff(edges, axis=1)[:, 0], np.diff(edges, axis=1)[:, 0])
    places = np.flatnonzero(gone)
    rate, spread = np.full(len(places), centre), np.full(len(places), variance)
    end, sides, beyond_it = (np.full(len(places), np.nan) for _ in range(3))
    at_end = np.ones(len(places), dtype=bool) if lost is None else ~lost[places]
    for side in (-1.0, 1.0):
        beyond = at_end & (side * (mean[places] - centre) > 0)
        if beyond.any():
            far = abs(float(np.median(mean[places[beyond]])) - centre)
            excess, of_excess = _excess(far, float(beyond.sum()) / (len(mean) - len(places) + beyond.sum()))
            end[beyond], sides[beyond] = mean[places[beyond]], side
            beyond_it[beyond] = math.hypot(excess, math.sqrt(of_excess))
            rate[beyond], spread[beyond] = mean[places[beyond]] + side * excess, of_excess
    return StandIn(places, rate, spread * length / PART, end, sides, beyond_it)


def _excess(end: float, share: float) -> tuple[float, float]:
    """Mean and variance of what a normal rate has beyond an end so far from its mean, deg/s and (deg/s)².

    share : of the samples that are beyond it. The inverse Mills ratio: Johnson, Kotz & Balakrishnan (1994), Continuous
    Univariate Distributions 1, sec. 13.10.1.
    """
    from scipy.special import log_ndtr, ndtri

    place = max(-float(ndtri(share)), LEAST_END)
    deviation = end / place
    density = -place * place / 2.0 - math.log(math.sqrt(2.0 * math.pi))
    mills = math.exp(density - float(log_ndtr(-place)))
    return deviation * mills - end, deviation**2 * (1.0 + place * mills - mills**2)
