"""Kalman filters of a scalar rate: Jiang 2012 (Markov and random walk), Xue 2012, Chang 2012.

One-sample convention. Jiang's discretisation (eq. 14) lets Z_k, held over the sample period, yield x_{k+1}. So it is
kept here: x starts at x_0 = u'Z_0, each Z_k yields x_{k+1}, and the row of sample k of the fused rate holds what Z_k
yields, as a board that sends a value for each sample does. For a slow motion that is T·e^(-sT)/(1 - e^(-sT)) late,
about 1/s - T/2; stamped with the next sample's time, as its index k + 1 says, it would be one period T later still.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from vgyro import engine as engines
from vgyro.fusion import design
from vgyro.fusion.blocks import combined
from vgyro.fusion.types import ArrayRates, FilterParameters, Fused, cannot_run

ONE_SAMPLE = "row k holds x(k+1), which Z(k) yields (eq. 14)"


def jiang_markov(array: ArrayRates, parameters: FilterParameters) -> Fused:
    """Steady-state Kalman filter of a first-order Markov rate.

    s = √(1/τ² + Dq), P∞ = (s - 1/τ)/D, K∞ = P∞·1'R⁻¹, A = -s,
    x_{k+1} = e^(AT)·x_k + A⁻¹(e^(AT) - 1)·K∞·Z_k.  Restarts in each gap-free stretch.
    Jiang et al. (2012), eq. 11-14. The gain for a constant rate is 1 - 1/(τs), not 1.
    """
    return _steady_state(array, parameters, parameters.tau_s)


def jiang_random_walk(array: ArrayRates, parameters: FilterParameters) -> Fused:
    """The same for a rate that is a random walk: 1/τ → 0. Jiang et al. (2012), eq. 14, 19, 20."""
    return _steady_state(array, parameters, math.inf)


def chang_2012(array: ArrayRates, parameters: FilterParameters) -> Fused:
    """Random-walk filter whose q is chosen from the bandwidth: √q = 2π·BW/√D; a `q` in the options has no say.

    Amplitude loss 1 - 1/√(1 + (f/BW)²) and phase lag atan(f/BW) at the frequency f. Chang et al. (2012).
    """
    D, u = _array_information(array, parameters)
    s = design.pole(D, design.q_for_bandwidth(D, parameters.bandwidth_hz))
    fused = _low_passed(array, parameters, u, s, 1.0)
    loss, lag = design.attenuation(0.1)
    note = f"q from the bandwidth; at BW/10 amplitude loss {loss:.2%} and lag {math.degrees(lag):.1f}°; {ONE_SAMPLE}"
    return _described(fused, u, s, 1.0, array.period, note)


def xue_2012(array: ArrayRates, parameters: FilterParameters) -> Fused:
    """Random-walk filter with the analytic covariance of the time since its start.

    a = √(Dq), P∞ = √(q/D), c = (P0 - P∞)/(P0 + P∞), P(t) = P∞(1 + c·e^(-2at))/(1 - c·e^(-2at)), K = P(t)·1'R⁻¹
    (Xue et al. 2012). P0 is the variance of the first sample's combination, 1/(D·T). Samples are held over their period
    and the gain is integrated over it in closed form: with G(t) = e^(at) - c·e^(-at), x_{k+1} = φ·x_k + (1 - φ)·u'Z_k,
    φ = G(t_k)/G(t_{k+1}). Once c·e^(-2at) is gone it is jiang_random_walk.
    """
    D, u = _array_information(array, parameters)
    q = _process_noise(D, parameters, math.inf)
    a, steady, initial = design.pole(D, q), design.steady_variance(D, q), 1.0 / (D * array.period)
    keep, c = math.exp(-a * array.period), (initial - steady) / (initial + steady)
    settle = engines.get(parameters.engine).kalman.settling_filter
    fused = _by_stretch(array, u, lambda signal: settle(signal, keep, c, signal[0]))
    return _described(fused, u, a, 1.0, array.period, f"P0 = 1/(D·T), inferred; {ONE_SAMPLE}")


def _steady_state(array: ArrayRates, parameters: FilterParameters, tau: float) -> Fused:
    D, u = _array_information(array, parameters)
    q = _process_noise(D, parameters, tau)
    s, gain = design.pole(D, q, tau), design.dc_gain(D, q, tau)
    fused = _low_passed(array, parameters, u, s, gain)
    return _described(fused, u, s, gain, array.period, f"q = {q:.4g} deg²/s³, D = {D:.4g}; {ONE_SAMPLE}")


def _low_passed(array: ArrayRates, parameters: FilterParameters, u: np.ndarray, s: float, gain: float) -> np.ndarray:
    """u'Z through a first-order low-pass with a held input: y_k = e^(-sT)·y_{k-1} + (1 - e^(-sT))·gain·u'Z_k [T].

    u : [N];  s : pole, rad/s;  gain : for a constant.  y_{-1} = u'Z_0 in each gap-free stretch.
    """
    keep, driven = math.exp(-s * array.period), -math.expm1(-s * array.period) * gain
    low_pass = engines.get(parameters.engine).kalman.low_pass
    return _by_stretch(array, u, lambda signal: low_pass(signal, keep, driven, signal[0]))


def _by_stretch(array: ArrayRates, u: np.ndarray, run: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """run(u'Z) in each gap-free stretch [T]."""
    fused = combined(array.rate, u)
    for part in array.stretches():
        fused[part] = run(fused[part])
    return fused


def _array_information(array: ArrayRates, parameters: FilterParameters) -> tuple[float, np.ndarray]:
    R = array.noise.with_arw(parameters.arw).R
    with cannot_run():
        return design.information(R), design.gain_direction(R)


def _process_noise(D: float, parameters: FilterParameters, tau: float) -> float:
    if parameters.q is not None:
        return parameters.q
    with cannot_run():
        return design.q_for_bandwidth(D, parameters.bandwidth_hz, tau)


def _described(rate: np.ndarray, u: np.ndarray, s: float, gain: float, period: float, note: str) -> Fused:
    delay = period * math.exp(-s * period) / -math.expm1(-s * period)
    return Fused(rate, u, gain, s / (2.0 * math.pi), s / 4.0, delay, note)
