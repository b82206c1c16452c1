"""All figures of a static test: single gyros and virtual gyros, side by side, with improvement factors."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vgyro.config import MetricsOptions
from vgyro.errors import TooShort
from vgyro.metrics.allan.coefficient_limits import Drawing
from vgyro.metrics.allan.covariance import CrossAllan, cross_allan
from vgyro.metrics.allan.deviation import AllanCurve
from vgyro.metrics.equal_bandwidth import BY_SHAPE, OTHER_SHAPE, SETTLED, LowPass, common_bandwidth, run_back
from vgyro.metrics.figures import Reading
from vgyro.metrics.improvement import (
    improvement_by_draws,
    improvement_factor,
    improvement_of_deviation,
    log_variance,
)
from vgyro.metrics.intervals.bootstrap import Resampled, joined, resample
from vgyro.metrics.intervals.drift import Drawn, DriftModel, draw, fit_drift
from vgyro.metrics.sampling import Sampling
from vgyro.metrics.spectra.welch import Spectrum
from vgyro.metrics.static.array_moments import ArrayMoments, array_moments
from vgyro.metrics.static.readings import lowest_point
from vgyro.metrics.static.series import Measured, RestRecording

POSE_NOTE = "each pose's own mean is removed"
RESOLVED = 3  # blocks of the drawn series that the minimum of a curve must span
BLOCKS_APART = 2.5  # times what is left out of the fit: blocks of 20 time constants are as good as independent


@dataclass(frozen=True)
class StaticFigures:
    """Of each of S series: Allan curves by kind, spectrum, figures by name (vgyro.metrics.FIGURES).

    cross : Allan covariances of all series; None: no stretch is long enough
    """

    curves: list[dict[str, AllanCurve]]
    spectra: list[Spectrum]
    readings: list[dict[str, Reading]]
    cross: CrossAllan | None


def static_figures(
    series: Iterable[np.ndarray],
    sampling: Sampling,
    singles: int,
    filters: Sequence[LowPass],
    options: MetricsOptions,
    engine: str = "native",
    poses: bool = False,
) -> StaticFigures:
    """Figures of series at rest, which are taken one by one: only one of them needs to be in memory.

    series   : S arrays [T], deg/s; the first `singles` are the gyros, the others virtual gyros
    sampling : when the samples were taken; its stretches are never joined
    filters  : S, what each series went through
    poses    : the stretches are different poses: 1σ is then taken about each pose's own mean, because gravity and
               switch-on change the bias from pose to pose
    returns  : StaticFigures; virtual gyros also get improvement factors
    raises   : TooShort if no stretch has three samples
    """
    bandwidth_hz = common_bandwidth(filters, options.equal_bandwidth_hz)
    shared = RestRecording.of(sampling, options, bandwidth_hz, engine, poses, run_back(filters))
    return array_figures(shared, [shared.measure(*one) for one in zip(series, filters, strict=True)], singles)


def array_figures(
    shared: RestRecording,
    measured: Sequence[Measured],
    singles: int,
    own: Mapping[int, Mapping[str, Reading]] | None = None,
) -> StaticFigures:
    """Figures that need all series of a recording: moments with common replicates, and improvement factors.

    measured : S, the first `singles` are the gyros
    own      : place of a gyro that lacks values → its figures from those that it has, which stand for what is found of
               the gyro as it was filled in
    """
    array = _Array.of(shared, measured, singles)
    confidence = shared.options.confidence
    readings = [dict(one.readings) for one in measured]
    for row, found in zip(readings, array.moments.readings(confidence), strict=True):
        row.update(found)
        if shared.poses:
            row["sigma"] = replace(row["sigma"], note=f"{POSE_NOTE}; {row['sigma'].note}")
    _add_equal(readings, shared, array, confidence)
    for place, figures in (own or {}).items():
        readings[place].update(figures)
    for column in range(singles, len(measured)):
        readings[column].update(array.factors(readings, column, confidence))
    return StaticFigures([one.curves for one in measured], [one.spectrum for one in measured], readings, array.cross)


@dataclass(frozen=True)
class _Array:
    """All series of a recording, and their replicates.

    drawn : None where the recording is too short for a model of its drift
    equal : moments at the common bandwidth, of the series that are `compared`
    """

    measured: Sequence[Measured]
    singles: int
    resampled: Resampled
    cross: CrossAllan | None
    model: DriftModel | None
    drawn: Drawn | None
    moments: ArrayMoments
    equal: ArrayMoments | None
    compared: list[int]

    @classmethod
    def of(cls, shared: RestRecording, measured: Sequence[Measured], singles: int) -> _Array:
        options, unit_s = shared.options, shared.grid.unit_s
        sums = joined([one.sums for one in measured])
        resampled = resample(sums, options.bootstrap, options.seed)
        cross = _cross(shared, measured)
        # A low-pass is felt up to a few of its time constants.
        limits = [one.low_pass.bandwidth_hz for one in measured if one.low_pass.bandwidth_hz]
        if shared.equaliser is not None:
            limits.append(shared.equaliser.bandwidth_hz)
        felt = SETTLED / (2 * math.pi * min(limits)) if limits else 0.0
        model = None if cross is None else fit_drift(cross, singles, felt)
        drawn = None if model is None else _draw(model, shared, measured, felt)
        inside = [one.inside for one in measured if one.inside is not None]
        moments = array_moments(sums, joined(inside) if inside else None, resampled, drawn, unit_s, options)
        compared = [place for place, one in enumerate(measured) if one.equal is not None]
        equal = None
        if compared:
            gain = np.array([measured[place].low_pass.dc_gain for place in compared])
            at_gain = None if drawn is None else drawn.only(compared).scaled(1 / gain)
            units = joined([one.equal for one in measured if one.equal is not None])
            of_them = resample(units, options.bootstrap, options.seed)
            equal = array_moments(units, None, of_them, at_gain, unit_s, options)
        return cls(measured, singles, resampled, cross, model, drawn, moments, equal, compared)

    def factors(self, readings: list[dict[str, Reading]], column: int, confidence: float) -> dict[str, Reading]:
        """Improvement factors of one virtual gyro."""
        number, adev = self.singles, self.resampled.adev_1s
        at_one = self._improvement(readings, "arw_1s", column, adev, confidence)
        of_white = self._noise_factor(readings, column, confidence)
        found = {
            "if_mean": self.moments.mean_factor(number, column, confidence),
            "if_sigma": self.moments.sigma_factor(number, column, confidence),
            "if_arw_1s": _marked(at_one, readings[column]["arw_1s"]),
            "if_arw": _marked(of_white, readings[column]["arw"]),
            "if_bias_drift": self._drift_factor(readings, column, confidence),
        }
        if self.equal is not None and column in self.compared:
            factor = self.equal.sigma_factor(number, self.compared.index(column), confidence)
            both = BY_SHAPE if self.measured[column].low_pass.both_ways else ""
            found["if_sigma_equal"] = replace(factor, note="; ".join(filter(None, (factor.note, both))))
        return found

    def _improvement(
        self, readings: list[dict[str, Reading]], name: str, column: int, drawn: np.ndarray, confidence: float
    ) -> Reading:
        figures = np.array([row[name].value for row in readings])
        number = self.singles
        return improvement_factor(
            figures[:number], float(figures[column]), drawn[:, :number], drawn[:, column], confidence
        )

    def _noise_factor(self, readings: list[dict[str, Reading]], column: int, confidence: float) -> Reading:
        chosen = [*range(self.singles), column]
        fitted = [readings[one]["arw"] for one in chosen]
        variance = np.array([log_variance(one, confidence) for one in fitted])
        values = np.array([one.value for one in fitted])
        correlation = np.eye(len(chosen)) if self.model is None else self.model.correlation(0)[np.ix_(chosen, chosen)]
        return improvement_of_deviation(values[:-1], float(values[-1]), variance, correlation, confidence)

    def _drift_factor(self, readings: list[dict[str, Reading]], column: int, confidence: float) -> Reading:
        number, drawn = self.singles, self.drawn
        chosen = [*range(number), column]
        points = [lowest_point(self.measured[one].curve, self.measured[one].low_pass.shortest_tau) for one in chosen]
        curves = [self.measured[one].curve for one in chosen]
        tau = np.array([curve.tau[point] for curve, point in zip(curves, points, strict=True)])
        lowest = np.array([readings[one]["bias_drift"].value for one in chosen])
        if drawn is not None and tau.min() >= RESOLVED * drawn.block_s:
            expected = drawn.lowest_expected
            centre = np.mean(expected[:, :number], axis=1) / expected[:, column]
            draws = drawn.lowest
            return improvement_by_draws(
                lowest[:-1], float(lowest[-1]), draws[:, :number], draws[:, column], centre, confidence
            )
        # The minimum lies where the degrees of freedom are many: those at its τ tell its error.
        freedom = np.array([max(curve.edf[point], 1.0) for curve, point in zip(curves, points, strict=True)])
        correlation = np.eye(len(chosen))
        if self.model is not None:
            correlation = self.model.correlation(float(tau[-1]))[np.ix_(chosen, chosen)]
        found = improvement_of_deviation(lowest[:-1], float(lowest[-1]), 1 / (2 * freedom), correlation, confidence)
        if self.model is None:
            found = replace(found, note=f"{found.note}; taken as independent".removeprefix("; "))
        return found


def _marked(factor: Reading, reading: Reading) -> Reading:
    """A factor of a figure that a low-pass lowers by itself says so."""
    if "band_limited" not in reading.flags:
        return factor
    note = f"{factor.note}; the low-pass takes part in it".removeprefix("; ")
    return replace(factor, note=note, flags=factor.flags | {"takes_part"})


def _cross(shared: RestRecording, measured: Sequence[Measured]) -> CrossAllan | None:
    """Allan covariances of the 1 s means of all series; None where too few of them are there."""
    means = np.column_stack([one.seconds for one in measured])
    try:
        return cross_allan(means, shared.seconds.rate_hz, shared.seconds, confidence=shared.options.confidence)
    except TooShort:
        return None


def _draw(model: DriftModel, shared: RestRecording, measured: Sequence[Measured], felt: float) -> Drawn:
    stretches = len(np.unique(shared.sampling.stretch)) if shared.poses else 1
    seconds = len(shared.sampling) / shared.sampling.rate_hz / stretches
    unit_s = shared.grid.unit_s
    shortest = unit_s * max(math.ceil(BLOCKS_APART * felt / unit_s), 1)
    taus = min((one.curve.tau for one in measured), key=lambda tau: float(tau[-1]))
    options = shared.options
    return draw(model, stretches, seconds, taus, shortest, Drawing(options.bootstrap, options.seed))


def _add_equal(readings: list[dict[str, Reading]], shared: RestRecording, array: _Array, confidence: float) -> None:
    if shared.equaliser is None:
        return
    band = f"low-passed to {shared.equaliser.bandwidth_hz:.3g} Hz"
    found = [] if array.equal is None else array.equal.readings(confidence)
    known = dict(zip(array.compared, found, strict=True))
    for place, (row, one) in enumerate(zip(readings, array.measured, strict=True)):
        if place in known:
            clauses = [band, *([BY_SHAPE] if one.low_pass.both_ways else []), known[place]["sigma"].note]
            row["sigma_equal"] = replace(known[place]["sigma"], note="; ".join(clauses))
            continue
        why = OTHER_SHAPE if one.low_pass.other_shape else f"{band}: no stretch without a gap is long enough"
        row["sigma_equal"] = Reading(math.nan, math.nan, math.nan, why)
