"""Design of the scalar rate filters: information, bandwidth, process noise, steady-state covariance.

Units: q in deg²/s³ (that is (deg/s)²/s), R in (deg/s)²/Hz, D in Hz/(deg/s)² , s in rad/s, P in (deg/s)².
All of this is continuous time. The gain of the continuous filter, brought to samples by a zero-order hold, is not the
optimal gain of the discrete filter: for a random walk it is larger by the share (s·T)²/24 when s·T is small.
"""

from __future__ import annotations

import math

import numpy as np

from vgyro.arrays import Floats
from vgyro.errors import DataError

SINGULAR = 1e-10
"""A combination of gyros whose variance is a smaller share of their own has none: rounding of sums over a recording
leaves some 1e-14, and gyros that are not copies differ by more than 1e-5 of their noise."""
INVOLVED = 0.1


def information(R: np.ndarray) -> float:
    """D = 1'R⁻¹1, Hz/(deg/s)²: what one second of the whole array says about the rate. Jiang et al. (2012), eq. 10.

    R      : continuous noise covariance [N, N], (deg/s)²/Hz
    raises : DataError if R is not finite and positive definite
    """
    return float(_solved(R).sum())


def gain_direction(R: Floats) -> Floats:
    """u = R⁻¹1/(1'R⁻¹1) [N]: how the gain is shared between the gyros, Σu = 1; not bounded to 0..1."""
    solved = _solved(R)
    direction: Floats = solved / solved.sum()
    return direction


def _solved(R: np.ndarray) -> np.ndarray:
    """R⁻¹1.  raises : DataError, which names the gyros that make R no covariance to be inverted"""
    R = np.asarray(R, dtype=float)
    why = flaw(R)
    if why:
        raise DataError(
            f"the noise covariance R is not finite and positive definite: {why}",
            remedy="look for gyros that are copies of each other or whose angle random walk was not measured",
        )
    return np.linalg.solve(R, np.ones(len(R)))


def flaw(covariance: np.ndarray) -> str:
    """Why a covariance [N, N] cannot be inverted, with the gyros counted from 1; empty if it can.

    Gyros whose noise adds up to nothing in some combination (a share below SINGULAR of their own variances) are named;
    two of them with the correlation 1 are copies.
    """
    variance = np.diag(covariance)
    bad = ~(np.isfinite(variance) & (variance > 0))
    if not bad.any():
        bad = ~np.isfinite(covariance).all(axis=1)
    if bad.any():
        return f"the noise of {_gyros(np.flatnonzero(bad))} is not known, or zero"
    scale = np.sqrt(variance)
    correlation = covariance / np.outer(scale, scale)
    copies = np.argwhere(np.triu(correlation, 1) > 1.0 - SINGULAR)
    if len(copies):
        pairs = ", ".join(f"{first + 1} and {second + 1}" for first, second in copies.tolist())
        return f"gyros {pairs} are copies of each other"
    value, vector = np.linalg.eigh(correlation)
    if value[0] > SINGULAR:
        return ""
    involved = np.flatnonzero(np.abs(vector[:, 0]) > INVOLVED * np.abs(vector[:, 0]).max())
    what = "no noise" if value[0] > -SINGULAR else "a negative variance"
    return f"a combination of {_gyros(involved)} has {what}"


def _gyros(places: np.ndarray) -> str:
    return f"gyro{'s' if len(places) > 1 else ''} {', '.join(str(place + 1) for place in places.tolist())}"


def pole(D: float, q: float, tau: float = math.inf) -> float:
    """s = √(1/τ² + D·q), rad/s: pole of the steady-state filter; τ = ∞ is the random walk. Eq. 15."""
    return math.sqrt(1.0 / tau**2 + D * q)


def bandwidth(D: float, q: float, tau: float = math.inf) -> float:
    """-3 dB bandwidth s/2π, Hz. Jiang et al. (2012), eq. 18 and, for τ = ∞, eq. 19."""
    return pole(D, q, tau) / (2.0 * math.pi)


def q_for_bandwidth(D: float, bandwidth_hz: float, tau: float = math.inf) -> float:
    """Process noise that gives a bandwidth: q = ((2π·BW)² - 1/τ²)/D, deg²/s³.

    For τ = ∞ it is √q = 2π·BW/√D (Chang et al. 2012).
    raises : DataError if the Markov rate alone is already faster than the bandwidth
    """
    q = ((2.0 * math.pi * bandwidth_hz) ** 2 - 1.0 / tau**2) / D
    if q <= 0:
        raise DataError(
            f"a bandwidth of {bandwidth_hz:g} Hz is below 1/(2πτ) with τ = {tau:g} s",
            "fusion.bandwidth_hz",
            "give a larger bandwidth or a larger tau_s",
        )
    return q


def steady_variance(D: float, q: float, tau: float = math.inf) -> float:
    """P∞ = (s - 1/τ)/D, (deg/s)². Jiang et al. (2012), eq. 11; τ = ∞ gives eq. 20, √(q/D)."""
    s = pole(D, q, tau)
    # (s - 1/τ) written without its cancellation, which matters where D·q is far below 1/τ².
    return q / (s + 1.0 / tau)


def steady_variance_identical(q: float, arw: float, gyros: int, correlation: float) -> float:
    """P∞ of a random-walk filter over N alike gyros: √(q·σ²·(1 + (N-1)ρ)/N). Jiang et al. (2012), eq. 21.

    arw : σ, deg/s/√Hz;  correlation : ρ, the same for every pair
    """
    return math.sqrt(q * arw**2 * (1.0 + (gyros - 1) * correlation) / gyros)


def dc_gain(D: float, q: float, tau: float = math.inf) -> float:
    """Gain for a constant rate, 1 - 1/(τs): below 1 for a Markov rate, which is drawn to zero."""
    s = pole(D, q, tau)
    return D * q / (s * (s + 1.0 / tau))


def response(frequency_hz: np.ndarray, D: float, q: float, tau: float = math.inf) -> np.ndarray:
    """Gain of the steady-state filter for a motion of these frequencies, H(2πi·f) [F], complex.

    H(s) = (√(1/τ² + Dq) - 1/τ)/(s + √(1/τ² + Dq)); |H(2πi·f)/H(0)| is 1/√2 at the bandwidth. Eq. 15-18.
    """
    s = pole(D, q, tau)
    return dc_gain(D, q, tau) * s / (2j * math.pi * np.asarray(frequency_hz, dtype=float) + s)


def attenuation(ratio: float) -> tuple[float, float]:
    """Amplitude loss 1 - 1/√(1 + r²) and phase lag atan(r), rad, at r = frequency / bandwidth. Chang et al. (2012)."""
    return 1.0 - 1.0 / math.sqrt(1.0 + ratio**2), math.atan(ratio)


def allan_ratio(tau: float, s: float) -> float:
    """Allan deviation of low-passed white noise over that of the white noise itself, at averaging time τ.

    √(1 - (3 - 4e^(-sτ) + e^(-2sτ))/(2sτ)) for a first-order low-pass of pole s and gain 1.
    """
    x = s * tau
    return math.sqrt(1.0 - (3.0 - 4.0 * math.exp(-x) + math.exp(-2.0 * x)) / (2.0 * x))
