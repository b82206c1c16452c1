"""The task fuse on a small array, through files, after what the volatility tasks write."""

import json
import os
import subprocess
import sys
import tracemalloc

import numpy as np
import pytest
from fuse_bench import (
    ANALYSIS,
    ARW,
    DEFINITIONS,
    FULL,
    GYROS,
    INJECTED,
    RATE_HZ,
    SECONDS,
    fuse_in,
    fuse_moved,
    run_volatility,
    task_of,
    write_inputs,
    write_weights,
)

from vgyro.engine import ENGINES
from vgyro.fusion import METHODS, Fused, Method, blocks
from vgyro.storage.tables import Provenance, read_columns, read_metadata, write_table
from vgyro.tasks.figures import crosscheck
from vgyro.tasks.fusion import array_inputs, fuse


def test_every_method_has_its_row_and_column(analysed):
    fused, methods = fuse_in(analysed, [f"{name}/weights.parquet" for name in DEFINITIONS])
    # Once each, but CCC and DCC in both modes for each definition.
    assert len(methods["method"]) == len(METHODS) + 4
    assert set(fused) == {"time", "segment", "sd_recommended", *(column for column in methods["column"] if column)}
    assert all(np.isfinite(values).all() for values in fused.values())
    row = dict(zip(methods["method"], methods["column"], strict=True))
    assert row["inverse_variance_rrw"] == ""
    notes = dict(zip(methods["method"], methods["note"], strict=True))
    assert "rate random walk was found for gyro 1 of 3" in notes["inverse_variance_rrw"]
    # Expected: the best weights give 1/√(Σ 1/N_i²), the average √(Σ N_i²)/3; a window of 120 s leaves some 10 %.
    best, average = np.sum(np.power(ARW, -2.0)) ** -0.5, np.sqrt(np.sum(np.square(ARW))) / 3
    first = fused["segment"] == 0  # the other stretch is shorter than a window: equal weights
    ratio = fused["dcc_in_sample[level]"][first].std() / fused["average"][first].std()
    assert ratio == pytest.approx(best / average, abs=0.06)


def test_weights_reach_the_samples_of_their_block(analysed):
    # Expected: the stored weights of a block, applied by hand to the samples of its second.
    fused, _ = fuse_in(analysed, ["level/weights.parquet"])
    rates = read_columns(analysed / "rates.parquet")
    table = read_columns(analysed / "level/weights.parquet")
    chosen = (table["model"] == "dcc") & (table["mode"] == "in_sample")
    for place in (0, 150, 299, 320):
        start = table["time"][chosen][place]
        inside = (rates["time"] >= start - 1e-6) & (rates["time"] < start + 1 - 1e-6)
        assert inside.sum() == 10
        expected = sum(rates[gyro][inside] * table[f"w_{gyro}"][chosen][place] for gyro in GYROS)
        np.testing.assert_allclose(fused["dcc_in_sample[level]"][inside], expected, atol=1e-12)


def test_weights_of_single_samples(tmp_path, monkeypatch):
    # The series is at the full rate and lacks some samples; row groups, pieces and blocks all end at different places.
    # Expected: the weights of the row with the sample's time, equal ones where there is none.
    monkeypatch.setattr(blocks, "PIECE", 256)
    monkeypatch.setattr(array_inputs, "ROW_GROUP", 500)
    rate, _ = write_inputs(tmp_path)
    time = read_columns(tmp_path / "rates.parquet")["time"]
    there = (np.arange(len(time)) % 1700 > 40) & (time < time[-30])
    (tmp_path / "level").mkdir()
    names = [("dcc", "in_sample"), ("dcc", "causal"), ("ccc", "in_sample")]
    found = write_weights(tmp_path / "level/weights.parquet", time[there], names, row_group=300)
    fused, methods = fuse_in(tmp_path, ["level/weights.parquet"], analysis=FULL)
    for model, mode in (names[0], names[2]):
        weights = np.full(rate.shape, 1 / 3)
        weights[there] = found[model, mode]
        np.testing.assert_allclose(fused[f"{model}_{mode}[level]"], (rate * weights).sum(axis=1), atol=1e-14)
    notes = {(m, d): n for m, d, n in zip(methods["method"], methods["definition"], methods["note"], strict=True)}
    assert notes["dcc_causal", "level"] == "status of causal."
    assert f"{1 - there.mean():.1%} of the samples" in notes["dcc_in_sample", "level"]


