"""The tasks volatility → fuse → crosscheck on a small array, through files."""

import json

import numpy as np
import pytest

from vgyro.engine.independent import nnls_weights
from vgyro.storage.tables import Provenance, read_columns, read_metadata, write_json, write_table
from vgyro.tasks import crosscheck, fuse, series, volatility
from vgyro.tasks.common import Task

GYROS = ("g1", "g2", "g3")
RATE_HZ, SECONDS = 10.0, 400
DEFINITIONS = ("level", "residual")
ARW = (0.05, 0.05, 0.15)
ANALYSIS = {
    "engine": "reference",
    "volatility": {"window": 120, "step": 40, "definitions": DEFINITIONS},
    "fusion": {"moment_window_s": 60},
    "crosscheck": {"windows": 2},
}


def board(gyros):
    fields = [{"name": gyro, "type": "i16", "at": 2 + 2 * index} for index, gyro in enumerate(gyros)]
    frame = {"kind": "binary", "sync": "EB90", "length": 20, "fields": fields, "checksum": {"family": "none"}}
    rows = [{"name": gyro, "field": gyro, "axis": "z", "scale": 0.01} for gyro in gyros]
    return {"name": "small", "title": "small", "rate_hz": RATE_HZ, "frame": frame, "gyros": rows}


def task_of(folder, inputs, outputs, gyros=GYROS, kind="static", **options):
    options = {"board": board(gyros), "axis": "z", "recording": "r", "kind": kind, "analysis": ANALYSIS, **options}
    return Task(
        {name: [folder / path for path in paths] for name, paths in inputs.items()},
        {name: folder / path for name, path in outputs.items()},
        json.loads(json.dumps(options)),
        "code",
    )


