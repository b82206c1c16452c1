"""A small data set of artefacts with plausible figures, made without the pipeline: what the pages are tested on."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from vgyro.storage.tables import write_json
from vgyro.tasks.common import Task

sys.path.insert(0, str(Path(__file__).parent))
from bench_array import write_array, write_rates
from bench_records import DATASET, GYROS, NOISE, board, calibration, integrity, manifest


def build(folder: Path, failed_check: bool = False, simulated: bool = True) -> Task:
    """Write the artefacts under folder/results; return the report task that reads them."""
    root = folder / "results" / DATASET
    write_json(root / "calibration.json", calibration())
    names = [recording["name"] for recording in manifest()["recordings"]]
    for name in names:
        write_json(root / name / "integrity.json", integrity(name))
    for recording in ("rest", "sine"):
        write_rates(root / recording / "rates.parquet", recording)
        for axis, gyros in (("x", GYROS), ("z", ("solo",))):
            write_array(root / recording / axis, recording, axis, gyros, failed_check)
    noise = {"gyros": list(GYROS), "arw": NOISE, "rrw": NOISE, "correlation": np.eye(4).tolist()}
    write_json(root / "noise" / "x.json", noise)
    inputs = {
        "calibration": [root / "calibration.json"],
        "integrity": [root / name / "integrity.json" for name in names],
        "noise": [root / "noise" / "x.json"],
        "artefacts": sorted(root.rglob("*.parquet")),
    }
    outputs = {"page": folder / "reports" / f"{DATASET}.html", "headline": root / "headline.json"}
    options = {
        "dataset": DATASET,
        "manifest": manifest(simulated),
        "board": board(),
        "analysis": {"metrics": {"welch_s": 100.0, "confidence": 0.95}, "calibration": {"confidence": 0.95}},
    }
    return Task(inputs, outputs, options, "code")


@pytest.fixture(scope="session")
def report_task(tmp_path_factory: pytest.TempPathFactory) -> Task:
    """The report task over the small data set."""
    return build(tmp_path_factory.mktemp("bench"))
