"""A gyro that is late is found by the motion, brought to the time of the others, and costs the fusion nothing."""

import numpy as np
import pytest
from task_chain import RATE_HZ, SIGMA, Chain
from task_options import complete

from vgyro.board import Board
from vgyro.tasks.fusion import faults, fuse, noise
from vgyro.tasks.rates import convert
from vgyro.tasks.rates.delays import Lateness, noise_left

GYROS = ("g1", "g2", "g3", "g4")
SECONDS = 120
LATE_S = 0.015  # three samples at 200 Hz
ANALYSIS = {"fusion": {"methods": ["recommended", "average"]}, "volatility": {"definitions": ["level"]}}


def motion(time: np.ndarray) -> np.ndarray:
    """Rate of a hand that turns the board for two thirds of the time, deg/s: tones of 0.3 to 3 Hz."""
    rng = np.random.default_rng(5)
    tones = zip(rng.uniform(0.3, 3.0, 12), rng.uniform(0, 2 * np.pi, 12), rng.uniform(1, 5, 12), strict=True)
    rate = sum(size * np.sin(2 * np.pi * hz * time + phase) for hz, phase, size in tones)
    turning = np.clip((time - 20) / 2, 0, 1) * np.clip((100 - time) / 2, 0, 1)
    return rate * turning


def fused(folder, late: float, kind: str = "free"):
    """Error of the recommended method and of the average against the motion, deg/s r.m.s.; the chain."""
    folder.mkdir()
    time = np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ
    rng = np.random.default_rng(2)
    rate = SIGMA * rng.standard_normal((len(time), len(GYROS))) + rng.normal(0, 0.3, len(GYROS))
    rate += motion(time)[:, None] if kind == "free" else 0.0
    rate[:, 1] += motion(time - late) - motion(time) if kind == "free" else 0.0
    chain = Chain(folder, GYROS, kind)
    chain.frames(rate)
    inputs = {"frames": "frames.parquet", "integrity": "integrity.json", "calibration": "calibration.json"}
    chain.run(convert, {**inputs, "reference": []}, ("rates",))
    chain.run(noise, {"rates": "rates.parquet"}, ("noise.json",))
    chain.run(faults, {"rates": "rates.parquet", "calibration": "calibration.json"}, ("faults",))
    chain.run(
        fuse, {"rates": "rates.parquet", "noise": "noise.json", "faults": "faults.parquet", "weights": [], "moved": []},
        ("fused", "methods", "moved"), analysis=complete(ANALYSIS),
    )  # fmt: skip
    table = chain.table("fused")
    truth = motion(time) if kind == "free" else np.zeros(len(time))
    inner = slice(100, -100)
    errors = {name: table[name] - truth for name in ("recommended", "average")}
    return {name: np.std(error[inner]) for name, error in errors.items()}, chain


def test_a_late_gyro_costs_nothing(tmp_path):
    even, chain = fused(tmp_path / "even", 0.0)
    gyros = chain.metadata("rates")["delays"]["z"]["gyros"]
    assert not any(entry["removed"] for entry in gyros.values())
    late, chain = fused(tmp_path / "late", LATE_S)
    gyros = chain.metadata("rates")["delays"]["z"]["gyros"]
    assert [name for name, entry in gyros.items() if entry["removed"]] == ["g2"]
    assert gyros["g2"]["delay_s"] == pytest.approx(LATE_S, abs=0.1 / RATE_HZ)
    assert gyros["g2"]["low_s"] < LATE_S < gyros["g2"]["high_s"]
    for name in ("recommended", "average"):
        assert late[name] <= 1.02 * even[name], name


def test_what_is_late_at_the_end_has_no_value_there(tmp_path):
    _, chain = fused(tmp_path / "late", LATE_S)
    rate = chain.table("rates")["g2"]
    assert np.isnan(rate[-2:]).all()
    assert chain.metadata("rates")["missing"]["g2"] == np.isnan(rate).sum() < 20
    assert np.isfinite(chain.table("fused")["recommended"]).all()


def test_at_rest_there_is_no_delay_to_find(tmp_path):
    _, chain = fused(tmp_path / "rest", LATE_S, kind="static")
    assert chain.metadata("rates")["delays"] == {}


def test_what_is_left_of_the_noise_is_written_down(tmp_path):
    _, chain = fused(tmp_path / "late", LATE_S)
    metadata = chain.metadata("rates")
    assert list(metadata["noise_gain"]) == ["g2"]
    assert metadata["noise_gain"]["g2"] == metadata["delays"]["z"]["gyros"]["g2"]["noise_gain"] < 1
    record = {
        "clocks": [{"alignment": {}, "channels": ["g1"]}, {"alignment": {"noise_gain": 0.97}, "channels": ["g3"]}]
    }
    board = Board.model_validate(chain.board)
    assert noise_left(board, record, Lateness(metadata["delays"])) == {
        "noise_gain": {"g2": metadata["noise_gain"]["g2"], "g3": 0.97}
    }
    assert noise_left(board, {"clocks": []}, Lateness()) == {}
