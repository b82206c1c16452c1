"""Tasks noise and measure on small artefacts of known truth."""

import math
from pathlib import Path

import numpy as np
import pytest
from task_options import complete

from vgyro.board import Board, parse_board
from vgyro.storage.tables import Provenance, read_columns, read_json, write_table
from vgyro.tasks.common import Task
from vgyro.tasks.figures import measure
from vgyro.tasks.fusion import noise

NOWHERE = Provenance({}, "", "")
RATE_HZ = 50.0
N = 0.1
INJECTED = 0.05
OPTIONS = {"analysis": complete({"metrics": {"bootstrap": 60, "welch_s": 20.0}, "engine": "reference"}), "axis": "z"}
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
    lost: int = 0,
    **about: object,
):
    # After `lost` samples in the middle a new segment begins.
    segment = (np.arange(len(rate)) >= len(rate) // 2).astype(np.int32) * bool(lost)
    columns = {
        "time": (np.arange(len(rate)) + lost * segment) / RATE_HZ,
        "segment": segment.astype(np.int32),
        "at_rest": at_rest,
        **({} if reference is None else {"reference": reference}),
        **{gyro: rate[:, column] for column, gyro in enumerate(gyros_of(board))},
    }
    extra = {"rate_hz": RATE_HZ, **about, **({} if reference is None else {"reference_axis": board.axes[0]})}
    write_table(folder / "rates.parquet", columns, "rates", NOWHERE, extra)
    fused = {"time": columns["time"], "segment": columns["segment"], "average": rate.mean(axis=1)}
    fused["dcc_causal[level]"] = rate[:, :2].mean(axis=1)
    fused["sd_average"] = np.full(len(rate), N * math.sqrt(RATE_HZ / rate.shape[1]), dtype=np.float32)
    write_table(folder / "fused.parquet", fused, "fused", NOWHERE)
    write_table(
        folder / "moved.parquet",
        {"time": columns["time"], "segment": columns["segment"], **(moved or {})},
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
        "passes": [1, 0, 0],
    }
    write_table(folder / "methods.parquet", methods, "methods", NOWHERE)


def run_noise(folder: Path, board: Board) -> dict:
    options = {**OPTIONS, "axis": board.axes[0], "board": board.model_dump(mode="json")}
    noise.main(Task({"rates": [folder / "rates.parquet"]}, {"noise": folder / "noise.json"}, options, ""))
    return read_json(folder / "noise.json")


def run_measure(
    folder: Path, board: Board, kind: str, true_rate: float = 0.0
) -> dict[tuple[str, str, str], dict[str, object]]:
    inputs = {name: [folder / f"{name}.parquet"] for name in ("rates", "fused", "methods", "moved")}
    options = {**OPTIONS, "axis": board.axes[0], "board": board.model_dump(mode="json"), "recording": "r", "kind": kind}
    measure.main(Task(inputs, {name: folder / f"{name}.parquet" for name in TABLES}, options, ""))
    table = read_columns(folder / "metrics.parquet")
    rows = [dict(zip(table, values, strict=True)) for values in zip(*table.values(), strict=True)]
    chosen = [row for row in rows if row["true_rate"] == true_rate]
    return {(row["method"], row["definition"], row["metric"]): row for row in chosen}


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
    # White errors and their true standard deviation: chi² of one degree of freedom, 6000 of them.
    assert rows["average", "", "nees"]["value"] == pytest.approx(1.0, abs=4 * math.sqrt(2 / 6000))
    assert ("dcc_causal", "level", "nees") not in rows
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


def test_counts_of_what_is_lost_clipped_and_far_off(tmp_path: Path, board: Board):
    gyros = gyros_of(board)
    rate = white(20_000, len(gyros))
    rate[5000, 1] += 100.0
    at_rest = np.ones(len(rate), bool)
    at_rest[[100, 101]] = False  # as convert marks clipped samples
    write_rates(tmp_path, board, rate, at_rest, lost=3, clipped={gyros[0]: 2, gyros[1]: 0})
    rows = run_measure(tmp_path, board, "static")
    assert [rows[gyro, "", "clipped"]["value"] for gyro in gyros[:2]] == [2, 0]
    assert [rows[gyro, "", "outliers"]["value"] for gyro in gyros[:3]] == [0, 1, 0]
    assert {row["value"] for key, row in rows.items() if key[2] == "missing"} == {5}
    assert ("average", "", "clipped") not in rows
    # Neither ends an average: the longest is a third of the recording.
    allan = read_columns(tmp_path / "allan.parquet")
    assert allan["tau"].max() > 0.8 * len(rate) / RATE_HZ / 3
    assert rows[gyros[1], "", "arw"]["value"] == pytest.approx(60 * N, rel=0.03)
    # The noise that the filters are designed from does not see the outlier, nor does its correlation.
    record = run_noise(tmp_path, board)
    assert record["arw"][gyros[1]] == pytest.approx(N, rel=0.03)
    assert abs(record["correlation"][0][1]) < 0.05


def test_the_same_at_another_rate(tmp_path: Path, board: Board):
    # A method that shrinks towards zero: perfect at rest, off by half of a constant rate.
    rate = white(20_000, len(gyros_of(board)))
    moved = {"dcc_causal[level]": rate[:, :2].mean(axis=1) - INJECTED / 2}
    write_rates(tmp_path, board, rate, np.ones(len(rate), bool), moved=moved)
    at_rest = run_measure(tmp_path, board, "static")
    rows = run_measure(tmp_path, board, "static", INJECTED)
    assert {key[:2] for key in rows} == {("dcc_causal", "level")}
    key = "dcc_causal", "level"
    assert rows[*key, "mean"]["value"] == pytest.approx(at_rest[*key, "mean"]["value"] - INJECTED / 2)
    assert rows[*key, "if_sigma"]["value"] == pytest.approx(at_rest[*key, "if_sigma"]["value"])
    assert rows[*key, "if_mean"]["value"] < at_rest[*key, "if_mean"]["value"]
    assert set(read_columns(tmp_path / "allan.parquet")["series"]) == {*gyros_of(board), "average", "dcc_causal[level]"}


def test_a_constant_rate_has_static_figures_of_its_errors(tmp_path: Path, board: Board):
    number, set_rate = len(gyros_of(board)), 40.0
    reference = np.full(20_000, set_rate)
    write_rates(tmp_path, board, 0.3 + set_rate + white(20_000, number), np.zeros(20_000, bool), reference)
    rows = run_measure(tmp_path, board, "constant", set_rate)
    assert rows["average", "", "mean"]["value"] == pytest.approx(0.3, abs=0.02)
    assert rows["average", "", "arw"]["value"] == pytest.approx(60 * N / math.sqrt(number), rel=0.03)
    assert rows["average", "", "if_sigma"]["low"] < math.sqrt(number) < rows["average", "", "if_sigma"]["high"]
    dynamic = run_measure(tmp_path, board, "constant")
    assert dynamic["average", "", "error_mean"]["value"] == pytest.approx(rows["average", "", "mean"]["value"])
    assert ("average", "", "arw") not in dynamic


def test_tones_and_covariances_of_the_gyros(tmp_path: Path, board: Board):
    gyros = gyros_of(board)
    rate = white(30_000, len(gyros)) + 0.02 * np.random.default_rng(9).standard_normal((30_000, 1)) * math.sqrt(RATE_HZ)
    rate[:, :2] += 0.1 * np.sin(2 * np.pi * 6.5 * np.arange(30_000) / RATE_HZ)[:, None]
    write_rates(tmp_path, board, rate, np.ones(30_000, bool))
    run_measure(tmp_path, board, "static")
    tones = read_columns(tmp_path / "tones.parquet")
    assert sorted(tones["gyro"]) == sorted(gyros[:2])
    np.testing.assert_allclose(tones["frequency"], 6.5, atol=0.01)
    assert np.all((tones["low"] < 0.1) & (tones["high"] > 0.1))
    assert set(tones["shared"]) == {", ".join(gyros[:2])}
    cross = read_columns(tmp_path / "cross_allan.parquet")
    number = len(gyros)
    assert len(cross["tau"]) == len(np.unique(cross["tau"])) * number * (number + 1) // 2
    # Known truth: common white noise of 0.02 in each of 0.1 and 0.02: covariance 4e-4/τ.
    other = (cross["gyro"] == gyros[2]) & (cross["other"] == gyros[3]) & (cross["tau"] == 1.0)
    assert cross["low"][other] < 4e-4 / (N**2 + 4e-4) < cross["high"][other]


def test_noise_of_a_recording_full_of_short_losses(tmp_path: Path, board: Board):
    # Every twentieth sample is lost: no run is longer than 0.4 s, yet noise and correlation are those at rest.
    number = len(gyros_of(board))
    rate = white(20_000, number) + N * math.sqrt(RATE_HZ) * np.random.default_rng(8).standard_normal((20_000, 1))
    write_rates(tmp_path, board, rate, np.arange(20_000) % 20 != 0)
    record = run_noise(tmp_path, board)
    assert record["method"] == "samples at rest"
    for gyro in gyros_of(board):
        assert record["arw"][gyro] == pytest.approx(math.sqrt(2) * N, rel=0.03)
    assert record["correlation"][0][1] == pytest.approx(0.5, abs=0.03)


def test_a_recording_with_hardly_a_sample_left_is_refused_not_guessed(tmp_path: Path, board: Board):
    rate = white(12_000, len(gyros_of(board)))
    write_rates(tmp_path, board, rate, np.random.default_rng(10).random(12_000) < 0.05)
    assert run_measure(tmp_path, board, "static") == {}
    assert "differences" in run_noise(tmp_path, board)["method"]
