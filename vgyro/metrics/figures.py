"""Names, units and meaning of every figure in metrics.parquet."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from vgyro.figure import Figure, Flag


@dataclass(frozen=True)
class Reading:
    """A figure with its confidence limits (NaN where none can be given) and what to know before using it.

    flags : of FLAGS, what decides how it is used;  note : the same and more, in words
    """

    value: float
    low: float
    high: float
    note: str = ""
    flags: frozenset[Flag] = frozenset()


def without_interpolation(sigma: Reading, gain: float) -> Reading:
    """1σ of an interpolated series as it is without: over the root of what is left of the variance of its noise.

    For noise that is white; gain: of vgyro.alignment.noise_gain, 1 for a series that was not interpolated.
    """
    share = math.sqrt(gain)
    note = f"of samples before the interpolation that brought the gyro to the others' time, which left {gain:.3f} of it"
    joined = f"{sigma.note}; {note}" if sigma.note else note
    return replace(sigma, value=sigma.value / share, low=sigma.low / share, high=sigma.high / share, note=joined)


FIGURES: dict[str, Figure] = {
    "mean": Figure("Mean", "deg/s", "mean of the samples at rest; limits by moving-block bootstrap"),
    "sigma": Figure(
        "1σ", "deg/s", "standard deviation of the samples about their mean; limits by moving-block bootstrap"
    ),
    "missing": Figure("Missing", "1", "samples of the series that are lost, within its stretches"),
    "clipped": Figure("Clipped", "1", "samples left out because the gyro or its converter was at a limit"),
    "outliers": Figure("Outliers", "1", "single samples far off the noise, left out of Allan deviation and spectrum"),
    "sigma_equal": Figure(
        "1σ at equal bandwidth", "deg/s", "1σ after the low-pass that brings every series to one bandwidth, DC gain 1"
    ),
    "noise_density": Figure(
        "Noise density", "deg/s/√Hz", "floor of the Welch spectrum, TWO-sided (the one-sided density is √2 larger)"
    ),
    "arw_1s": Figure("ARW read at 1 s", "deg/√h", "60·σ(1 s), the papers' reading; a low-pass filter lowers it"),
    "arw": Figure("ARW fitted, N", "deg/√h", "white-noise term of the Allan curve, N = 60·N[deg/s/√Hz, two-sided]"),
    "density_ratio": Figure(
        "Density / N", "1", "noise density over N: 1 where white noise governs the band of the density and the fit"
    ),
    "quantisation": Figure("Quantisation, Q", "deg", "angle-noise term of the Allan curve, σ² = 3Q²/τ²; on evidence"),
    "rrw_read": Figure("RRW read", "deg/h/√h", "slope +1/2 line through the long end of the Allan curve, at τ = 3 s"),
    "rrw": Figure("RRW fitted, K", "deg/h/√h", "random-walk term of the Allan curve, K = 216000·K[deg/s/√s]"),
    "rate_ramp": Figure("Rate ramp, R", "deg/h²", "ramp term of the Allan curve, σ² = R²τ²/2; only on evidence"),
    "bias_drift": Figure("Bias drift, min σ", "deg/h", "lowest point of the Allan curve, as the papers read it"),
    "bias_drift_tau": Figure("τ of min σ", "s", "averaging time of the lowest point"),
    "bias_instability": Figure("Bias instability, B", "deg/h", "flicker term of the Allan curve: flat floor / 0.664"),
    "error_mean": Figure("Mean error", "deg/s", "mean of rate - reference"),
    "error_sigma": Figure("Error 1σ", "deg/s", "standard deviation of rate - reference"),
    "error_sigma_aligned": Figure(
        "Error 1σ, delay removed", "deg/s", "the same after shifting the reference by the delay"
    ),
    "error_sigma_scaled": Figure(
        "Error 1σ, delay and gain removed", "deg/s", "standard deviation about offset + gain · delayed reference"
    ),
    "nees": Figure(
        "NEES", "1", "mean of (error / posterior s.d.)²: 1 where that s.d. is honest, above 1 where it is too small"
    ),
    "amplitude": Figure(
        "Amplitude", "deg/s", "gain times √2 times the r.m.s. of the reference: a sinusoid's amplitude"
    ),
    "phase": Figure("Phase", "deg", "phase of a sinusoid against the reference; negative: the rate lags"),
    "angle_drift_60s": Figure(
        "Angle drift in 60 s", "deg", "r.m.s. over the recording of the error integrated over 60 s, its mean removed"
    ),
    "angle_bound_60s": Figure(
        "Angle drift in 60 s, bound", "deg", "1σ that N, B and K imply: integrated white noise and random walk"
    ),
    "delay": Figure("Delay", "s", "shift of the reference that fits the rate best; positive: the rate lags"),
    "if_mean": Figure("IF of mean", "1", "mean of |mean| over the single gyros / |mean| of the virtual gyro"),
    "if_sigma": Figure("IF of 1σ", "1", "mean of 1σ over the single gyros / 1σ of the virtual gyro"),
    "if_sigma_equal": Figure(
        "IF of 1σ at equal bandwidth", "1", "mean of 1σ over the single gyros / 1σ of the virtual gyro, both low-passed"
    ),
    "if_arw": Figure("IF of N", "1", "mean of N over the single gyros / N of the virtual gyro"),
    "if_arw_1s": Figure("IF of ARW at 1 s", "1", "mean of σ(1 s) over the single gyros / σ(1 s) of the virtual gyro"),
    "if_bias_drift": Figure("IF of bias drift", "1", "mean of min σ over the single gyros / min σ of the virtual gyro"),
}
