"""The task effects end to end: series, tones and GARCH in, one row a gyro out."""

from pathlib import Path

import numpy as np
import pytest
from task_options import complete

from vgyro.board import Board
from vgyro.storage.schemas import SCHEMAS
from vgyro.storage.tables import Provenance, read_columns, read_metadata, write_table
from vgyro.tasks.common import Task
from vgyro.tasks.volatility import assemble, effects
from vgyro.volatility.effects.whiten import block_gain

GYROS = ["g1", "g2", "g3"]
SAMPLES = 1200


def board() -> dict:
    channels = {"name": "rate", "type": "i16", "count": len(GYROS), "at": 2}
    frame = {"kind": "binary", "sync": "EB90", "length": 2 + 2 * len(GYROS), "fields": [channels]}
    frame["checksum"] = {"family": "none"}
    gyros = [
        {"name": name, "field": f"rate{place + 1}", "axis": "z", "scale": 0.01} for place, name in enumerate(GYROS)
    ]
    record = {"name": "b", "title": "b", "rate_hz": 200.0, "frame": frame, "gyros": gyros}
    return Board.model_validate(record).model_dump(mode="json")


def write_inputs(folder: Path, values: np.ndarray, runs: list[list[int]]) -> Task:
    """series.parquet of `values` [M, N] and tones.parquet with one tone of g2; the task that reads them."""
    made = Provenance({}, "", "")
    stretch = np.repeat(np.arange(len(runs)), [stop - start for start, stop, _ in runs]).astype(np.int32)
    columns = {"time": np.arange(len(values)) + 100.0, "segment": stretch, "stretch": stretch}
    columns |= {name: values[:, place] for place, name in enumerate(GYROS)}
    write_table(folder / "series.parquet", columns, "series", made, {"rate_hz": 1.0, "runs": runs, "use": "all"})
    tone = {"frequency": 6.503, "amplitude": 0.03 / abs(block_gain(6.503 / 200, 200))}
    tone |= {"low": tone["amplitude"], "high": tone["amplitude"], "probability": 0.0}
    table = {"gyro": ["g2"], **{name: [value] for name, value in tone.items()}, "shared": ["g2"]}
    write_table(folder / "tones.parquet", table, "tones", made, {"rate_hz": 200.0})
    options = {
        "board": board(), "axis": "z", "definition": "level", "kind": "static",
        "analysis": complete({"volatility": {"window": 120, "step": 50}}),
    }  # fmt: skip
    inputs = {name: [folder / f"{name}.parquet"] for name in ("series", "tones")}
    return Task(inputs, {"effects": folder / "effects.parquet"}, options, "code")


def simulated() -> np.ndarray:
    """g1 drifts, g2 has the aliased tone, g3 does not vary."""
    time = np.arange(SAMPLES)
    values = 0.04 * np.random.default_rng(8).standard_normal((SAMPLES, 3))
    values[:, 0] += np.linspace(0, 0.5, SAMPLES)
    values[:, 1] += 0.03 * np.sin(2 * np.pi * 0.497 * time)
    values[:, 2] = 0.01
    return values


def with_garch(task: Task, folder: Path) -> Task:
    """The task with GARCH fits of the level, as the rule volatility writes them."""
    tables = {name: folder / f"{name}.parquet" for name in ("garch", "dcc", "arch_lm", "weights", "fits")}
    parts: dict[str, list[Path]] = {"garch": [], "dcc": [], "weights": []}
    assemble.main(Task({"series": task.inputs["series"], **parts}, tables, task.options, "code"))
    return Task({**task.inputs, "garch": [tables["garch"]]}, task.outputs, task.options, "code")


@pytest.mark.parametrize("garch", [False, True])
def test_a_row_a_gyro(tmp_path: Path, garch: bool):
    task = write_inputs(tmp_path, simulated(), [[0, SAMPLES, 0]])
    task = with_garch(task, tmp_path) if garch else task
    effects.main(task)
    found = read_columns(task.output("effects"))
    assert list(found) == [column.name for column in SCHEMAS["effects"].columns]
    assert found["gyro"].tolist() == GYROS
    assert found["verdict"].tolist() == ["drift", "tone at 6.5 Hz", "no variance"]
    assert found["tone_frequency"][1] == 6.503
    assert found["tone_seen_at"][1] == pytest.approx(0.497, abs=0.001)
    assert np.isnan(found["p_level"]).tolist() == [False, False, True]
    assert np.isfinite(found["p_standardised"]).tolist() == [garch, garch, False]
    assert read_metadata(task.output("effects"))["schema"] == "effects"


def test_what_arch_lm_says_too(tmp_path: Path):
    # The same series, the same tests: the p-values are those of arch_lm.parquet.
    task = with_garch(write_inputs(tmp_path, simulated(), [[0, SAMPLES, 0]]), tmp_path)
    effects.main(task)
    found, tests = read_columns(task.output("effects")), read_columns(tmp_path / "arch_lm.parquet")
    for name in ("level", "detrended", "whitened", "standardised"):
        np.testing.assert_allclose(found[f"p_{name}"], tests["p_value"][tests["series"] == name], rtol=1e-9)


def test_the_longest_stretch_is_tested(tmp_path: Path):
    values = simulated()
    values[:300, 1] += 100
    task = write_inputs(tmp_path, values, [[0, 300, 0], [300, SAMPLES, 1]])
    effects.main(task)
    assert read_columns(task.output("effects"))["verdict"].tolist()[1:] == ["tone at 6.5 Hz", "no variance"]


@pytest.mark.parametrize("samples", [0, 40])
def test_too_short(tmp_path: Path, samples: int):
    runs = [[0, samples, 0]] if samples else []
    task = write_inputs(tmp_path, simulated()[:samples], runs)
    effects.main(task)
    assert set(read_columns(task.output("effects"))["verdict"]) == {f"too short: {samples} samples"}
