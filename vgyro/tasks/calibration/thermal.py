"""What the temperature does to a gyro, from all recordings: bias, scale factor, self-heating; what to compensate."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vgyro.board import Board, Gyro
from vgyro.calibration import (
    BiasTemperature,
    Compensation,
    Finding,
    ScaleFit,
    bias_repeatability,
    bias_temperature,
    fit_bias_temperature,
    not_measured,
    scale_repeatability,
    scale_temperature,
    self_heating,
    thermal_points,
    to_rates,
)
from vgyro.calibration.figures import VALUE
from vgyro.config import CalibrationOptions, RestOptions
from vgyro.errors import TooShort
from vgyro.storage.tables import read_column
from vgyro.tasks.calibration.tables import RecordingSource, TableTest
from vgyro.tasks.rates.block_means import FrameMeans, between, block_means, thermometer_of
from vgyro.tasks.rates.moves import moves_of
from vgyro.units import parts_per_million

SAME_TEMPERATURE = 2.0  # K
FEWEST_ALIKE = 3
FEWEST_TEMPERATURES = 4


@dataclass(frozen=True)
class Cycles:
    """Fits of one gyro in the R tests on a rate table in which it was measured, one for each time it was switched on.

    scale [R], deg/s a count; bias [R], counts; temperature [R], °C, NaN without a thermometer; _error : standard errors
    """

    recordings: tuple[str, ...]
    scale: np.ndarray
    scale_error: np.ndarray
    bias: np.ndarray
    bias_error: np.ndarray
    temperature: np.ndarray

    @classmethod
    def of(cls, tests: Sequence[TableTest], gyro: str) -> Cycles:
        """Of the tests about the gyro's axis."""
        fits = {test.name: fit for test in tests for fit in test.fits if fit.gyro == gyro and fit.source == "measured"}
        columns = [
            np.array([getattr(fit, key) for fit in fits.values()], dtype=float)
            for key in ("scale", "scale_error", "bias", "bias_error", "temperature_c")
        ]
        return cls(tuple(fits), *columns)

    def alike(self) -> Cycles:
        """Those within 2 K of the first, if there are 3; else all."""
        near = np.abs(self.temperature - self.temperature[:1]) <= SAME_TEMPERATURE
        if near.sum() < FEWEST_ALIKE:
            return self
        names = tuple(name for name, kept in zip(self.recordings, near, strict=True) if kept)
        return Cycles(
            names, self.scale[near], self.scale_error[near], self.bias[near], self.bias_error[near],
            self.temperature[near],
        )  # fmt: skip

    @property
    def celsius(self) -> np.ndarray | None:
        """Temperature of each; None without a thermometer."""
        return self.temperature if np.isfinite(self.temperature).all() else None


@dataclass(frozen=True)
class Rests:
    """Means of one second from the recordings at rest: of the first thermal one and of the first static one.

    Either is None where there is no such recording.
    """

    thermal: tuple[str, FrameMeans] | None
    static: tuple[str, FrameMeans] | None


@dataclass(frozen=True)
class Thermal:
    """What the temperature does to one gyro.

    figures : by name;  compensation : what may be taken off, None: nothing known;  fit : of the bias
    recordings : those that the compensation comes from;  points : temperature °C, bias in counts, recording
    """

    figures: dict[str, Finding]
    compensation: Compensation | None = None
    fit: BiasTemperature | None = None
    recordings: tuple[str, ...] = ()
    points: tuple[tuple[float, float, str], ...] = ()
    note: str = ""


def read_rests(sources: Sequence[RecordingSource], board: Board, options: RestOptions) -> Rests:
    """Means of one second of everything that the recordings at rest say, without what moves in them.

    options : how motion is told from rest, in a recording whose rests are not listed
    """
    found: dict[str, tuple[str, FrameMeans]] = {}
    fields = [gyro.field for gyro in board.gyros] + [thermometer.field for thermometer in board.temperatures]
    for kind in ("thermal", "static"):
        source = next((source for source in sources if source.recording.kind == kind), None)
        if source is not None:
            rate_hz = source.rate_hz
            rails = {} if board.adc is None else {g.field: (board.adc.low, board.adc.high) for g in board.gyros}
            means = block_means(source.frames, fields, max(1.0, 1.0 / rate_hz), rails)
            for thermometer in board.temperatures:
                means.values[thermometer.field] = between(means.time, means.values[thermometer.field])
            found[kind] = source.recording.name, _at_rest(means, source, board, rate_hz, options)
    return Rests(found.get("thermal"), found.get("static"))


