"""Scale factor, bias and the other figures of each gyro from rate-table plateaus, with intervals and floors."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from vgyro import units
from vgyro.calibration.figures import BELOW, Finding, not_measured
from vgyro.calibration.linearity import asymmetry, combined, hysteresis, nonlinearity, zero_offset, zero_shift
from vgyro.calibration.plateaus import PlateauMeans
from vgyro.calibration.response import RateResponse, Visits, fit_response, same_rates
from vgyro.errors import DataError, TooShort

FEWEST_RATES = 3
NO_RESPONSE = 0.1  # of the nominal slope
FAR_FROM_NOMINAL = 0.2
UNEXPLAINED = 2.0
PERCENT = 100.0


@dataclass(frozen=True)
class GyroNominal:
    """What the board file says of a gyro: scale deg/s a count, bias counts, sign ±1, range deg/s (None: not given)."""

    name: str
    scale: float
    bias: float
    sign: int
    range_deg_s: float | None = None


@dataclass(frozen=True)
class FittedPoints:
    """The plateaus [P] that a line was fitted through, in their order.

    rate deg/s of the table;  mean_count counts;  residual deg/s, output - table;  standard_error deg/s
    direction 1 up -1 down 0 none;  temperature °C
    """

    rate: np.ndarray = field(default_factory=lambda: np.empty(0))
    mean_count: np.ndarray = field(default_factory=lambda: np.empty(0))
    residual: np.ndarray = field(default_factory=lambda: np.empty(0))
    standard_error: np.ndarray = field(default_factory=lambda: np.empty(0))
    direction: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int8))
    temperature: np.ndarray = field(default_factory=lambda: np.empty(0))


@dataclass(frozen=True, kw_only=True)
class ScaleFit:
    """Calibration of one gyro: rate = sign · (count - bias) · scale.

    source           : "measured" or "nominal"
    scale, low, high deg/s a count; bias, low, high counts; scale_error, bias_error standard errors; NaN where nominal
    nonlinearity_ppm : largest |residual| over full scale as seen, visits of one rate averaged, noise not taken off
    floor_ppm        : what a perfectly linear gyro would show, median
    figures          : the findings of this test by the names of figures.FIGURES; empty where nominal
    full_scale deg/s; temperature_c mean of the test, NaN without a thermometer
    points           : of the fit; none where nominal
    """

    gyro: str
    source: str
    scale: float
    scale_low: float
    scale_high: float
    bias: float
    bias_low: float
    bias_high: float
    nonlinearity_ppm: float = math.nan
    floor_ppm: float = math.nan
    note: str = ""
    scale_error: float = math.nan
    bias_error: float = math.nan
    full_scale: float = math.nan
    temperature_c: float = math.nan
    figures: dict[str, Finding] = field(default_factory=dict)
    points: FittedPoints = field(default_factory=FittedPoints)


def nominal_fit(gyro: GyroNominal, note: str = "nominal scale: no calibration recording") -> ScaleFit:
    """The board's nominal values as a calibration, marked as such."""
    return ScaleFit(
        gyro=gyro.name,
        source="nominal",
        scale=gyro.scale,
        scale_low=math.nan,
        scale_high=math.nan,
        bias=gyro.bias,
        bias_low=math.nan,
        bias_high=math.nan,
        note=note,
    )


def fit_scale_factor(
    means: PlateauMeans,
    gyros: list[GyroNominal],
    latitude_deg: float | None = None,
    confidence: float = 0.95,
    where: str | None = None,
) -> list[ScaleFit]:
    """Least-squares line count = bias + slope · rate through the plateaus of each gyro; scale = sign / slope.

    means        : of a table about the gyros' axis; NaN where a plateau cannot be used for a gyro (clipped)
    gyros        : N nominal values, whose sign says which way each gyro is mounted
    latitude_deg : given: the axis is taken as vertical, upwards, and 15.04 deg/h · sin(latitude) is added to the
                   table's rate, so that it does not end up in the bias
    where        : the recording, for messages
    returns      : N ScaleFit. Intervals from the scatter of the plateaus about the model of `response`, whose bias may
                   drift in time and whose errors may wander (bias instability, random walk). The bias is the mean of
                   the test. A gyro that does not answer to the table (below a tenth of its nominal slope) keeps its
                   nominal values, and says so.
    raises       : TooShort with fewer than 3 rates; DataError if a gyro turns against its sign
    IEEE Std 1431-2004, scale factor, nonlinearity, asymmetry, hysteresis; Liu et al. (2015), fig. 2.
    """
    rates, _ = same_rates(means.rate)
    if rates.size < FEWEST_RATES:
        raise TooShort(
            f"{rates.size} different rates on the table", where, "A line with its nonlinearity needs 3 or more"
        )
    earth = 0.0 if latitude_deg is None else units.earth_rate_deg_s(latitude_deg)
    fits = []
    for column, gyro in enumerate(gyros):
        response = _respond(means, column)
        if response is None:
            fits.append(nominal_fit(gyro, "nominal scale: fewer than 3 plateaus without clipped samples"))
            continue
        relative = float(response.slope @ response.fit.estimate) * gyro.sign * gyro.scale
        if abs(relative) < NO_RESPONSE:
            words = f"nominal scale: the gyro does not answer to the table ({relative:.1%} of nominal)"
            fits.append(nominal_fit(gyro, words))
        elif relative < 0:
            remedy = f"Set its sign to {-gyro.sign} in the board file"
            raise DataError(f"gyro {gyro.name!r} turns against the table", where, remedy)
        else:
            fits.append(_scale_fit(response, means, column, gyro, earth, confidence))
    return fits


