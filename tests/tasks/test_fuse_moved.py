"""The table `moved`: the methods once more, with a constant rate added."""

import numpy as np
import pytest
from fuse_bench import (
    DEFINITIONS,
    FULL,
    INJECTED,
    RATE_HZ,
    fuse_in,
    fuse_moved,
    run_volatility,
    task_of,
    write_inputs,
    write_weights,
)

from vgyro.fusion import METHODS, Fused, Method
from vgyro.storage.tables import read_columns, read_metadata
from vgyro.tasks.fusion import array_inputs


def test_moved_is_another_recording_that_turns(analysed, tmp_path):
    # Expected: the same gyros, recorded while they turn, through all of series, volatility and fuse, to the depth to
    # which optima are found.
    turning = tmp_path / "turning"
    turning.mkdir()
    write_inputs(turning, turning=INJECTED)
    run_volatility(turning)
    fused, methods, moved = fuse_moved(analysed, injected_rate=INJECTED)
    expected = fuse_in(turning, [f"{name}/weights.parquet" for name in DEFINITIONS])[0]
    answering = [f"{model}_{mode}[level]" for model in ("ccc", "dcc") for mode in ("in_sample", "causal")]
    answering = ["rolling_moment", "ewma_causal", "ewma_two_sided", "jiang_markov", *answering]
    assert set(moved) == {"time", "segment", *answering}
    for name in answering:
        np.testing.assert_allclose(moved[name], expected[name] - INJECTED, atol=1e-4, err_msg=name)
    said = dict(zip(methods["column"], methods["moved"], strict=True))
    for column in fused:
        if column in ("time", "segment", "sd_recommended", *answering):
            continue
        assert said[column].startswith("the same at any constant rate: "), column
        # What is said to be the same is the same in the recording that turns.
        np.testing.assert_allclose(fused[column], expected[column] - INJECTED, atol=1e-4, err_msg=column)
    assert {name: said[name] for name in answering} == {name: name for name in answering}
    assert said[""] == ""  # of the method that could not run
    # The rate does something to each of these (of the level it shrinks: tests/fusion/motion/test_constant_rate.py).
    for name in answering:
        assert np.abs(moved[name] - fused[name]).max() > 1e-5, name
    about = read_metadata(analysed / "moved.parquet")
    assert about["injected_rate"] == INJECTED
    assert about["rate_hz"] == RATE_HZ


@pytest.mark.parametrize(
    ("keywords", "reason"),
    [({"kind": "constant", "injected_rate": INJECTED}, "not one at rest"), ({"injected_rate": None}, "null")],
)
def test_no_rate_is_added(analysed, keywords, reason):
    fused, methods, moved = fuse_moved(analysed, **keywords)
    assert list(moved) == ["time", "segment"]
    assert len(moved["time"]) == len(fused["time"])
    said = dict(zip(methods["column"], methods["moved"], strict=True))
    assert said["average"].startswith("the same at any constant rate")
    assert said["dcc_causal[level]"].startswith("not known: ")
    assert reason in said["dcc_causal[level]"]


def test_level_weights_of_single_samples_are_not_estimated_again(tmp_path):
    write_inputs(tmp_path)
    time = read_columns(tmp_path / "rates.parquet")["time"]
    (tmp_path / "level").mkdir()
    write_weights(tmp_path / "level/weights.parquet", time, [("dcc", "in_sample")], row_group=4000)
    _, methods = fuse_in(tmp_path, ["level/weights.parquet"], analysis=FULL, injected_rate=INJECTED)
    said = dict(zip(methods["column"], methods["moved"], strict=True))
    assert said["dcc_in_sample[level]"] == f"not known: {array_inputs.NOT_AT_FULL_RATE}."
    assert said["ewma_causal"] == "ewma_causal"


def test_a_response_that_is_not_declared_is_measured(analysed, monkeypatch):
    # A mean of three samples, the last one of them its own: 1 sample late.
    def smooth(array, parameters):  # noqa: ARG001
        mean = np.pad(array.rate.mean(axis=1), (2, 0), mode="edge")
        return Fused((mean[2:] + mean[1:-1] + mean[:-2]) / 3)

    monkeypatch.setitem(METHODS, "smooth", Method("smooth", "Smooth", "test", True, (), smooth))
    _, methods, moved = fuse_moved(analysed, injected_rate=INJECTED)
    row = list(methods["method"]).index("smooth")
    figures = {name: methods[name][row] for name in ("response", "dc_gain", "delay_s", "moved")}
    assert figures["response"] == "measured"
    assert figures["dc_gain"] == pytest.approx(1.0)
    assert figures["delay_s"] == pytest.approx(1 / RATE_HZ, rel=1e-3)
    assert figures["moved"] == "smooth"
    assert moved["smooth"].std() > 0
    ran = methods["column"] != ""
    assert np.isfinite(methods["dc_gain"][ran]).all()
    assert set(methods["response"][ran]) == {"analytic", "measured"}
    assert set(methods["response"][~ran]) == {""}


def test_what_was_found_of_the_rates_is_forgotten_with_them(tmp_path):
    # The rates are changed in their place: what was made once of them would be of rates that are no more.
    write_inputs(tmp_path, seconds=30)
    inputs = {"rates": ["rates.parquet"], "noise": ["noise.json"]}
    opened = array_inputs.open_array(task_of(tmp_path, inputs, {}, injected_rate=INJECTED))
    before = opened.rates.once("mean", lambda: float(opened.rates.rate.mean()))
    moved = opened.move()
    for rates in (opened.rates, moved):
        assert rates.once("mean", lambda: float(moved.rate.mean())) == pytest.approx(before + INJECTED, abs=1e-6)
