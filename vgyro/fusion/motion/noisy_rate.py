"""A rate with noise: what is smoothed, and what a model of the motion is chosen for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vgyro.fusion.motion.models import Motion


@dataclass(frozen=True)
class NoisyRate:
    """One series z = w + v of a rate w, with a noise v of known variance.

    z       : [T] deg/s;  r : variance of its noise, (deg/s)², one or [T]; infinite: z says nothing at this sample
    segment : [T], number of the gap-free stretch;  rate_hz : sample rate, Hz
    phi     : AR(1) coefficient of the noise, from one sample to the next, 0 ≤ phi < 1
    """

    z: np.ndarray
    r: float | np.ndarray
    segment: np.ndarray
    rate_hz: float
    phi: float = 0.0


class Standstill(NamedTuple):
    """Where the board stands still in a recording in motion: samples [T] bool, and how the rate moves there."""

    at_rest: np.ndarray
    motion: Motion