def cross_axis(means: PlateauMeans, gyros: list[GyroNominal], confidence: float = 0.95) -> list[Finding]:
    """Response of gyros of other axes to this table, % of a rotation about their own axis; one a gyro.

    means : [P, N] of those gyros;  gyros : their scale, measured where there is one, and sign
    """
    findings = []
    for column, gyro in enumerate(gyros):
        response = _respond(means, column)
        if response is None:
            findings.append(not_measured("fewer than 3 plateaus without clipped samples"))
            continue
        percent = gyro.sign * gyro.scale * PERCENT
        findings.append(combined(response, response.slope * percent, confidence))
    return findings


def _respond(means: PlateauMeans, column: int) -> RateResponse | None:
    usable = np.isfinite(means.mean[:, column])
    rate, count = means.rate[usable], means.mean[usable, column]
    if same_rates(rate)[0].size < FEWEST_RATES:
        return None
    return fit_response(Visits(rate, count, means.seconds[usable], means.time[usable], means.direction[usable]))


def _scale_fit(
    response: RateResponse, means: PlateauMeans, column: int, gyro: GyroNominal, earth: float, confidence: float
) -> ScaleFit:
    fit, visits, usable = response.fit, response.model.visits, np.isfinite(means.mean[:, column])
    slope = float(response.slope @ fit.estimate)
    slope_half = fit.half_width(response.slope, confidence)
    # The table's zero is the Earth's rate for the gyro.
    at_rest = response.bias - earth * response.slope
    bias, bias_half = float(at_rest @ fit.estimate), fit.half_width(at_rest, confidence)
    scale = gyro.sign / slope
    ends = sorted(gyro.sign / (slope + side * slope_half) for side in (-1, 1))
    full_scale = gyro.range_deg_s or visits.largest
    figures = {
        **nonlinearity(response, scale, full_scale, confidence),
        "asymmetry": asymmetry(response, confidence),
        "hysteresis": hysteresis(response, scale, full_scale, confidence),
        "zero_shift": zero_shift(response, gyro.sign * scale, confidence),
        "zero_offset": zero_offset(response, gyro.sign * scale, confidence),
    }
    seen = np.abs(response.seen_bend @ visits.count).max() * scale / full_scale
    error = means.standard_error[usable, column] * scale
    warmth = means.temperature[usable, column]
    residual = gyro.sign * scale * (visits.count - bias) - visits.rate - earth
    return ScaleFit(
        gyro=gyro.name,
        source="measured",
        scale=scale,
        scale_low=ends[0],
        scale_high=ends[1],
        scale_error=fit.standard_error(response.slope) / slope**2,
        bias=bias,
        bias_low=bias - bias_half,
        bias_high=bias + bias_half,
        bias_error=fit.standard_error(at_rest),
        nonlinearity_ppm=float(units.parts_per_million(seen)),
        floor_ppm=figures["nonlinearity_full_scale"].floor,
        note=_note(response, scale, gyro, full_scale, error, figures["nonlinearity_full_scale"]),
        full_scale=full_scale,
        temperature_c=float(np.mean(warmth)),
        figures=figures,
        points=FittedPoints(visits.rate, visits.count, residual, error, visits.direction, warmth),
    )


def _note(
    response: RateResponse, scale: float, gyro: GyroNominal, full_scale: float, error: np.ndarray, bend: Finding
) -> str:
    notes = [f"full scale {full_scale:g} deg/s"]
    if bend.state == BELOW:
        notes.append("the nonlinearity is below the floor of this test")
    if abs(scale / gyro.scale - 1) > FAR_FROM_NOMINAL:
        notes.append(f"the scale is {scale / gyro.scale:.2f} times the nominal one")
    if not response.drifts:
        notes.append("no drift in time taken off: too few plateaus, or in the order of their rates")
    within = float(np.sqrt(np.mean(error**2)))
    between = float(np.sqrt(np.mean(np.diag(response.fit.noise)))) * scale
    if within > 0 and between > UNEXPLAINED * within:
        notes.append(f"the plateaus scatter {between / within:.1f} times more than the noise within them explains")
    return "; ".join(notes)
