"""What the tasks that fuse share: the rates of one array with its noise and weights, and the parameters."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import TypeVar, cast

import numpy as np
import pyarrow.parquet as pq

from vgyro.board import Board
from vgyro.config import MODELS, MODES, FusionOptions, VolatilityOptions
from vgyro.dataset import AT_REST
from vgyro.fusion import ArrayRates, FilterParameters, SampleWeights, block_of_sample
from vgyro.fusion.events import FaultEvent, FaultKind
from vgyro.fusion.types import WeightKey
from vgyro.storage.tables import ROW_GROUP, read_batches, read_columns, read_rows
from vgyro.tasks.common import Task
from vgyro.tasks.fusion.noise_record import read_noise
from vgyro.tasks.rates.rates_file import (
    ArrayFile,
    read_array,
    read_temperature,
    samples_before,
    stretch_times,
    thermometers,
)
from vgyro.tasks.volatility.layout import weight_blocks
from vgyro.tasks.volatility.stored import LEVEL, MOVED

T = TypeVar("T")

NOT_AT_FULL_RATE = "at volatility.rate_hz: full the weights of the level are not estimated a second time"


@dataclass(frozen=True)
class OpenArray:
    """One recording of one array, and how it is to be fused.

    injected_rate : constant rate that is added for a second run, deg/s; None: there is none
    """

    gyros: list[str]
    file: ArrayFile
    rates: ArrayRates
    parameters: FilterParameters
    fusion: FusionOptions
    volatility: VolatilityOptions
    injected_rate: float | None = None

    def move(self) -> ArrayRates:
        """Add the injected rate to the rates, in their place, for they are large; the weights are those with it, too.

        Rates in single precision are rounded by that, at 0.05 deg/s by 3e-8 deg/s at most where they are below 1 deg/s.
        """
        for column in self.rates.rate.T:
            column += self.injected_rate
        self.rates.forget()
        weights, deviations = (_of_moved_level(known) for known in (self.rates.weights, self.rates.deviations))
        reasons: dict[WeightKey, str] = _of_moved_level(self.rates.no_weights)
        if self.volatility.rate_hz == "full":
            reasons = {(model, mode, LEVEL): NOT_AT_FULL_RATE for model in MODELS for mode in MODES}
        return replace(self.rates, weights=weights, deviations=deviations, no_weights=reasons)


def _of_moved_level(known: Mapping[WeightKey, T]) -> dict[WeightKey, T]:
    """What is known of the moved level, as that of the definition `level`."""
    return {(model, mode, LEVEL): one for (model, mode, definition), one in known.items() if definition == MOVED}


def open_array(task: Task) -> OpenArray:
    """Read rates, noise and, where they are an input, the weights of one array.

    inputs : rates, noise, weights; moved, the weights of the level with the option injected_rate, and faults (both may
             be left out)
    """
    fusion = task.section("fusion", FusionOptions)
    volatility = task.section("volatility", VolatilityOptions)
    board = task.section("board", Board)
    members = board.array(task.option("axis"))
    gyros = [gyro.name for gyro in members]
    file = read_array(task.input("rates"), gyros, task.option("axis"))
    tables = [*task.inputs.get("weights", []), *task.inputs.get("moved", [])]
    block_hz = file.rate_hz if volatility.rate_hz == "full" else volatility.rate_hz
    weights, deviations, reasons = read_weights(tables, gyros, file, block_hz)
    noise = read_noise(task.input("noise"), gyros, file.path.parent.name)
    rates = ArrayRates(
        file.rate, file.rate_hz, file.segment, file.at_rest, noise, weights, reasons,
        faults=tuple(event for path in task.inputs.get("faults", []) for event in read_faults(path, gyros, file)),
        deviations=deviations,
        temperature=read_temperature(file, thermometers(board, gyros)) if fusion.temperature == "auto" else None,
        stretch_time=stretch_times(file), missing=file.missing,
        lowpass_hz=np.array([gyro.lowpass_hz or np.nan for gyro in members]),
    )  # fmt: skip
    moving = in_motion(task.option("kind"), file.at_rest, file.moved)
    parameters = FilterParameters.of(fusion, moving, block_hz, task.engine)
    return OpenArray(gyros, file, rates, parameters, fusion, volatility, task.option("injected_rate"))


def read_faults(path: Path, gyros: list[str], file: ArrayFile) -> list[FaultEvent]:
    """The events of faults.parquet in samples of the rates."""
    rows = read_columns(path)
    half = 0.5 / file.rate_hz
    start = samples_before(file.path, rows["start"] - half)
    stop = samples_before(file.path, rows["stop"] + half)
    return [
        FaultEvent(
            gyros.index(str(rows["gyro"][row])), cast(FaultKind, str(rows["kind"][row])), int(start[row]),
            int(stop[row]), float(rows["evidence"][row]), float(rows["size"][row]), str(rows["unit"][row]),
        )
        for row in range(len(rows["gyro"]))
    ]  # fmt: skip


def in_motion(kind: str, at_rest: np.ndarray, moved: bool) -> bool:
    """Does the board move in this recording, at least in part?

    moved : convert found motion in what is declared to be at rest. The samples at rest alone do not tell it: at rest,
            too, those are left out at which a gyro is clipped.
    """
    if kind in AT_REST:
        return moved
    return not (kind == "free" and bool(at_rest.all()))


def read_weights(
    paths: list[Path], gyros: list[str], file: ArrayFile, block_hz: float
) -> tuple[dict[WeightKey, SampleWeights], dict[WeightKey, SampleWeights], dict[WeightKey, str]]:
    """Weights of every model, mode and definition, ready for the samples of the rates; the deviations; why no weights.

    paths : weights.parquet, each in the folder that its definition names. The weights stay there until they are used.
    file  : the samples;  block_hz : rate of the volatility series
    """
    weights: dict[WeightKey, SampleWeights] = {}
    reasons: dict[WeightKey, str] = {}
    deviations: dict[WeightKey, SampleWeights] = {}
    kinds = ((weights, [f"w_{gyro}" for gyro in gyros]), (deviations, [f"sd_{gyro}" for gyro in gyros]))
    block, last = np.empty(0, dtype=np.int32), None
    for path in paths:
        blocks, count = weight_blocks(path)
        if count == 0:
            continue
        # The definitions have one series in common: its map is made once.
        if last is None or not _same_times(path, last):
            block, last = _blocks_of_samples(path, count, file, block_hz), path
        for (model, mode), first in blocks.items():
            key = model, mode, path.parent.name
            if _any_known(path, first, count):
                there = pq.read_schema(path).names
                for known, columns in ((known, columns) for known, columns in kinds if set(columns) <= set(there)):
                    known[key] = SampleWeights(block, partial(rows_in_order, path, columns, first), len(gyros))
            else:
                reasons[key] = str(read_rows(path, ["status"], first, first + 1)["status"][0])
    return weights, deviations, reasons


def _blocks_of_samples(path: Path, count: int, file: ArrayFile, block_hz: float) -> np.ndarray:
    # As long as vgyro.volatility makes its blocks: a whole number of samples.
    block_s = max(1, round(file.rate_hz / block_hz)) / file.rate_hz
    begins = np.concatenate([time[:, 0] for time in rows_in_order(path, ["time"], 0, _slices(count))])
    times = (batch["time"] for batch in read_batches(file.path, ["time"]))
    return np.concatenate([block_of_sample(time, begins, block_s, file.rate_hz) for time in times])


def _same_times(path: Path, other: Path) -> bool:
    counts = [weight_blocks(one)[1] for one in (path, other)]
    times = [rows_in_order(one, ["time"], 0, _slices(counts[0])) for one in (path, other)]
    return counts[0] == counts[1] and all(np.array_equal(*pair) for pair in zip(*times, strict=True))


def _any_known(path: Path, first: int, count: int) -> bool:
    return any(np.isfinite(sigma).any() for sigma in rows_in_order(path, ["sigma"], first, _slices(count)))


def _slices(count: int) -> list[slice]:
    return [slice(start, min(start + ROW_GROUP, count)) for start in range(0, count, ROW_GROUP)]


def rows_in_order(path: Path, columns: list[str], first: int, slices: Iterable[slice]) -> Iterator[np.ndarray]:
    """Rows [B, columns] of one slice after the other, counted from row `first`; each row group is read once."""
    file = pq.ParquetFile(path)
    edges = np.cumsum([0, *(file.metadata.row_group(index).num_rows for index in range(file.num_row_groups))])

    @lru_cache(maxsize=1)
    def group(index: int) -> np.ndarray:
        table = file.read_row_group(index, columns=columns)
        return np.vstack([table.column(name).to_numpy() for name in columns])

    for rows in slices:
        start, stop = rows.start + first, rows.stop + first
        groups = range(np.searchsorted(edges, start, side="right") - 1, np.searchsorted(edges, stop))
        parts = [group(index)[:, max(0, start - edges[index]) : stop - edges[index]] for index in groups]
        yield np.hstack([np.empty((len(columns), 0)), *parts]).T
