"""Calibrate: scale factor, bias and all other figures of every gyro, from the rate-table recordings, or nominal.

Beside them the recordings at rest: thermal ones for the bias against temperature, static ones for the self-heating.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vgyro.board import Board
from vgyro.calibration import (
    DIRECTION_NAMES,
    Finding,
    ScaleFit,
    figure_record,
    nominal_fit,
    not_measured,
)
from vgyro.calibration.figures import FIGURES
from vgyro.config import CalibrationOptions, RestOptions
from vgyro.dataset import FileReference, Manifest, values_of
from vgyro.storage.tables import read_json, write_json
from vgyro.tasks.calibration.suspicions import suspicions_of
from vgyro.tasks.calibration.tables import RecordingSource, TableTest, cross_axes, fit_tests, nominal_of
from vgyro.tasks.calibration.thermal import Thermal, read_rests, temperature_record, thermal_of, worth_it
from vgyro.tasks.common import Task, run_task
from vgyro.tasks.rates.block_means import thermometer_of
from vgyro.units import earth_rate_deg_s

SECTIONS = ("manifest", "board", "calibration", "rest")

KINDS = ("calibration", "thermal", "static")
STANDARD = "IEEE Std 1431-2004"
RULE = (
    "scale, bias and points are those of the first usable calibration recording about each axis; the others are not "
    "pooled, because the bias changes from one switch-on to the next: they give repeatability and temperature slopes"
)


def main(task: Task) -> None:
    """inputs : frames, integrity (of calibration, thermal and static recordings, in the manifest's order), references

    references : logged rates, of the calibration recordings that have one
    outputs : calibration;  options : manifest, board, analysis.calibration, analysis.rest
    """
    manifest = task.section("manifest", Manifest)
    board = task.section("board", Board)
    options = task.section("calibration", CalibrationOptions)
    sources, skipped = usable(task, manifest)
    tables = [source for source in sources if source.recording.kind == "calibration"]
    tests, problems = fit_tests(tables, board, manifest.latitude_deg, options)
    known = {gyro.name: main_fit(gyro.name, tests, board) for gyro in board.gyros}
    rests = read_rests(sources, board, task.section("rest", RestOptions))
    crossed = cross_axes(tests, board, {name: fit for name, (fit, _) in known.items()}, options)
    gyros = {}
    for gyro in board.gyros:
        fit, recording = known[gyro.name]
        thermal = thermal_of(gyro, board, fit, tests, rests, options)
        thermometer = thermometer_of(board, gyro.name)
        gyros[gyro.name] = {
            **record_of(fit, recording),
            "figures": figures_of(fit, thermal, crossed[gyro.name]),
            "temperature": temperature_record(
                thermal, thermometer.name if thermometer else None, options.temperature == "auto" and worth_it(thermal)
            ),
        }
    used = {axis: next((test for test in tests if test.axis == axis), None) for axis in board.axes}
    record = {
        "dataset": task.option("dataset"),
        "rule": RULE,
        "recordings": {axis: test.name if test else None for axis, test in used.items()},
        "skipped": {**skipped, **problems},
        "suspicions": suspicions_of(tables, tests, board, options),
        "earth_rate_removed": manifest.latitude_deg is not None and any(used.values()),
        "test": {axis: test_record(axis, tests, manifest.latitude_deg) for axis, test in used.items() if test},
        "gyros": gyros,
    }
    write_json(task.output("calibration"), record)


def usable(task: Task, manifest: Manifest) -> tuple[list[RecordingSource], dict[str, str]]:
    """Recordings that decode did not refuse and that hold counts, and those left out with the reason."""
    recordings = [recording for recording in manifest.recordings if recording.kind in KINDS]
    logs = iter(task.inputs.get("references", []))
    sources, skipped = [], {}
    for recording, frames, integrity in zip(
        recordings, task.inputs.get("frames", []), task.inputs.get("integrity", []), strict=True
    ):
        log = None
        if recording.kind == "calibration" and isinstance(recording.reference, FileReference):
            log = next(logs, None)
        about = read_json(integrity)
        if about["status"] == "refused":
            reason = "refused: see its integrity record"
        elif values_of(manifest, recording) == "rates":
            reason = "holds rates, not counts: nothing to calibrate"
        else:
            sources.append(RecordingSource(recording, frames, float(about["rate_hz"]), log))
            continue
        if recording.kind == "calibration":
            skipped[recording.name] = reason
    return sources, skipped


def main_fit(gyro: str, tests: list[TableTest], board: Board) -> tuple[ScaleFit, str | None]:
    """The first fit in which the gyro was measured, and its recording; else nominal, with the reason."""
    fits = [(fit, test.name) for test in tests for fit in test.fits if fit.gyro == gyro]
    for fit, recording in fits:
        if fit.source == "measured":
            return fit, recording
    if fits:
        return fits[0][0], None
    (nominal,) = nominal_of([one for one in board.gyros if one.name == gyro])
    return nominal_fit(nominal), None


def figures_of(fit: ScaleFit, thermal: Thermal, crossed: Finding) -> dict[str, Any]:
    """Every figure of FIGURES, in its order, as JSON."""
    known = {**fit.figures, **thermal.figures, "cross_axis": crossed}
    missing = not_measured("no calibration recording that can be used")
    return {name: figure_record(name, known.get(name, missing)) for name in FIGURES}


def test_record(axis: str, tests: list[TableTest], latitude_deg: float | None) -> dict[str, Any]:
    """How the gyros of an axis were tested: rates and times of the first recording, temperatures of all."""
    about = [test for test in tests if test.axis == axis]
    means = about[0].means
    celsius = np.concatenate([test.means.temperature.ravel() for test in about])
    celsius = celsius[np.isfinite(celsius)]
    turning = means.rate != 0
    full_scale = [fit.full_scale for fit in about[0].fits if math.isfinite(fit.full_scale)]
    return {
        "recordings": [test.name for test in about],
        "rates": int(np.unique(means.rate).size),
        "full_scale": max(full_scale, default=float(np.abs(means.rate).max())),
        "seconds_a_point": float(np.median(means.seconds)),
        "whole_turns": bool(turning.any() and (means.turns[turning] > 0).all()),
        "earth_rate_deg_s": None if latitude_deg is None else earth_rate_deg_s(latitude_deg),
        "temperature_c": [float(celsius.min()), float(celsius.max())] if celsius.size else None,
        "standard": STANDARD,
    }


def record_of(fit: ScaleFit, recording: str | None) -> dict[str, Any]:
    """JSON of one gyro. Scale deg/s a count, bias counts, residual deg/s; null where there is no figure."""
    numbers = (
        "scale", "scale_low", "scale_high", "bias", "bias_low", "bias_high", "nonlinearity_ppm", "floor_ppm",
    )  # fmt: skip
    points = fit.points
    columns = (
        points.rate, points.mean_count, points.residual, points.standard_error, points.direction, points.temperature,
    )  # fmt: skip
    return {
        "source": fit.source,
        "recording": recording,
        **{name: _number(getattr(fit, name)) for name in numbers},
        "points": [
            {
                "rate": float(rate),
                "mean_count": float(count),
                "residual_deg_s": float(residual),
                "recording": recording,
                "direction": DIRECTION_NAMES[int(direction)],
                "temperature_c": _number(celsius),
                "standard_error_deg_s": _number(error),
            }
            for rate, count, residual, error, direction, celsius in zip(*columns, strict=True)
        ],
        "note": fit.note,
    }


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


if __name__ == "__main__":
    run_task(main)
