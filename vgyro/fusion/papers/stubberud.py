"""Extended Kalman filter with scale factor errors, in the style of Stubberud & Stubberud (2008).

The paper itself could not be read. What is known of it: an extended Kalman filter of several sensors. That its state
holds the rate, its derivative, and a bias and a scale factor error of each gyro is inferred, as is the rest; see
INFERRED.

Rate model: w is an integrated random walk, ẅ = white noise of density q_a (deg²/s⁵). With biases and scales known, N
gyros are one of information D = 1'R⁻¹1, and the steady Riccati equation has a closed form, with ω = (q_a·D)^¼ (rad/s):
    P_ww = √2·ω/D,  P_wẇ = ω²/D,  P_ẇẇ = √2·ω³/D;  gain √2·ω, ω²;  w/y = (√2·ω·s + ω²)/(s² + √2·ω·s + ω²).
|w/y|² = (1 + 2x²)/(1 + x⁴), x = (angular frequency)/ω, so the -3 dB bandwidth is √(2 + √5)·ω/2π = 2.058·ω/2π, the
noise-equivalent one 3ω/(4√2), the gain of a constant rate 1, and the delay at low frequency 0: it follows a ramp. At
0.79·ω it amplifies by 1.27. Steady has the sampled filter's figures: it is narrower, by 2 % for 5 Hz at 200 Hz.

The plain sum of the scale errors is zero, as for identical gyros it should. Where the gyros are not alike, a rate that
is smaller than its model expects looks like a scale error of the better ones. So in a recording at rest, which says
nothing of scale errors, they are held at zero.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

import numpy as np

from vgyro import engine as engines
from vgyro.fusion import design
from vgyro.fusion.types import ArrayRates, CannotRun, FilterParameters, Fused, cannot_run

INFERRED = (
    "all but that it is an EKF of several sensors; rate: integrated random walk of the configured bandwidth; biases: "
    "random walks of the measured RRW; scale errors: constant, of prior s.d. scale_sd, zero in recordings at rest; the "
    "sums of biases and of scale errors are zero, since no gyro tells the common part from the rate; diffuse start"
)
DIFFUSE = 100.0
"""Standard deviation of what is not known at the start, over that of the noise of a sample."""
HALF_POWER = math.sqrt(2.0 + math.sqrt(5.0))
"""Angular frequency at which the power gain is 1/2, over ω: the root of x⁴ - 4x² - 1."""


def natural_frequency(D: float, q: float) -> float:
    """ω = (q·D)^¼, rad/s.  D : information, Hz/(deg/s)²;  q : density of ẅ, deg²/s⁵"""
    frequency: float = (q * D) ** 0.25
    return frequency


def bandwidth(D: float, q: float) -> float:
    """-3 dB bandwidth of the steady continuous filter √(2 + √5)·(q·D)^¼/2π, Hz."""
    return HALF_POWER * natural_frequency(D, q) / (2.0 * math.pi)


def q_for_bandwidth(D: float, bandwidth_hz: float) -> float:
    """Density of ẅ that gives a bandwidth: (2π·BW)⁴/((2 + √5)²·D), deg²/s⁵."""
    return (2.0 * math.pi * bandwidth_hz / HALF_POWER) ** 4 / D


def drive(q: float, period: float) -> np.ndarray:
    """Process noise of (w, ẇ) over a sample period [2, 2]: q·[[T³/3, T²/2], [T²/2, T]]."""
    return q * np.array([[period**3 / 3.0, period**2 / 2.0], [period**2 / 2.0, period]])


@dataclass(frozen=True)
class Steady:
    """The steady sampled filter of w and ẇ: w += alpha·e, ẇ += beta/T·e for the innovation e.

    w/y = z(αz + β - α)/(z² - (2 - α - β)z + 1 - α). What it leaves out, 1 - w/y, is (1 - α)(z - 1)²/(…): the gain of a
    constant is 1 and the delay at low frequency 0.
    """

    alpha: float
    beta: float
    period: float

    @classmethod
    def of(cls, D: float, q: float, period: float) -> Steady:
        """By spectral factorisation: noise 1/(D·T) and ẅ of density q make innovations of the spectrum
        1/(D·T)·((1 - c)² + g(2 + c))/(1 - c)², g = q·D·T⁴/12, c = cos(2πfT); its zeros in the unit circle are the
        poles of the filter. With δ = c - 1 they are z = 1 + δ - √(δ(δ + 2)), δ² + gδ + 3g = 0.
        """
        g = q * D * period**4 / 12.0
        root = cmath.sqrt(g * g - 12.0 * g)
        ends = []
        for delta in ((-g + root) / 2.0, (-g - root) / 2.0):
            side = cmath.sqrt(delta * (delta + 2.0))
            ends.append(min(side - delta, -side - delta, key=lambda end: abs(1.0 - end)))
        product = (ends[0] * ends[1]).real
        return cls((ends[0] + ends[1]).real - product, product, period)

    @property
    def bandwidth_hz(self) -> float:
        """-3 dB bandwidth, Hz, NaN where there is none: |w/y|² = 1/2 is quadratic in v = 1 - cos(2πfT)."""
        a, b = self.alpha, self.beta
        square, linear = 4.0 * (1.0 - a), -2.0 * a * a + 6.0 * a * b - 4.0 * b
        v = 2.0 * b * b / (linear + math.sqrt(linear**2 + 4.0 * square * b * b))
        return math.nan if v > 2.0 else 2.0 * math.asin(math.sqrt(v / 2.0)) / (2.0 * math.pi * self.period)

    @property
    def noise_bandwidth_hz(self) -> float:
        """Noise-equivalent bandwidth, one-sided, Hz: variance of w over that of white samples, times 1/(2T)."""
        a, b = self.alpha, self.beta
        return (2.0 * a * a + 2.0 * b - 3.0 * a * b) / (a * (4.0 - 2.0 * a - b)) / (2.0 * self.period)


def stubberud_2008(array: ArrayRates, parameters: FilterParameters) -> Fused:
    """x = [w, ẇ, b_1..b_N, s_1..s_N], Σb = Σs = 0, in the style of Stubberud & Stubberud (2008).

    R from the ARW and the correlation; b walks by the RRW; s is constant, of prior s.d. `scale_sd` in motion and zero
    at rest; ẅ is white, with q_a from `bandwidth_hz` or, where `q` is given, from the bandwidth √(D·q)/2π that it gives
    to a random-walk filter. What is not known at the start has DIFFUSE times the standard deviation of a sample. After
    a gap w and ẇ start anew; b and s are kept, and b has walked on where the length of the gap is known.
    """
    noise = array.noise.with_arw(parameters.arw)
    walk = _walk(noise.rrw)
    with cannot_run():
        D = design.information(noise.R)
    bandwidth_hz = parameters.bandwidth_hz if parameters.q is None else design.bandwidth(D, parameters.q)
    q = q_for_bandwidth(D, bandwidth_hz)
    R, steps = noise.R / array.period, drive(q, array.period)
    run = engines.get(parameters.engine).adaptive.scale_bias_filter

    fused, unknown = np.empty(len(array.rate)), DIFFUSE**2 * float(np.diag(R).max())
    gyros, parts = array.rate.shape[1], array.stretches()
    state, scale_sd = np.zeros(2 + 2 * gyros), parameters.scale_sd if parameters.in_motion else 0.0
    variance = np.concatenate([np.zeros(2), np.full(gyros, unknown), np.full(gyros, scale_sd**2)])
    covariance, biases = np.diag(variance), range(2, 2 + gyros)
    for part, gap in zip(parts, _gaps(array, parts), strict=True):
        state[:2] = float(np.mean(array.rate[part.start], dtype=float)), 0.0
        covariance[:2] = covariance[:, :2] = 0.0
        covariance[0, 0], covariance[1, 1] = unknown, unknown * (2.0 * math.pi * bandwidth_hz) ** 2
        covariance[biases, biases] += walk * gap
        fused[part], state, covariance = run(
            array.rate[part], array.period, R, steps, walk * array.period, state, covariance
        )
    note = f"q_a = {q:.4g} deg²/s⁵, D = {D:.4g}; {_scales(state, covariance, parameters)}"
    steady = Steady.of(D, q, array.period)
    return Fused(fused, None, 1.0, steady.bandwidth_hz, steady.noise_bandwidth_hz, 0.0, note, passes=0)


def operations(gyros: int) -> float:
    """Floating-point operations a sample: N updates of 2N states, the linearisation, the prediction."""
    states = 2 * gyros
    update = 4 * states**2 + 8 * states + 4
    return float(gyros * update + 6 * gyros**2 + (gyros - 1) ** 2 + 5 * states)


def _walk(rrw: np.ndarray) -> np.ndarray:
    """K² [N], (deg/s)²/s."""
    unknown = np.flatnonzero(~np.isfinite(rrw))
    if len(unknown):
        which = ", ".join(str(index + 1) for index in unknown)
        raise CannotRun(f"no rate random walk was measured for gyro {which} of {len(rrw)}")
    return np.asarray(rrw, dtype=float) ** 2


def _gaps(array: ArrayRates, parts: list[slice]) -> list[float]:
    """Time without samples before each stretch, s; 0 where it is not known."""
    if array.stretch_time is None:
        return [0.0] * len(parts)
    lengths = [(part.stop - part.start) * array.period for part in parts]
    ends = array.stretch_time[:-1] + lengths[:-1]
    return [0.0, *np.maximum(array.stretch_time[1:] - ends, 0.0).tolist()]


def _scales(state: np.ndarray, covariance: np.ndarray, parameters: FilterParameters) -> str:
    if not parameters.in_motion:
        return "scale errors are held at zero: a recording at rest says nothing of them"
    scales = slice(2 + len(state[2:]) // 2, None)
    found = zip(state[scales], np.sqrt(np.maximum(np.diag(covariance)[scales], 0.0)), strict=True)
    sizes = ", ".join(f"{100 * scale:+.2f} ± {100 * sd:.2f}" for scale, sd in found)
    return f"scale errors at the end, less their mean, % (prior ± {100 * parameters.scale_sd:g}): {sizes}"
