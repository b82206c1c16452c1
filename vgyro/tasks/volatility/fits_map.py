"""How the fits of the rolling windows ended, over the recording: what the report draws instead of every window."""

from __future__ import annotations

import numpy as np
import pyarrow as pa

from vgyro.arrays import Ints
from vgyro.engine.models import DCC_STATUSES, GARCH_STATUSES
from vgyro.tasks.volatility.layout import WHOLE
from vgyro.tasks.volatility.stored import ArraySeries

BINS = 100
DCC = "dcc"


class FitsMap:
    """Counts windows by time, subject (gyro, or dcc) and status; a window counts where its middle is."""

    def __init__(self, array: ArraySeries) -> None:
        self._gyros = array.gyros
        bins = min(BINS, len(array.plan))
        start, stop = time_of(array) if bins else (0.0, 0.0)
        self._edges = np.linspace(start, stop, bins + 1)
        self._counts = {
            **{gyro: np.zeros((bins, len(GARCH_STATUSES)), dtype=np.int64) for gyro in array.gyros},
            DCC: np.zeros((bins, len(DCC_STATUSES)), dtype=np.int64),
        }

    def count(self, table: pa.Table) -> None:
        """Add rows of garch.parquet, or of dcc.parquet."""
        time = (table.column("time_start").to_numpy() + table.column("time_stop").to_numpy()) / 2
        bins = np.searchsorted(self._edges, time, side="right") - 1
        rolling = table.column("window").to_numpy() != WHOLE
        if "gyro" in table.column_names:
            gyro, status = codes_of(table, "gyro", self._gyros), codes_of(table, "status", GARCH_STATUSES)
            for number, name in enumerate(self._gyros):
                mine = rolling & (gyro == number)
                np.add.at(self._counts[name], (bins[mine], status[mine]), 1)
        else:
            np.add.at(self._counts[DCC], (bins[rolling], codes_of(table, "status", DCC_STATUSES)[rolling]), 1)

    def table(self) -> pa.Table:
        """Rows of fits.parquet: by bin, subject and status; no row where there is no window."""
        rows = [
            (self._edges[place], self._edges[place + 1], subject, code, int(counts[place, code]))
            for place in range(len(self._edges) - 1)
            for subject, counts in self._counts.items()
            for code in np.flatnonzero(counts[place]).tolist()
        ]
        names = {subject: DCC_STATUSES if subject == DCC else GARCH_STATUSES for subject in self._counts}
        start, stop, subject, code, count = zip(*rows, strict=True) if rows else ((),) * 5
        return pa.table(
            {
                "time_start": np.array(start, dtype=float),
                "time_stop": np.array(stop, dtype=float),
                "subject": pa.array(subject, pa.string()),
                "status": pa.array([names[one][place] for one, place in zip(subject, code, strict=True)], pa.string()),
                "windows": np.array(count, dtype=np.int64),
            }
        )


def time_of(array: ArraySeries) -> tuple[float, float]:
    """When the series begins and ends, s."""
    first, last = array.table(0, 1)[1][0], array.table(array.samples - 1, array.samples)[1][0]
    return float(first), float(last) + 1 / array.rate_hz


def codes_of(table: pa.Table, name: str, names: list[str] | tuple[str, ...]) -> Ints:
    """A dictionary-encoded column as places in `names`."""
    column = table.column(name).combine_chunks()
    places = np.array([names.index(word) for word in column.dictionary.to_pylist()], dtype=np.int64)
    codes: Ints = places[column.indices.to_numpy()]
    return codes