def _at_rest(
    means: FrameMeans, source: RecordingSource, board: Board, rate_hz: float, options: RestOptions
) -> FrameMeans:
    rest = source.recording.rest
    if rest == "auto":
        time = read_column(source.frames, "time")
        moves = moves_of(source.frames, source.recording, board.gyros, time, rate_hz, options)
        if moves is None:
            return means
        inside = moves.still[np.minimum(np.searchsorted(time, means.time), len(time) - 1)]
    else:
        inside = np.zeros(means.time.size, dtype=bool)
        for start, stop in rest:
            inside |= (means.time >= start) & (means.time <= stop)
    values = {name: column[inside] for name, column in means.values.items()}
    return FrameMeans(means.seconds, means.time[inside], means.segment[inside], values)


def thermal_of(gyro: Gyro, board: Board, main: ScaleFit, tests: Sequence[TableTest], rests: Rests,
               options: CalibrationOptions) -> Thermal:  # fmt: skip
    """Everything of one gyro.  main : the fit whose scale and bias are used"""
    cycles = Cycles.of(tests, gyro.name)
    figures = {
        **_repeatability(cycles, options.confidence),
        "self_heating": _self_heating(gyro, main, rests, options.confidence),
    }
    if thermometer_of(board, gyro.name) is None:
        nothing = not_measured("no thermometer")
        return Thermal({**figures, "scale_temperature": nothing, "bias_temperature": nothing})
    slope = not_measured("fewer than 2 tests on a rate table")
    if len(cycles.recordings) > 1 and cycles.celsius is not None:
        slope = scale_temperature(cycles.temperature, cycles.scale, cycles.scale_error, options.confidence)
    figures["scale_temperature"] = slope
    try:
        # The scale was found at this temperature, so its own slope must change nothing there.
        at = main.temperature_c if math.isfinite(main.temperature_c) else None
        fit, points, recordings = _bias_fit(gyro, board, cycles, rests, options.confidence, at)
    except TooShort as error:
        figures["bias_temperature"] = not_measured(error.what)
        return _without_bias(figures, slope, main, cycles)
    figures["bias_temperature"] = bias_temperature(fit, main.scale, gyro.sign)
    constant, first, second, third = map(float, fit.coefficients)
    bias = (constant, first, second, third)
    shape = Compensation(fit.reference_c, fit.low_c, fit.high_c, _applied_slope(slope), bias)
    sources = tuple(dict.fromkeys([*recordings, *(cycles.recordings if _shown(slope) else ())]))
    return Thermal(figures, shape.anchored(main.bias), fit, sources, points, fit.note)


def _shown(slope: Finding) -> bool:
    """Is there a slope of the scale factor?  Two temperatures alone give one without limits: that shows nothing."""
    return slope.state == VALUE and math.isfinite(slope.low)


def _applied_slope(slope: Finding) -> float:
    """1/K, of S; nothing where it is not shown."""
    return slope.value / parts_per_million(1.0) if _shown(slope) else 0.0


def _without_bias(figures: dict[str, Finding], slope: Finding, main: ScaleFit, cycles: Cycles) -> Thermal:
    if not _shown(slope):
        return Thermal(figures)
    low, high = float(cycles.temperature.min()), float(cycles.temperature.max())
    compensation = Compensation(main.temperature_c, low, high, _applied_slope(slope), (main.bias, 0.0, 0.0, 0.0))
    return Thermal(figures, compensation, recordings=cycles.recordings, note="scale alone")