def test_both_engines_fuse_alike(analysed):
    tables = [f"{name}/weights.parquet" for name in DEFINITIONS]
    native, reference = (fuse_in(analysed, tables, analysis={**ANALYSIS, "engine": name})[0] for name in ENGINES)
    assert set(native) == set(reference)
    for name, column in native.items():
        # Of the GARCH models of waegli_guerrier the two engines find the maximum to some 1e-6.
        found = name == "waegli_guerrier"
        np.testing.assert_allclose(column, reference[name], rtol=1e-10, atol=1e-5 if found else 1e-12, err_msg=name)


def test_same_bytes_for_any_threads_and_instruction_set(analysed, tmp_path):
    # As the workflow runs it: python -m vgyro.tasks.fusion.fuse.
    tables = [str(analysed / name / "weights.parquet") for name in DEFINITIONS]
    task = task_of(analysed, {}, {})
    written = set()
    for extra in ({"VGYRO_THREADS": "1"}, {"VGYRO_THREADS": "3"}, {"VGYRO_ISA": "baseline"}):
        command = [sys.executable, "-m", "vgyro.tasks.fusion.fuse", "--input", "rates", str(analysed / "rates.parquet")]
        command += ["--input", "noise", str(analysed / "noise.json"), "--input", "weights", *tables]
        command += ["--output", "fused", str(tmp_path / "f.parquet")]
        command += [
            "--output",
            "methods",
            str(tmp_path / "m.parquet"),
            "--output",
            "moved",
            str(tmp_path / "c.parquet"),
        ]
        subprocess.run([*command, "--options", json.dumps(task.options)], env=os.environ | extra, check=True)
        written.add((tmp_path / "f.parquet").read_bytes())
    assert len(written) == 1
    assert not list(tmp_path.glob(".*")), "the columns' file has no name"


def test_memory_of_a_long_recording(tmp_path):
    # Rates in single precision, segment, rest, numbers of blocks and one fused rate or two: 60 bytes a sample for three
    # gyros. One more array [T, N] in double precision would add 24.
    peaks, lengths = [], (400_000, 1_000_000)
    some = {**FULL, "fusion": {"methods": ["median", "ewma_two_sided", "jiang_markov", "dcc_in_sample"]}}
    for samples in lengths:
        write_inputs(tmp_path, seconds=samples / RATE_HZ, single=True)
        time = read_columns(tmp_path / "rates.parquet")["time"]
        (tmp_path / "level").mkdir(exist_ok=True)
        write_weights(tmp_path / "level/weights.parquet", time, [("dcc", "in_sample")], row_group=1 << 16)
        tracemalloc.start()
        fuse_in(tmp_path, ["level/weights.parquet"], analysis=some, read=False, injected_rate=INJECTED)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert (peaks[1] - peaks[0]) / (lengths[1] - lengths[0]) < 60


def test_without_weights(tmp_path):
    write_inputs(tmp_path, seconds=30)
    _, methods = fuse_in(tmp_path)
    by_name = dict(zip(methods["method"], zip(methods["column"], methods["note"], strict=True), strict=True))
    assert by_name["dcc_causal"][0] == ""
    assert "no causal weights" in by_name["dcc_causal"][1]
    assert by_name["jiang_markov"][0] == "jiang_markov"


def test_reason_of_a_short_recording_is_that_of_the_weights(tmp_path):
    write_inputs(tmp_path, seconds=100)
    run_volatility(tmp_path)
    _, methods = fuse_in(tmp_path, ["level/weights.parquet"])
    notes = dict(zip(methods["method"], methods["note"], strict=True))
    assert notes["dcc_causal"]
    level = [n for m, d, n in zip(methods["method"], methods["definition"], methods["note"], strict=True)
             if (m, d) == ("dcc_causal", "level")]  # fmt: skip
    assert level[0].startswith("too short")


def test_one_gyro(tmp_path):
    write_inputs(tmp_path, gyros=("g1",), seconds=30)
    fused, methods = fuse_in(tmp_path, gyros=("g1",))
    assert list(fused) == ["time", "segment"]
    assert len(methods["method"]) == 0
    assert "one gyro" in read_metadata(tmp_path / "methods.parquet")["note"]


def test_motion_takes_the_wider_filter_and_warns(tmp_path):
    write_inputs(tmp_path, motion=20.0, rest=False)
    run_volatility(tmp_path)
    _, methods = fuse_in(tmp_path, ["level/weights.parquet"], kind="sinusoid")
    rows = {name: index for index, name in enumerate(methods["column"])}
    assert methods["bandwidth_hz"][rows["chang_2012"]] == pytest.approx(5.0)
    assert "bias" in methods["note"][rows["dcc_causal[level]"]]


