"""Kalman filters of a scalar rate: Jiang 2012 (Markov and random walk), Xue 2012, Chang 2012.

One-sample convention. Jiang's discretisation (eq. 14) lets Z_k, held over the sample period, yield x_{k+1}. So it is
kept here: x starts at x_0 = u'Z_0, each Z_k yields x_{k+1}, and the row of sample k of the fused rate holds what Z_k
yields, as a board that sends a value for each sample does. For a slow motion that is T·e^(-sT)/(1 - e^(-sT)) late,
about 1/s - T/2; stamped with the next sample's time, as its index k + 1 says, it would be one period T later still.
"""

from __future__ import annotations

import math

import numpy as np

from vgyro.errors import DataError
from vgyro.fusion import design
from vgyro.fusion.array import ArrayRates, CannotRun, FilterParameters, Fused

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
    combined = array.rate @ u
    fused = np.concatenate([low_pass(combined[part], s, 1.0, array.period) for part in array.stretches()])
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
    combined = array.rate @ u
    fused = np.concatenate([_settling_low_pass(combined[part], D, q, array.period) for part in array.stretches()])
    return _described(fused, u, design.pole(D, q), 1.0, array.period, f"P0 = 1/(D·T), inferred; {ONE_SAMPLE}")


def low_pass(signal: np.ndarray, s: float, gain: float, period: float) -> np.ndarray:
    """First-order low-pass with a held input: y_k = e^(-sT)·y_{k-1} + (1 - e^(-sT))·gain·signal_k, y_{-1} = signal_0.

    signal : array [T];  s : pole, rad/s;  gain : for a constant;  period : T, s
    """
    from scipy.signal import lfilter

    keep = math.exp(-s * period)
    filtered, _ = lfilter([-math.expm1(-s * period) * gain], [1.0, -keep], signal, zi=[keep * signal[0]])
    return filtered


def _steady_state(array: ArrayRates, parameters: FilterParameters, tau: float) -> Fused:
    D, u = _array_information(array, parameters)
    q = _process_noise(D, parameters, tau)
    s, gain = design.pole(D, q, tau), design.dc_gain(D, q, tau)
    combined = array.rate @ u
    fused = np.concatenate([low_pass(combined[part], s, gain, array.period) for part in array.stretches()])
    return _described(fused, u, s, gain, array.period, f"q = {q:.4g} deg²/s³, D = {D:.4g}; {ONE_SAMPLE}")


def _settling_low_pass(signal: np.ndarray, D: float, q: float, period: float) -> np.ndarray:
    a = math.sqrt(D * q)
    steady, initial = math.sqrt(q / D), 1.0 / (D * period)
    c = (initial - steady) / (initial + steady)
    fused = np.empty(len(signal))
    x = signal[0]
    settling = min(len(signal), math.ceil(20.0 / (a * period)))
    fading = c * np.exp(-2.0 * a * period * np.arange(settling + 1))
    keep = math.exp(-a * period) * (1.0 - fading[:-1]) / (1.0 - fading[1:])
    for index in range(settling):
        x = keep[index] * x + (1.0 - keep[index]) * signal[index]
        fused[index] = x
    if settling < len(signal):
        rest = np.concatenate([[x], signal[settling:]])
        fused[settling:] = low_pass(rest, a, 1.0, period)[1:]
    return fused


def _array_information(array: ArrayRates, parameters: FilterParameters) -> tuple[float, np.ndarray]:
    R = array.noise.with_arw(parameters.arw).R
    try:
        return design.information(R), design.gain_direction(R)
    except DataError as error:
        raise CannotRun(error.what, remedy=error.remedy) from None


def _process_noise(D: float, parameters: FilterParameters, tau: float) -> float:
    if parameters.q is not None:
        return parameters.q
    try:
        return design.q_for_bandwidth(D, parameters.bandwidth_hz, tau)
    except DataError as error:
        raise CannotRun(error.what, error.where, error.remedy) from None


def _described(rate: np.ndarray, u: np.ndarray, s: float, gain: float, period: float, note: str) -> Fused:
    delay = period * math.exp(-s * period) / -math.expm1(-s * period)
    return Fused(rate, u, gain, s / (2.0 * math.pi), s / 4.0, delay, note)
