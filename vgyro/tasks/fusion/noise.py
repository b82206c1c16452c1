"""Noise: white noise, random walk and correlation of the gyros of one axis, which the filters are designed from."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from vgyro import units
from vgyro.board import Board
from vgyro.config import MetricsOptions
from vgyro.errors import TooShort
from vgyro.metrics import (
    Coefficient,
    NoiseCoefficients,
    Sampling,
    Scales,
    allan_deviation,
    allan_scales,
    cleaned_of,
    correlation_of,
    noise_coefficients,
    noise_from_differences,
    own_samples,
    read_curve,
    without_outliers,
)
from vgyro.storage.tables import write_json
from vgyro.tasks.common import Task, run_task
from vgyro.tasks.fusion.noise_record import UPPER_LIMIT, Source, noise_of_record, scales_record
from vgyro.tasks.fusion.noise_temperature import slopes_of_file
from vgyro.tasks.rates.rates_file import ArrayFile, FileColumns, has_moved, incomplete, read_frame

SECTIONS = ("board", "metrics", "engine")

ENOUGH_REST_S = 10.0
LONG_ENOUGH = 30  # samples
AT_REST = "samples at rest"
"""Where the noise is from: ArrayNoiseRecord.method."""


@dataclass(frozen=True)
class ArrayNoiseRecord:
    """What is written: N deg/s/√Hz (two-sided) and K deg/s/√s with limits, correlation [N, N], and how it was found.

    read   : σ(1 s) of each gyro, deg/s/√Hz, which stands in for N where the fit does not hold
    scales : Allan covariances of the gyros at rest; None: not known
    """

    method: str
    seconds: float
    coefficients: list[NoiseCoefficients]
    read: list[float]
    correlation: np.ndarray
    scales: Scales | None = None


def main(task: Task) -> None:
    """inputs : rates, of the recordings to take it from, the first choice first;  outputs : noise

    options : axis, board, analysis.metrics
    """
    options = task.section("metrics", MetricsOptions)
    engine = task.engine
    board = task.section("board", Board)
    gyros = [gyro.name for gyro in board.array(task.option("axis"))]
    path = source_of(task.inputs["rates"])
    frame = read_frame(path, gyros, task.option("axis"))
    places = [(path, gyro) for gyro in gyros]
    sampling = frame.rest_sampling(options.most_lost_s)
    found = None
    if rests_enough(sampling):
        try:
            lacking = [gyros.index(gyro) for gyro in incomplete(path, gyros)]
            found = noise_at_rest(FileColumns(places, frame.at_rest), sampling, options, engine, lacking)
        except TooShort as reason:
            logging.warning("not from the samples at rest: %s", reason)
    if found is None:
        found = noise_in_motion(FileColumns(places), frame, engine)
    record = record_of(found, gyros, task.option("axis"), path.parent.name)
    if found.method == AT_REST:
        record |= slopes_of_file(path, board, gyros, frame.rate_hz, noise_of_record(record, gyros))
    write_json(task.output("noise"), record)


_UNKNOWN = Coefficient(math.nan, math.nan, math.nan)
NOTHING_KNOWN = NoiseCoefficients(_UNKNOWN, _UNKNOWN, _UNKNOWN, math.nan, math.nan)


def source_of(choices: Sequence[Path]) -> Path:
    """The first recording that is what it is declared to be; where the board moved in all of them, the first."""
    return next((path for path in choices if not has_moved(path)), choices[0])


def rests_enough(sampling: Sampling) -> bool:
    """Is there rest enough to see the noise in, one stretch of it long enough for an Allan curve?"""
    longest = int(np.bincount(sampling.stretch).max(initial=0))
    return len(sampling) >= ENOUGH_REST_S * sampling.rate_hz and longest >= LONG_ENOUGH


def noise_at_rest(
    gyros: FileColumns, sampling: Sampling, options: MetricsOptions, engine: str, lacking: Sequence[int] = ()
) -> ArrayNoiseRecord:
    """From the samples at rest, the only ones of `gyros`, without outliers; averages go over short losses alone.

    lacking : places of gyros that have no value in some samples: these are lost to them alone
    """
    segment, rate_hz = sampling.segment, sampling.rate_hz
    fits, read = [], []
    for place, rate in enumerate(gyros):
        own, when = own_samples(rate, sampling) if place in lacking else (rate, sampling)
        cut = segment if when is sampling else when.segment
        outliers = without_outliers(own, when.rate_hz, cut, options.outlier_threshold)[1]
        try:
            curve = allan_deviation(
                own[~outliers], when.rate_hz, None, None, options.confidence, engine, options.taus_per_octave,
                sampling=when.without(outliers),
            )  # fmt: skip
        except TooShort as reason:
            if place not in lacking:
                raise
            logging.warning("gyro %d has too few values for its noise: %s", place + 1, reason)
            fits.append(NOTHING_KNOWN)
            read.append(math.nan)
            continue
        fits.append(noise_coefficients(curve, replicates=options.bootstrap, seed=options.seed))
        read.append(read_curve(curve, 1.0)[0])

    def cleaned(rate: np.ndarray) -> np.ndarray:
        return cleaned_of(rate, rate_hz, segment, options.outlier_threshold)

    columns = replace(gyros, cleaned=cleaned)
    correlation = correlation_of(columns, lacking, rate_hz, sampling.stretch, options.confidence).value
    scales = _scales(columns, sampling, engine, lacking)
    return ArrayNoiseRecord(AT_REST, len(segment) / rate_hz, fits, read, correlation, scales)


def _scales(columns: Sequence[np.ndarray], sampling: Sampling, engine: str, lacking: Sequence[int]) -> Scales | None:
    try:
        return allan_scales(columns, sampling, engine, lacking)
    except TooShort as reason:
        logging.warning("no Allan covariances: %s", reason)
        return None


def noise_in_motion(series: Sequence[np.ndarray], frame: ArrayFile, engine: str) -> ArrayNoiseRecord:
    """From the differences between the gyros, in which the motion cancels; correlation is then not known."""
    number = len(series)
    if len(frame.segment) >= 3:
        n, k = noise_from_differences(series, frame.rate_hz, frame.segment, engine)
    else:
        n, k = np.full(number, math.nan), np.full(number, math.nan)
    nothing = Coefficient(math.nan, math.nan, math.nan)
    fits = [
        NoiseCoefficients(
            Coefficient(a, math.nan, math.nan), nothing, Coefficient(b, math.nan, math.nan), math.nan, math.nan
        )
        for a, b in zip(n.tolist(), k.tolist(), strict=True)
    ]
    method = "differences between the gyros, no rest long enough; their correlation is taken as none"
    return ArrayNoiseRecord(method, len(frame.segment) / frame.rate_hz, fits, [math.nan] * number, np.eye(number))


def record_of(found: ArrayNoiseRecord, gyros: list[str], axis: str, recording: str) -> dict[str, Any]:
    """JSON: arw and rrw by gyro, such that filters can use them; arw_source and rrw_source say what they are."""
    correlation = np.where(np.isnan(found.correlation), np.eye(len(gyros)), found.correlation)
    fits, scales = dict(zip(gyros, found.coefficients, strict=True)), found.scales
    arw = {gyro: _usable_arw(fit, read) for (gyro, fit), read in zip(fits.items(), found.read, strict=True)}
    rrw = {gyro: _usable_rrw(fit) for gyro, fit in fits.items()}
    return {
        "axis": axis,
        "recording": recording,
        "method": found.method,
        "seconds": found.seconds,
        "gyros": gyros,
        "units": {
            "arw": "deg/s/√Hz, two-sided",
            "rrw": "deg/s/√s",
            "bias_instability": "deg/s",
            "allan_covariance": "(deg/s)²",
        },
        "arw": {gyro: _number(value) for gyro, (value, _) in arw.items()},
        "arw_source": {gyro: source for gyro, (_, source) in arw.items()},
        "arw_low": {gyro: _number(fit.N.low) for gyro, fit in fits.items()},
        "arw_high": {gyro: _number(fit.N.high) for gyro, fit in fits.items()},
        "arw_deg_rt_h": {gyro: _number(units.arw_deg_rt_h(value)) for gyro, (value, _) in arw.items()},
        "rrw": {gyro: _number(value) for gyro, (value, _) in rrw.items()},
        "rrw_source": {gyro: source for gyro, (_, source) in rrw.items()},
        "rrw_low": {gyro: _number(fit.K.low) for gyro, fit in fits.items()},
        "rrw_high": {gyro: _number(fit.K.high) for gyro, fit in fits.items()},
        "bias_instability": {gyro: _number(fit.B.value) for gyro, fit in fits.items()},
        "correlation": [[float(value) for value in row] for row in correlation],
        **({} if scales is None else scales_record(scales.tau, scales.covariance, scales.pairs)),
    }


def _usable_arw(fit: NoiseCoefficients, read: float) -> tuple[float, Source]:
    fitted = fit.N.value
    if math.isfinite(read) and read > 0 and (fit.N.low == 0 or not fit.reliable):
        return read, "read at 1 s"
    return fitted, "fitted" if math.isfinite(fitted) else "not known"


def _usable_rrw(fit: NoiseCoefficients) -> tuple[float, Source]:
    if fit.K.value > 0:
        return fit.K.value, "fitted"
    if fit.K.high > 0:
        return fit.K.high, UPPER_LIMIT
    return fit.K.value, "none" if fit.K.value == 0 else "not known"


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


if __name__ == "__main__":
    run_task(main)
