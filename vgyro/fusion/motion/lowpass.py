"""How late the whole array is: by the low-passes that data sheets give, or that the motion itself shows.

White noise that a low-pass has coloured correlates from one sample to the next by φ, a pole of the time constant
-T/ln φ, which would delay the motion by as much. But noise can be coloured where the motion is not late. So it is
believed only where the gyros differ in colour, and the delays between them, seen in the motion, follow their colours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vgyro.fusion.motion.relative import Relative

SURE = 3.0
"""Standard deviations (root of the χ²) by which the colours must explain the delays better than no delay does.

Where the gyros are alike the χ² speaks against the colours by as much as they are apart: chance hardly gets here.
"""
TOLERANCE = 0.1
"""Of a low-pass's time constant, 1σ: as data sheets have it, and alike in all gyros of one kind."""
MAD = 1.4826
"""Standard deviation over median absolute deviation, of normal variables."""
EXPLAINED = 0.5
"""What the colours leave of the delays' χ², at most: delays that have another cause, too, are no evidence of poles."""


@dataclass(frozen=True)
class ArrayDelay:
    """Delay of the mean of the gyros, s; 0: not known.  sd : of it, s, NaN where it is not known;  note : how it is"""

    late_s: float = 0.0
    sd: float = math.nan
    note: str = ""


def array_delay(relative: Relative | None, phi: np.ndarray, period: float, declared: np.ndarray) -> ArrayDelay:
    """Delay of the mean of the gyros, and how it is known; 0 and a note where it is not.

    relative : the gyros' delays about their mean;  phi [N] : correlation of the noise from one sample to the next
    declared : [N] Hz, -3 dB frequency of each gyro's first-order low-pass; NaN: not known; of one gyro it is enough
    The array's delay is that of a low-pass less what its gyro is late about the array: the median of the gyros.
    Its variance is that of the median of so many, as far as they are apart, and of TOLERANCE of the low-passes.
    """
    if relative is None:
        return ArrayDelay()
    delay, told = relative.value[:, 1], np.isfinite(declared)
    if told.any():
        tau = 1.0 / (2.0 * math.pi * declared[told])
        each = tau - delay[told]
        how = "low-pass as declared"
    else:
        tau = pole_times(phi, period)
        if not _follows(delay, tau, np.sqrt(np.diagonal(relative.covariance[1]))):
            slowest = float(tau.max())
            why = "which is not undone: no lowpass_hz is declared, and no delay shows it"
            pole_hz = 1.0 / (2.0 * math.pi * slowest) if slowest else math.nan
            said = f"the noise is coloured as by a low-pass at {pole_hz:.3g} Hz, {why}" if slowest else ""
            return ArrayDelay(note=said)
        told, each = np.ones(len(tau), dtype=bool), tau - delay
        how = "low-pass by the colour of the noise, and delays between the gyros that follow it"
    late = float(np.median(each))
    apart = MAD * float(np.median(np.abs(each - late)))
    error = float(np.median(np.diagonal(relative.covariance[1])[told]))
    sd = math.hypot(math.sqrt(0.5 * math.pi * (apart**2 + error) / len(each)), TOLERANCE * float(np.median(tau)))
    return ArrayDelay(late, sd, f"{how}: the array's delay of {1000.0 * late:.3g} ms is undone")


def pole_times(phi: np.ndarray, period: float) -> np.ndarray:
    """Time constants, s, of the first-order low-passes that make white noise correlate by phi from one sample to the
    next: -T/ln φ; 0 where φ is 0."""
    coloured = phi > 0.0
    return np.where(coloured, -period / np.log(np.where(coloured, phi, 0.5)), 0.0)


def _follows(delay: np.ndarray, tau: np.ndarray, error: np.ndarray) -> bool:
    """Do the delays follow the colours? One gyro of four or more may be late by itself."""
    if not (error > 0).all():
        return False

    def misfit(values: np.ndarray) -> float:
        counts = 1.0 - np.eye(len(values)) if len(values) > 3 else np.ones((1, len(values)))
        weight = counts / error**2
        mean = (weight @ values) / weight.sum(axis=1)
        return float((weight * (values - mean[:, None]) ** 2).sum(axis=1).min())

    alike, follow = misfit(delay), misfit(delay - tau)
    return alike - follow > SURE**2 and follow < EXPLAINED * alike and bool((tau > 0).all())
