"""A CSV of a time and six gyros to Parquet, against pandas."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from benchmarks.contest import Accuracy, Contest, Rival, Side
from benchmarks.limits import arithmetic
from vgyro.config import IntegrityOptions
from vgyro.dataset import Manifest, array_board
from vgyro.log import TextForm
from vgyro.storage import open_recording
from vgyro.storage.logs.text import open_log
from vgyro.storage.tables import Provenance
from vgyro.tasks.rates.decode import decode

GYROS = 6
NAMES = ("t", *(f"g{gyro}" for gyro in range(1, GYROS + 1)))
REPEATED = 1 << 14
TARGET = 8
"""Asked of pandas' time over ours, from file to file. The hash of the file and the writing of the Parquet file alone
take a quarter of pandas' time: with them no reader, however fast, reaches more than about 4."""


def contests(quick: bool) -> list[Contest]:
    """The way from file to file, and the reading alone."""
    rows = REPEATED if quick else 192 * REPEATED
    folder = tempfile.TemporaryDirectory(prefix="vgyro-benchmarks-")
    path, made = Path(folder.name) / "log.csv", Path(folder.name) / "log.parquet"
    values = write_log(path, rows)
    size = path.stat().st_size

    def accuracy() -> list[Accuracy]:
        # The folder lives as long as this function does.
        assert folder.name
        to_parquet(path, made)
        mine = pq.read_table(made)
        ours = np.column_stack([mine[name].to_numpy() for name in NAMES])
        theirs = pd.read_csv(path).to_numpy()
        return [
            Accuracy("cells of ours that are not the nearest double", float(np.count_nonzero(ours != values)), 0.0),
            Accuracy("cells of pandas that are not", float(np.count_nonzero(theirs != values))),
        ]

    def pandas_to_parquet() -> None:
        pd.read_csv(path).to_parquet(made)

    title, version = f"{size / 1e6:.1f} MB of CSV", f"pandas {pd.__version__}"
    # Read each byte once; write a double for each cell.
    limit = arithmetic(transferred=1 + 8 * len(NAMES) * rows / size)
    theirs = Side(f"{version} read_csv, to_parquet", pandas_to_parquet, size)
    reading = Side(f"{version} read_csv", lambda: pd.read_csv(path), size)
    return [
        Contest(
            "log", f"{title} to Parquet", "byte", Side("vgyro", lambda: to_parquet(path, made), size),
            (Rival(theirs, TARGET),), limit, accuracy, "ours hashes the file, too, and compresses with zstd",
        ),
        Contest(
            "log_frames", f"{title} to frames.parquet", "byte", Side("vgyro", lambda: to_frames(path, made), size),
            (Rival(theirs),), limit, accuracy, "the stage decode as a whole, with clock and gaps",
        ),
        Contest(
            "log_read", f"{title} to columns", "byte", Side("vgyro", lambda: read(path), size), (Rival(reading),),
            limit, accuracy, "ours finds the form and hashes the file, too",
        ),
    ]  # fmt: skip


def write_log(path: Path, rows: int) -> np.ndarray:
    """A log at 100 Hz, 5 decimals; the values of its cells [rows, 7]."""
    rng = np.random.default_rng(23)
    rates = np.cumsum(rng.normal(0, 0.002, (REPEATED, GYROS)), axis=0) + rng.normal(0, 0.05, (REPEATED, GYROS))
    cells = [",".join(f"{rate:.5f}" for rate in row) for row in rates.tolist()]
    with open(path, "w", encoding="ascii", newline="\n") as file:
        file.write(",".join(NAMES) + "\n")
        for first in range(0, rows, REPEATED):
            file.writelines(f"{(first + row) / 100:.3f},{text}\n" for row, text in enumerate(cells))
    kept = np.array([[float(cell) for cell in row.split(",")] for row in cells])
    time = np.array([float(f"{row / 100:.3f}") for row in range(rows)])
    return np.column_stack([time, np.tile(kept, (rows // REPEATED, 1))])


def read(path: Path) -> int:
    """All rows, as the pipeline reads them."""
    return sum(rows.batch.num_rows for rows in open_log(path, TextForm()).rows("", NAMES))


def to_parquet(path: Path, made: Path) -> None:
    """Rows into a file such as the pipeline writes."""
    schema = pa.schema([(name, pa.float64()) for name in NAMES])
    encoding = dict.fromkeys(NAMES, "BYTE_STREAM_SPLIT")
    with pq.ParquetWriter(
        made, schema, compression="zstd", version="2.6", use_dictionary=False, column_encoding=encoding
    ) as writer:
        for rows in open_log(path, TextForm()).rows("", NAMES):
            writer.write_batch(rows.batch)


def to_frames(path: Path, made: Path) -> None:
    """What the stage decode does with the log."""
    gyros = [{"name": name, "axis": "z", "unit": "deg/s"} for name in NAMES[1:]]
    record = {"name": "log", "kind": "free", "files": str(path), "log": {"time": {"column": "t", "unit": "s"}}}
    manifest = Manifest.model_validate({"array": {"gyros": gyros}, "recordings": [record]})
    board = array_board(manifest, "log")
    assert board is not None
    reader = open_recording([path], manifest.recordings[0], board, IntegrityOptions(), array=manifest.array)
    decode(reader, made, Provenance({}, "", ""), {})
