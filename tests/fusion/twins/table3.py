"""The figures of the two papers' tables, of the error of one fused rate."""

from __future__ import annotations

import math

import numpy as np
from harness import Case

from vgyro.fusion import Fused
from vgyro.metrics import Equaliser, LowPass, allan_deviation, dynamic_errors, noise_coefficients, read_curve
from vgyro.metrics.static.readings import bias_drift
from vgyro.units import arw_deg_rt_h

LIU = ("mean", "sigma", "arw", "bias_drift")
JIANG = ("sigma", "aligned", "amplitude", "delay")


def liu(one: Case, fused: Fused) -> dict[str, float]:
    """Of the second means of rate - truth: mean and 1σ (deg/s), ARW fitted (deg/√h), bias drift (deg/h).

    ARW is of the rate itself, with the low-pass that it went through taken off, so that a smoother gains nothing by its
    bandwidth.
    """
    error = fused.rate - one.truth
    size = round(one.array.rate_hz)
    means = error[: len(error) // size * size].reshape(-1, size).mean(axis=1)
    low_pass = low_pass_of(fused)
    whole = allan_deviation(error, one.array.rate_hz)
    found = noise_coefficients(whole, low_pass.bandwidth_hz, low_pass.dc_gain, 50, passes=low_pass.passes)
    return {
        "mean": float(means.mean()),
        "sigma": float(means.std(ddof=1)),
        "arw": arw_deg_rt_h(found.N.value),
        "bias_drift": bias_drift(allan_deviation(means, 1.0))[0].value,
    }


def low_pass_of(fused: Fused) -> LowPass:
    """What a method does to a series, as the measure stage sees it."""
    limit = None if math.isnan(fused.bandwidth_hz) else fused.bandwidth_hz
    return LowPass(limit, 1.0 if math.isnan(fused.dc_gain) else fused.dc_gain, fused.passes)


def comparable(fused: Fused) -> bool:
    """Is its band full, or limited by a first-order low-pass that is known?"""
    return math.isfinite(fused.dc_gain) and not low_pass_of(fused).other_shape


def jiang_static(one: Case, fused: Fused, bandwidth_hz: float) -> dict[str, float]:
    """1σ at the common bandwidth (deg/s), ARW read at 1 s (deg/√h) and bias drift (deg/h) of the rate as it is."""
    curve = allan_deviation(fused.rate, one.array.rate_hz)
    equaliser = Equaliser.of(bandwidth_hz, one.array.rate_hz, one.array.segment, back=True)
    return {
        "sigma_equal": float(equaliser.apply(fused.rate, low_pass_of(fused)).std(ddof=1)),
        "arw_1s": arw_deg_rt_h(read_curve(curve, 1.0)[0]),
        "bias_drift": bias_drift(curve)[0].value,
    }


def jiang_dynamic(one: Case, fused: Fused, seen: bool = False) -> dict[str, float]:
    """1σ of rate - truth, the same with the delay removed (deg/s), amplitude over the true one, delay (s).

    seen : against the rate behind the sensors' pole
    """
    truth = one.seen if seen else one.truth
    found = dynamic_errors(fused.rate, truth, one.array.rate_hz, one.array.segment)
    return {
        "sigma": found.error_sigma,
        "aligned": found.error_sigma_aligned,
        "amplitude": found.gain,
        "delay": found.delay,
    }


def rms(values: list[float]) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))
