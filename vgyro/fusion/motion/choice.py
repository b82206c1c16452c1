"""Which model of the rate, with which parameters: those of the smoother with the least estimated error.

A rate is of no model exactly, and then the parameters of the greatest likelihood, which is the score of a filter, are
not those that smooth best: of motion limited to a band they smooth too little. So the smoother's own squared error is
what is compared, by an unbiased estimate (Stein 1981, Ann. Statist. 9, 1135-1151), plus PRICE for each parameter; that
is the one rule by which models, lines, no motion and no smoothing are chosen. The error of the steady smoother is in
closed form in the spectrum of the fused rate (vgyro.fusion.motion.evidence).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vgyro import engine as engines
from vgyro.config import MOTION_MODELS
from vgyro.engine.linear import StateSpace
from vgyro.errors import DataError, EngineError
from vgyro.fusion.motion.evidence import RateSpectrum, SpectrumPiece, gather, spectrum
from vgyro.fusion.motion.lines import above_neighbours, fine_bands, peak, single, sinusoid, without_peaks
from vgyro.fusion.motion.models import UNLIMITED, Motion, MotionCandidate, SpectralLine
from vgyro.fusion.motion.noisy_rate import NoisyRate
from vgyro.fusion.motion.search import PRICE, MotionFit, crossing_of, line_price, refine, search, signal_of, still
from vgyro.fusion.motion.start import wide_start

DRIVEN = ("random_walk", "acceleration", "jerk")
MOST_LINES, MOST_FOREIGN = 3, 10
WIDE = 0.1
"""Damping of an oscillation that is no line of a board at rest."""
AROUND = 1.2
"""Whether a line has a width is seen from the spectrum within this factor of its frequency."""
SURE = 4.0
"""Standard errors above which there is motion that is not passed."""
LEAST_NOISE = 1e-3
"""Noise at rest, over the variance of the samples, at least: the size of a vibration is not known better than that."""
SPENT = 4.0
"""Risk of the amplitude and the phase of a sinusoid, both passed as they are."""
CHECKED = 1 << 14
"""Samples on which the smoother itself is tried."""


@dataclass(frozen=True)
class ComparedModels:
    """Models of the rate that were fitted to one recording, beside the sinusoids that were found first.

    pieces    : the stretches of the recording, from which the sinusoids have been taken
    sinusoids : the lines without a width that were taken
    bands     : the spectrum of the pieces in bands, which the models were fitted to
    fits      : the models, that of the least cost first
    spent     : cost of the sinusoids, in the units of MotionFit.cost
    """

    pieces: list[SpectrumPiece]
    sinusoids: tuple[SpectralLine, ...]
    bands: RateSpectrum
    fits: list[MotionFit]
    spent: float

    @property
    def cost(self) -> float:
        return self.fits[0].cost + self.spent


def choose_motion(
    noisy: NoisyRate,
    models: Sequence[str] = MOTION_MODELS,
    engine: str = "native",
    moving: np.ndarray | None = None,
    shared: Callable[[float], bool] | None = None,
    lines: bool = True,
) -> Motion:
    """The model of the rate whose smoother has the least estimated error.

    moving : [T] bool, only these samples count
    models : names of those to choose from;  lines : look for them
    shared : whether a line at a frequency, Hz, is motion; None: all are
    A constant rate is a legal answer, q = 0, and so is no smoothing, `none`. Lines that stand in the spectrum of z are
    motion: sinusoids, or with a width. A model whose smoother breaks down is left out.
    raises : DataError if the samples do not change, or if r is not above zero; TooShort
    """
    pieces, rate_hz = gather(noisy, moving), noisy.rate_hz
    families = _families(models)
    found = (
        _best(pieces, rate_hz, families, shared)
        if lines
        else _compared(FoundLines(pieces, spectrum(pieces, rate_hz)), families)
    )
    rows = tuple(
        MotionCandidate(*_named(fit, found.sinusoids, models), fit.risk + found.spent, fit.cost + found.spent)
        for fit in found.fits
    )
    free = float(found.bands.weight.sum())
    for row in rows:
        motion = Motion(row.model, row.parameters, rate_hz, rows, lines=row.lines)
        if row.cost < free and _stands(motion, noisy, found.pieces, engine):
            return motion
    return Motion(UNLIMITED, {}, rate_hz, rows)


def _named(
    fit: MotionFit, sinusoids: tuple[SpectralLine, ...], models: Sequence[str]
) -> tuple[str, dict[str, float], tuple[SpectralLine, ...]]:
    """Model, parameters and lines of Motion: a single oscillation of a rate that is constant is an oscillator."""
    lines = (*sinusoids, *fit.lines)
    if fit.family:
        model = "oscillator" if fit.family in ("resonance", "pair") else fit.family
        return model, dict(fit.values) | ({"q": 0.0} if fit.family == "resonance" else {}), lines
    if len(lines) == 1 and "oscillator" in models:
        one = lines[0]
        return "oscillator", {"frequency_hz": one.frequency_hz, "damping": one.damping, "sd": one.sd, "q": 0.0}, ()
    return "random_walk", {"q": 0.0}, lines


def _families(models: Sequence[str]) -> list[str]:
    unknown = set(models) - set(MOTION_MODELS)
    if unknown:
        raise DataError(f"unknown motion model {min(unknown)!r}", remedy=f"Known: {', '.join(MOTION_MODELS)}")
    return [one for model in models for one in (("resonance", "pair") if model == "oscillator" else (model,))]


def _best(
    pieces: list[SpectrumPiece], rate_hz: float, families: Sequence[str], shared: Callable[[float], bool] | None
) -> ComparedModels:
    """With lines and without. Lines are looked for beside the motion that the spectrum without peaks has: other models
    take a line for a part of themselves."""
    whole = spectrum(pieces, rate_hz)
    plain = _compared(FoundLines(pieces, whole), families)
    bare = still(plain.bands) if single(whole) else _bare(plain.bands)
    found = _lines(pieces, whole, bare, shared)
    if found.foreign:
        plain = _compared(FoundLines(pieces, whole.without(found.foreign)), families)
    if not found.lines and not found.sinusoids:
        return plain
    return min(plain, _compared(found, families), key=lambda one: one.cost)


@dataclass(frozen=True)
class FoundLines:
    """What the search for narrow lines has found so far in one recording.

    pieces    : the stretches of the recording, from which the sinusoids have been taken
    whole     : all lines of their periodograms, without the bands `foreign`
    sinusoids : lines of the motion that have no width;  lines : lines of the motion that have one
    foreign   : bands (from, to) in Hz that stand out and are no motion, because the gyros do not share them
    """

    pieces: list[SpectrumPiece]
    whole: RateSpectrum
    sinusoids: tuple[SpectralLine, ...] = ()
    lines: tuple[SpectralLine, ...] = ()
    foreign: tuple[tuple[float, float], ...] = ()


def _lines(
    pieces: list[SpectrumPiece], whole: RateSpectrum, bare: MotionFit, shared: Callable[[float], bool] | None
) -> FoundLines:
    """Lines that are worth their price beside the motion `bare`, the one that lowers the risk most first."""
    found = FoundLines(pieces, whole)
    while len(found.lines) + len(found.sinusoids) < MOST_LINES and len(found.foreign) < MOST_FOREIGN:
        there = peak(found.whole, signal_of(found.whole, bare, found.lines))
        if there.gain < line_price(whole):
            break
        if shared is not None and not shared(there.frequency_hz):
            foreign = (*found.foreign, there.band())
            found = replace(found, foreign=foreign, whole=found.whole.without(foreign))
            continue
        around = there.frequency_hz / AROUND, there.frequency_hz * AROUND
        near = fine_bands(found.whole.between(*around), [there.frequency_hz])
        others = signal_of(near, bare, found.lines)
        wide = refine(near, "", np.empty(0), (there.line(),), others)
        if there.sharp:
            line, left = sinusoid(found.pieces, whole.rate_hz, there.frequency_hz)
            without = spectrum(left, whole.rate_hz).without(found.foreign)
            risk = float(fine_bands(without.between(*around), [there.frequency_hz]).risk(others))
            if risk + _spent((line,), without) < wide.risk + line_price(whole):
                found = replace(found, pieces=left, whole=without, sinusoids=(*found.sinusoids, line))
                continue
        found = replace(found, lines=(*found.lines, *wide.lines))
    return found


@dataclass(frozen=True)
class AtRest:
    """What a board at rest does that its smoother, a low-pass of a fixed bandwidth, would take away.

    lines : vibrations, which the smoother is told to pass
    lost  : (deg/s)², variance of any other motion that is seen for certain and is not passed
    noise : the part of the variance of the samples that is noise and no vibration, above 0 and at most 1
    """

    lines: tuple[SpectralLine, ...] = ()
    lost: float = 0.0
    noise: float = 1.0


def beside_fixed(noisy: NoisyRate, fixed: Motion, shared: Callable[[float], bool] | None = None) -> AtRest:
    """The motion that the smoother `fixed`, of a board at rest, would take away.

    shared : as in choose_motion
    raises : as choose_motion
    Noise at rest may have any colour: only what stands out of its neighbours is passed.
    """
    if fixed.model == UNLIMITED:
        return AtRest()
    pieces, rate_hz = gather(noisy), noisy.rate_hz
    whole = spectrum(pieces, rate_hz)
    bare = MotionFit(fixed.model, fixed.parameters, (), np.empty(0), 0.0, 0.0)
    found = _lines(pieces, above_neighbours(whole), bare, shared)
    lines = tuple(line for line in found.lines if line.damping < WIDE)
    rest = fine_bands(spectrum(found.pieces, rate_hz).without(found.foreign), [line.frequency_hz for line in lines])
    lost = _lost(rest, signal_of(rest, bare, lines))
    return AtRest((*found.sinusoids, *lines), lost, _not_vibration(pieces, found.pieces, lines))


def _not_vibration(
    pieces: Sequence[SpectrumPiece], left: Sequence[SpectrumPiece], lines: Sequence[SpectralLine]
) -> float:
    """Part of the variance of the pieces that is in those without the sinusoids `left`, and not of the lines."""
    total = sum(float(piece.z @ piece.z) for piece in pieces)
    samples = sum(len(piece.z) for piece in pieces)
    noise = sum(float(piece.z @ piece.z) for piece in left) - samples * sum(line.sd**2 for line in lines)
    return max(noise / total, LEAST_NOISE) if total > 0 else 1.0


def _bare(bands: RateSpectrum) -> MotionFit:
    """The motion without lines, about."""
    smooth = without_peaks(bands)
    return min((search(smooth, family, (), 0.0) for family in DRIVEN), key=lambda fit: fit.cost)


def _compared(found: FoundLines, families: Sequence[str]) -> ComparedModels:
    whole, lines = found.whole, found.lines
    bands = fine_bands(whole, [line.frequency_hz for line in lines])
    fits = [still(bands, lines)]
    if lines:
        fits.append(refine(bands, "", np.empty(0), lines))
    fits += [search(bands, family, lines, 0.0) for family in DRIVEN]
    crossing = crossing_of(bands, min(fits, key=lambda fit: fit.cost).signal)
    fits += [search(bands, family, lines, crossing) for family in families if family not in DRIVEN]
    fits = [fit for fit in fits if not fit.family or fit.family in families]
    fits.sort(key=lambda fit: fit.cost)
    return ComparedModels(found.pieces, found.sinusoids, bands, fits, _spent(found.sinusoids, whole))


def _spent(sinusoids: tuple[SpectralLine, ...], whole: RateSpectrum) -> float:
    """Of each its frequency; in each piece its amplitude and phase, which count as one line of the periodogram."""
    share = 0.5 * float(np.mean(whole.weight)) * whole.pieces
    return len(sinusoids) * (line_price(whole) - 2.0 * PRICE + SPENT * share)


def _stands(motion: Motion, noisy: NoisyRate, pieces: list[SpectrumPiece], engine: str) -> bool:
    """The smoother itself does not break down on the longest piece, and its estimated risk is below no smoothing's."""
    z, r = np.asarray(noisy.z, dtype=float), np.asarray(noisy.r, dtype=float)
    longest = max(pieces, key=lambda piece: len(piece.z))
    part = slice(longest.start, longest.start + min(len(longest.z), CHECKED))
    own, noise, model = z[part], r if r.ndim == 0 else r[part], motion.dynamics()
    start = wide_start(own, noise, model)
    if start is None:
        return False
    space = StateSpace(model.transition, model.process, model.reads, model.reads, *start, pole=noisy.phi)
    try:
        smoothed, variance = engines.get(engine).statespace.smooth(own, noise, space)
    except EngineError:
        return False
    noise = np.broadcast_to(noise, own.shape)
    told = np.isfinite(noise)
    if not np.all(variance > 0.0):
        return False
    left = (own[told] - smoothed[told]) ** 2 + 2.0 * variance[told]
    return bool(float(np.mean(left / noise[told])) < 2.0)


def _lost(spectrum: RateSpectrum, signal: np.ndarray) -> float:
    """Variance of the motion that the smoother takes away, (deg/s)²: ∫ (1 - H)²·(S_z - S_v), as far as it is certain.

    signal : S [F], which makes the smoother and need not be the density of the motion
    Zero within SURE standard errors.
    """
    H = signal / (signal + spectrum.noise)
    share = (1.0 - H) ** 2 * spectrum.weight / float(spectrum.weight.sum()) * spectrum.rate_hz
    mean = float(share @ (spectrum.power - spectrum.noise))
    error = math.sqrt(2.0 * float((share * spectrum.noise) ** 2 @ (1.0 / spectrum.weight)))
    return mean if mean > SURE * error else 0.0
