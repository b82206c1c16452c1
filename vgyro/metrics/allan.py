"""Overlapping Allan deviation with degrees of freedom and chi² limits, over gap-free segments."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from vgyro import engine as engines
from vgyro.errors import TooShort
from vgyro.metrics.noise_type import noise_exponents

TAUS_PER_OCTAVE = 3
LONGEST_TAU = 3  # the longest τ is a third of the longest segment


@dataclass(frozen=True)
class AllanCurve:
    """tau [M] s; deviation, low, high [M] in the unit of the rate; edf [M] equivalent degrees of freedom.

    exponent [M] : power of the spectrum taken at each τ for edf: 0 white, -1 flicker, -2 random walk
    """

    tau: np.ndarray
    deviation: np.ndarray
    low: np.ndarray
    high: np.ndarray
    edf: np.ndarray
    exponent: np.ndarray
    confidence: float = 0.95


def allan_deviation(
    rate: np.ndarray,
    rate_hz: float,
    taus: np.ndarray | None = None,
    segment: np.ndarray | None = None,
    confidence: float = 0.95,
    engine: str = "native",
    per_octave: int = TAUS_PER_OCTAVE,
) -> AllanCurve:
    """Overlapping Allan deviation, chi² limits and equivalent degrees of freedom.

    rate       : array [T], deg/s, at a constant rate_hz within each segment
    taus       : array, s, rounded to whole samples; None: `per_octave` a factor 2, from one sample to a third of the
                 longest segment, with τ = 1 s among them where that is a whole number of samples
    segment    : array [T] int, number of the gap-free stretch of each sample; None: there is no gap
    confidence : of the limits
    returns    : AllanCurve; σ²(τ) = Σ (θ[k+2m] - 2θ[k+m] + θ[k])² / (2τ²·n), θ the angle, the sum and n taken over all
                 segments of at least 3τ, so no difference bridges a gap; edf adds up over the segments. A series
                 without variance has σ = 0.
    raises     : TooShort if no segment has three samples
    Riley, NIST SP 1065, eq. 11 and 45; edf: Greenhall & Riley (2003), with the noise identified at each τ.
    """
    rate = np.asarray(rate, dtype=float)
    edges = edges_of(len(rate), segment)
    lengths, alike = np.unique(np.diff(edges), return_counts=True)
    longest = int(lengths.max(initial=0))
    factors = averaging_factors(rate_hz, longest, taus, per_octave)
    if factors.size == 0:
        raise TooShort(
            f"the longest gap-free stretch has {longest} samples", remedy="An Allan deviation needs 3 samples in a row"
        )
    allan = engines.get(engine).allan
    sums, counts = allan.differences(rate, factors, edges, LONGEST_TAU)
    exponent = noise_exponents(rate, edges, factors, allan)
    edf = np.empty(factors.size)
    for row, (m, alpha) in enumerate(zip(factors.tolist(), exponent.tolist(), strict=True)):
        used = lengths >= LONGEST_TAU * m
        edf[row] = np.sum(alike[used] * allan.degrees_of_freedom(alpha, m, lengths[used]))
    deviation = np.sqrt(sums / counts)
    low, high = allan.limits(deviation, edf, confidence)
    return AllanCurve(factors / rate_hz, deviation, low, high, edf, exponent, confidence)


def averaging_factors(
    rate_hz: float, samples: int, taus: np.ndarray | None = None, per_octave: int = TAUS_PER_OCTAVE
) -> np.ndarray:
    """Averaging factors m (τ = m / rate_hz) for a segment of `samples`, ascending, without repeats."""
    longest = samples // LONGEST_TAU
    if taus is None:
        # Counted from 1 s, so that recordings at different rates share their τ.
        first = np.floor(per_octave * np.log2(1 / rate_hz))
        last = np.ceil(per_octave * np.log2(max(longest, 1) / rate_hz))
        taus = 2.0 ** (np.arange(first, last + 1) / per_octave)
    factors = np.unique(np.round(np.asarray(taus, dtype=float) * rate_hz).astype(np.int64))
    return factors[(factors >= 1) & (factors <= longest)]


def edges_of(samples: int, segment: np.ndarray | None) -> np.ndarray:
    """First sample of each run of equal `segment` [T] (None: there is no gap), and T: [S + 1] int."""
    inner = np.empty(0, np.int64) if segment is None else np.flatnonzero(segment[1:] != segment[:-1]) + 1
    return np.concatenate([np.zeros(1, np.int64), inner, np.full(int(samples > 0), samples)])


def stretches(segment: np.ndarray) -> list[tuple[int, int]]:
    """First sample, and one past the last, of each run of equal `segment` [T]."""
    return list(itertools.pairwise(edges_of(len(segment), segment).tolist()))


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
