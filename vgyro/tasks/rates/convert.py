"""Convert: counts to deg/s, with the stretches at rest and the true rate where it is known."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from vgyro.arrays import Floats
from vgyro.board import Board, Gyro
from vgyro.calibration import (
    Compensation,
    clipped_samples,
    compensate,
    find_rest,
    fit_phase,
    sinusoid,
    smooth_temperature,
    to_rates,
)
from vgyro.config import RestOptions
from vgyro.dataset import AT_REST, ConstantReference, FileReference, Manifest, Recording, SinusoidReference, values_of
from vgyro.log import Values
from vgyro.storage.frames import gyro_rails
from vgyro.storage.tables import TableWriter, read_batches, read_column, read_json
from vgyro.tasks.common import Task, run_task
from vgyro.tasks.rates.block_means import between, block_means
from vgyro.tasks.rates.delays import lateness, noise_left
from vgyro.tasks.rates.moves import moves_of
from vgyro.tasks.rates.reference_log import read_reference

SECTIONS = ("manifest", "board", "rest")

MOSTLY_CLIPPED = 0.01


def main(task: Task) -> None:
    """inputs : frames, integrity, calibration, reference (a logged rate, or none);  outputs : rates

    options : manifest, board, recording, analysis.rest
    """
    manifest = task.section("manifest", Manifest)
    board = task.section("board", Board)
    recording = manifest.recording(task.option("recording"))
    frames = task.input("frames")
    time = read_column(frames, "time")
    integrity = read_json(task.input("integrity"))
    rate_hz = float(integrity["rate_hz"])
    converter = Converter(
        board, recording, read_json(task.input("calibration"))["gyros"], values_of(manifest, recording)
    )
    converter.read_temperatures(frames, rate_hz)
    options = task.section("rest", RestOptions)
    clipped = converter.clipped(frames)
    at_rest = rest_of(converter, frames, time, rate_hz, options)
    moves = moves_of(frames, recording, board.gyros, time, rate_hz, options)
    if moves is not None:
        at_rest &= moves.still
    for mask in clipped.values():
        # A gyro that sits at a rail is bad by itself; it must not take the rest away from the others.
        if mask.any() and mask.mean() <= MOSTLY_CLIPPED:
            at_rest &= ~mask
    reference = reference_of(converter, frames, time, task.inputs.get("reference", []))
    late = lateness(converter, frames, rate_hz)
    extra = {"rate_hz": rate_hz, **converter.about(clipped), **missing_record(frames, board), "delays": late.record}
    extra |= noise_left(board, integrity, late)
    if late.rates:
        # Between its samples a late gyro has no value at the ends and beside a missing one.
        extra["missing"] = missing_of(extra.get("missing", {}), late.rates)
    if moves is not None:
        extra["moved"] = moves.record
    if reference is not None:
        extra["reference_axis"] = recording.axis or board.axes[0]
    with TableWriter(task.output("rates"), "rates", task.provenance(), extra) as writer:
        first = 0
        for raw in _batches(frames, converter.columns):
            rows = slice(first, first + len(raw["time"]))
            known = {} if reference is None else {"reference": reference[rows]}
            head = {"time": raw["time"], "segment": raw["segment"], "at_rest": at_rest[rows]}
            rates = converter.rates_of(raw) | {name: rate[rows] for name, rate in late.rates.items()}
            writer.append({**head, **known, **converter.temperatures(raw), **rates})
            first = rows.stop


def _batches(frames: Path, columns: list[str]) -> Iterator[dict[str, np.ndarray]]:
    """Columns of frames.parquet piece by piece; of a refused recording, which has no rows, one empty piece."""
    begun = False
    for raw in read_batches(frames, columns):
        begun = True
        yield raw
    if not begun:
        yield {**dict.fromkeys(columns, np.empty(0)), "segment": np.empty(0, np.int32)}


class Converter:
    """What turns the columns of one recording's frames into rates."""

    def __init__(self, board: Board, recording: Recording, calibration: dict[str, Any], values: Values) -> None:
        self.board, self.recording = board, recording
        self.gyros = {gyro.name: calibration[gyro.name] for gyro in board.gyros}
        self.rates = values == "rates"
        fields = [*(gyro.field for gyro in board.gyros), *(temperature.field for temperature in board.temperatures)]
        self.columns = ["time", "segment", *dict.fromkeys(fields)]
        self.compensations = {} if self.rates else compensations_of(self.gyros)
        self._celsius: dict[str, tuple[np.ndarray, np.ndarray]] = {}  # sensor: time, smoothed °C

    def read_temperatures(self, frames: Path, rate_hz: float) -> None:
        """Smooth the thermometers that are needed: means of a second, then as the calibration does."""
        sensors = {self._sensor_of(name) for name in self.compensations}
        used = [thermometer for thermometer in self.board.temperatures if thermometer.name in sensors]
        if not used:
            return
        means = block_means(frames, [thermometer.field for thermometer in used], max(1.0, 1.0 / rate_hz))
        if means.time.size == 0:
            self.compensations = {}
            return
        for thermometer in used:
            celsius = means.values[thermometer.field] * thermometer.scale + thermometer.offset
            if not np.isfinite(celsius).any():
                continue
            # A thermometer slower than the means has none in some of them.
            smooth = smooth_temperature(between(means.time, celsius), 1.0 / means.seconds, segment=means.segment)
            self._celsius[thermometer.name] = means.time, smooth
        self.compensations = {
            name: one for name, one in self.compensations.items() if self._sensor_of(name) in self._celsius
        }

    def _sensor_of(self, gyro: str) -> str:
        """The thermometer whose temperature a gyro is compensated by."""
        return str(self.gyros[gyro]["temperature"]["sensor"])

    def rates_of(self, raw: dict[str, np.ndarray], gyros: Sequence[Gyro] | None = None) -> dict[str, np.ndarray]:
        """Gyro → deg/s along its axis, of all or of some; a log of rates is only turned the right way round."""
        chosen = self.board.gyros if gyros is None else gyros
        if self.rates:
            return {gyro.name: gyro.sign * raw[gyro.field].astype(float) for gyro in chosen}
        return {gyro.name: self._rate_of(gyro, raw) for gyro in chosen}

    def _rate_of(self, gyro: Gyro, raw: dict[str, np.ndarray]) -> np.ndarray:
        row = self.gyros[gyro.name]
        if gyro.name not in self.compensations:
            return to_rates(raw[gyro.field], gyro.sign, row["scale"], row["bias"])
        celsius = np.interp(raw["time"], *self._celsius[self._sensor_of(gyro.name)])
        return compensate(raw[gyro.field], celsius, gyro.sign, row["scale"], self.compensations[gyro.name])

    def compensation_record(self, gyro: Gyro) -> dict[str, Any]:
        """What was done about the temperature of one gyro, for the metadata.

        in_sample : the compensation was found on this very recording, so what is left of the dependence is flattered
        outside   : share of the time outside the temperatures of the calibration, where its ends are held
        """
        record = self.gyros[gyro.name].get("temperature")
        if gyro.name not in self.compensations:
            return {"applied": False, "note": "rates as logged" if self.rates else "no temperature compensation"}
        celsius = self._celsius[record["sensor"]][1]
        low, high = record["low_c"], record["high_c"]
        in_sample = self.recording.name in record["recordings"]
        note = f"bias and scale compensated by {record['sensor']}, {low:.1f} to {high:.1f} °C"
        return {
            "applied": True,
            "sensor": record["sensor"],
            "in_sample": in_sample,
            "outside": float(np.mean((celsius < low) | (celsius > high))),
            "note": f"{note}; in-sample: found on this recording" if in_sample else note,
        }

    def about(self, clipped: dict[str, np.ndarray]) -> dict[str, Any]:
        """Metadata of rates.parquet: clipped samples, where each scale is from, what was done about the temperature."""
        return {
            "clipped": {name: int(mask.sum()) for name, mask in clipped.items()},
            "calibration": {
                name: "rates as logged" if self.rates else row["source"] for name, row in self.gyros.items()
            },
            "temperature": {gyro.name: self.compensation_record(gyro) for gyro in self.board.gyros},
        }

    def temperatures(self, raw: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """temp_<name> → °C."""
        return {f"temp_{t.name}": raw[t.field].astype(float) * t.scale + t.offset for t in self.board.temperatures}

    def clipped(self, frames: Path) -> dict[str, np.ndarray]:
        """Gyro → bool [T], true at a rail of its converter or range; without the gyros whose rails are not known.

        The rule is that of decode: vgyro.storage.frames.gyro_rails.
        """
        rails = [(gyro, gyro_rails(self.board, gyro, self.rates)) for gyro in self.board.gyros]
        return {
            gyro.name: clipped_samples(read_column(frames, gyro.field), known)
            for gyro, known in rails
            if np.isfinite(known).any()
        }

    def array(self, frames: Path, names: list[str]) -> np.ndarray:
        """Rates [T, n] of some gyros, in single precision."""
        gyros = [gyro for gyro in self.board.gyros if gyro.name in names]
        rates = np.empty((pq.read_metadata(frames).num_rows, len(gyros)), dtype=np.float32)
        first = 0
        for raw in read_batches(frames, ["time", *dict.fromkeys(gyro.field for gyro in gyros)]):
            stop = first + len(raw["time"])
            found = self.rates_of(raw, gyros)
            for index, gyro in enumerate(gyros):
                rates[first:stop, index] = found[gyro.name]
            first = stop
        return rates


def missing_record(frames: Path, board: Board) -> dict[str, dict[str, int]]:
    """Metadata of what the gyros' channels lack; empty where they lack nothing, as channels of whole numbers do.

    missing   : gyro → samples without a value, which are NaN in rates.parquet
    lost_rows : axis → samples in which no gyro of the axis has a value, where there are any
    """
    schema = pq.read_schema(frames)
    chosen = [gyro for gyro in board.gyros if pa.types.is_floating(schema.field(gyro.field).type)]
    if not chosen:
        return {}
    missing, lost = dict.fromkeys([gyro.name for gyro in board.gyros], 0), dict.fromkeys(board.axes, 0)
    for raw in read_batches(frames, list(dict.fromkeys(gyro.field for gyro in chosen))):
        gone = {gyro.name: np.isnan(raw[gyro.field]) for gyro in chosen}
        for name, mask in gone.items():
            missing[name] += int(mask.sum())
        for axis in board.axes:
            members = [gyro.name for gyro in board.array(axis)]
            if all(name in gone and gone[name].any() for name in members):
                lost[axis] += int(np.logical_and.reduce([gone[name] for name in members]).sum())
    found = {"missing": missing, "lost_rows": {axis: rows for axis, rows in lost.items() if rows}}
    return {name: record for name, record in found.items() if any(record.values())}


def missing_of(missing: dict[str, int], rates: Mapping[str, np.ndarray]) -> dict[str, int]:
    """Samples without a value of each gyro, those of `rates` counted anew."""
    return {**missing, **{name: int(np.isnan(rate).sum()) for name, rate in rates.items()}}


def compensations_of(calibration: dict[str, Any]) -> dict[str, Compensation]:
    """Gyro → what the calibration says is to be taken off."""
    found = {}
    for name, row in calibration.items():
        known = row.get("temperature")
        if known and known["applied"]:
            constant, first, second, third = known["bias"]
            found[name] = Compensation(
                known["reference_c"], known["low_c"], known["high_c"], known["scale_slope"],
                (constant, first, second, third),
            )  # fmt: skip
    return found


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
        return find_rest(rates, rate_hz, options, read_column(frames, "segment"))
    return np.full(time.size, recording.kind in AT_REST)


def reference_of(converter: Converter, frames: Path, time: Floats, logs: list[Path]) -> Floats | None:
    """True rate [T], deg/s, about the recording's axis; NaN outside a log; None where it is not known."""
    reference = converter.recording.reference
    if isinstance(reference, ConstantReference):
        return np.full(time.size, reference.rate)
    if isinstance(reference, SinusoidReference):
        phase = reference.phase_rad
        if phase is None:
            axis = converter.recording.axis or converter.board.axes[0]
            names = [gyro.name for gyro in converter.board.array(axis)]
            rates = converter.array(frames, names) if time.size else np.zeros((0, len(names)), np.float32)
            complete = np.isfinite(rates).all(axis=1)
            known = slice(None) if complete.all() else complete
            phase = fit_phase(rates[known].mean(axis=1), time[known], reference.frequency_hz) if complete.any() else 0.0
        return sinusoid(time, reference.amplitude, reference.frequency_hz, phase)
    if isinstance(reference, FileReference) and logs:
        logged, rate = read_reference(logs[0], reference)
        truth: Floats = np.interp(time, logged, rate, left=np.nan, right=np.nan)
        return truth
    return None


if __name__ == "__main__":
    run_task(main)
