"""A small array from what the volatility tasks write to the task fuse, through files."""

import json

import numpy as np
from task_options import complete

from vgyro.storage.tables import Provenance, TableWriter, read_columns, write_json, write_table
from vgyro.tasks.common import Task
from vgyro.tasks.fusion import fuse
from vgyro.tasks.volatility import assemble, series

GYROS = ("g1", "g2", "g3")
RATE_HZ, SECONDS = 10.0, 400
DEFINITIONS = ("level", "residual")
ARW = (0.05, 0.05, 0.15)
BIAS = (0.02, -0.01, 0.01)
INJECTED = 0.05
OUTPUTS = {name: f"{name}.parquet" for name in ("fused", "methods", "moved")}
ANALYSIS = {
    "volatility": {"window": 120, "step": 40, "definitions": DEFINITIONS},
    "fusion": {"moment_window_s": 60},
    "crosscheck": {"windows": 2},
}
FULL = {**ANALYSIS, "volatility": {"rate_hz": "full"}}


def board(gyros):
    fields = [{"name": gyro, "type": "i16", "at": 2 + 2 * index} for index, gyro in enumerate(gyros)]
    frame = {"kind": "binary", "sync": "EB90", "length": 20, "fields": fields, "checksum": {"family": "none"}}
    rows = [{"name": gyro, "field": gyro, "axis": "z", "scale": 0.01} for gyro in gyros]
    return {"name": "small", "title": "small", "rate_hz": RATE_HZ, "frame": frame, "gyros": rows}


def task_of(folder, inputs, outputs, gyros=GYROS, kind="static", analysis=ANALYSIS, **options):
    options = {
        "board": board(gyros),
        "axis": "z",
        "recording": "r",
        "kind": kind,
        "injected_rate": None,
        "analysis": complete(analysis),
        **options,
    }
    return Task(
        {name: [folder / path for path in paths] for name, paths in inputs.items()},
        {name: folder / path for name, path in outputs.items()},
        json.loads(json.dumps(options)),
        "code",
    )


def write_inputs(folder, gyros=GYROS, seconds=SECONDS, motion=0.0, rest=True, single=False, turning=0.0):
    """Rates of white gyros, the third three times as noisy; a gap after 3/4; their noise record."""
    samples = int(seconds * RATE_HZ)
    time = np.arange(samples) / RATE_HZ
    segment = np.where(np.arange(samples) < 3 * samples // 4, 0, 1).astype(np.int32)
    time = time + 5.0 * segment
    white = np.random.default_rng(7).standard_normal((samples, len(gyros))) * ARW[: len(gyros)] * np.sqrt(RATE_HZ)
    rate = (white + BIAS[: len(gyros)] + turning + motion * np.sin(time)[:, None]).astype(
        np.float32 if single else float
    )
    columns = {"time": time, "segment": segment, "at_rest": np.full(samples, rest)}
    columns |= {gyro: rate[:, index] for index, gyro in enumerate(gyros)}
    write_table(folder / "rates.parquet", columns, "rates", Provenance({}, "", ""), {"rate_hz": RATE_HZ})
    record = {
        "gyros": list(gyros),
        "arw": dict(zip(gyros, ARW, strict=False)),
        "rrw": {**dict.fromkeys(gyros, 0.001), gyros[0]: None},
        "rrw_source": {**dict.fromkeys(gyros, "upper limit"), gyros[0]: "not known"},
        "correlation": np.eye(len(gyros)).tolist(),
    }
    write_json(folder / "noise.json", record)
    return rate, segment


def run_volatility(folder):
    series.main(task_of(folder, {"rates": ["rates.parquet"]}, {"series": "series.parquet"}))
    for definition in (*DEFINITIONS, "moved"):
        made = {name: f"{definition}/{name}.parquet" for name in ("garch", "dcc", "arch_lm", "weights", "fits")}
        (folder / definition).mkdir(exist_ok=True)
        options = {"definition": definition, "injected_rate": INJECTED if definition == "moved" else None}
        assemble.main(task_of(folder, {"series": ["series.parquet"]}, made, **options))


def fuse_in(folder, tables=(), read=True, moved=(), **keywords):
    inputs = {"rates": ["rates.parquet"], "noise": ["noise.json"], "weights": list(tables), "moved": list(moved)}
    fuse.main(task_of(folder, inputs, OUTPUTS, **keywords))
    return [read_columns(folder / name) for name in ("fused.parquet", "methods.parquet") if read]


def fuse_moved(folder, **keywords):
    tables = [f"{name}/weights.parquet" for name in DEFINITIONS]
    fused, methods = fuse_in(folder, tables, moved=["moved/weights.parquet"], **keywords)
    return fused, methods, read_columns(folder / "moved.parquet")


def write_weights(path, time, names, row_group):
    """Random weights of every sample at `time`, as the volatility stage writes them; returned by model and mode."""
    rng = np.random.default_rng(3)
    found = {name: rng.dirichlet(np.ones(len(GYROS)), len(time)) for name in names}
    extra = {"blocks": [list(name) for name in names], "samples": len(time)}
    with TableWriter(path, "weights", Provenance({}, "", ""), extra, row_group=row_group) as writer:
        for name, weights in found.items():
            sigma = np.full(len(time), np.nan if name[1] == "causal" else 0.1, dtype=np.float32)
            columns = {"time": time, "sigma": sigma, "status": np.full(len(time), f"status of {name[1]}")}
            writer.append({**columns, **{f"w_{gyro}": weights[:, place] for place, gyro in enumerate(GYROS)}})
    return found
