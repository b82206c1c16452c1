"""Two clocks brought to one time by the motion that both streams saw."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.special import ndtri

from vgyro.alignment.coarse import search
from vgyro.alignment.growth import (
    MOST_BLOCKS,
    NEAR_S,
    RIVAL_ODDS,
    apart,
    fit_window,
    grow,
    odds,
    offset,
    score,
    unexplained,
)
from vgyro.alignment.pair import ClockRelation, PairFit
from vgyro.alignment.streams import AlignedStream, Band, highest_cutoff, low_pass
from vgyro.errors import DataError
from vgyro.units import parts_per_million

FOUND, NO_COMMON_MOTION, AMBIGUOUS, TOO_SHORT = "found", "no common motion", "ambiguous", "too short"
STATUSES = (FOUND, NO_COMMON_MOTION, AMBIGUOUS, TOO_SHORT)
FALSE_ALARM = 1e-3
LEAST_CORRELATION = 0.7  # in motion; below it the motion is as small as the noise, or only alike
MOST_DRIFT_PPM = 1000.0
CUTOFFS_HZ = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0)
SEARCH_HZ = 4.0
RIVAL_SHARE = 1 / 3  # of the evidence of the best: less is no rival
CONFIDENCE = 0.95
EVERYWHERE = (-math.inf, math.inf)


class ClockEvidence(NamedTuple):
    """What a ClockFit rests on.

    correlation : of both streams on one time, slow drift removed
    scale       : scale factor of the other over that of the reference; negative: they are mounted against each other
    chance_log10 : log10 of the chance that streams with nothing in common agree so well somewhere in the search
    compared_s  : time that was compared, s
    cutoff_hz   : band of the estimate
    rival_s     : the offset that explains the streams next best; NaN if there is none
    rival_odds  : twice the log likelihood ratio against it, after an allowance of a tenth of the unexplained power;
                  below 20 the two cannot be told apart; infinite if there is none
    """

    correlation: float = math.nan
    scale: float = math.nan
    chance_log10: float = 0.0
    compared_s: float = 0.0
    cutoff_hz: float = math.nan
    rival_s: float = math.nan
    rival_odds: float = math.inf


class ClockFit(NamedTuple):
    """How the clock of one stream (the other) reads against that of another (the reference).

    The other's first sample was taken offset_s after the reference's first, in seconds of the reference's clock, and
    the other's clock runs faster by drift_ppm:

        reading - other.time[0] = (t - reference.time[0] - offset_s) · (1 + 1e-6 · drift_ppm)

    offset_s, offset_low, offset_high   : s, with the 95 % interval
    drift_ppm, drift_low, drift_high    : with the 95 % interval; 0 and the bounds of the search where the motion is
                                          too short to tell
    significant : the offset differs from what the stamps say (other.time[0] - reference.time[0]), or the drift from 0
    status      : "found", "no common motion", "ambiguous" (periodic motion: offsets a period apart fit as well) or
                  "too short"; figures are NaN if nothing was found
    evidence    : what it rests on
    origins     : (reference.time[0], other.time[0]), s
    best        : (time s after the reference's first sample, standard error s) where the two clocks are known best,
                  and the standard error of the drift, ppm
    """

    offset_s: float
    offset_low: float
    offset_high: float
    drift_ppm: float
    drift_low: float
    drift_high: float
    significant: bool
    status: str
    evidence: ClockEvidence
    origins: tuple[float, float]
    best: tuple[float, float, float]

    def on_other(self, time: np.ndarray) -> np.ndarray:
        """Times of the reference's clock as readings of the other: [M] s → [M] s."""
        return self.origins[1] + (time - self.origins[0] - self.offset_s) * (1 + 1e-6 * self.drift_ppm)

    def on_reference(self, reading: np.ndarray) -> np.ndarray:
        """Readings of the other clock as times of the reference's: [M] s → [M] s."""
        return self.origins[0] + self.offset_s + (reading - self.origins[1]) / (1 + 1e-6 * self.drift_ppm)

    def error_s(self, time: np.ndarray) -> np.ndarray:
        """Standard error of `on_other` at times of the reference's clock: [M] s → [M] s."""
        centre, lag, drift = self.best
        return np.hypot(lag, 1e-6 * drift * (time - self.origins[0] - centre))


def relative_clock(
    reference: AlignedStream,
    other: AlignedStream,
    most_offset_s: float = math.inf,
    most_drift_ppm: float = MOST_DRIFT_PPM,
    false_alarm: float = FALSE_ALARM,
) -> ClockFit:
    """Offset and drift of the other's clock against the reference's, from the motion that both saw.

    most_offset_s  : the most by which one stream begins before or after the other; less is faster
    most_drift_ppm : the most by which the clocks' rates differ
    false_alarm    : chance at which streams with no motion in common are taken to have one; above it the status is
                     "no common motion", as it is below a correlation of 0.7 in motion
    Both are low-passed; peaks of their correlation over a grid of drifts are candidates; each is refined by
    least squares of other - scale · reference with a level and slope per ten seconds (see `fit_line`); the best is
    fitted again in bands of 1 … 32 Hz, and the one with the smallest standard error is kept. Levels, scale factors and
    slow drift of the gyros do not matter. A delay inside a sensor (its filter) counts as offset.
    A recording of any length: at most 300 blocks of ten seconds are compared, those that move most in each thirtieth.
    """
    starts = (float(reference.time[0]), float(other.time[0])) if len(reference.time) and len(other.time) else (0.0, 0.0)
    one = AlignedStream(np.asarray(reference.time, dtype=float) - starts[0], reference.rate, reference.rate_hz)
    two = AlignedStream(np.asarray(other.time, dtype=float) - starts[1], other.rate, other.rate_hz)
    highest = highest_cutoff(min(one.rate_hz, two.rate_hz))
    bands = _bands(one, two, min(SEARCH_HZ, highest))
    if bands is None:
        return _nothing(TOO_SHORT, starts)
    most_drift = 1e-6 * most_drift_ppm
    found = search(*bands, most_offset_s, most_drift)
    fits = grow(*bands, found.candidates, most_drift)
    chances = [_chance_log10(fit, found.tried) for fit in fits]
    good = [
        fit
        for fit, chance in zip(fits, chances, strict=True)
        if chance < math.log10(false_alarm) and abs(fit.correlation) >= LEAST_CORRELATION
    ]
    if not good:
        best = max(fits, key=score, default=None)
        evidence = ClockEvidence() if best is None else _evidence(best, min(chances), SEARCH_HZ, None)
        return _nothing(NO_COMMON_MOTION, starts, evidence)
    first = max(good, key=score)
    rival = _rival(first, good)
    fit, cutoff = first, bands[0].cutoff_hz
    for band_hz in [hz for hz in CUTOFFS_HZ if hz <= highest and hz != cutoff]:
        pair = _bands(one, two, band_hz)
        again = None if pair is None else fit_window(*pair, first.line, most_drift, EVERYWHERE, MOST_BLOCKS)
        if again is not None and again.covariance[0, 0] < fit.covariance[0, 0]:
            fit, cutoff = again, band_hz
    evidence = _evidence(fit, _chance_log10(first, found.tried), cutoff, rival)
    return _clock(fit, evidence, starts, most_drift_ppm)


def refuse_clock(fit: ClockFit, where: str) -> DataError:
    """The error for a caller that needs the clocks: where names the two streams."""
    what = {
        NO_COMMON_MOTION: "the two streams show no motion in common, so their clocks cannot be compared",
        AMBIGUOUS: "the motion is periodic: several offsets between the two clocks explain it equally well",
        TOO_SHORT: "the streams are too short to compare their clocks",
    }.get(fit.status, f"the clocks could not be compared ({fit.status})")
    remedy = (
        "turn the whole assembly back and forth by hand, irregularly, for a few seconds at the beginning and the end "
        "of the recording"
    )
    return DataError(what, where, remedy)


def _bands(one: AlignedStream, two: AlignedStream, cutoff_hz: float) -> tuple[Band, Band] | None:
    bands = low_pass(one, cutoff_hz), low_pass(two, cutoff_hz)
    return bands if min(len(band.time) for band in bands) > 1 else None


def _rival(best: PairFit, fits: list[PairFit]) -> tuple[float, float] | None:
    """Offset and odds of the line that explains the streams next best."""
    others = [fit for fit in fits if apart(fit, best) > NEAR_S and score(fit) > RIVAL_SHARE * score(best)]
    return min(((offset(fit.line), odds(best, fit)) for fit in others), key=lambda rival: rival[1], default=None)


def _chance_log10(fit: PairFit, tried: int) -> float:
    """log10 of the chance that the best of `tried` correlations of unrelated normal series is as large."""
    if fit.independent <= 2:
        return 0.0
    single = 0.5 * (fit.independent - 2) * math.log10(unexplained(fit))
    return min(single + math.log10(tried), 0.0)


def _evidence(fit: PairFit, chance: float, cutoff: float, rival: tuple[float, float] | None) -> ClockEvidence:
    second = rival or (math.nan, math.inf)
    return ClockEvidence(fit.correlation, fit.scale, chance, fit.seconds, cutoff, *second)


def _clock(fit: PairFit, evidence: ClockEvidence, starts: tuple[float, float], most_ppm: float) -> ClockFit:
    z = float(ndtri(0.5 + CONFIDENCE / 2))
    line, drift_error = fit.line, math.sqrt(fit.covariance[1, 1])
    known = z * drift_error < 1e-6 * most_ppm
    if not known:
        line = ClockRelation(line.centre_s, line.lag_s, 0.0)
    lag_error = math.sqrt(fit.covariance[0, 0])
    start = float(offset(line))
    reach = line.centre_s - start
    if known:
        variance = np.array([-1.0, reach]) @ fit.covariance @ np.array([-1.0, reach])
        half, drift_half = z * math.sqrt(variance), parts_per_million(z * drift_error)
    else:
        half, drift_half = z * lag_error + abs(reach) * 1e-6 * most_ppm, most_ppm
        drift_error = 1e-6 * most_ppm / z
    drift = parts_per_million(line.drift)
    stamped = starts[1] - starts[0]
    stricter = float(ndtri(1 - (1 - CONFIDENCE) / 4)) / z  # two questions are asked
    status = AMBIGUOUS if evidence.rival_odds < RIVAL_ODDS else FOUND
    return ClockFit(
        start,
        start - half,
        start + half,
        drift,
        drift - drift_half,
        drift + drift_half,
        bool(status == FOUND and (abs(start - stamped) > stricter * half or abs(drift) > stricter * drift_half)),
        status,
        evidence,
        starts,
        (line.centre_s, lag_error, parts_per_million(drift_error)),
    )


def _nothing(status: str, starts: tuple[float, float], evidence: ClockEvidence | None = None) -> ClockFit:
    nan = math.nan
    return ClockFit(nan, nan, nan, nan, nan, nan, False, status, evidence or ClockEvidence(), starts, (nan, nan, nan))
