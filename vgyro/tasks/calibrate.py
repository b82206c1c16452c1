"""Calibrate: scale factor and bias of every gyro, from the rate-table recordings or, where there are none, nominal."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vgyro.board import Board, Gyro
from vgyro.calibration import (
    GyroNominal,
    ScaleFit,
    average_plateaus,
    find_plateaus,
    fit_scale_factor,
    nominal_fit,
)
from vgyro.dataset import FileReference, Manifest, PlateauReference, Recording
from vgyro.errors import TooShort
from vgyro.storage.tables import read_columns, read_json, write_json
from vgyro.tasks.common import Task, run_task
from vgyro.tasks.reference_log import read_reference


@dataclass(frozen=True)
class Source:
    """A calibration recording, its frames, and its logged reference if it has one."""

    recording: Recording
    frames: Path
    reference: Path | None


def main(task: Task) -> None:
    """inputs : frames, integrity (calibration recordings, in the manifest's order), references (those that have one)

    outputs : calibration;  options : manifest, board
    """
    manifest = Manifest.model_validate(task.options["manifest"])
    board = Board.model_validate(task.options["board"])
    sources, skipped = usable(task, manifest)
    gyros: dict[str, Any] = {}
    used: dict[str, str | None] = {}
    for axis in board.axes:
        name, fits, problems = calibrate_axis(sources, board, axis, manifest.latitude_deg)
        used[axis] = name
        skipped.update({problem: reason for problem, reason in problems.items() if problem not in skipped})
        gyros.update({fit.gyro: record_of(fit, name) for fit in fits})
    record = {
        "dataset": task.options.get("dataset", ""),
        "rule": "the first usable calibration recording about each axis; the others are not pooled, because the bias "
        "changes from one switch-on to the next",
        "recordings": used,
        "skipped": skipped,
        "earth_rate_removed": manifest.latitude_deg is not None and any(used.values()),
        "gyros": {gyro.name: gyros[gyro.name] for gyro in board.gyros},
    }
    write_json(task.output("calibration"), record)


def usable(task: Task, manifest: Manifest) -> tuple[list[Source], dict[str, str]]:
    """Calibration recordings that decode did not refuse, and those left out with the reason."""
    recordings = [recording for recording in manifest.recordings if recording.kind == "calibration"]
    logs = iter(task.inputs.get("references", []))
    sources, skipped = [], {}
    for recording, frames, integrity in zip(
        recordings, task.inputs.get("frames", []), task.inputs.get("integrity", []), strict=True
    ):
        log = next(logs, None) if isinstance(recording.reference, FileReference) else None
        if read_json(integrity)["status"] == "refused":
            skipped[recording.name] = "refused: see its integrity record"
        elif recording.parquet is not None and recording.parquet.values == "rates":
            skipped[recording.name] = "holds rates, not counts: nothing to calibrate"
        else:
            sources.append(Source(recording, frames, log))
    return sources, skipped


def calibrate_axis(
    sources: list[Source], board: Board, axis: str, latitude_deg: float | None
) -> tuple[str | None, list[ScaleFit], dict[str, str]]:
    """Fits of one axis' gyros from the first recording that allows it; else nominal."""
    array = board.array(axis)
    nominal = [GyroNominal(g.name, g.scale, g.bias, g.sign, g.range_deg_s) for g in array]
    problems = {}
    for source in sources:
        if (source.recording.axis or board.axes[0]) != axis:
            continue
        try:
            fits = fit_recording(source, board, array, nominal, latitude_deg)
        except TooShort as error:
            problems[source.recording.name] = error.what
            continue
        return source.recording.name, fits, problems
    return None, [nominal_fit(gyro) for gyro in nominal], problems


def fit_recording(
    source: Source, board: Board, array: list[Gyro], nominal: list[GyroNominal], latitude_deg: float | None
) -> list[ScaleFit]:
    """Fits from one recording.  raises : TooShort, DataError"""
    fields = [gyro.field for gyro in array]
    columns = read_columns(source.frames, ["time", *dict.fromkeys(fields)])
    counts = np.column_stack([columns[name] for name in fields])
    plateaus = list(plateaus_of(source))
    rails = (board.adc.low, board.adc.high) if board.adc else None
    means = average_plateaus(counts, columns["time"], plateaus, rails)
    return fit_scale_factor(
        means.rate, means.mean, means.standard_error, nominal, latitude_deg, where=source.recording.name
    )


def plateaus_of(source: Source) -> Iterator[tuple[float, float, float]]:
    """(start s, stop s, rate deg/s): as the manifest lists them, or found in the logged reference."""
    reference = source.recording.reference
    if isinstance(reference, PlateauReference):
        yield from ((plateau.start, plateau.stop, plateau.rate) for plateau in reference.plateaus)
    elif isinstance(reference, FileReference) and source.reference is not None:
        time, rate = read_reference(source.reference, reference)
        yield from find_plateaus(rate, time)


def record_of(fit: ScaleFit, recording: str | None) -> dict[str, Any]:
    """JSON of one gyro. Scale deg/s a count, bias counts, residual deg/s; null where there is no figure."""
    return {
        "source": fit.source,
        "recording": recording if fit.source == "measured" else None,
        **{
            name: _number(getattr(fit, name))
            for name in (
                "scale", "scale_low", "scale_high", "bias", "bias_low", "bias_high", "nonlinearity_ppm", "floor_ppm",
            )
        },
        "points": [
            {"rate": float(rate), "mean_count": float(count), "residual_deg_s": float(residual)}
            for rate, count, residual in zip(fit.rate, fit.mean_count, fit.residual, strict=True)
        ],
        "note": fit.note,
    }  # fmt: skip


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


if __name__ == "__main__":
    run_task(main)
