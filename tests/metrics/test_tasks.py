"""Tasks noise and measure on small artefacts of known truth."""

import math
from pathlib import Path

import numpy as np
import pytest

from vgyro.board import Board, parse_board
from vgyro.storage.tables import Provenance, read_columns, read_json, write_table
from vgyro.tasks import measure, noise
from vgyro.tasks.common import Task

NOWHERE = Provenance({}, "", "")
RATE_HZ = 50.0
N = 0.1
INJECTED = 0.05
OPTIONS = {"analysis": {"metrics": {"bootstrap": 60, "welch_s": 20.0}, "engine": "reference"}, "axis": "z"}
TABLES = ("allan", "spectrum", "metrics", "correlation", "cross_allan", "tones")


@pytest.fixture(scope="module")
def board(root: Path) -> Board:
    return parse_board((root / "config/boards/dsp6.yaml").read_text(encoding="utf-8"), "dsp6")


def gyros_of(board: Board) -> list[str]:
    return [gyro.name for gyro in board.array(board.axes[0])]


def write_rates(
    folder: Path,
    board: Board,
    rate: np.ndarray,
    at_rest: np.ndarray,
    reference: np.ndarray | None = None,
    moved: dict | None = None,
):
    columns = {
        "time": np.arange(len(rate)) / RATE_HZ,
        "segment": np.zeros(len(rate), np.int32),
        "at_rest": at_rest,
        **({} if reference is None else {"reference": reference}),
        **{gyro: rate[:, column] for column, gyro in enumerate(gyros_of(board))},
    }
    extra = {"rate_hz": RATE_HZ, **({} if reference is None else {"reference_axis": board.axes[0]})}
    write_table(folder / "rates.parquet", columns, "rates", NOWHERE, extra)
    fused = {"time": columns["time"], "segment": columns["segment"], "average": rate.mean(axis=1)}
    fused["dcc_causal[level]"] = rate[:, :2].mean(axis=1)
    write_table(folder / "fused.parquet", fused, "fused", NOWHERE)
    write_table(
        folder / "moved.parquet",
        moved or {"time": columns["time"], "segment": columns["segment"]},
        "moved",
        NOWHERE,
        {"injected_rate": INJECTED},
    )
    methods = {
        "method": ["average", "dcc_causal", "jiang_markov"],
        "definition": ["", "level", ""],
        "column": ["average", "dcc_causal[level]", ""],
        "bandwidth_hz": [math.nan, math.nan, math.nan],
        "dc_gain": [1.0, 1.0, math.nan],
    }
    write_table(folder / "methods.parquet", methods, "methods", NOWHERE)


def run_noise(folder: Path, board: Board) -> dict:
    options = {**OPTIONS, "axis": board.axes[0], "board": board.model_dump(mode="json")}
    noise.main(Task({"rates": [folder / "rates.parquet"]}, {"noise": folder / "noise.json"}, options, ""))
    return read_json(folder / "noise.json")


def run_measure(folder: Path, board: Board, kind: str) -> dict[tuple[str, str, str], dict[str, object]]:
    inputs = {name: [folder / f"{name}.parquet"] for name in ("rates", "fused", "methods", "moved")}
    options = {**OPTIONS, "axis": board.axes[0], "board": board.model_dump(mode="json"), "recording": "r", "kind": kind}
    measure.main(Task(inputs, {name: folder / f"{name}.parquet" for name in TABLES}, options, ""))
    table = read_columns(folder / "metrics.parquet")
    rows = [dict(zip(table, values, strict=True)) for values in zip(*table.values(), strict=True)]
    return {(row["method"], row["definition"], row["metric"]): row for row in rows}


def white(samples: int, number: int, seed: int = 1) -> np.ndarray:
    return N * np.sqrt(RATE_HZ) * np.random.default_rng(seed).standard_normal((samples, number))


def test_static_recording(tmp_path: Path, board: Board):
    number = len(gyros_of(board))
    write_rates(tmp_path, board, white(30_000, number), np.ones(30_000, bool))
    rows = run_measure(tmp_path, board, "static")
    gyro = gyros_of(board)[0]
    assert rows[gyro, "", "arw"]["value"] == pytest.approx(60 * N, rel=0.03)
    assert rows[gyro, "", "arw"]["unit"] == "deg/√h"
    assert rows["average", "", "if_sigma"]["value"] == pytest.approx(math.sqrt(number), rel=0.02)
    assert rows["dcc_causal", "level", "if_sigma"]["value"] == pytest.approx(math.sqrt(2), rel=0.02)
    assert not any(method == "jiang_markov" for method, _, _ in rows)
    allan = read_columns(tmp_path / "allan.parquet")
    assert set(allan["series"]) == {*gyros_of(board), "average", "dcc_causal[level]"}
    assert np.all(allan["low"] < allan["high"])
    spectrum = read_columns(tmp_path / "spectrum.parquet")
    counts = [np.sum(spectrum["series"] == name) for name in set(spectrum["series"])]
    assert 0 < max(counts) <= 600
    correlation = read_columns(tmp_path / "correlation.parquet")
    assert len(correlation["gyro"]) == number**2
    record = run_noise(tmp_path, board)
    assert all(record["arw"][name] == pytest.approx(N, rel=0.03) for name in gyros_of(board))
    assert all(value > 0 for value in record["rrw"].values())
    assert np.array(record["correlation"]).shape == (number, number)


def test_same_inputs_same_bytes(tmp_path: Path, board: Board):
    for folder in (tmp_path / "one", tmp_path / "two"):
        folder.mkdir()
        write_rates(folder, board, white(3000, len(gyros_of(board))), np.ones(3000, bool))
        run_measure(folder, board, "static")
        run_noise(folder, board)
    for name in (*(f"{table}.parquet" for table in TABLES), "noise.json"):
        one, two = ((tmp_path / folder / name).read_bytes() for folder in ("one", "two"))
        assert one.replace(b'"one"', b'"two"') == two, name


def test_moving_recording_against_its_reference(tmp_path: Path, board: Board):
    number = len(gyros_of(board))
    truth = 62.8 * np.sin(2 * np.pi * 0.25 * np.arange(6000) / RATE_HZ)
    write_rates(tmp_path, board, truth[:, None] + white(6000, number), np.zeros(6000, bool), truth)
    rows = run_measure(tmp_path, board, "sinusoid")
    assert rows["average", "", "error_sigma"]["value"] == pytest.approx(N * math.sqrt(RATE_HZ / number), rel=0.05)
    assert rows["average", "", "amplitude"]["value"] == pytest.approx(62.8, rel=2e-3)
    assert ("average", "", "arw") not in rows
    assert len(read_columns(tmp_path / "allan.parquet")["tau"]) == 0
    record = run_noise(tmp_path, board)
    assert "differences" in record["method"]
    assert record["arw"][gyros_of(board)[0]] == pytest.approx(N, rel=0.1)


def test_moving_recording_without_a_reference(tmp_path: Path, board: Board):
    motion = 50 * np.sin(np.arange(4000) / 30)[:, None]
    write_rates(tmp_path, board, motion + white(4000, len(gyros_of(board))), np.zeros(4000, bool))
    assert run_measure(tmp_path, board, "free") == {}


def test_an_empty_recording(tmp_path: Path, board: Board):
    write_rates(tmp_path, board, np.empty((0, len(gyros_of(board)))), np.empty(0, bool))
    assert run_measure(tmp_path, board, "static") == {}
    assert all(value is None for value in run_noise(tmp_path, board)["arw"].values())
