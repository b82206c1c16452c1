"""What a page is made from: artefacts as plain arrays and records, already read."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from vgyro.board import Board
from vgyro.dataset import Manifest
from vgyro.figure import Figure

Table = Mapping[str, np.ndarray]
Record = Mapping[str, Any]
# Recordings to which a rate is added for a second table (metrics.injected_rate).
MOVED_KINDS = ("static", "thermal")


@dataclass(frozen=True)
class Value:
    """One row of metrics.parquet."""

    value: float
    low: float
    high: float
    unit: str
    note: str
    flags: frozenset[str] = frozenset()

    @property
    def known(self) -> bool:
        return math.isfinite(self.value)


# (method or gyro, definition) → metric → figure, in the order of the table.
Values = dict[tuple[str, str], dict[str, Value]]


@dataclass(frozen=True)
class RatesPart:
    """Rates of a recording as they are drawn.

    time [M], gyros {name: [M]} : least and greatest value of each run of samples in turn;  reference [M] or None
    rest        : the same of the samples at rest alone, {name: [M]}; empty where the board always or never rests
    spans       : stretches at rest, (start, stop) s; empty where it always or never rests
    still       : share of the samples that are at rest
    temperature_time [P], temperatures {name: [P]} : some samples
    moved       : where the board moved though the recording is declared to be at rest: share of it, stretches in s;
                  None: it did not
    delays      : axis → delays between its gyros: status, moving_s, and delay_s, low_s, high_s, removed of each gyro
    """

    time: np.ndarray
    gyros: Table
    rest: Table
    reference: np.ndarray | None
    spans: tuple[tuple[float, float], ...]
    still: float
    temperature_time: np.ndarray
    temperatures: Table
    moved: Record | None = None
    delays: Record = field(default_factory=dict)


@dataclass(frozen=True)
class GarchSummary:
    """GARCH of one gyro. alpha, beta : medians over the windows that have a model;  whole : row of the whole record

    statuses : of the windows, status → how many
    """

    gyro: str
    windows: int
    alpha: float
    beta: float
    statuses: Mapping[str, int]
    whole: Record | None


@dataclass(frozen=True)
class DccSummary:
    """DCC of an array. a, b : medians;  statuses, whole : as for GARCH

    rejects : p_value, p_value_s → share of the tested windows below 5 %; NaN where none was tested
    curves  : time, a, b of some of the fitted windows
    """

    windows: int
    a: float
    b: float
    rejects: Mapping[str, float]
    statuses: Mapping[str, int]
    whole: Record | None
    curves: Table


@dataclass(frozen=True)
class WeightCurves:
    """Weights of one model and mode. curves : time, w_{gyro}, sd_{gyro}, sigma of some samples

    statuses : of all samples, status → how many
    """

    model: str
    mode: str
    curves: Table
    statuses: Mapping[str, int]


@dataclass(frozen=True)
class VolatilityPart:
    """Volatility analysis of one array by one definition of r_t. fits : map of the fits over time"""

    arch_lm: Table | None = None
    garch: tuple[GarchSummary, ...] = ()
    dcc: DccSummary | None = None
    weights: tuple[WeightCurves, ...] = ()
    fits: Table | None = None


@dataclass(frozen=True)
class ArrayPart:
    """One array in one recording.

    gyros      : names, in the board's order
    tables     : correlation, allan, cross_allan, spectrum, tones, metrics, methods, effects, faults, crosscheck,
                 more_gyros: columns as arrays; absent ones are missing
    volatility : definition → its part
    kind       : kind of the recording
    """

    recording: str
    axis: str
    gyros: tuple[str, ...]
    tables: Mapping[str, Table]
    volatility: Mapping[str, VolatilityPart]
    kind: str = "static"

    @property
    def anchor(self) -> str:
        return f"{self.recording}-{self.axis}"

    def values(self) -> Values:
        """Figures of the recording as it is; of one at rest, the rows with an added rate are left out."""
        return self._values[0]

    def moved_values(self) -> Values:
        """Figures of a recording at rest to which a constant rate was added; empty where none was."""
        return self._values[1]

    @property
    def added_rate(self) -> float:
        """The rate of moved_values, deg/s; 0 where there are none."""
        rates = self.tables.get("metrics", {}).get("true_rate", np.empty(0))
        added = rates[rates != 0] if self.kind in MOVED_KINDS else rates[:0]
        return float(added[0]) if len(added) else 0.0

    @cached_property
    def _values(self) -> tuple[Values, Values]:
        still: Values = {}
        moved: Values = {}
        for row in rows_of(self.tables.get("metrics", {})):
            value = Value(
                float(row["value"]), float(row["low"]), float(row["high"]), str(row["unit"]), str(row["note"]),
                frozenset(str(row["flags"]).split()),
            )  # fmt: skip
            found = moved if row["true_rate"] != 0 and self.kind in MOVED_KINDS else still
            found.setdefault((str(row["method"]), str(row["definition"])), {})[str(row["metric"])] = value
        return still, moved

    def methods(self) -> list[dict[str, Any]]:
        """Rows of methods.parquet."""
        return list(rows_of(self.tables.get("methods", {})))


@dataclass(frozen=True)
class RecordingPart:
    """One recording. rates : None where there are none;  arrays : one an axis"""

    name: str
    kind: str
    integrity: Record
    rates: RatesPart | None = None
    arrays: tuple[ArrayPart, ...] = ()

    @property
    def usable(self) -> bool:
        return self.integrity.get("status") != "refused"

    @property
    def moved(self) -> Record | None:
        """Where the board moved though the recording is declared to be at rest; None: it did not."""
        return None if self.rates is None else self.rates.moved

    @property
    def status(self) -> str:
        """good, suspect or refused: by its frames, and by whether it is what it is declared to be."""
        status = str(self.integrity["status"])
        return "suspect" if status == "good" and self.moved is not None else status


@dataclass(frozen=True)
class DatasetPart:
    """Everything that the page of a data set shows.

    noise : axis → noise/<axis>.json;  figures, calibration_figures : name → its meaning;  sources : path → metadata
    """

    name: str
    manifest: Manifest
    board: Board
    recordings: tuple[RecordingPart, ...]
    calibration: Record
    noise: Mapping[str, Record] = field(default_factory=dict)
    figures: Mapping[str, Figure] = field(default_factory=dict)
    calibration_figures: Mapping[str, Figure] = field(default_factory=dict)
    options: Record = field(default_factory=dict)
    sources: Mapping[str, Record] = field(default_factory=dict)

    @property
    def title(self) -> str:
        return self.manifest.title or self.name

    @property
    def arrays(self) -> list[ArrayPart]:
        return [array for recording in self.recordings for array in recording.arrays]

    def recording(self, name: str) -> RecordingPart:
        return next(recording for recording in self.recordings if recording.name == name)


def rows_of(table: Table) -> Iterator[dict[str, Any]]:
    """A table row by row."""
    names = list(table)
    for values in zip(*(table[name] for name in names), strict=True):
        yield dict(zip(names, values, strict=True))
