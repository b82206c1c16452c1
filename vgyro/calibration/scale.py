"""Scale factor and bias of each gyro from rate-table plateaus, with intervals and the floor of the test."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from vgyro import units
from vgyro.errors import DataError, TooShort

FEWEST_PLATEAUS = 3
NO_RESPONSE = 0.1  # of the nominal slope
FAR_FROM_NOMINAL = 0.2


@dataclass(frozen=True)
class GyroNominal:
    """What the board file says of a gyro: scale deg/s a count, bias counts, sign ±1, range deg/s (None: not given)."""

    name: str
    scale: float
    bias: float
    sign: int
    range_deg_s: float | None = None


@dataclass(frozen=True)
class ScaleFit:
    """Calibration of one gyro: rate = sign · (count - bias) · scale.

    source        : "measured" or "nominal"
    scale, low, high deg/s a count; bias, low, high counts; NaN limits where nominal
    nonlinearity_ppm : largest |residual| over full scale;  floor_ppm : what a perfectly linear gyro would show
    rate, mean_count, residual [P] : the points of the fit, deg/s, counts, deg/s (output - table)
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
    rate: np.ndarray = field(default_factory=lambda: np.empty(0))
    mean_count: np.ndarray = field(default_factory=lambda: np.empty(0))
    residual: np.ndarray = field(default_factory=lambda: np.empty(0))
    note: str = ""


def nominal_fit(gyro: GyroNominal, note: str = "nominal scale: no calibration recording") -> ScaleFit:
    """The board's nominal values as a calibration, marked as such."""
    nothing = math.nan
    return ScaleFit(gyro.name, "nominal", gyro.scale, nothing, nothing, gyro.bias, nothing, nothing, note=note)


def fit_scale_factor(
    rate: np.ndarray,
    mean_count: np.ndarray,
    standard_error: np.ndarray,
    gyros: list[GyroNominal],
    latitude_deg: float | None = None,
    confidence: float = 0.95,
    where: str | None = None,
) -> list[ScaleFit]:
    """Least-squares line count = bias + slope · rate through the plateaus of each gyro; scale = sign / slope.

    rate           : array [P], deg/s, of the table about the gyros' axis
    mean_count     : array [P, N]; NaN where a plateau cannot be used for a gyro (clipped)
    standard_error : array [P, N], counts, of the plateau means
    gyros          : N nominal values, whose sign says which way each gyro is mounted
    latitude_deg   : given: the axis is taken as vertical, upwards, and 15.04 deg/h · sin(latitude) is added to the
                     table's rate, so that it does not end up in the bias
    where          : the recording, for messages
    returns        : N ScaleFit. Limits from the t distribution with P - 2 degrees of freedom. A gyro that does not
                     answer to the table (below a tenth of its nominal slope) keeps its nominal values, and says so.
                     floor_ppm: median of the largest |residual| that the standard errors alone produce.
    raises         : TooShort with fewer than 3 plateaus; DataError if a gyro turns against its sign
    IEEE Std 1431-2004, scale factor and nonlinearity; Liu et al. (2015), fig. 2.
    """
    rate = np.asarray(rate, dtype=float)
    if np.unique(rate).size < FEWEST_PLATEAUS:
        raise TooShort(
            f"{np.unique(rate).size} different rates on the table",
            where,
            "A line with its nonlinearity needs 3 or more",
        )
    if latitude_deg is not None:
        rate = rate + units.earth_rate_deg_s(latitude_deg)
    fits = []
    for column, gyro in enumerate(gyros):
        usable = np.isfinite(mean_count[:, column])
        if np.unique(rate[usable]).size < FEWEST_PLATEAUS:
            fits.append(nominal_fit(gyro, "nominal scale: fewer than 3 plateaus without clipped samples"))
            continue
        fits.append(
            _fit_one(rate[usable], mean_count[usable, column], standard_error[usable, column], gyro, confidence, where)
        )
    return fits


def _fit_one(
    rate: np.ndarray, count: np.ndarray, error: np.ndarray, gyro: GyroNominal, confidence: float, where: str | None
) -> ScaleFit:
    from scipy.special import stdtrit

    points = len(rate)
    centre = rate.mean()
    spread = float(np.sum((rate - centre) ** 2))
    slope = float((rate - centre) @ count) / spread
    relative = slope * gyro.sign * gyro.scale
    if abs(relative) < NO_RESPONSE:
        return nominal_fit(gyro, f"nominal scale: the gyro does not answer to the table ({relative:.1%} of nominal)")
    if relative < 0:
        raise DataError(
            f"gyro {gyro.name!r} turns against the table", where, f"Set its sign to {-gyro.sign} in the board file"
        )
    bias = float(count.mean()) - slope * centre
    left = count - bias - slope * rate
    scatter = math.sqrt(float(left @ left) / (points - 2))
    quantile = float(stdtrit(points - 2, 0.5 + confidence / 2))
    slope_half = quantile * scatter / math.sqrt(spread)
    bias_half = quantile * scatter * math.sqrt(1 / points + centre**2 / spread)
    scale = gyro.sign / slope
    ends = sorted(gyro.sign / (slope + side * slope_half) for side in (-1, 1))
    residual = gyro.sign * left * scale
    full_scale = gyro.range_deg_s or float(np.max(np.abs(rate)))
    nonlinearity = float(units.parts_per_million(float(np.max(np.abs(residual))) / full_scale))
    floor = float(units.parts_per_million(_largest_of_noise(error * scale) / full_scale))
    return ScaleFit(
        gyro.name, "measured", scale, ends[0], ends[1], bias, bias - bias_half, bias + bias_half,
        nonlinearity, floor, rate, count, residual, _note(nonlinearity, floor, relative, full_scale),
    )  # fmt: skip


def _largest_of_noise(error: np.ndarray) -> float:
    """Median of the largest of |x_p|, x_p normal with standard deviations `error` [P]."""
    from scipy.special import log_ndtr, ndtr

    if not np.any(error > 0):
        return 0.0
    spread = error[error > 0]
    low, high = 0.0, 10 * float(spread.max())
    for _ in range(60):
        middle = (low + high) / 2
        # P(|x| < m) = 1 - 2 P(x > m); the product over the plateaus as a sum of logarithms
        tails = ndtr(-middle / spread)
        inside = np.sum(np.where(tails < 0.4, np.log1p(-2 * np.minimum(tails, 0.4)), log_ndtr(-np.inf)))
        low, high = (low, middle) if inside > math.log(0.5) else (middle, high)
    return (low + high) / 2


def _note(nonlinearity: float, floor: float, relative: float, full_scale: float) -> str:
    notes = [f"full scale {full_scale:g} deg/s"]
    if nonlinearity <= 1.5 * floor:
        notes.append("the nonlinearity is at the floor of this test")
    if abs(1 / relative - 1) > FAR_FROM_NOMINAL:
        notes.append(f"the scale is {1 / relative:.2f} times the nominal one")
    return "; ".join(notes)
