"""Chang et al. 2008, level 1: biases and rate are random walks, estimated together."""

from __future__ import annotations

import math

import numpy as np

from vgyro.fusion import design
from vgyro.fusion.papers.decoupled_walk import Modes, estimate, modes, walk_factor
from vgyro.fusion.papers.decoupled_walk import operations as operations_of_modes
from vgyro.fusion.types import ArrayRates, FilterParameters, Fused, cannot_run

SOURCE = "Chang et al. (2008), Sensors 8, 2886-2899, level 1"
INFERRED = (
    "q of the rate from the bandwidth of config; the random walks are correlated as the white noise is; the covariance "
    "at the start is without bound in the proportions of the walks, so that the common part, which biases and rate "
    "share, is divided between them as their random walks are; level 2 is left out"
)
LEVEL_2 = "level 2 needs three axes, accelerometers and magnetometers: not run"
LOWEST_HZ = 1e-9
ROUNDING = 1e-12


def chang_2008(array: ArrayRates, parameters: FilterParameters, start_s: float = math.inf) -> Fused:
    """Kalman filter of x = [b_1 … b_N, w]: y = 1·w + b + n, b and w random walks.

    Each sample: P += diag(Q, q)·T, then the update with H = [I, 1] and R_d = R/T; w after the update.
    Q = K²·correlation;  q : from the options, or from the bandwidth (design.q_for_bandwidth)
    start_s : P_0 = diag(Q, q)·start_s; infinite: nothing is known of the start
    raises  : CannotRun if R is not positive definite or a random walk is not known

    What moves b by c·1 and w by -c is not seen: along it P grows without bound, whatever the start. The gain stays
    finite, for P_0 has the proportions of the walks: of the sum 1·w + b, which is seen, w then has the share
    q·1'(Q + q·11')⁻¹ at every sample. So a constant rate passes with the gain qE/(1 + qE), E = 1'Q⁻¹1: a little is
    taken for a bias. Any other P_0 would leave more or less of the first sample in w for ever.
    In the style of Chang et al. (2008), Sensors 8(4), 2886-2899, whose second level needs three axes.
    """
    q, found = rate_modes(array, parameters)
    rate = estimate(array, np.zeros(array.rate.shape[1]), found, parameters.engine, start_s)
    return _described(rate, found, q, array)


def rate_modes(array: ArrayRates, parameters: FilterParameters) -> tuple[float, Modes]:
    """q, deg²/s³, and the modes of 1·w + b, whose output is w.  raises : as chang_2008"""
    noise = array.noise.with_arw(parameters.arw)
    with cannot_run():
        D = design.information(noise.R)
    q = design.q_for_bandwidth(D, parameters.bandwidth_hz) if parameters.q is None else parameters.q
    gyros = len(noise.arw)
    steps = np.column_stack([walk_factor(noise), np.full(gyros, math.sqrt(q))]) * math.sqrt(array.period)
    output = np.zeros(gyros + 1)
    output[-1] = math.sqrt(q * array.period)
    return q, modes(noise.R / array.period, steps, output)


def operations(gyros: int) -> float:
    """Floating-point operations a sample."""
    return operations_of_modes(gyros, gyros)


def _described(rate: np.ndarray, found: Modes, q: float, array: ArrayRates) -> Fused:
    """The response of the settled filter: a sum of first-order low-passes, Σ a_k·p_k/(1 - (1 - p_k)/z)."""
    slow = found.direction @ found.share
    height, gain = found.share * found.direction.sum(axis=0), found.gain
    dc, keep = float(height.sum()), 1.0 - gain
    pairs = np.outer(height * gain, height * gain) / (1.0 - np.outer(keep, keep))
    noise_bandwidth = array.rate_hz / 2.0 * float(pairs.sum()) / dc**2
    delay = array.period * float(np.sum(height * keep / gain)) / dc
    bandwidth = _bandwidth(height, gain, array.rate_hz)
    lost = f" - {1.0 - dc:.2g}" if 1.0 - dc > ROUNDING else ""
    notes = [f"q = {q:.4g} deg²/s³", f"gain for a constant rate 1{lost}", LEVEL_2, array.noise.rrw_note]
    note = "; ".join(text for text in notes if text)
    return Fused(rate, slow / dc, dc, bandwidth, noise_bandwidth, delay, note)


def _bandwidth(height: np.ndarray, gain: np.ndarray, rate_hz: float) -> float:
    """-3 dB bandwidth of the sum of low-passes, Hz; NaN if it is above half the sample rate."""
    from scipy.optimize import brentq

    def excess(log_hz: float) -> float:
        turn = np.exp(-2j * math.pi * math.exp(log_hz) / rate_hz)
        return float(abs(np.sum(height * gain / (1.0 - (1.0 - gain) * turn))) ** 2 - height.sum() ** 2 / 2.0)

    low, high = math.log(LOWEST_HZ), math.log(rate_hz / 2.0)
    return math.nan if excess(high) > 0 else math.exp(brentq(excess, low, high, xtol=1e-12))
