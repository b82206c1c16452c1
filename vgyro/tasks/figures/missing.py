"""Measure gyros that lack values: from those that they have, at their own rate; in what is common, as filled in."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from vgyro.config import MetricsOptions
from vgyro.metrics import (
    LowPass,
    Measured,
    Reading,
    RestRecording,
    Sampling,
    array_figures,
    counted,
    own_samples,
)
from vgyro.metrics.dynamic.figures import dynamic_figures
from vgyro.storage.tables import read_column
from vgyro.tasks.rates.rates_file import ArrayFile, incomplete, read_array

FEWEST_SAMPLES = 30  # in the longest stretch of a gyro's own values; with fewer it has no figures
Row = dict[str, Reading]


@dataclass(frozen=True)
class Lacking:
    """The gyros of an array that lack values, and are measured all the same.

    gyros  : those of the array that are measured, in its order;  places : of those that lack values, in `gyros`
    filled : (file, gyro) → its rate [T], deg/s, as the methods saw it
    """

    gyros: list[str]
    places: list[int] = field(default_factory=list)
    filled: dict[tuple[Path, str], np.ndarray] = field(default_factory=dict)

    @classmethod
    def of(cls, path: Path, gyros: list[str], frame: ArrayFile, most_lost_s: float) -> Lacking:
        """From rates.parquet; where no gyro lacks a value nothing is read.  frame : of these gyros"""
        names = incomplete(path, gyros)
        if not names:
            return cls(gyros)
        where = frame.at_rest if frame.at_rest.any() else np.ones(len(frame.at_rest), dtype=bool)
        sampling = frame.sampling(most_lost_s).without(~where)
        gone = [name for name in names if _longest(read_column(path, name, float)[where], sampling) < FEWEST_SAMPLES]
        for name in gone:
            logging.warning("%s: no figures, fewer than %d values follow one another", name, FEWEST_SAMPLES)
        kept = [gyro for gyro in gyros if gyro not in gone]
        rate = read_array(path, gyros, frame.axis).rate
        chosen = [gyro for gyro in names if gyro in kept]
        filled = {(path, gyro): rate[:, gyros.index(gyro)].astype(float) for gyro in chosen}
        return cls(kept, [kept.index(gyro) for gyro in chosen], filled)

    def own(self, path: Path, place: int) -> np.ndarray:
        """Rates [T] of the gyro at a place, NaN where it has no value."""
        return read_column(path, self.gyros[place], float)


def _longest(values: np.ndarray, sampling: Sampling) -> int:
    return int(np.bincount(own_samples(values, sampling)[1].stretch).max(initial=0))


def own_still(
    values: np.ndarray, shared: RestRecording, bandwidth_hz: float | None, back: bool
) -> tuple[Measured, Row]:
    """Curves, spectrum and figures of one gyro at rest from the values [T] that it has, deg/s.

    shared : of the recording;  bandwidth_hz, back : as RestRecording.of takes them
    raises : TooShort
    """
    own, when = own_samples(values, shared.sampling)
    alone = RestRecording.of(when, shared.options, bandwidth_hz, shared.engine, shared.poses, back)
    measured = alone.measure(own, LowPass())
    row = dict(array_figures(alone, [measured], 1).readings[0])
    lost = shared.sampling.without(np.isnan(values)).missing
    row["missing"] = counted(lost)
    if when.rate_hz < shared.sampling.rate_hz:
        note = f"at its own rate of {when.rate_hz:g} Hz"
        row = {name: replace(one, note="; ".join(filter(None, [one.note, note]))) for name, one in row.items()}
    return measured, row


def own_moving(values: np.ndarray, reference: np.ndarray, sampling: Sampling, options: MetricsOptions) -> Row:
    """Errors of one gyro against the true rate [T], deg/s, from the values [T] that it has."""
    place = own_samples(np.where(np.isnan(values), np.nan, np.arange(len(values))), sampling)[0].astype(np.int64)
    when = own_samples(values, sampling)[1]
    return dynamic_figures([values[place]], reference[place], when.rate_hz, when.segment, 1, options, when)[0]


def with_own(measured: Sequence[Measured], own: dict[int, Measured]) -> list[Measured]:
    """The series as filled in, with the curves, spectra and figures of their own values."""
    return [
        replace(one, curves=own[place].curves, spectrum=own[place].spectrum, readings=own[place].readings)
        if place in own
        else one
        for place, one in enumerate(measured)
    ]
