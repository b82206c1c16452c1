"""Lines in the spectrum of the rate, vibrations: where they stand, and what is left without them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vgyro.fusion.motion.evidence import PER_OCTAVE, RateSpectrum, SpectrumPiece
from vgyro.fusion.motion.models import SpectralLine

SHARP = 4
"""Lines of a periodogram over which its taper spreads a sinusoid."""
SKIRT = 8.0
SHARE, NEARLY_ALL = 0.1, 0.9
NEIGHBOURS = 13
"""Bands whose median is the spectrum without lines: half an octave."""
BESIDE = 257
"""Lines of a periodogram whose median is the noise about one."""
FINE = 30
"""Lines of the periodogram on either side of a line of the motion that are not merged into bands."""


@dataclass(frozen=True)
class Peak:
    """Where a smoother that passed everything would lower the risk most.

    frequency_hz, width_hz, sd : of the line, Hz and deg/s;  gain : of risk
    sharp : not wider than SHARP lines of a periodogram
    """

    frequency_hz: float
    width_hz: float
    sd: float
    gain: float
    sharp: bool

    def band(self) -> tuple[float, float]:
        """From and to, Hz, with the skirts of the taper."""
        return self.frequency_hz - SKIRT * self.width_hz, self.frequency_hz + SKIRT * self.width_hz

    def line(self) -> SpectralLine:
        """With the density of the peak: an oscillation of damping ζ is 2ζf wide."""
        return SpectralLine(self.frequency_hz, min(max(0.5 * self.width_hz / self.frequency_hz, 1e-5), 0.5), self.sd)


def single(spectrum: RateSpectrum) -> bool:
    """Nearly all the power beside the noise is in one line, and that is not the end of a slow motion."""
    above = np.append(0.0, np.cumsum(np.maximum(spectrum.power - spectrum.noise, 0.0)))
    size = min((2 * SHARP + 1) * spectrum.pieces, len(above) - 1)
    inside = above[size:] - above[:-size]
    return float(inside.max()) > NEARLY_ALL * float(above[-1]) and float(above[size // 2]) < 0.5 * float(above[-1])


def without_peaks(spectrum: RateSpectrum) -> RateSpectrum:
    """The bands with the median of their neighbours: a line is narrower than that."""
    from scipy.ndimage import median_filter

    power = spectrum.power / spectrum.noise
    return replace(spectrum, power=median_filter(power, NEIGHBOURS, mode="nearest") * spectrum.noise)


def above_neighbours(spectrum: RateSpectrum) -> RateSpectrum:
    """All lines, with a noise that is not below the median of BESIDE lines about each: what is broad is no line.

    A periodogram's line is exponential: its median is ln 2 of its mean.
    """
    from scipy.ndimage import median_filter

    floor = median_filter(spectrum.power, BESIDE, mode="nearest") / math.log(2.0)
    return replace(spectrum, noise=np.maximum(spectrum.noise, floor))


def peak(spectrum: RateSpectrum, signal: np.ndarray) -> Peak:
    """In windows of 1, 2, 4 … lines of the periodogram: the smallest that has SHARE of the most that one has.

    signal : S [F], of the motion without the line
    """
    H = signal / (signal + spectrum.noise)
    excess = spectrum.power / spectrum.noise
    gain = np.append(0.0, np.cumsum(spectrum.weight * ((1.0 - H) ** 2 * excess + 2.0 * H - 2.0)))
    found, size = [], 1
    while size < max(len(gain) // 4, 2):
        inside = gain[size:] - gain[:-size]
        first = int(np.argmax(inside))
        found.append((float(inside[first]), first, size))
        size *= 2
    most = max(found)[0]
    _, first, size = next(one for one in found if one[0] >= min(SHARE * most, most))
    part = slice(max(first - 2 * size, 0), first + 3 * size)
    sharp = size <= SHARP * spectrum.pieces
    above = np.maximum(spectrum.power[part] - signal[part] - spectrum.noise[part], 0.0)
    highest = float(spectrum.frequency[part][np.argmax(above)])
    total, step = max(float(above.sum()), 1e-300), _resolution(spectrum)
    return Peak(
        frequency_hz=highest if sharp else float(above @ spectrum.frequency[part]) / total,
        width_hz=2.0 * step * size / spectrum.pieces,
        sd=math.sqrt(2.0 * step * total / spectrum.pieces),
        gain=most,
        sharp=sharp,
    )


def _resolution(spectrum: RateSpectrum) -> float:
    """Distance of the lines of one piece, Hz, about."""
    span = spectrum.frequency[-1] - spectrum.frequency[0]
    return float(span) * spectrum.pieces / max(len(spectrum.frequency) - 1, 1)


def fine_bands(spectrum: RateSpectrum, lines: Sequence[float]) -> RateSpectrum:
    """Bands of all lines of the periodograms, but for those near the frequencies `lines`, Hz."""
    if not lines:
        return spectrum.bands()
    near = np.zeros(len(spectrum.frequency), dtype=bool)
    for own in lines:
        near |= np.abs(spectrum.frequency - own) < FINE * _resolution(spectrum)
    place = np.floor(np.log2(spectrum.frequency / spectrum.frequency[0]) * PER_OCTAVE)
    first = (np.diff(place, prepend=-1.0) != 0) | near | np.append(False, near[:-1])
    return spectrum.merged(np.flatnonzero(first))


def sinusoid(pieces: list[SpectrumPiece], rate_hz: float, about_hz: float) -> tuple[SpectralLine, list[SpectrumPiece]]:
    """The sinusoid next to a frequency, in all pieces with amplitudes and phases of their own; and what is left.

    Its frequency is where the periodogram of the tapered samples is highest.
    """
    from scipy.optimize import minimize_scalar

    step = rate_hz / max(len(piece.z) for piece in pieces)
    tables = [(_rows(piece.z * piece.taper), len(piece.z)) for piece in pieces]

    def power(frequency: float) -> float:
        turn = 2.0 * math.pi * frequency / rate_hz
        total: float = -sum(
            abs(_wave(turn * ROW, len(rows)) @ (rows @ _wave(turn, ROW))) ** 2 / size for rows, size in tables
        )
        return total

    bounds = (about_hz - 1.2 * step, about_hz + 1.2 * step)
    found = float(minimize_scalar(power, bounds=bounds, method="bounded", options={"xatol": 1e-6 * step}).x)
    left, squares, total = [], 0.0, 0
    for piece in pieces:
        wave = _wave(2.0 * math.pi * found / rate_hz, len(piece.z))
        basis = np.stack([wave.real, wave.imag], axis=1)
        tapered = basis * (piece.taper**2)[:, None]
        size = np.linalg.lstsq(tapered.T @ basis, tapered.T @ piece.z, rcond=None)[0]
        left.append(replace(piece, z=piece.z - basis @ size))
        squares, total = squares + float(size @ size) * len(piece.z), total + len(piece.z)
    return SpectralLine(found, 1e-9, math.sqrt(0.5 * squares / total)), left


ROW = 256


def _rows(values: np.ndarray) -> np.ndarray:
    """[T'/ROW, ROW], filled up with zeros."""
    return np.pad(values, (0, -len(values) % ROW)).reshape(-1, ROW)


def _wave(turn: float, samples: int) -> np.ndarray:
    found: np.ndarray = np.exp(-1j * turn * np.arange(samples))
    return found
