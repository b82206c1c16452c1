"""Allan deviations with degrees of freedom and chi² limits, over gap-free segments and over short losses."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from vgyro import engine as engines
from vgyro.arrays import Floats, Ints
from vgyro.engine.protocols.noise import AllanEngine
from vgyro.errors import TooShort
from vgyro.metrics.allan.noise_type import noise_exponents
from vgyro.metrics.allan.robust import robust_differences, robust_edf, without_far_off
from vgyro.metrics.allan.slots import SINGLE, SlotSums, variance_of_samples
from vgyro.metrics.sampling import Sampling
from vgyro.runs import run_starts, runs

TAUS_PER_OCTAVE = 3
LONGEST_TAU = 3  # the longest τ is a third of the longest segment
LONGEST = {"overlapping": LONGEST_TAU, "modified": 4, "hadamard": 4, "robust": LONGEST_TAU}
KINDS = tuple(LONGEST)
LEAST_USED = 0.1  # of the differences: a τ at which losses leave fewer is left out


@dataclass(frozen=True)
class AllanCurve:
    """tau [M] s; deviation, low, high [M] in the unit of the rate; edf [M] equivalent degrees of freedom.

    exponent [M] : power of the spectrum taken at each τ for edf: 0 white, -1 flicker, -2 random walk
    kind         : one of KINDS
    """

    tau: np.ndarray
    deviation: np.ndarray
    low: np.ndarray
    high: np.ndarray
    edf: np.ndarray
    exponent: np.ndarray
    confidence: float = 0.95
    kind: str = "overlapping"


@dataclass(frozen=True)
class _CurveSeries:
    """rate [T]; edges [S + 1] of its stretches, in samples; or in slots, where samples are lost: then sums of it."""

    rate: np.ndarray
    edges: np.ndarray
    sums: SlotSums | None = None


def allan_deviation(
    rate: np.ndarray,
    rate_hz: float,
    taus: np.ndarray | None = None,
    segment: np.ndarray | None = None,
    confidence: float = 0.95,
    engine: str = "native",
    per_octave: int = TAUS_PER_OCTAVE,
    *,
    sampling: Sampling | None = None,
    kind: str = "overlapping",
) -> AllanCurve:
    """Allan deviation from overlapping differences, chi² limits and equivalent degrees of freedom.

    rate       : array [T], deg/s, at a constant rate_hz within each segment
    taus       : array, s, rounded to whole samples; None: `per_octave` a factor 2, from one sample to a third of the
                 longest stretch (a fourth for modified and hadamard), with τ = 1 s among them where that is a whole
                 number of samples
    segment    : array [T] int, number of the gap-free stretch of each sample; None: there is no gap
    confidence : of the limits
    sampling   : instead of segment: when the samples were taken. Then differences go over the short losses within its
                 stretches; nothing ever goes from one stretch to another
    kind       : overlapping  the standard: σ²(τ) = Σ (θ[k+2m] - 2θ[k+m] + θ[k])² / (2τ²·n), θ the angle
                 modified     the same of angles averaged over τ: tells white from flicker noise of the angle
                 hadamard     third differences: a constant drift of the rate does not count
                 robust       median instead of mean of the squared differences, without outliers (metrics.robust)
    returns    : AllanCurve; sums and counts are taken over all stretches of at least 3τ (4τ), so no difference bridges
                 the gap between two; edf adds up over the stretches. A series without variance has σ = 0.
    raises     : TooShort if no stretch has three samples, or if losses leave too few differences at every τ
    Riley, NIST SP 1065, eq. 11, 15, 19 and 45; edf: Greenhall & Riley (2003), with the noise identified at each τ.

    Losses. A mean over m slots counts where nine tenths of its samples are there (below m = 10: all), as the mean of
    these; nothing is put in the place of a lost sample. A mean of n of m samples has more noise: of single samples of
    white noise of variance σ₁², σ₁²/n and not σ₁²/m. σ₁² is read from the shortest τ (variance of a sample about the
    mean of 16: the sum of half the Allan variances of 1, 2, 4, 8 samples, times 16/15) and the mean of
    σ₁²(1/n₁ + 1/n₂ - 2/m)/2 is taken off σ²(τ). So the correction is whole where the noise at τ is white; where it is
    flicker or random walk, only the white part of it, the one that losses enlarge, is corrected. edf is that of the
    stretches were nothing lost, times the share of the differences that there are: a lower bound, because overlapping
    differences replace each other. A τ at which fewer than a tenth are there is left out.
    """
    if sampling is not None and segment is not None:
        raise ValueError("either segment or sampling")
    if kind not in KINDS:
        raise ValueError(f"unknown kind {kind!r}: {', '.join(KINDS)}")
    rate = np.asarray(rate, dtype=float)
    if kind == "robust":
        rate, sampling = without_far_off(rate, rate_hz, sampling, segment)
    allan = engines.get(engine).allan
    series = _series(rate, segment, sampling, allan, kind)
    longest = int(np.diff(series.edges).max(initial=0))
    factors = averaging_factors(rate_hz, longest, taus, per_octave, LONGEST[kind])
    if factors.size == 0:
        raise TooShort(
            f"the longest gap-free stretch has {longest} samples",
            remedy=f"An Allan deviation ({kind}) needs {LONGEST[kind]} samples in a row",
        )
    variance, share = _variances(series, factors, allan, kind)
    kept = share >= LEAST_USED
    if not kept.any():
        raise TooShort("lost samples leave too few differences at every τ", remedy="Look for a less damaged recording")
    factors, variance, share = factors[kept], variance[kept], share[kept]
    exponent = noise_exponents(rate, series.edges, factors, allan, series.sums)
    edf = _freedom(series, factors, exponent, share, allan, kind)
    if kind == "robust":
        variance, edf = robust_edf(variance, edf, factors, int(series.edges[-1]))
    deviation = np.sqrt(variance)
    low, high = allan.limits(deviation, edf, confidence)
    return AllanCurve(factors / rate_hz, deviation, low, high, edf, exponent, confidence, kind)


def _series(
    rate: np.ndarray, segment: np.ndarray | None, sampling: Sampling | None, allan: AllanEngine, kind: str
) -> _CurveSeries:
    if sampling is None:
        return _CurveSeries(rate, edges_of(len(rate), segment))
    if len(sampling) != len(rate):
        raise ValueError(f"{len(rate)} rates, but {len(sampling)} samples")
    if sampling.missing == 0 and kind != "robust":
        return _CurveSeries(rate, edges_of(len(rate), sampling.stretch))
    slot, edges = sampling.slots()
    return _CurveSeries(rate, edges, SlotSums.of(rate, slot, edges, allan))


def _variances(
    series: _CurveSeries, factors: np.ndarray, allan: AllanEngine, kind: str
) -> tuple[np.ndarray, np.ndarray]:
    """Variance at each factor, and the share of the differences there are."""
    sums, share = series.sums, LONGEST[kind]
    if sums is None:
        squares, counts = allan.differences(series.rate, factors, series.edges, share, kind)
        return squares / np.maximum(counts, 1), (counts > 0).astype(float)
    if kind == "robust":
        return robust_differences(sums, factors, share)
    parts = sums.total, sums.have, sums.edges
    squares, excess, counts, possible = allan.differences_over_losses(*parts, factors, share, kind)
    singles, _, number, _ = allan.differences_over_losses(*parts, SINGLE, 2)
    single = variance_of_samples(singles / np.maximum(number, 1), number > 0)
    some = np.maximum(counts, 1)
    return np.maximum(squares / some - single * excess / some, 0.0), counts / np.maximum(possible, 1)


def _freedom(
    series: _CurveSeries, factors: Ints, exponent: Floats, share: Floats, allan: AllanEngine, kind: str
) -> Floats:
    """Degrees of freedom [M]: those of all stretches that are long enough, times the share of the differences."""
    lengths, alike = np.unique(np.diff(series.edges), return_counts=True)
    estimator = "overlapping" if kind == "robust" else kind
    edf = np.empty(factors.size)
    for row, (m, alpha) in enumerate(zip(factors.tolist(), exponent.tolist(), strict=True)):
        used = lengths >= LONGEST[kind] * m
        edf[row] = np.sum(alike[used] * allan.degrees_of_freedom(alpha, m, lengths[used], estimator))
    return edf * share


def averaging_factors(
    rate_hz: float,
    samples: int,
    taus: np.ndarray | None = None,
    per_octave: int = TAUS_PER_OCTAVE,
    share: int = LONGEST_TAU,
) -> np.ndarray:
    """Averaging factors m (τ = m / rate_hz), of which `share` fit into `samples`, ascending, without repeats."""
    longest = samples // share
    if taus is None:
        # Counted from 1 s, so that recordings at different rates share their τ.
        first = np.floor(per_octave * np.log2(1 / rate_hz))
        last = np.ceil(per_octave * np.log2(max(longest, 1) / rate_hz))
        taus = 2.0 ** (np.arange(first, last + 1) / per_octave)
    factors = np.unique(np.round(np.asarray(taus, dtype=float) * rate_hz).astype(np.int64))
    return factors[(factors >= 1) & (factors <= longest)]


def edges_of(samples: int, segment: np.ndarray | None) -> np.ndarray:
    """First sample of each run of equal `segment` [T] (None: there is no gap), and T: [S + 1] int."""
    starts = np.zeros(1, np.int64) if segment is None or samples == 0 else run_starts(segment)
    return np.concatenate([starts, np.full(int(samples > 0), samples)])


def stretches(segment: np.ndarray) -> list[tuple[int, int]]:
    """First sample, and one past the last, of each run of equal `segment` [T]."""
    return [(start, stop) for start, stop in runs(segment).tolist()]


def split_segments(rate: np.ndarray, segment: np.ndarray | None) -> list[np.ndarray]:
    """The gap-free stretches of `rate`: runs of equal `segment`."""
    return [rate[start:stop] for start, stop in itertools.pairwise(edges_of(len(rate), segment).tolist())]


def read_curve(curve: AllanCurve, tau: float) -> tuple[float, float, float]:
    """Deviation and limits at `tau` s, interpolated in log-log between neighbours; NaN outside the curve."""
    if not curve.tau[0] <= tau * (1 + 1e-9) or not tau <= curve.tau[-1] * (1 + 1e-9):
        return float("nan"), float("nan"), float("nan")
    if not curve.deviation.all():
        values = [np.interp(tau, curve.tau, row) for row in (curve.deviation, curve.low, curve.high)]
    else:
        at, grid = np.log(tau), np.log(curve.tau)
        values = [np.exp(np.interp(at, grid, np.log(row))) for row in (curve.deviation, curve.low, curve.high)]
    return float(values[0]), float(values[1]), float(values[2])