def _repeatability(cycles: Cycles, confidence: float) -> dict[str, Finding]:
    if len(cycles.recordings) < 2:
        nothing = not_measured("fewer than 2 tests on a rate table")
        return {"repeatability": nothing, "bias_repeatability": nothing}
    near = cycles.alike()
    found = {
        "repeatability": scale_repeatability(near.scale, near.scale_error, near.celsius, confidence),
        "bias_repeatability": bias_repeatability(
            near.bias, near.bias_error, float(near.scale.mean()), near.celsius, confidence
        ),
    }
    words = ", ".join(near.recordings)
    return {name: replace(one, note="; ".join(filter(None, [one.note, words]))) for name, one in found.items()}


def _self_heating(gyro: Gyro, main: ScaleFit, rests: Rests, confidence: float) -> Finding:
    if rests.static is None:
        return not_measured("no static recording that can be used")
    name, means = rests.static
    counts = means.values[gyro.field]
    known = np.isfinite(counts)
    rate = to_rates(counts[known], gyro.sign, main.scale, main.bias)
    try:
        found = self_heating(rate, 1.0 / means.seconds, means.segment[known], confidence)
    except TooShort as error:
        return not_measured(f"{name}: {error.what}")
    return replace(found, note="; ".join(filter(None, [found.note, f"from {name}"])))


Points = tuple[tuple[float, float, str], ...]


def _bias_fit(
    gyro: Gyro, board: Board, cycles: Cycles, rests: Rests, confidence: float, reference_c: float | None
) -> tuple[BiasTemperature, Points, tuple[str, ...]]:
    """Bias against temperature from a thermal recording, else from the tests.  raises : TooShort"""
    thermometer = thermometer_of(board, gyro.name)
    assert thermometer is not None
    problem = None
    if rests.thermal is not None:
        name, means = rests.thermal
        counts = means.values[gyro.field]
        known = np.isfinite(counts)
        celsius = means.values[thermometer.field][known] * thermometer.scale + thermometer.offset
        try:
            blocks = thermal_points(counts[known, None], celsius, 1.0 / means.seconds, None, means.segment[known])
            warmth, bias = blocks.temperature[:, 0], blocks.counts[:, 0]
            fit = fit_bias_temperature(warmth, bias, blocks.time, None, confidence, reference_c)
        except TooShort as error:
            problem = error
        else:
            return fit, tuple((float(t), float(b), name) for t, b in zip(warmth, bias, strict=True)), (name,)
    if cycles.celsius is None or len(cycles.recordings) < FEWEST_TEMPERATURES:
        words = f"no thermal recording, and fewer than {FEWEST_TEMPERATURES} tests on a rate table"
        raise problem or TooShort(words)
    fit = fit_bias_temperature(cycles.temperature, cycles.bias, None, cycles.bias_error, confidence, reference_c)
    rows = zip(cycles.temperature, cycles.bias, cycles.recordings, strict=True)
    return fit, tuple((float(t), float(b), name) for t, b, name in rows), cycles.recordings


def temperature_record(thermal: Thermal, sensor: str | None, applied: bool) -> dict[str, Any] | None:
    """The entry "temperature" of a gyro in calibration.json; None where nothing is known."""
    compensation = thermal.compensation
    if compensation is None or sensor is None:
        return None
    in_sample = f"figures of {', '.join(thermal.recordings)} after compensation are in-sample"
    covariance = thermal.fit.covariance.tolist() if thermal.fit is not None else np.zeros((4, 4)).tolist()
    return {
        "sensor": sensor,
        "reference_c": compensation.reference_c,
        "low_c": compensation.low_c,
        "high_c": compensation.high_c,
        "scale_slope": compensation.scale_slope,
        "bias": list(compensation.bias),
        "bias_covariance": covariance,
        "applied": applied,
        "recordings": list(thermal.recordings),
        "note": "; ".join(filter(None, [thermal.note, in_sample])),
        "points": [{"temperature_c": t, "bias": b, "recording": name} for t, b, name in thermal.points],
    }


def worth_it(thermal: Thermal) -> bool:
    """Does anything depend on the temperature, so far as the recordings show?"""
    compensation = thermal.compensation
    if compensation is None:
        return False
    return compensation.scale_slope != 0.0 or (thermal.fit is not None and thermal.fit.order > 0)
