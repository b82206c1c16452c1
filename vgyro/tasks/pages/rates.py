"""rates.parquet as a page draws it: thinned while it is read, so that a day of samples is never held."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vgyro.report.envelope import Envelope, places_of, stretches
from vgyro.report.model import RatesPart
from vgyro.storage.tables import read_columns, read_metadata, row_groups
from vgyro.tasks.rates.block_means import between

REFERENCE = "reference"
TEMPERATURE = "temp_"


def read_rates(path: Path, gyros: list[str]) -> RatesPart:
    """The curves of a recording; gyros that the table lacks are left out."""
    metadata = read_metadata(path)
    known = list(metadata["units"])
    gyros = [name for name in gyros if name in known]
    temperatures = [name for name in known if name.startswith(TEMPERATURE)]
    reference = [REFERENCE] if REFERENCE in known else []
    at_rest = read_columns(path, ["at_rest"])["at_rest"].astype(bool)
    samples = len(at_rest)
    runs = [] if at_rest.all() or not at_rest.any() else stretches(at_rest)
    whole = Envelope(samples, [*gyros, *reference])
    rest = Envelope(samples, gyros if runs else [])
    borders = _Picker(np.array(runs, dtype=np.int64).ravel(), ["time"])
    slow = _Picker(places_of(samples), ["time", *temperatures])
    done = 0
    names = ["time", *gyros, *reference, *temperatures]
    for group in row_groups(path, names):
        batch = {name: group.column(name).to_numpy() for name in names}
        time = batch["time"]
        whole.feed(time, batch)
        if runs:
            still = at_rest[done : done + len(time)]
            rest.feed(time, {name: np.where(still, batch[name], np.nan) for name in gyros})
        borders.feed(batch)
        slow.feed({**batch, **{name: between(time, batch[name]) for name in temperatures}})
        done += len(time)
    time, curves = whole.result()
    drawn = curves.pop(REFERENCE, None)
    ends = borders.columns()["time"].reshape(-1, 2)
    some = slow.columns()
    return RatesPart(
        time=time,
        gyros=curves,
        rest=rest.result()[1],
        reference=drawn if drawn is not None and np.isfinite(drawn).any() else None,
        spans=tuple((float(start), float(stop)) for start, stop in ends),
        still=float(at_rest.mean()) if samples else 1.0,
        temperature_time=some["time"],
        temperatures={name.removeprefix(TEMPERATURE): some[name] for name in temperatures},
        moved=metadata.get("moved"),
        delays=metadata["delays"],
    )


class _Picker:
    """Some rows, in rising order, of columns that come in pieces."""

    def __init__(self, rows: np.ndarray, columns: list[str]) -> None:
        self._rows, self._done = rows, 0
        self._parts: dict[str, list[np.ndarray]] = {name: [np.empty(0)] for name in columns}

    def feed(self, batch: dict[str, np.ndarray]) -> None:
        size = len(next(iter(batch.values())))
        first, stop = np.searchsorted(self._rows, [self._done, self._done + size])
        here = self._rows[first:stop] - self._done
        for name, parts in self._parts.items():
            parts.append(batch[name][here])
        self._done += size

    def columns(self) -> dict[str, np.ndarray]:
        return {name: np.concatenate(parts) for name, parts in self._parts.items()}
