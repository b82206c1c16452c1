"""Names, units and meaning of every figure in metrics.parquet."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Figure:
    """title : for people;  unit : of value, low and high;  meaning : definition and convention"""

    title: str
    unit: str
    meaning: str


@dataclass(frozen=True)
class Reading:
    """A figure with its confidence limits (NaN where none can be given) and what to know before using it."""

    value: float
    low: float
    high: float
    note: str = ""


FIGURES: dict[str, Figure] = {
    "mean": Figure("Mean", "deg/s", "mean of the samples at rest; limits by moving-block bootstrap"),
    "sigma": Figure(
        "1σ", "deg/s", "standard deviation of the samples about their mean; limits by moving-block bootstrap"
    ),
    "noise_density": Figure(
        "Noise density", "deg/s/√Hz", "floor of the Welch spectrum, TWO-sided (the one-sided density is √2 larger)"
    ),
    "arw_1s": Figure("ARW read at 1 s", "deg/√h", "60·σ(1 s), the papers' reading; a low-pass filter lowers it"),
    "arw": Figure("ARW fitted, N", "deg/√h", "white-noise term of the Allan curve, N = 60·N[deg/s/√Hz, two-sided]"),
    "rrw_read": Figure("RRW read", "deg/h/√h", "slope +1/2 line through the long end of the Allan curve, at τ = 3 s"),
    "rrw": Figure("RRW fitted, K", "deg/h/√h", "random-walk term of the Allan curve, K = 216000·K[deg/s/√s]"),
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
    "amplitude": Figure(
        "Amplitude", "deg/s", "gain times √2 times the r.m.s. of the reference: a sinusoid's amplitude"
    ),
    "delay": Figure("Delay", "s", "shift of the reference that fits the rate best; positive: the rate lags"),
    "if_mean": Figure("IF of mean", "1", "mean of |mean| over the single gyros / |mean| of the virtual gyro"),
    "if_sigma": Figure("IF of 1σ", "1", "mean of 1σ over the single gyros / 1σ of the virtual gyro"),
    "if_arw_1s": Figure("IF of ARW at 1 s", "1", "mean of σ(1 s) over the single gyros / σ(1 s) of the virtual gyro"),
    "if_bias_drift": Figure("IF of bias drift", "1", "mean of min σ over the single gyros / min σ of the virtual gyro"),
}
