"""What a perfect calibration of a twin would find: the figures of its noiseless transfer at the table's own rates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Bools, Floats
from vgyro.board import Board, Gyro
from vgyro.errors import DataError
from vgyro.simulate.motion import plateaus_of
from vgyro.simulate.transfer import Direction, Transfer, temperature_at, thermal_bias
from vgyro.simulate.twin import Twin, TwinRecording, temperature_of, truth_of
from vgyro.units import EARTH_RATE_DEG_H, deg_h, deg_s, earth_rate_deg_s, parts_per_million

FAST = 0.1  # of full scale


@dataclass(frozen=True)
class TruePoints:
    """Plateaus of one gyro, [P].

    rate : deg/s, the Earth's included;  output : without noise, deg/s, in counts `count`;  between : the same, half-way
    between the branches of the hysteresis, deg/s;  direction : 1 reached from below, -1 from above, 0 never changed
    """

    rate: np.ndarray
    output: np.ndarray
    count: np.ndarray
    between: np.ndarray
    direction: np.ndarray
    full_scale: float


def calibration_truth(twin: Twin, board: Board, recording: str) -> dict[str, dict[str, float]]:
    """Gyro of the axis that turns → figure → true value, for one calibration recording.

    scale (deg/s a count) and bias (counts): least-squares line of the counts over the rate, between the branches of
    the hysteresis. nonlinearity_full_scale, _rms, _reading (ppm): residuals of that line at the different rates,
    largest and r.m.s. over full scale, largest over the rate itself from a tenth of full scale on. asymmetry (ppm):
    slopes of the lines through the rates from 0 up and from 0 down, their difference over their mean. hysteresis (ppm
    of full scale): largest |output reached from below - from above| at one rate (NaN if none is met both ways).
    zero_shift (deg/h): last zero rate minus first. zero_offset (deg/h): output minus line at zero rate.
    scale_temperature (ppm/K): of the sensitivity, over that at
    reference_c. Flicker and random walk are noise here: they are left out.
    raises : DataError for a recording that is not on a rate table
    """
    spec = twin.recording(recording)
    axis = spec.axis or board.axes[0]
    return {gyro.name: _figures(true_points(twin, spec, gyro), twin, spec, gyro) for gyro in board.array(axis)}


def repeatability_truth(twin: Twin, board: Board, recordings: Sequence[str]) -> dict[str, dict[str, float]]:
    """Gyro → repeatability (ppm) and bias_repeatability (deg/h): s.d. over power cycles, n - 1 in the denominator."""
    cycles = [calibration_truth(twin, board, name) for name in recordings]
    found = {}
    for gyro in cycles[0]:
        sensitivity = np.array([1.0 / cycle[gyro]["scale"] for cycle in cycles])
        bias = np.array([cycle[gyro]["bias"] * cycle[gyro]["scale"] for cycle in cycles])
        found[gyro] = {
            "repeatability": parts_per_million(float(sensitivity.std(ddof=1) / sensitivity.mean())),
            "bias_repeatability": deg_h(float(bias.std(ddof=1))),
        }
    return found


def thermal_truth(twin: Twin, board: Board, recording: str) -> dict[str, dict[str, float]]:
    """Gyro → bias_temperature (deg/h/K) and self_heating (deg/h) of a recording.

    Slope of the least-squares line through the bias over the temperatures that the recording meets, each degree alike
    (NaN if it stays the same); bias once the self-heating has come to its end minus bias at the start.
    """
    spec = twin.recording(recording)
    thermal = temperature_of(twin, spec)
    met = temperature_at(thermal, np.arange(0.5, spec.duration)) - thermal.reference_c
    above = np.linspace(met.min(), met.max(), 1001)
    found = {}
    for gyro in board.gyros:
        truths = [truth_of(twin, spec, gyro.name)]
        begin = temperature_at(thermal, np.zeros(1)) - thermal.reference_c
        cold, settled = thermal_bias(truths, np.append(begin, begin + thermal.rise_k))[:, 0]
        slope = np.polyfit(above, thermal_bias(truths, above)[:, 0], 1)[0] if np.ptp(above) > 0 else np.nan
        found[gyro.name] = {"bias_temperature": deg_h(float(slope)), "self_heating": deg_h(float(settled - cold))}
    return found


def true_points(twin: Twin, spec: TwinRecording, gyro: Gyro) -> TruePoints:
    """The points that a calibration recording would give without noise.  raises : DataError"""
    plateaus = plateaus_of(spec.motion)
    if not plateaus:
        raise DataError(f"recording {spec.name!r} of twin {twin.name!r} is not on a rate table")
    truth, thermal = truth_of(twin, spec, gyro.name), temperature_of(twin, spec)
    table = np.array([plateau.rate for plateau in plateaus])
    temperature = temperature_at(thermal, np.array([(p.start + p.stop) / 2 for p in plateaus]))
    direction = Direction().next(np.concatenate([[0.0], table]))[1:]
    rate = table + (0.0 if twin.latitude_deg is None else earth_rate_deg_s(twin.latitude_deg))
    full_scale = gyro.range_deg_s or float(np.abs(table).max())
    transfer = Transfer([truth], [full_scale], thermal.reference_c)
    error, straight = (transfer.error(rate[:, None], way, temperature)[:, 0] for way in (direction, 0 * direction))
    bias = truth.bias_deg_s + thermal_bias([truth], temperature - thermal.reference_c)[:, 0]
    count = gyro.bias + gyro.sign * (1.0 + truth.scale_error) * (rate + error + bias) / gyro.scale
    return TruePoints(rate, rate + error + bias, count, rate + straight + bias, direction, full_scale)


def _figures(points: TruePoints, twin: Twin, spec: TwinRecording, gyro: Gyro) -> dict[str, float]:
    slope, offset = np.polyfit(points.rate, points.between, 1)
    residual = points.between / slope - points.rate - offset / slope
    once = np.unique(points.rate, return_index=True)[1]
    fast = np.abs(points.rate) >= FAST * points.full_scale
    truth = truth_of(twin, spec, gyro.name)
    ratios = {
        "nonlinearity_full_scale": np.abs(residual).max() / points.full_scale,
        "nonlinearity_reading": np.abs(residual[fast] / points.rate[fast]).max(initial=0.0),
        "nonlinearity_rms": np.sqrt(np.mean(residual[once] ** 2)) / points.full_scale,
        "asymmetry": _asymmetry(points),
        "hysteresis": _hysteresis(points) / points.full_scale,
    }
    zeros = points.output[_at_zero(points.rate)]
    return {
        "scale": gyro.scale / ((1.0 + truth.scale_error) * float(slope)),
        "bias": gyro.bias + gyro.sign * (1.0 + truth.scale_error) * float(offset) / gyro.scale,
        **{name: parts_per_million(float(ratio)) for name, ratio in ratios.items()},
        "zero_shift": deg_h(float(zeros[-1] - zeros[0])) if zeros.size > 1 else float("nan"),
        "zero_offset": deg_h(float(residual[_at_zero(points.rate)].mean())) if zeros.size else float("nan"),
        "scale_temperature": truth.scale_temperature_ppm_k,
    }


def _asymmetry(points: TruePoints) -> float:
    zero = _at_zero(points.rate)
    sides = ((points.rate > 0) | zero, (points.rate < 0) | zero)
    plus, minus = (np.polyfit(points.rate[side], points.between[side], 1)[0] for side in sides)
    asymmetry: float = (plus - minus) / ((plus + minus) / 2)
    return asymmetry


def _hysteresis(points: TruePoints) -> float:
    """deg/s"""
    widths = []
    for rate in np.unique(points.rate):
        up, down = (points.output[(points.rate == rate) & (points.direction == way)] for way in (1, -1))
        if up.size and down.size:
            widths.append(abs(float(up.mean() - down.mean())))
    return max(widths, default=float("nan"))


def _at_zero(rate: Floats) -> Bools:
    """The table stands: what is left is the Earth's rate."""
    return np.abs(rate) < 2 * deg_s(EARTH_RATE_DEG_H)
