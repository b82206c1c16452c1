"""GARCH(1,1) of each gyro."""

from __future__ import annotations

import numpy as np

from vgyro import engine as engines
from vgyro.arrays import Floats
from vgyro.engine import recursions
from vgyro.engine.models import GarchFit
from vgyro.errors import TooShort

garch_variance = recursions.garch_variance


def fit_garch(r: Floats, engine: str = "native") -> GarchFit:
    """Fit h_t = ω + α e²_{t-1} + β h_{t-1} to each gyro by Gaussian quasi maximum likelihood.

    r       : [T, N] deg/s, one series a column; the model's mean is zero
    engine  : name of the engine (vgyro.engine)
    returns : GarchFit; ω in (deg/s)²
    raises  : TooShort if there is no sample at all; EngineError if the engine is unknown

    Conventions. Each series is divided by its own r.m.s. first. ω > 0 (at least 1e-8 of mean(e²)), α >= 0, β >= 0,
    α + β < 1. The recursion starts at ε_0² = h_0 = mean(e²), so that h_1 = ω + (α + β)·mean(e²) (Fiorentini, Calzolari
    & Panattoni 1996). The result is the greatest likelihood over this set, α = 0 included: h_t is then a trend of the
    variance, from mean(e²) to ω/(1 - β). Several starts; no start depends on another series or window. Where the best
    point gains less than 1e-6 a sample over the constant variance, that is the answer: ω = mean(e²), α = β = 0.
    Status: `boundary: …` where the optimum lies there (α counts as 0 below 0.001), `outlier-dominated` where one sample
    holds more than a fifth of Σe². Standard errors are Bollerslev & Wooldridge's (1992) robust ones,
    H⁻¹(ΣSS')H⁻¹; NaN unless the status is `converged`.
    A series that does not vary, is too short (< 20 samples) or holds NaN gets a status and NaN, never an exception.
    Bollerslev (1986); Liu et al. (2015), eq. 1.
    """
    r = _two_dimensional(r)
    return engines.get(engine).garch.fit_garch(r)


def _two_dimensional(r: np.ndarray) -> np.ndarray:
    r = np.asarray(r, dtype=float)
    if r.ndim != 2:
        raise TypeError(f"r has {r.ndim} dimensions; expected [T, N]")
    if len(r) == 0:
        raise TooShort("the series holds no sample", remedy="Give at least 50 samples")
    return r
