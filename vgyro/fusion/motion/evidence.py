"""What models of the rate are compared on: the spectrum of the fused rate, and that of its noise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from vgyro.errors import DataError, TooShort
from vgyro.fusion.motion.noisy_rate import NoisyRate

LONGEST = 1 << 18
"""A stretch is cut into pieces of no more samples."""
MOST, MOST_SAMPLES = 128, 1 << 22
"""Pieces, and samples of all, that are used at most."""
SHORTEST = 32
"""Samples of a piece at least."""
FILLED = 16
"""So many samples in a row that say nothing are filled in by a straight line; more of them end a piece."""
SPIKE, RARE = 5.0, 0.03
"""A sample that lies so many standard deviations off the line between its neighbours says nothing of the motion, where
such samples are no larger a share: more of them are motion."""
PER_OCTAVE = 24
"""Bands of the spectrum in a factor of two: each as wide as 3 % of its frequency, or one line of the periodogram."""


@dataclass(frozen=True)
class RateSpectrum:
    """Periodograms of all pieces, each line or means over bands. Arrays [F], frequency above 0 and below half the rate.

    frequency : Hz, rising;  power, noise : densities of z and of its noise, two-sided, deg²/s
    weight    : how many independent values the power is the mean of, of one degree of freedom each
    rate_hz   : of the samples;  pieces : how many
    """

    frequency: np.ndarray
    power: np.ndarray
    noise: np.ndarray
    weight: np.ndarray
    rate_hz: float
    pieces: int

    def risk(self, signal: np.ndarray) -> np.ndarray:
        """Unbiased estimate of the squared error of the smoother H = S/(S + S_v), in units of the noise, summed.

        signal : S [..., F], of the model, deg²/s
        The smoother leaves (1 - H)·z, and H·S_v of noise and rate are common to both: the error has the density
        (1 - H)²·S_z + (2H - 1)·S_v, whatever the rate does. Stein (1981), Ann. Statist. 9, 1135-1151.
        """
        H = signal / (signal + self.noise)
        found: np.ndarray = ((1.0 - H) ** 2 * (self.power / self.noise) + 2.0 * H - 1.0) @ self.weight
        return found

    def between(self, low: float, high: float) -> RateSpectrum:
        """The lines of these frequencies, Hz."""
        part = slice(*np.searchsorted(self.frequency, [low, high]).tolist())
        arrays = {name: getattr(self, name)[part] for name in ("frequency", "power", "noise", "weight")}
        return replace(self, **arrays)

    def without(self, bands: Sequence[tuple[float, float]]) -> RateSpectrum:
        """But for lines in these bands, from and to, Hz."""
        keep = np.ones(len(self.frequency), dtype=bool)
        for low, high in bands:
            keep &= (self.frequency < low) | (self.frequency > high)
        arrays = {name: getattr(self, name)[keep] for name in ("frequency", "power", "noise", "weight")}
        return replace(self, **arrays)

    def bands(self) -> RateSpectrum:
        """Means over bands of equal width on the logarithm of the frequency, where they hold more than one line."""
        place = np.floor(np.log2(self.frequency / self.frequency[0]) * PER_OCTAVE)
        return self.merged(np.flatnonzero(np.diff(place, prepend=-1.0)))

    def merged(self, first: np.ndarray) -> RateSpectrum:
        """Weighted means over the lines from each of `first` [F'] to the next."""
        total = np.add.reduceat(self.weight, first)
        means = [np.add.reduceat(self.weight * one, first) / total for one in (self.frequency, self.power, self.noise)]
        return RateSpectrum(means[0], means[1], means[2], total, self.rate_hz, self.pieces)


@dataclass(frozen=True)
class SpectrumPiece:
    """A stretch of samples without a gap.

    start : its first sample;  z : [T], deg/s, without its mean under the taper, filled where it says nothing
    taper : [T];  noise : density [F] of the noise at the lines of the periodogram, deg²/s
    """

    start: int
    z: np.ndarray
    taper: np.ndarray
    noise: np.ndarray

    def lines(self, rate_hz: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Frequency, density of z, and weight of each line [F]."""
        from scipy.fft import rfft

        squares = np.square(self.taper)
        total = float(squares.sum())
        power = np.abs(rfft(self.z * self.taper)[1:][: len(self.noise)]) ** 2 / (total * rate_hz)
        weight = 2.0 * total**2 / float(np.square(squares).sum()) / len(self.z)
        return _frequencies(len(self.z), rate_hz), power, np.full(len(power), weight)


def spectrum(pieces: list[SpectrumPiece], rate_hz: float) -> RateSpectrum:
    """All lines of all pieces."""
    parts = [piece.lines(rate_hz) for piece in pieces]
    frequency, power, weight = (np.concatenate([part[k] for part in parts]) for k in range(3))
    noise = np.concatenate([piece.noise for piece in pieces])
    if len(pieces) == 1:
        return RateSpectrum(frequency, power, noise, weight, rate_hz, 1)
    order = np.argsort(frequency, kind="stable")
    return RateSpectrum(frequency[order], power[order], noise[order], weight[order], rate_hz, len(pieces))


def gather(noisy: NoisyRate, moving: np.ndarray | None = None) -> list[SpectrumPiece]:
    """The pieces of a recording on which models are compared; moving [T] bool: of these samples alone.

    raises : DataError, TooShort
    """
    z, r, segment = np.asarray(noisy.z, dtype=float), np.asarray(noisy.r, dtype=float), noisy.segment
    told = np.broadcast_to(np.isfinite(r), z.shape)
    if moving is not None:
        told = told & np.asarray(moving, dtype=bool)
    runs = _runs(segment, told)
    total = sum(stop - start for start, stop in runs)
    if total < SHORTEST:
        raise TooShort(f"{total} samples that say anything in stretches of {SHORTEST} or more", remedy="record longer")
    for start, stop in runs:
        usable = (r if r.ndim == 0 else r[start:stop]) > 0
        if not np.all(usable):
            place = f"sample {start + int(np.argmin(usable))}"
            remedy = "look for gyros that are stuck, or copies of each other"
            raise DataError("the variance of the noise is not above zero", place, remedy)
    value = z[runs[0][0]]
    if all(np.all((z[start:stop] == value) | ~told[start:stop]) for start, stop in runs):
        raise DataError(f"the rate is {value:g} deg/s at every sample: no gyro", remedy="look at the recording")
    runs = _spread(runs)
    spikes = _spikes(z, r)
    if np.count_nonzero(spikes & told) <= RARE * total:
        told = told & ~spikes
    return [_piece(z, r, told, run, noisy.phi, noisy.rate_hz) for run in runs]


def _spikes(z: np.ndarray, r: np.ndarray) -> np.ndarray:
    """Samples [T] that are far off the line between their neighbours, while those are not far from each other."""
    spikes = np.zeros(len(z), dtype=bool)
    limit = 2.0 * SPIKE**2 * (r if r.ndim == 0 else r[1:-1])
    with np.errstate(invalid="ignore"):
        off = z[1:-1] - 0.5 * (z[:-2] + z[2:])
        spikes[1:-1] = (off**2 > 0.75 * limit) & ((z[2:] - z[:-2]) ** 2 < limit)
    return spikes


def _runs(segment: np.ndarray, told: np.ndarray) -> list[tuple[int, int]]:
    """First sample and last + 1 of the stretches without long holes; both ends say something."""
    places = np.flatnonzero(told)
    if len(places) == 0:
        return []
    apart = (np.diff(places) > FILLED + 1) | (np.diff(np.asarray(segment)[places]) != 0)
    edges = [0, *(np.flatnonzero(apart) + 1).tolist(), len(places)]
    runs = [(int(places[first]), int(places[last - 1]) + 1) for first, last in pairwise(edges)]
    return [(start, stop) for start, stop in runs if stop - start >= SHORTEST]


def _spread(runs: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """The runs in pieces of at most LONGEST samples: the longest ones, or spread evenly over a long recording."""
    pieces = []
    for start, stop in runs:
        many = -(-(stop - start) // LONGEST)
        edges = np.linspace(start, stop, many + 1).astype(int).tolist()
        pieces += list(pairwise(edges))
    length = np.array([stop - start for start, stop in pieces])
    if length.sum() > MOST_SAMPLES:
        many = max(int(len(pieces) * MOST_SAMPLES / length.sum()), 1)
        pieces = [pieces[k] for k in np.linspace(0, len(pieces) - 1, many).astype(int).tolist()]
        length = np.array([stop - start for start, stop in pieces])
    return [pieces[k] for k in sorted(np.argsort(-length, kind="stable")[:MOST].tolist())]


def _piece(
    z: np.ndarray, r: np.ndarray, told: np.ndarray, run: tuple[int, int], phi: float, rate_hz: float
) -> SpectrumPiece:
    part = slice(*run)
    own, known, taper = z[part], told[part], taper_of(run[1] - run[0])
    variance = np.broadcast_to(r, z.shape)[part]
    frequency = _frequencies(len(own), rate_hz)
    turn = np.exp(-2j * math.pi * frequency / rate_hz)
    if known.all():
        noise = np.full(len(frequency), float(taper**2 @ variance))
    else:
        places = np.flatnonzero(known)
        own = np.interp(np.arange(len(own)), places, own[places])
        noise = _of_filled(places, taper[places] ** 2 * variance[places], turn)
    noise = noise / (float(taper @ taper) * rate_hz) * (1.0 - phi**2) / np.abs(1.0 - phi * turn) ** 2
    return SpectrumPiece(run[0], own - float(taper @ own) / float(taper.sum()), taper, noise)


def taper_of(samples: int) -> np.ndarray:
    """[T], flat in the middle, sin⁴ over a quarter at each end: lines far from their frequency fall with its 10th
    power, so that a rate of eight decades does not leak into its noise."""
    side = samples // 4
    rise = np.sin(0.5 * math.pi * (np.arange(side) + 0.5) / side) ** 4
    return np.concatenate([rise, np.ones(samples - 2 * side), rise[::-1]])


def _frequencies(samples: int, rate_hz: float) -> np.ndarray:
    return np.arange(1, (samples + 1) // 2) * (rate_hz / samples)


def _of_filled(places: np.ndarray, power: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Of white noise [F], known at `places` with `power`, and a straight line between them.

    A sample also counts in the gaps beside it: its kernel is 1 + Σ (1 - m/(g + 1))·e^(±iωm), m = 1 … g.
    """
    gaps = np.diff(places) - 1
    beside = np.stack([np.append(0, gaps), np.append(gaps, 0)], axis=1)
    sizes, which = np.unique(beside, axis=0, return_inverse=True)
    shares = np.bincount(which.ravel(), weights=power)
    total = np.zeros(len(turn))
    for (before, after), share in zip(sizes.tolist(), shares.tolist(), strict=True):
        kernel = np.ones(len(turn), dtype=complex)
        for m in range(1, before + 1):
            kernel += (1.0 - m / (before + 1.0)) * turn**-m
        for m in range(1, after + 1):
            kernel += (1.0 - m / (after + 1.0)) * turn**m
        total += share * np.abs(kernel) ** 2
    return total
