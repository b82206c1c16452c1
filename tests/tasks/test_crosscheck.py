"""The cross-check of a small array through files: sound results pass on either engine, spoilt ones do not."""

from __future__ import annotations

import json
import math
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from task_options import complete

from vgyro.engine import independent
from vgyro.metrics import allan_deviation
from vgyro.storage.tables import Provenance, read_columns, read_metadata, write_json, write_table
from vgyro.tasks.common import Task
from vgyro.tasks.figures import crosscheck
from vgyro.tasks.figures.crosscheck_rows import Check, compare, compare_maximum
from vgyro.tasks.fusion import fuse
from vgyro.tasks.volatility import assemble, series

GYROS = ("g1", "g2", "g3")
DEFINITIONS = ("difference", "level", "residual")
RATE_HZ, SECONDS, WINDOW = 10.0, 400, 120
TABLES = ("garch", "dcc", "arch_lm", "weights", "fits")
OUTPUTS = {name: f"{name}.parquet" for name in ("fused", "methods", "moved")}
NOTHING = Provenance({}, "", "")


def task_of(folder: Path, inputs: dict[str, list[str]], outputs: dict[str, str], **changes: Any) -> Task:
    fields = [{"name": gyro, "type": "i16", "at": 2 + 2 * index} for index, gyro in enumerate(GYROS)]
    frame = {"kind": "binary", "sync": "EB90", "length": 20, "fields": fields, "checksum": {"family": "none"}}
    gyros = [{"name": gyro, "field": gyro, "axis": "z", "scale": 0.01} for gyro in GYROS]
    board = {"name": "small", "title": "small", "rate_hz": RATE_HZ, "frame": frame, "gyros": gyros}
    analysis = {
        "engine": changes.pop("engine", "native"),
        "volatility": {"window": WINDOW, "step": 40, "definitions": DEFINITIONS},
        "crosscheck": {"windows": 3},
    }
    options = {
        "board": board,
        "axis": "z",
        "recording": "r",
        "kind": "static",
        "injected_rate": None,
        "analysis": complete(analysis),
        **changes,
    }
    return Task(
        {name: [folder / path for path in paths] for name, paths in inputs.items()},
        {name: folder / path for name, path in outputs.items()},
        json.loads(json.dumps(options)),
        "code",
    )


def write_rates(folder: Path) -> np.ndarray:
    """White noise whose size changes slowly, a third gyro that is noisier and one that sticks for a while; a gap."""
    rng = np.random.default_rng(5)
    samples = int(SECONDS * RATE_HZ)
    time = np.arange(samples) / RATE_HZ
    size = np.exp(0.5 * np.sin(time / 15))[:, None] * np.array([0.05, 0.06, 0.15])
    rate = rng.standard_normal((samples, len(GYROS))) * size + 0.02 * rng.standard_normal((samples, 1))
    rate[-1500:, 1] = 0.5
    segment = (np.arange(samples) >= 2000).astype(np.int32)
    columns = {"time": time + 5.0 * segment, "segment": segment, "at_rest": np.ones(samples, dtype=bool)}
    columns |= {gyro: rate[:, index] for index, gyro in enumerate(GYROS)}
    write_table(folder / "rates.parquet", columns, "rates", NOTHING, {"rate_hz": RATE_HZ})
    noise = {
        "gyros": list(GYROS), "arw": dict(zip(GYROS, (0.016, 0.02, 0.05), strict=True)),
        "rrw": dict.fromkeys(GYROS, 0.001), "rrw_source": dict.fromkeys(GYROS, "fit"),
        "correlation": np.eye(len(GYROS)).tolist(),
    }  # fmt: skip
    write_json(folder / "noise.json", noise)
    return rate


def run_stages(folder: Path, engine: str) -> None:
    """Everything that the cross-check reads."""
    rate = write_rates(folder)
    series.main(task_of(folder, {"rates": ["rates.parquet"]}, {"series": "series.parquet"}))
    for name in DEFINITIONS:
        (folder / name).mkdir()
        made = {table: f"{name}/{table}.parquet" for table in TABLES}
        assemble.main(task_of(folder, {"series": ["series.parquet"]}, made, definition=name, engine=engine))
    inputs = {"rates": ["rates.parquet"], "noise": ["noise.json"], "weights": []}
    fuse.main(task_of(folder, inputs, OUTPUTS, engine=engine))
    segment = read_columns(folder / "rates.parquet", ["segment"])["segment"]
    rows: dict[str, list[Any]] = {name: [] for name in ("series", "kind", "tau", "deviation", "low", "high", "edf")}
    for index, gyro in enumerate(GYROS):
        curve = allan_deviation(rate[:, index], RATE_HZ, np.array([0.1, 2.0, 30.0]), segment=segment)
        for values in zip(
            [gyro] * 3, [curve.kind] * 3, curve.tau, curve.deviation, curve.low, curve.high, curve.edf, strict=True
        ):
            for name, value in zip(rows, values, strict=True):
                rows[name].append(value)
    write_table(folder / "allan.parquet", rows, "allan", NOTHING)


