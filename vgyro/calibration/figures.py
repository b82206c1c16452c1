"""Names, units and meaning of the figures of a calibration, and what a test says about one of them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from vgyro.figure import Figure

VALUE = "value"
BELOW = "below the floor"
MISSING = "not measured"


@dataclass(frozen=True)
class Finding:
    """What a test says of one figure, in the figure's unit; NaN where it says nothing.

    value, low, high : estimate and confidence limits; no value unless `state` is VALUE, but the limits stay: those of a
                       figure with a sign hold 0 then, and `high` is the upper limit of one without
    floor            : what a gyro without the effect shows in half of such tests
    state            : VALUE, BELOW (the test does not show the effect) or MISSING
    """

    value: float
    low: float
    high: float
    floor: float
    state: str
    note: str = ""


FIGURES: dict[str, Figure] = {
    "nonlinearity_full_scale": Figure(
        "Nonlinearity over full scale", "ppm", "largest |output - straight line| over full scale, noise taken off"
    ),
    "nonlinearity_reading": Figure(
        "Nonlinearity over reading",
        "ppm",
        "largest |output - straight line| over |rate|, at rates of at least a tenth of full scale, noise taken off",
    ),
    "nonlinearity_rms": Figure(
        "Nonlinearity, r.m.s.",
        "ppm",
        "r.m.s. of output - straight line over the rates, over full scale, noise taken off",
    ),
    "asymmetry": Figure(
        "Asymmetry", "ppm", "(S⁺ - S⁻) / S: slopes of the rates from 0 up and from 0 down, over the mean of the two"
    ),
    "hysteresis": Figure(
        "Hysteresis", "ppm", "largest |output reached from below - from above| at equal rate, over full scale"
    ),
    "repeatability": Figure(
        "Repeatability of the scale factor", "ppm", "σ(S_i) / mean S over the power cycles, noise of each S_i taken off"
    ),
    "bias_repeatability": Figure(
        "Repeatability of the bias", "deg/h", "σ of the bias over the power cycles, noise of each taken off"
    ),
    "zero_shift": Figure("Zero shift", "deg/h", "output at zero rate after the test minus before it"),
    "zero_offset": Figure(
        "Output at zero rate", "deg/h", "output at zero rate minus the straight line's: what its bend makes of rest"
    ),
    "scale_temperature": Figure(
        "Scale factor against temperature", "ppm/K", "slope of S over S, from tests at different temperatures"
    ),
    "bias_temperature": Figure(
        "Bias against temperature", "deg/h/K", "slope of the straight line through the bias over the range measured"
    ),
    "self_heating": Figure(
        "Self-heating", "deg/h", "settled bias minus bias at switch-on, of an exponential approach at rest"
    ),
    "cross_axis": Figure("Cross-axis", "%", "response to rotation about another axis than its own"),
}


def not_measured(note: str) -> Finding:
    """A figure that the recordings cannot give, and why."""
    return Finding(math.nan, math.nan, math.nan, math.nan, MISSING, note)


def signed(value: float, half: float, floor: float, note: str = "") -> Finding:
    """A figure with a sign: shown where value ± half does not hold 0."""
    shown = abs(value) > half
    return Finding(
        value if shown else math.nan, value - half, value + half, floor, VALUE if shown else BELOW, note
    )  # fmt: skip


def unsigned(value: float, low: float, high: float, floor: float, stands_out: bool = True, note: str = "") -> Finding:
    """A size: shown where its lower limit is above 0, its value above the floor, and the figure as seen stands out."""
    shown = low > 0 and value > floor and stands_out
    return Finding(value if shown else math.nan, low if shown else 0.0, high, floor, VALUE if shown else BELOW, note)


def figure_record(name: str, finding: Finding) -> dict[str, Any]:
    """The finding as a JSON-able mapping, null for NaN."""
    numbers = {key: getattr(finding, key) for key in ("value", "low", "high", "floor")}
    return {
        **{key: float(number) if math.isfinite(number) else None for key, number in numbers.items()},
        "unit": FIGURES[name].unit,
        "state": finding.state,
        "note": finding.note,
    }
