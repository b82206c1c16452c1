"""Bias against temperature from a sweep or from several tests, and its way from switch-on to the settled value."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vgyro import units
from vgyro.arrays import Floats
from vgyro.calibration.figures import Finding, not_measured, signed
from vgyro.calibration.wandering import Errors, LinearFit, average_fits
from vgyro.errors import TooShort
from vgyro.runs import runs

BLOCKS = 150
SHORTEST_BLOCK_S = 10.0
FEWEST_KELVIN = 2.0
FEWEST_POINTS = 4
HIGHEST_ORDER = 3
BELIEVED = 0.01  # p value at which a higher order is taken
STEADY = 0.95  # correlation of temperature and time above which a drift in time looks like one in temperature
MEDIAN_OF_NOISE = 0.6745  # of |x|, x standard normal
GRID = 50
WARM_UP_BLOCKS = 100
FEWEST_WARM_UP_BLOCKS = 20
TIME_CONSTANTS = 12


@dataclass(frozen=True)
class ThermalPoints:
    """Block means of a recording at rest: time [M] s, counts [M, N], temperature [M, N] °C."""

    time: np.ndarray
    counts: np.ndarray
    temperature: np.ndarray


@dataclass(frozen=True)
class OrderEvidence:
    """Does the curve of this order fit better than that of one less?

    f, p_value : (last coefficient / its standard error)² and its p value;  aic : of the curve, to be compared only
    """

    order: int
    f: float
    p_value: float
    aic: float


@dataclass(frozen=True)
class BiasTemperature:
    """Bias of one gyro against temperature: counts = Σ coefficients[k] · (T - reference_c)^k, from low_c to high_c.

    coefficients [4], covariance [4, 4] : counts/K^k, 0 above `order`
    evidence : of every order that the points allow
    slope, slope_low, slope_high, slope_error : of the straight line through the curve over the range, counts/K
    """

    reference_c: float
    low_c: float
    high_c: float
    coefficients: np.ndarray
    covariance: np.ndarray
    order: int
    evidence: tuple[OrderEvidence, ...]
    slope: float
    slope_low: float
    slope_high: float
    slope_error: float
    note: str


def thermal_points(
    counts: np.ndarray,
    temperature: np.ndarray,
    rate_hz: float,
    seconds: float | None = None,
    segment: np.ndarray | None = None,
) -> ThermalPoints:
    """Block means of counts [T, N] and temperature, °C, [T] or [T, N].

    seconds : length of a block; None: what gives 150 blocks, 10 s at least
    segment : [T] int, numbers that change where the board was off: no block goes across
    """
    counts = np.asarray(counts)
    samples, gyros = counts.shape
    warmth = np.asarray(temperature)
    warmth = np.broadcast_to(warmth[:, None] if warmth.ndim == 1 else warmth, (samples, gyros))
    seconds = max(samples / rate_hz / BLOCKS, SHORTEST_BLOCK_S) if seconds is None else seconds
    length = max(round(seconds * rate_hz), 1)
    parts = [[0, samples]] if segment is None else runs(segment).tolist()
    starts = np.concatenate([np.arange(a, b - length + 1, length) for a, b in parts])
    means = [
        np.array([values[start : start + length].mean(axis=0, dtype=float) for start in starts]).reshape(-1, gyros)
        for values in (counts, warmth)
    ]
    return ThermalPoints((starts + length / 2) / rate_hz, *means)


def fit_bias_temperature(
    temperature: np.ndarray,
    bias: np.ndarray,
    time: np.ndarray | None = None,
    error: np.ndarray | None = None,
    confidence: float = 0.95,
    reference_c: float | None = None,
) -> BiasTemperature:
    """Polynomial of up to the third order through the bias, counts [M], at temperatures [M], °C.

    time        : [M], s: the points are block means of one recording, whose errors wander (`Errors`)
                  None: independent tests; the scatter about the curve holds what changes from one switch-on to the next
    error       : [M], counts, standard errors of independent points (None: equal)
    reference_c : the temperature the polynomial is about (None: the mean)
    returns     : BiasTemperature of the highest order whose last coefficient differs from 0 at 1 %; orders up to 3, as
                  far as they leave a degree of freedom
    raises      : TooShort with fewer than 4 points or less than 2 K between them
    """
    known = np.isfinite(temperature) & np.isfinite(bias)
    temperature, bias = temperature[known], bias[known]
    span = float(np.ptp(temperature)) if temperature.size else 0.0
    if temperature.size < FEWEST_POINTS or span < FEWEST_KELVIN:
        raise TooShort(f"{temperature.size} temperatures over {span:.1f} K", None, "A curve needs 4 points and 2 K")
    reference = float(temperature.mean()) if reference_c is None else reference_c
    weight = None if error is None or not np.all(error[known] > 0) else error[known] ** 2
    when = None if time is None else time[known]
    powers = np.vander((temperature - reference) / span, HIGHEST_ORDER + 1, increasing=True)
    highest = min(HIGHEST_ORDER, temperature.size - 2)
    errors = Errors(len(bias), weight, when)
    fits = [errors.fit(powers[:, : order + 1], bias) for order in range(highest + 1)]
    evidence = _evidence(fits, powers, bias)
    order = max((step.order for step in evidence if step.p_value < BELIEVED), default=0)
    fit = fits[order]
    unit = span ** -np.arange(order + 1.0)
    coefficients, covariance = np.zeros(HIGHEST_ORDER + 1), np.zeros((HIGHEST_ORDER + 1, HIGHEST_ORDER + 1))
    coefficients[: order + 1] = fit.estimate * unit
    covariance[: order + 1, : order + 1] = fit.covariance * np.outer(unit, unit)
    line = fits[-1]  # the highest order: what selecting one leaves out would be missing in the limits
    combination = _line_of(line, temperature, reference, span)
    slope, half = float(combination @ line.estimate), line.half_width(combination, confidence)
    return BiasTemperature(
        reference, float(temperature.min()), float(temperature.max()), coefficients, covariance, order, evidence,
        slope, slope - half, slope + half, line.standard_error(combination), _note(order, temperature, when),
    )  # fmt: skip


def bias_temperature(fit: BiasTemperature, scale: float, sign: int = 1) -> Finding:
    """The slope of the bias as a figure, deg/h/K; scale deg/s a count."""
    factor = float(units.deg_h(scale)) * sign
    half = (fit.slope_high - fit.slope_low) / 2
    return signed(factor * fit.slope, factor * half * sign, MEDIAN_OF_NOISE * abs(factor) * fit.slope_error, fit.note)


def self_heating(
    rate: np.ndarray, rate_hz: float, segment: np.ndarray | None = None, confidence: float = 0.95
) -> Finding:
    """Settled bias minus bias at switch-on, deg/h, from a recording at rest that begins there.

    rate : [T], deg/s;  segment : [T] int, numbers that change where the board was off
    Block means are fitted by c + a·e^(-t/τ), errors that wander allowed for; τ on a grid from two blocks to half the
    recording, every τ with the weight of its marginal likelihood. The figure is -a.
    """
    seconds = len(rate) / rate_hz / WARM_UP_BLOCKS
    points = thermal_points(np.asarray(rate)[:, None], np.zeros(len(rate)), rate_hz, seconds, segment)
    time, bias = points.time, points.counts[:, 0]
    if time.size < FEWEST_WARM_UP_BLOCKS:
        return not_measured("needs a recording at rest that begins at switch-on")
    constants = np.geomspace(2 * seconds, len(rate) / rate_hz / 2, TIME_CONSTANTS)
    shapes = [np.column_stack([np.ones_like(time), np.exp(-time / constant)]) for constant in constants]
    errors = Errors(len(time), None, time)
    fits = [errors.fit(shape, bias) for shape in shapes]
    # Evidence as if every shape had the same size, so that none is preferred for its unit.
    evidence = np.array([fit.evidence + math.log(shape[:, 1].std()) for fit, shape in zip(fits, shapes, strict=True)])
    fit = average_fits(fits, evidence)
    change = np.array([0.0, -float(units.deg_h(1.0))])
    floor = MEDIAN_OF_NOISE * fit.standard_error(change)
    note = f"time constant about {constants[int(np.argmax(evidence))]:.0f} s"
    return signed(float(change @ fit.estimate), fit.half_width(change, confidence), floor, note)


def _evidence(fits: list[LinearFit], powers: np.ndarray, bias: np.ndarray) -> tuple[OrderEvidence, ...]:
    """Test of the highest coefficient of each order; AIC with the errors' covariance of the highest order."""
    lower = np.linalg.cholesky(fits[-1].noise)
    values, columns = np.linalg.solve(lower, bias), np.linalg.solve(lower, powers)
    found, number = [], len(bias)
    for order, fit in enumerate(fits[1:], start=1):
        highest = np.eye(order + 1)[order]
        part = columns[:, : order + 1]
        left = values - part @ np.linalg.lstsq(part, values, rcond=None)[0]
        aic = number * math.log(max(float(left @ left), np.finfo(float).tiny) / number) + 2 * (order + 1)
        error = max(fit.standard_error(highest), np.finfo(float).tiny)
        found.append(OrderEvidence(order, float((fit.estimate[order] / error) ** 2), fit.p_value(highest), aic))
    return tuple(found)


def _line_of(fit: LinearFit, temperature: Floats, reference: float, span: float) -> Floats:
    """Combination of the coefficients that is the slope, counts/K, of the straight line through the curve."""
    grid = np.linspace(temperature.min(), temperature.max(), GRID)
    curve = np.vander((grid - reference) / span, len(fit.estimate), increasing=True)
    apart = grid - grid.mean()
    line: Floats = apart @ curve / (apart @ apart)
    return line


def _note(order: int, temperature: np.ndarray, time: np.ndarray | None) -> str:
    notes = [f"order {order} over {temperature.min():.1f} to {temperature.max():.1f} °C"]
    if time is not None and abs(np.corrcoef(time, temperature)[0, 1]) > STEADY:
        notes.append("the temperature changed one way only: a drift in time would look the same")
    return "; ".join(notes)