def check(folder: Path, engine: str = "native") -> dict[str, np.ndarray]:
    inputs = {name: [f"{name}.parquet"] for name in ("rates", "fused", "methods", "allan", "series")}
    inputs |= {name: [f"{one}/{name}.parquet" for one in DEFINITIONS] for name in ("garch", "dcc", "weights")}
    task = task_of(folder, {**inputs, "noise": ["noise.json"]}, {"crosscheck": "crosscheck.parquet"}, engine=engine)
    crosscheck.main(task)
    return read_columns(folder / "crosscheck.parquet")


@pytest.fixture(scope="module")
def analysed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """All stages by the native engine."""
    folder = tmp_path_factory.mktemp("native")
    run_stages(folder, "native")
    return folder


def passes(folder: Path, engine: str, other: str) -> dict[str, np.ndarray]:
    found = check(folder, engine)
    failed = [row for row in zip(*found.values(), strict=True) if not row[-1]]
    assert not failed
    kinds = {name.split()[0].rstrip(",") for name in found["check"]}
    assert kinds == {"GARCH", "DCC", "weights", "filter", "Allan"}
    assert {other, "dense grid and SciPy", "loops and scipy.optimize.nnls"} <= set(found["against"])
    return found


def test_sound_results_pass_and_the_sample_depends_on_the_seed_alone(analysed: Path) -> None:
    found, again = (passes(analysed, "native", "arch") for _ in range(2))
    assert all(np.array_equal(found[name], again[name]) for name in found)


def test_results_of_the_reference_engine_pass_the_native_one(tmp_path: Path) -> None:
    run_stages(tmp_path, "reference")
    passes(tmp_path, "reference", "native engine")


SPOILT = {
    "omega": ("garch", "GARCH log-likelihood [", lambda column: 1.5 * column),
    "log_likelihood": ("garch", "GARCH log-likelihood as stored", lambda column: column + 0.01),
    "b": ("dcc", "DCC log-likelihood", lambda column: 0.5 * column + 0.2),
    "w_g1": ("weights", "weights", lambda column: column + 1e-6),
}


@pytest.mark.parametrize("column", SPOILT)
def test_a_spoilt_column_fails_its_check(analysed: Path, tmp_path: Path, column: str) -> None:
    folder = tmp_path / "spoilt"
    shutil.copytree(analysed, folder)
    table, title, change = SPOILT[column]
    for definition in DEFINITIONS:
        path = folder / definition / f"{table}.parquet"
        columns, about = read_columns(path), read_metadata(path)
        columns[column] = change(columns[column])
        extra = {name: about[name] for name in ("blocks", "samples") if name in about}
        write_table(path, columns, table, NOTHING, extra)
    found = check(folder)
    mine = np.array([name.startswith(title) for name in found["check"]])
    assert not found["passed"][mine].all()
    others = np.array([name.startswith(("filter", "Allan")) for name in found["check"]])
    assert found["passed"][others].all()


def test_a_maximum_fails_only_where_ours_is_the_smaller() -> None:
    assert compare_maximum(Check("x", "", 0, ""), 5.0, 4.0, 1e-3).passed
    assert compare_maximum(Check("x", "", 0, ""), 5.0, 5.0009, 1e-3).passed
    assert not compare_maximum(Check("x", "", 0, ""), 5.0, 5.0011, 1e-3).passed
    assert not compare_maximum(Check("x", "", 0, ""), math.nan, 5.0, 1e-3).passed
    assert not compare(Check("x", "", 0, ""), np.array([1.0, np.nan]), np.array([1.0, 2.0]), 1.0, "1").passed


def test_the_definition_of_allan_in_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    # Expected: every pair of adjacent means of 7 samples, one by one, in each of the two stretches.
    rate = np.random.default_rng(6).standard_normal(400)
    segment = (np.arange(400) >= 150).astype(np.int32)
    squares = [
        (rate[i + 7 : i + 14].mean() - rate[i : i + 7].mean()) ** 2
        for begin, end in ((0, 150), (150, 400))
        for i in range(begin, end - 13)
    ]
    monkeypatch.setattr(independent, "PIECE", 64)
    found = independent.textbook_allan_deviation(rate, 10.0, 0.7, segment)
    assert found == pytest.approx(math.sqrt(np.mean(squares) / 2), rel=1e-12)