def write_inputs(folder, gyros=GYROS, seconds=SECONDS, motion=0.0, rest=True):
    """Rates of white gyros, the third three times as noisy; a gap after 3/4; their noise record."""
    samples = int(seconds * RATE_HZ)
    time = np.arange(samples) / RATE_HZ
    segment = np.where(np.arange(samples) < 3 * samples // 4, 0, 1).astype(np.int32)
    time = time + 5.0 * segment
    white = np.random.default_rng(7).standard_normal((samples, len(gyros))) * ARW[: len(gyros)] * np.sqrt(RATE_HZ)
    rate = white + motion * np.sin(time)[:, None]
    columns = {"time": time, "segment": segment, "at_rest": np.full(samples, rest)}
    columns |= {gyro: rate[:, index] for index, gyro in enumerate(gyros)}
    write_table(folder / "rates.parquet", columns, "rates", Provenance({}, "", ""), {"rate_hz": RATE_HZ})
    record = {
        "gyros": list(gyros),
        "arw": dict(zip(gyros, ARW, strict=False)),
        "rrw": {**dict.fromkeys(gyros, 0.001), gyros[0]: None},
        "rrw_source": {**dict.fromkeys(gyros, "upper limit: no random walk was found"), gyros[0]: "not known"},
        "correlation": np.eye(len(gyros)).tolist(),
    }
    write_json(folder / "noise.json", record)
    return rate, segment


def run_volatility(folder):
    series.main(task_of(folder, {"rates": ["rates.parquet"]}, {"series": "series.parquet"}))
    for definition in DEFINITIONS:
        made = {name: f"{definition}/{name}.parquet" for name in ("garch", "dcc", "arch_lm", "weights", "fits")}
        (folder / definition).mkdir(exist_ok=True)
        volatility.main(task_of(folder, {"series": ["series.parquet"]}, made, definition=definition))


def fuse_in(folder, tables=(), **keywords):
    inputs = {"rates": ["rates.parquet"], "noise": ["noise.json"], "weights": list(tables)}
    fuse.main(task_of(folder, inputs, {"fused": "fused.parquet", "methods": "methods.parquet"}, **keywords))
    return read_columns(folder / "fused.parquet"), read_columns(folder / "methods.parquet")


@pytest.fixture(scope="module")
def analysed(tmp_path_factory):
    """A static recording with everything that the volatility tasks write."""
    folder = tmp_path_factory.mktemp("analysed")
    write_inputs(folder)
    run_volatility(folder)
    return folder


def test_every_method_has_its_row_and_column(analysed):
    fused, methods = fuse_in(analysed, [f"{name}/weights.parquet" for name in DEFINITIONS])
    assert len(methods["method"]) == 11 + 4 * 2
    assert set(fused) == {"time", "segment", *(column for column in methods["column"] if column)}
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


def check_in(folder):
    tables = {name: [f"{d}/{name}.parquet" for d in DEFINITIONS] for name in ("garch", "dcc", "weights")}
    inputs = {"rates": ["rates.parquet"], "noise": ["noise.json"], "fused": ["fused.parquet"],
              "methods": ["methods.parquet"], "allan": ["allan.parquet"], "series": ["series.parquet"],
              **tables}  # fmt: skip
    crosscheck.main(task_of(folder, inputs, {"crosscheck": "crosscheck.parquet"}))
    return read_columns(folder / "crosscheck.parquet")


def write_allan(folder, factor=1.0):
    # Expected here: NIST SP 1065's estimator by phase data, written out.
    fused = read_columns(folder / "fused.parquet", ["average", "segment"])
    total, count = 0.0, 0
    for number in (0, 1):
        phase = np.concatenate([[0.0], np.cumsum(fused["average"][fused["segment"] == number])]) / RATE_HZ
        second = phase[40:] - 2 * phase[20:-20] + phase[:-40]
        total, count = total + np.sum(second**2), count + len(second)
    deviation = np.sqrt(total / (2 * 2.0**2 * count)) * factor
    columns = {"series": ["average"], "tau": [2.0], "deviation": [deviation], "low": [0.0], "high": [1.0], "edf": [9.0]}
    write_table(folder / "allan.parquet", columns, "allan", Provenance({}, "", ""))


def test_crosscheck_passes_on_sound_results(analysed):
    fuse_in(analysed, [f"{name}/weights.parquet" for name in DEFINITIONS])
    write_allan(analysed)
    table = check_in(analysed)
    kinds = {check.split()[0] for check in table["check"]}
    assert kinds == {"GARCH", "weights,", "filter,", "Allan"}
    assert table["passed"].all(), [row for row in zip(*table.values(), strict=True) if not row[-1]]
    again = check_in(analysed)
    assert all(np.array_equal(table[name], again[name]) for name in table), "the sample depends on the seed alone"


def test_crosscheck_finds_what_is_wrong(analysed, tmp_path):
    # A result is spoilt in each table; its check, and no other, must fail.
    for path in analysed.rglob("*"):
        if path.is_file():
            (tmp_path / path.relative_to(analysed)).parent.mkdir(exist_ok=True)
            (tmp_path / path.relative_to(analysed)).write_bytes(path.read_bytes())
    fuse_in(tmp_path, ["level/weights.parquet"])
    fused = read_columns(tmp_path / "fused.parquet")
    fused["jiang_markov"] = fused["jiang_markov"] + 1e-6 * (np.arange(len(fused["time"])) == 100)
    write_table(tmp_path / "fused.parquet", fused, "fused", Provenance({}, "", ""))
    write_allan(tmp_path, factor=1.00001)
    for definition in DEFINITIONS:
        spoil(tmp_path / definition / "garch.parquet", "garch", "log_likelihood", -0.6)
        spoil(tmp_path / definition / "weights.parquet", "weights", "w_g2", 1e-6)
    table = check_in(tmp_path)
    kinds = np.array([check.split()[0] for check in table["check"]])
    assert not table["passed"][np.isin(kinds, ["GARCH", "weights,", "Allan"])].any()
    assert table["passed"][table["series"] == "jiang_markov"].tolist() == [False]
    assert table["passed"][table["series"] == "jiang_random_walk"].tolist() == [True]


def spoil(path, schema, column, change):
    table = read_columns(path)
    table[column] = table[column] + change
    write_table(path, table, schema, Provenance({}, "", ""))


def test_crosscheck_without_weights_or_gyros_to_fuse(tmp_path):
    write_inputs(tmp_path, gyros=("g1",), seconds=30)
    fuse_in(tmp_path, gyros=("g1",))
    empty = {"series": np.array([], dtype=str), "tau": np.empty(0), "deviation": np.empty(0), "low": np.empty(0)}
    write_table(tmp_path / "allan.parquet", empty, "allan", Provenance({}, "", ""))
    inputs = {name: [f"{name}.parquet"] for name in ("rates", "fused", "methods", "allan")}
    inputs |= {"noise": ["noise.json"], "garch": [], "dcc": [], "weights": []}
    crosscheck.main(task_of(tmp_path, inputs, {"crosscheck": "crosscheck.parquet"}, gyros=("g1",)))
    assert len(read_columns(tmp_path / "crosscheck.parquet")["check"]) == 0


def test_nnls_route_closed_form():
    # Expected: uncorrelated gyros weigh as 1/h.
    np.testing.assert_allclose(nnls_weights(np.diag([1.0, 2.0, 4.0])), np.array([4, 2, 1]) / 7, atol=1e-14)
