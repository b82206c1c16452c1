"""Which model of the rate, with which parameters: those of the smoother with the least estimated error.

A rate is of no model exactly, and then the parameters of the greatest likelihood, which is the score of a filter, are
not those that smooth best: of motion limited to a band they smooth too little. So the smoother's own squared error is
what is compared, by an unbiased estimate (Stein 1981, Ann. Statist. 9, 1135-1151), plus PRICE for each parameter; that
is the one rule by which models, lines, no motion and no smoothing are chosen. The error of the steady smoother is in
closed form in the spectrum of the fused rate (vgyro.fusion.motion_evidence).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vgyro import engine as engines
from vgyro.config import MOTION_MODELS
from vgyro.engine.linear import StateSpace
from vgyro.errors import DataError, EngineError
from vgyro.fusion.motion_calibration import calibration
from vgyro.fusion.motion_evidence import Piece, Spectrum, gather, spectrum
from vgyro.fusion.motion_lines import fine_bands, peak, single, sinusoid, without_peaks
from vgyro.fusion.motion_models import UNLIMITED, Candidate, Line, Motion
from vgyro.fusion.motion_search import PRICE, Fit, crossing_of, line_price, refine, search, signal_of, still
from vgyro.fusion.motion_start import wide_start

DRIVEN = ("random_walk", "acceleration", "jerk")
MOST_LINES = 3
AROUND = 1.2
"""Whether a line has a width is seen from the spectrum within this factor of its frequency."""
SPENT = 4.0
"""Risk of the amplitude and the phase of a sinusoid, both passed as they are."""
CHECKED = 1 << 14
"""Samples on which the smoother itself is tried."""


@dataclass(frozen=True)
class Compared:
    """Models compared on the pieces of a recording without the sinusoids that were taken out of them.

    whole : all lines of the periodograms;  bands : of them, on which the fits were made
    fits  : in order of their cost;  spent : cost of the sinusoids
    """

    pieces: list[Piece]
    sinusoids: tuple[Line, ...]
    whole: Spectrum
    bands: Spectrum
    fits: list[Fit]
    spent: float

    @property
    def cost(self) -> float:
        return self.fits[0].cost + self.spent


def choose_motion(
    z: np.ndarray,
    r: float | np.ndarray,
    segment: np.ndarray,
    rate_hz: float,
    phi: float = 0.0,
    models: Sequence[str] = MOTION_MODELS,
    engine: str = "native",
    moving: np.ndarray | None = None,
) -> Motion:
    """The model of the rate whose smoother has the least estimated error.

    z, r, segment, rate_hz, phi : as in vgyro.fusion.smoother.smooth;  moving : [T] bool, only these samples count
    models : names of those to choose from
    A constant rate is a legal answer, q = 0, and so is no smoothing, `none`. Lines that stand in the spectrum of z are
    motion: sinusoids, or with a width. A model whose smoother breaks down is left out.
    raises : DataError if the samples do not change, or if r is not above zero; TooShort
    """
    found = _best(gather(z, r, segment, rate_hz, phi, moving), rate_hz, _families(models))
    rows = tuple(
        Candidate(*_named(fit, found.sinusoids, models), fit.risk + found.spent, fit.cost + found.spent)
        for fit in found.fits
    )
    z, r, free = np.asarray(z, dtype=float), np.asarray(r, dtype=float), float(found.bands.weight.sum())
    for fit, row in zip(found.fits, rows, strict=True):
        motion = Motion(row.model, row.parameters, rate_hz, rows, calibration(found.bands, fit.signal), row.lines)
        if row.cost < free and _stands(motion, z, r, phi, found.pieces, engine):
            return motion
    return Motion(UNLIMITED, {}, rate_hz, rows)


def _named(
    fit: Fit, sinusoids: tuple[Line, ...], models: Sequence[str]
) -> tuple[str, dict[str, float], tuple[Line, ...]]:
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


def _best(pieces: list[Piece], rate_hz: float, families: Sequence[str]) -> Compared:
    """With lines and without. Lines are looked for beside the motion that the spectrum without peaks has: other models
    take a line for a part of themselves."""
    plain = _compared(pieces, (), (), rate_hz, families)
    bare = still(plain.bands) if single(plain.whole) else _bare(plain.bands)
    here, whole = pieces, plain.whole
    lines: tuple[Line, ...] = ()
    sinusoids: tuple[Line, ...] = ()
    for _ in range(MOST_LINES):
        there = peak(whole, signal_of(whole, bare, lines))
        if there.gain < line_price(whole):
            break
        around = there.frequency_hz / AROUND, there.frequency_hz * AROUND
        near = fine_bands(whole.between(*around), [there.frequency_hz])
        others = signal_of(near, bare, lines)
        wide = refine(near, "", np.empty(0), (there.line(),), others)
        if there.sharp:
            line, left = sinusoid(here, rate_hz, there.frequency_hz)
            without = spectrum(left, rate_hz)
            risk = float(fine_bands(without.between(*around), [there.frequency_hz]).risk(others))
            if risk + _spent((line,), without) < wide.risk + line_price(whole):
                here, whole, sinusoids = left, without, (*sinusoids, line)
                continue
        lines = (*lines, *wide.lines)
    if not lines and not sinusoids:
        return plain
    found = _compared(here, sinusoids, lines, rate_hz, families)
    return min(plain, found, key=lambda one: one.cost)


def _bare(bands: Spectrum) -> Fit:
    """The motion without lines, about."""
    smooth = without_peaks(bands)
    return min((search(smooth, family, (), 0.0) for family in DRIVEN), key=lambda fit: fit.cost)


def _compared(
    pieces: list[Piece], sinusoids: tuple[Line, ...], lines: tuple[Line, ...], rate_hz: float, families: Sequence[str]
) -> Compared:
    whole = spectrum(pieces, rate_hz)
    bands = fine_bands(whole, [line.frequency_hz for line in lines])
    fits = [still(bands, lines)]
    if lines:
        fits.append(refine(bands, "", np.empty(0), lines))
    fits += [search(bands, family, lines, 0.0) for family in DRIVEN]
    crossing = crossing_of(bands, min(fits, key=lambda fit: fit.cost).signal)
    fits += [search(bands, family, lines, crossing) for family in families if family not in DRIVEN]
    fits = [fit for fit in fits if not fit.family or fit.family in families]
    return Compared(pieces, sinusoids, whole, bands, sorted(fits, key=lambda fit: fit.cost), _spent(sinusoids, whole))


def _spent(sinusoids: tuple[Line, ...], whole: Spectrum) -> float:
    """Of each its frequency; in each piece its amplitude and phase, which count as one line of the periodogram."""
    share = 0.5 * float(np.mean(whole.weight)) * whole.pieces
    return len(sinusoids) * (line_price(whole) - 2.0 * PRICE + SPENT * share)


def _stands(motion: Motion, z: np.ndarray, r: np.ndarray, phi: float, pieces: list[Piece], engine: str) -> bool:
    """The smoother itself does not break down on the longest piece, and its estimated risk is below no smoothing's."""
    longest = max(pieces, key=lambda piece: len(piece.z))
    part = slice(longest.start, longest.start + min(len(longest.z), CHECKED))
    own, noise, model = z[part], r if r.ndim == 0 else r[part], motion.dynamics()
    start = wide_start(own, noise, model)
    if start is None:
        return False
    space = StateSpace(model.transition, model.process, model.reads, model.reads, *start, pole=phi)
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
