"""What the biases follow beside their random walks: the temperature, or a course in time (COURSES) such as a warm-up.

Both are regressors with one coefficient for each gyro, chosen with the walks by the likelihood
(vgyro.fusion.bias.choice).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vgyro.fusion.bias.blocks import SlowBlocks
from vgyro.fusion.bias.choice import Choice, choose, quick_gains
from vgyro.fusion.bias.common_walk import common_walk
from vgyro.fusion.bias.model import BiasEvidence, BlockNoise, Regressor, Walk
from vgyro.fusion.types import ArrayRates, FilterParameters, TemperatureAtRest

CONTRADICTED = "the differences contradict the temperature coefficients of the record at rest: these are not used"
LEAST_RANGE = 1.0
"""Range of the temperature, K, from which the biases may be regressed on it."""
FEWEST = 60
"""Blocks from which a warm-up is looked for."""
SETTLED = (3.0, 6.0, 12.0)
"""A course has the time constant of the recording over one of these."""
PROMISING = 3.0
"""Units of ln(blocks) by which 2Δ log likelihood may be below that of the walks alone, before its own are chosen."""
DRIFTING = 4.0
"""Units of ln(blocks) by which 2Δ log likelihood of the walks is above those of the record: then one is looked for."""


@dataclass(frozen=True)
class Course:
    """A course in time that the biases may follow, each gyro's by a factor of its own.

    words : what the page says of the biases, such as "settle, as in a warm-up, in about"; the time constant comes after
    shape : (time since the first block [B] in s, time constant in s) → regressor [B], of the size of 1
    """

    words: str
    shape: Callable[[np.ndarray, float], np.ndarray]


COURSES = (Course("settle, as in a warm-up, in about", lambda since, tau: np.exp(-since / tau)),)
"""What is looked for where no temperature is known; the likeliest is taken."""


@dataclass(frozen=True)
class Followed:
    """The model of the biases of one recording, chosen by the likelihood.

    evidence  : the block means with the regressor;  choice : the walks, and whether the slopes were believed
    common    : (deg/s)²/s, covariance rate of a random walk that all gyros share; 0: none is seen
    regressor : [B], what the slopes are multiplied by: temperature less `reference` in K, or a course in time of the
                size of 1; None: nothing was looked for
    reference : °C, temperature at which the regressor is zero
    known     : slopes from a record at rest, where they are used; None: they are not
    course    : the course in time that the regressor is; None: it is a temperature, or nothing
    tau_s     : time constant of the course, s; NaN without one
    note      : what was not looked for, or not believed, and why
    """

    evidence: BiasEvidence
    choice: Choice
    common: float
    regressor: np.ndarray | None = None
    reference: float = 0.0
    known: TemperatureAtRest | None = None
    course: Course | None = None
    tau_s: float = math.nan
    note: str = ""


@dataclass(frozen=True)
class BiasCase:
    """One recording of N gyros in B blocks, for which a model of the biases is to be chosen.

    variance    : [B, N], (deg/s)², variance of the white noise of a sample;  correlation : [N, N] of that noise
    resting     : [B] of bool, the board stands still in the whole block for certain
    arw         : [N], deg/s/√Hz, white noise of each gyro in most blocks
    walk        : the random walks; None: they are chosen
    """

    array: ArrayRates
    parameters: FilterParameters
    blocks: SlowBlocks
    variance: np.ndarray
    correlation: np.ndarray
    resting: np.ndarray
    arw: np.ndarray
    walk: Walk | None = None

    def followed(self) -> Followed:
        """The model that the likelihood prefers."""
        degrees, why_not = blocks_temperature(self.array, self.blocks)
        off = self.parameters.temperature == "off" or not self.parameters.has("temperature")
        if self.array.temperature is not None and off:
            degrees, why_not = None, "temperature is off"
        if degrees is None:
            return self._or_course(self._fit(None, note=why_not))
        centre = float(np.average(degrees, weights=self.blocks.length))
        known = None if self.array.at_rest.all() else self.array.noise.temperature
        if known is not None:
            found = self._fit(degrees - known.nulled, known.nulled, known)
            if found.choice.slopes:
                return found
            return self._fit(degrees - centre, centre, note=CONTRADICTED)
        return self._fit(degrees - centre, centre)

    def _fit(
        self,
        regressor: np.ndarray | None,
        reference: float = 0.0,
        known: TemperatureAtRest | None = None,
        course: Course | None = None,
        tau_s: float = math.nan,
        note: str = "",
    ) -> Followed:
        noise = self.array.noise
        scales = noise.scales if known is None or known.scales is None else known.scales
        common = common_walk(scales) if self.parameters.has("slow_common") else 0.0
        evidence = self._evidence(regressor, common, known)
        choice = choose(evidence, self.blocks, noise.rrw, self.arw, self.walk)
        return Followed(evidence, choice, common, regressor, reference, known, course, tau_s, note)

    def _evidence(self, regressor: np.ndarray | None, common: float, known: TemperatureAtRest | None) -> BiasEvidence:
        noise = BlockNoise(self.variance, self.correlation)
        slopes = None if regressor is None else Regressor(regressor, known)
        return BiasEvidence.of(self.array, self.blocks, noise, self.resting, slopes, common)

    def _or_course(self, plain: Followed) -> Followed:
        """The likeliest course where the walks alone are far from those of the record, and it is likelier than they.

        It costs its time constant beside the coefficients' variance: ln(blocks) each (BIC).
        """
        price = math.log(len(self.blocks))
        short = len(self.blocks) < FEWEST
        steady = plain.choice.walk.gain < DRIFTING * price
        if self.walk is not None or short or steady or not self.parameters.has("warm_up"):
            return plain
        since = self.blocks.time - self.blocks.time[0]
        courses = [(course, float(since[-1]) / part) for course in COURSES for part in SETTLED]
        others = [self._evidence(course.shape(since, tau), plain.common, None) for course, tau in courses]
        walk, rrw = plain.choice.walk, self.array.noise.rrw
        gains = quick_gains(plain.evidence, walk, others, self.blocks, rrw, self.arw)
        if max(gains) < -PROMISING * price:
            return plain
        course, tau = courses[int(np.argmax(gains))]
        found = self._fit(course.shape(since, tau), course=course, tau_s=tau)
        likelier = found.choice.slopes and found.choice.slopes_gain > found.choice.needed + price
        return found if likelier else plain


def blocks_temperature(array: ArrayRates, blocks: SlowBlocks) -> tuple[np.ndarray | None, str]:
    """Temperature of the blocks [B], °C, where it can be regressed on; else None and why."""
    if array.temperature is None:
        return None, ""
    degrees = blocks.mean(array.temperature)
    known = np.isfinite(degrees)
    if not known.all():
        return None, f"temperature unknown in {int((~known).sum())} of {len(known)} blocks: not regressed on"
    span = float(np.ptp(degrees))
    if span <= LEAST_RANGE:
        return None, f"temperature within {span:.2g} K: not regressed on"
    return degrees, ""