def test_crosscheck_without_weights_or_gyros_to_fuse(tmp_path):
    write_inputs(tmp_path, gyros=("g1",), seconds=30)
    fuse_in(tmp_path, gyros=("g1",))
    words = dict.fromkeys(("series", "kind"), np.array([], dtype=str))
    empty = {**words, "tau": np.empty(0), "deviation": np.empty(0), "low": np.empty(0)}
    write_table(tmp_path / "allan.parquet", empty, "allan", Provenance({}, "", ""))
    inputs = {name: [f"{name}.parquet"] for name in ("rates", "fused", "methods", "allan")}
    inputs |= {"noise": ["noise.json"], "garch": [], "dcc": [], "weights": []}
    crosscheck.main(task_of(tmp_path, inputs, {"crosscheck": "crosscheck.parquet"}, gyros=("g1",)))
    assert len(read_columns(tmp_path / "crosscheck.parquet")["check"]) == 0


def test_what_a_method_is_and_its_deviation_reach_the_tables(analysed, monkeypatch):
    # Known: what the method itself says.
    sd = np.linspace(0.01, 0.02, int(SECONDS * RATE_HZ))

    def known(array, parameters):  # noqa: ARG001
        return Fused(array.rate.mean(axis=1), dc_gain=1.0, bandwidth_hz=2.0, delay_s=0.0, passes=2, sd=sd)

    method = Method(
        "known", "Known", "test", False, ("arw", "rrw"), known, family="ours", operations=lambda n: 7.0 * n,
        inferred="nothing",
    )  # fmt: skip
    monkeypatch.setitem(METHODS, "known", method)
    fused, methods = fuse_in(analysed)
    row = list(methods["method"]).index("known")
    names = ("family", "needs", "inferred", "operations", "passes")
    assert [methods[name][row] for name in names] == ["ours", "arw, rrw", "nothing", 21.0, 2]
    assert fused["sd_known"].dtype == np.float32
    np.testing.assert_allclose(fused["sd_known"], sd, rtol=1e-6)
    np.testing.assert_allclose(fused["known"], fused["average"], atol=1e-12)
    assert "sd_average" not in fused
    assert read_metadata(analysed / "fused.parquet")["units"]["sd_known"] == "deg/s"


def test_a_method_that_fails_is_a_row_and_the_job_goes_on(analysed, monkeypatch, caplog):
    # One ends with an error of numpy, one cannot tell its response or its cost.
    def broken(array, parameters):  # noqa: ARG001
        raise np.linalg.LinAlgError("Singular matrix")

    def once(array, parameters):  # noqa: ARG001
        if len(array.rate) != int(SECONDS * RATE_HZ):
            raise RuntimeError("not with so few samples")
        return Fused(array.rate.mean(axis=1))

    fail = {"broken": broken, "once": once}
    for name, fuse_one in fail.items():
        method = Method(name, name, "test", True, (), fuse_one, operations=lambda n: 1 / 0 * n, family="other")
        monkeypatch.setitem(METHODS, name, method)
    monkeypatch.setattr(fuse, "LEFT_OUT", ["package old-gyro 0.1: it is left out"])
    fused, methods, moved = fuse_moved(analysed, injected_rate=INJECTED)
    state = dict(zip(methods["method"], methods["state"], strict=True))
    row = {name: list(methods["method"]).index(name) for name in fail}
    assert (state["average"], state["broken"], state["once"]) == ("ran", "failed", "ran")
    assert set(methods["state"]) <= {"ran", "cannot run", "failed"}
    assert (methods["column"] != "").tolist() == (methods["state"] == "ran").tolist()
    why = "LinAlgError: Singular matrix (a bug in vgyro; the traceback is in the log)"
    assert methods["note"][row["broken"]] == f"failed: {why}"
    assert methods["moved"][row["broken"]] == ""
    assert "broken" not in fused
    assert "once" in fused
    assert "once" in moved
    assert methods["response"][row["once"]] == ""
    assert np.isnan(methods["dc_gain"][row["once"]])
    assert np.isnan(methods["operations"][row["once"]])
    assert "its response could not be measured: failed: RuntimeError" in methods["note"][row["once"]]
    assert "broken failed" in caplog.text
    assert "old-gyro 0.1" in caplog.text
