"""Convert: counts to deg/s, with the stretches at rest and the true rate where it is known."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq

from vgyro.board import Board
from vgyro.calibration import clipped_samples, find_rest, fit_phase, sinusoid, to_rates
from vgyro.config import RestOptions
from vgyro.dataset import AT_REST, ConstantReference, FileReference, Manifest, Recording, SinusoidReference
from vgyro.storage.tables import TableWriter, read_batches, read_json
from vgyro.tasks.common import Task, run_task
from vgyro.tasks.reference_log import read_reference

MOSTLY_CLIPPED = 0.01
CONTRADICTION = 0.02
FEWEST_STEPS = 10
GAP_STEPS = 1.5


def main(task: Task) -> None:
    """inputs : frames, calibration, reference (a logged rate, or none);  outputs : rates

    options : manifest, board, recording, analysis.rest
    """
    manifest = Manifest.model_validate(task.options["manifest"])
    board = Board.model_validate(task.options["board"])
    recording = manifest.recording(task.options["recording"])
    frames = task.input("frames")
    converter = Converter(board, recording, read_json(task.input("calibration"))["gyros"])
    time = whole_column(frames, "time")
    rate_hz = sample_rate(recording, board, time)
    options = RestOptions.model_validate(task.options["analysis"].get("rest", {}))
    clipped = converter.clipped(frames)
    at_rest = rest_of(converter, frames, time, rate_hz, options)
    for mask in clipped.values():
        # A gyro that sits at a rail is bad by itself; it must not take the rest away from the others.
        if mask.any() and mask.mean() <= MOSTLY_CLIPPED:
            at_rest &= ~mask
    reference = reference_of(converter, frames, time, task.inputs.get("reference", []))
    extra: dict[str, Any] = {
        "rate_hz": rate_hz,
        "clipped": {name: int(mask.sum()) for name, mask in clipped.items()},
        "calibration": {
            name: "rates as logged" if converter.rates else row["source"] for name, row in converter.gyros.items()
        },
    }
    if reference is not None:
        extra["reference_axis"] = recording.axis or board.axes[0]
    with TableWriter(task.output("rates"), "rates", task.provenance(), extra) as writer:
        first = 0
        for raw in read_batches(frames, converter.columns):
            rows = slice(first, first + len(raw["time"]))
            known = {} if reference is None else {"reference": reference[rows]}
            head = {"time": raw["time"], "segment": raw["segment"], "at_rest": at_rest[rows]}
            writer.append({**head, **known, **converter.temperatures(raw), **converter.rates_of(raw)})
            first = rows.stop
        if first == 0:
            raw = dict.fromkeys(converter.columns, np.empty(0))
            head = {"time": np.empty(0), "segment": np.empty(0, np.int32), "at_rest": np.empty(0, bool)}
            known = {} if reference is None else {"reference": np.empty(0)}
            writer.append({**head, **known, **converter.temperatures(raw), **converter.rates_of(raw)})


class Converter:
    """What turns the columns of one recording's frames into rates."""

    def __init__(self, board: Board, recording: Recording, calibration: dict[str, Any]) -> None:
        self.board, self.recording = board, recording
        self.gyros = {gyro.name: calibration[gyro.name] for gyro in board.gyros}
        self.rates = recording.parquet is not None and recording.parquet.values == "rates"
        fields = [*(gyro.field for gyro in board.gyros), *(temperature.field for temperature in board.temperatures)]
        self.columns = ["time", "segment", *dict.fromkeys(fields)]

    def rates_of(self, raw: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Gyro → deg/s along its axis; a log of rates is only turned the right way round."""
        if self.rates:
            return {gyro.name: gyro.sign * raw[gyro.field].astype(float) for gyro in self.board.gyros}
        return {
            gyro.name: to_rates(
                raw[gyro.field], gyro.sign, self.gyros[gyro.name]["scale"], self.gyros[gyro.name]["bias"]
            )
            for gyro in self.board.gyros
        }

    def temperatures(self, raw: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """temp_<name> → °C."""
        return {f"temp_{t.name}": raw[t.field].astype(float) * t.scale + t.offset for t in self.board.temperatures}

    def clipped(self, frames: Path) -> dict[str, np.ndarray]:
        """Gyro → bool [T], true at a rail of the converter; empty where the rails are not known."""
        if self.board.adc is None or self.rates:
            return {}
        rails = (self.board.adc.low, self.board.adc.high)
        return {gyro.name: clipped_samples(whole_column(frames, gyro.field), rails) for gyro in self.board.gyros}

    def array(self, frames: Path, names: list[str]) -> np.ndarray:
        """Rates [T, n] of some gyros, in single precision."""
        chosen = Converter(
            self.board.model_copy(update={"gyros": tuple(g for g in self.board.gyros if g.name in names)}),
            self.recording,
            self.gyros,
        )
        fields = [*dict.fromkeys(gyro.field for gyro in chosen.board.gyros)]
        rates = np.empty((pq.read_metadata(frames).num_rows, len(chosen.board.gyros)), dtype=np.float32)
        first = 0
        for raw in read_batches(frames, fields):
            stop = first + len(raw[fields[0]])
            for index, rate in enumerate(chosen.rates_of(raw).values()):
                rates[first:stop, index] = rate
            first = stop
        return rates


def whole_column(frames: Path, name: str) -> np.ndarray:
    """One column of numbers of a table, read row group by row group: little more memory than it takes itself."""
    kind = pq.read_schema(frames).field(name).type.to_pandas_dtype()
    values = np.empty(pq.read_metadata(frames).num_rows, dtype=kind)
    first = 0
    for batch in read_batches(frames, [name]):
        stop = first + len(batch[name])
        values[first:stop] = batch[name]
        first = stop
    return values


def sample_rate(recording: Recording, board: Board, time: np.ndarray) -> float:
    """Sample rate, Hz: as declared, unless the time stamps contradict it by more than 2 %."""
    declared = float(recording.rate_hz or board.rate_hz)
    if time.size < FEWEST_STEPS:
        return declared
    steps = np.diff(time)
    usual = steps[steps <= GAP_STEPS * np.median(steps)]
    if usual.size == 0 or usual.mean() <= 0:
        return declared
    measured = 1.0 / float(usual.mean())
    return measured if abs(measured / declared - 1) > CONTRADICTION else declared


def rest_of(converter: Converter, frames: Path, time: np.ndarray, rate_hz: float, options: RestOptions) -> np.ndarray:
    """bool [T]: at rest, as listed, as the kind says, or as found."""
    recording = converter.recording
    if recording.rest != "auto":
        inside = np.zeros(time.size, dtype=bool)
        for start, stop in recording.rest:
            inside |= (time >= start) & (time <= stop)
        return inside
    if recording.kind == "free" and time.size:
        rates = converter.array(frames, [gyro.name for gyro in converter.board.gyros])
        return find_rest(rates, rate_hz, options, whole_column(frames, "segment"))
    return np.full(time.size, recording.kind in AT_REST)


def reference_of(converter: Converter, frames: Path, time: np.ndarray, logs: list[Path]) -> np.ndarray | None:
    """True rate [T], deg/s, about the recording's axis; NaN outside a log; None where it is not known."""
    reference = converter.recording.reference
    if isinstance(reference, ConstantReference):
        return np.full(time.size, reference.rate)
    if isinstance(reference, SinusoidReference):
        phase = reference.phase_rad
        if phase is None:
            axis = converter.recording.axis or converter.board.axes[0]
            names = [gyro.name for gyro in converter.board.array(axis)]
            phase = (
                fit_phase(converter.array(frames, names).mean(axis=1), time, reference.frequency_hz)
                if time.size
                else 0.0
            )
        return sinusoid(time, reference.amplitude, reference.frequency_hz, phase)
    if isinstance(reference, FileReference) and logs:
        logged, rate = read_reference(logs[0], reference)
        return np.interp(time, logged, rate, left=np.nan, right=np.nan)
    return None


if __name__ == "__main__":
    run_task(main)
