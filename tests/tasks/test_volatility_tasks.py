"""The volatility tasks end to end: rates in, five tables out, whatever the number of jobs."""

import numpy as np
import pytest
from task_options import complete

from vgyro.board import Board
from vgyro.storage.schemas import SCHEMAS
from vgyro.storage.tables import Provenance, read_columns, read_metadata, write_table
from vgyro.tasks.common import Task
from vgyro.tasks.volatility import assemble, chunk, series
from vgyro.tasks.volatility.layout import WHOLE, garch_rows, weight_blocks
from vgyro.tasks.volatility.stored import open_series, stored_model
from vgyro.volatility import Window, fit_garch, windows

WINDOW, STEP = 120, 50


def board_of(names):
    channels = {"name": "rate", "type": "i16", "count": len(names), "at": 2}
    frame = {"kind": "binary", "sync": "EB90", "length": 2 + 2 * len(names), "fields": [channels]}
    frame["checksum"] = {"family": "none"}
    field = "rate{}" if len(names) > 1 else "rate"
    gyros = [
        {"name": name, "field": field.format(index + 1), "axis": "z", "scale": 0.01} for index, name in enumerate(names)
    ]
    record = {"name": "b", "title": "b", "rate_hz": 10.0, "frame": frame, "gyros": gyros}
    return Board.model_validate(record).model_dump(mode="json")


TABLES = ("garch", "dcc", "arch_lm", "weights", "fits")
PARTS = ("garch", "dcc", "weights")


def write_series(folder, values, segment=None, rest=None, definition="level", kind="static", **analysis):
    """Write rates at 10 Hz whose 1 Hz block means are `values`, and the series of them; return the options."""
    samples, n = values.shape
    names = [f"g{i + 1}" for i in range(n)]
    rates = np.repeat(values, 10, axis=0)
    columns = {
        "time": np.arange(10 * samples) / 10,
        "segment": np.repeat(np.zeros(samples) if segment is None else segment, 10).astype(np.int32),
        "at_rest": np.repeat(np.ones(samples) if rest is None else rest, 10).astype(bool),
        **{name: rates[:, i] for i, name in enumerate(names)},
    }
    write_table(folder / "rates.parquet", columns, "rates", Provenance({}, "", ""), {"rate_hz": 10.0})
    options = {
        "board": board_of(names),
        "axis": "z",
        "definition": definition,
        "kind": kind,
        "analysis": complete({"volatility": {"window": WINDOW, "step": STEP, **analysis}}),
    }
    made = Task({"rates": [folder / "rates.parquet"]}, {"series": folder / "series.parquet"}, options, "code")
    series.main(made)
    return options


def run_volatility(folder, options, chunks=1):
    """Run the task `volatility`, after `chunks` jobs that make the parts, or by itself; read the tables."""
    known = {"series": [folder / "series.parquet"]}
    parts = {name: [] for name in PARTS}
    for number in range(1, chunks + 1) if chunks > 1 else ():
        made = {name: folder / f"{name}.{number}.parquet" for name in PARTS}
        chunk.main(Task(known, made, {**options, "chunk": f"{number}-of-{chunks}"}, "code"))
        parts = {name: [*paths, made[name]] for name, paths in parts.items()}
    outputs = {name: folder / f"{name}.parquet" for name in TABLES}
    assemble.main(Task({**known, **parts}, outputs, options, "code"))
    return {name: read_columns(path) for name, path in outputs.items()}


def run_all(folder, values, **keywords):
    """The series of `values`, and what the stage makes of it."""
    return run_volatility(folder, write_series(folder, values, **keywords))


def noise(samples, n, seed=0):
    return 0.04 * np.random.default_rng(seed).standard_normal((samples, n))


@pytest.fixture(scope="module")
def tables(tmp_path_factory):
    folder = tmp_path_factory.mktemp("volatility")
    return folder, run_all(folder, noise(300, 3), definition="demeaned")


def test_rows_of_every_table(tables):
    # By hand: windows [0, 120), [50, 170), [100, 220), [150, 270) of 300 samples, and the whole record.
    _, found = tables
    assert found["garch"]["window"].tolist() == [number for number in (-1, 0, 1, 2, 3) for _ in range(3)]
    assert found["dcc"]["window"].tolist() == [-1, 0, 1, 2, 3]
    assert found["dcc"]["start"].tolist() == [0, 0, 50, 100, 150]
    assert found["dcc"]["stop"].tolist() == [300, 120, 170, 220, 270]
    assert found["dcc"]["time_start"].tolist() == [0, 0, 50, 100, 150]
    assert found["arch_lm"]["series"].tolist() == [
        name for name in ("level", "detrended", "whitened", "standardised") for _ in range(3)
    ]
    assert set(found["arch_lm"]["status"]) == {"ok"}
    assert set(found["arch_lm"]["samples"]) == {300}
    rows = found["weights"]
    assert len(rows["time"]) == 4 * 300
    assert set(zip(rows["model"], rows["mode"], strict=True)) == {
        (model, mode) for model in ("dcc", "ccc") for mode in ("in_sample", "causal")
    }


def test_columns_are_declared_with_units(tables):
    folder, found = tables
    assert set(found) == set(TABLES)
    for name in [*found, "series"]:
        about = read_metadata(folder / f"{name}.parquet")
        assert about["schema"] == name
        assert about["version"] == SCHEMAS[name].version
    assert read_metadata(folder / "garch.parquet")["units"]["omega"] == "(deg/s)²"


def test_parameters_are_those_of_the_window(tables):
    # Expected: the public function on the window cut out by hand.
    _, found = tables
    window = noise(300, 3)[50:170]
    fit = fit_garch(window - window.mean(axis=0))
    rows = found["garch"]["window"] == 1
    np.testing.assert_allclose(found["garch"]["log_likelihood"][rows], fit.log_likelihood, rtol=1e-9)
    # The rounding of a block mean moves an ω near 0 along a flat likelihood; the variance is 0.0016.
    np.testing.assert_allclose(found["garch"]["omega"][rows], fit.omega, rtol=1e-5, atol=1e-8)
    assert found["garch"]["status"][rows].tolist() == fit.status.tolist()


def test_weights_are_weights(tables):
    rows = tables[1]["weights"]
    w = np.column_stack([rows[f"w_g{i}"] for i in (1, 2, 3)])
    np.testing.assert_allclose(w.sum(axis=1), 1, rtol=1e-12)
    assert w.min() >= 0
    waiting = rows["status"] == "no model yet"
    assert waiting.sum() == 2 * WINDOW
    assert set(rows["mode"][waiting]) == {"causal"}
    np.testing.assert_array_equal(w[waiting], 1 / 3)
    assert np.isnan(rows["sigma"][waiting]).all()
    # The fused rate is never noisier than the best gyro, by construction of the weights.
    best = np.min(np.column_stack([rows[f"sd_g{i}"] for i in (1, 2, 3)])[~waiting], axis=1)
    assert np.all(rows["sigma"][~waiting] <= best * (1 + 1e-9))


def test_same_bytes_again(tables, tmp_path):
    folder, _ = tables
    run_all(tmp_path, noise(300, 3), definition="demeaned")
    for name in TABLES:
        assert (tmp_path / f"{name}.parquet").read_bytes() == (folder / f"{name}.parquet").read_bytes()


def gappy():
    """Stretches of 310, 60 (too short), 130 and 200 s; the third begins a window long, with little to carry forward."""
    segment = np.repeat([0, 1, 2, 3], [310, 60, 130, 200])
    values = noise(700, 3, seed=3)
    values[340:365] += 5.0
    values[420:520, 2] = 0.01
    return values, segment


@pytest.mark.parametrize("definition", ["difference", "residual"])
def test_the_tables_do_not_depend_on_the_jobs(tmp_path, definition, monkeypatch):
    # Windows: 4 (to 270 of 310), none, 1, 2. Seven windows in 1 job, 2, 3 and 9, the last of which have none.
    values, segment = gappy()
    options = write_series(tmp_path, values, segment=segment, definition=definition)
    found = run_volatility(tmp_path, options)
    assert found["dcc"]["start"].tolist() == [0, 0, 50, 100, 150, 370, 500, 550]
    expected = {name: (tmp_path / f"{name}.parquet").read_bytes() for name in TABLES}
    for chunks in (2, 3, 9):
        run_volatility(tmp_path, options, chunks)
        for name in TABLES:
            assert (tmp_path / f"{name}.parquet").read_bytes() == expected[name], (chunks, name)
    # Nor on how many windows are fitted at once, and how much of the series is read.
    monkeypatch.setattr(chunk, "BATCH_WINDOWS", 2)
    monkeypatch.setattr(chunk, "FAR", 100)
    monkeypatch.setattr("vgyro.tasks.volatility.stored.SLAB", 200)
    run_volatility(tmp_path, options)
    for name in TABLES:
        assert (tmp_path / f"{name}.parquet").read_bytes() == expected[name], name


def test_rows_of_a_recording_with_gaps(tmp_path):
    values, segment = gappy()
    found = run_all(tmp_path, values, segment=segment, models=["ccc"], modes=["causal"])
    rows = found["weights"]
    np.testing.assert_array_equal(rows["segment"], segment)
    np.testing.assert_array_equal(rows["time"], np.arange(700))
    # By hand: equal weights in the stretch that is too short, and before each first window is complete.
    short = rows["status"] == "too short: 310 samples, window 120"
    assert np.flatnonzero(short).tolist() == list(range(310, 370))
    waiting = [*range(120), *range(370, 490), *range(500, 620)]
    assert np.flatnonzero(rows["status"] == "no model yet").tolist() == waiting
    np.testing.assert_array_equal(rows["w_g1"][short], 1 / 3)
    assert np.isnan(rows["sigma"][short]).all()
    # The third gyro sticks in the first 100 s of the window [370, 490), and that window's model is carried to 500.
    assert set(rows["status"][490:500]) <= {"ok"}


def test_weights_are_blocks_of_models_and_modes(tables):
    folder, found = tables
    about = read_metadata(folder / "weights.parquet")
    assert about["blocks"] == [["dcc", "in_sample"], ["dcc", "causal"], ["ccc", "in_sample"], ["ccc", "causal"]]
    assert about["samples"] == 300
    for number, (model, mode) in enumerate(about["blocks"]):
        rows = slice(300 * number, 300 * (number + 1))
        assert set(found["weights"]["model"][rows]) == {model}
        assert set(found["weights"]["mode"][rows]) == {mode}


def test_the_map_of_fits_counts_every_window(tables):
    _, found = tables
    fits, rolling = found["fits"], found["garch"]["window"] != WHOLE
    for gyro in ("g1", "g2", "g3"):
        statuses = found["garch"]["status"][rolling & (found["garch"]["gyro"] == gyro)]
        for status in set(statuses):
            counted = fits["windows"][(fits["subject"] == gyro) & (fits["status"] == status)]
            assert counted.sum() == (statuses == status).sum()
    assert fits["windows"][fits["subject"] == "dcc"].sum() == 4
    # By hand: four bins of 75 s; the middles of the windows, 59.5, 109.5, 159.5 and 209.5 s, lie in 0, 1, 2 and 2.
    dcc = fits["subject"] == "dcc"
    counts = [int(fits["windows"][dcc & (fits["time_start"] == start)].sum()) for start in (0.0, 75.0, 150.0, 225.0)]
    assert counts == [1, 1, 2, 0]


def test_a_stored_model_is_that_of_its_window(tables):
    folder, found = tables
    options = write_series(folder, noise(300, 3), definition="demeaned")
    array = open_series(Task({"series": [folder / "series.parquet"]}, {}, options, "code"))
    assert [array.plan.window(k) for k in range(4)] == windows(np.zeros(300), WINDOW, STEP)
    assert array.window(WHOLE) == Window(0, 300)
    model = stored_model(array, folder / "garch.parquet", folder / "dcc.parquet", 2)
    rows = found["garch"]["window"] == 2
    np.testing.assert_array_equal(model.omega[0], found["garch"]["omega"][rows])
    assert model.start.tolist() == [100]
    assert model.target[0, 2, 1] == found["dcc"]["target"][3][2]
    window = noise(300, 3)[100:220]
    np.testing.assert_allclose(array.residuals(2), window - window.mean(axis=0), atol=1e-12)


def test_rows_that_are_not_of_the_window_are_refused(tables):
    # Three gyros: with two the rows of window 1 would be the last of window 0 and the first of window 1.
    folder, _ = tables
    path = folder / "garch.parquet"
    assert garch_rows(path, ["gyro"], 1, 3)["gyro"].tolist() == ["g1", "g2", "g3"]
    with pytest.raises(ValueError, match="window 1 is not where it should be"):
        garch_rows(path, ["gyro"], 1, 2)


def test_blocks_of_weights_begin_where_the_table_says(tables):
    folder, found = tables
    blocks, samples = weight_blocks(folder / "weights.parquet")
    assert samples == 300
    for (model, mode), first in blocks.items():
        rows = slice(first, first + samples)
        assert set(found["weights"]["model"][rows]) == {model}
        assert set(found["weights"]["mode"][rows]) == {mode}


def test_a_long_stretch_stands_for_itself_by_its_beginning(tmp_path, monkeypatch):
    monkeypatch.setattr("vgyro.tasks.volatility.stored.WHOLE_SAMPLES", 150)
    found = run_all(tmp_path, noise(300, 2))
    assert (found["dcc"]["start"][0], found["dcc"]["stop"][0]) == (0, 150)
    assert set(found["arch_lm"]["samples"]) == {150}


def test_too_short_for_a_window_but_not_for_a_fit(tmp_path):
    found = run_all(tmp_path, noise(60, 2))
    assert found["garch"]["window"].tolist() == [-1, -1]
    assert found["dcc"]["window"].tolist() == [-1]
    assert np.isfinite(found["dcc"]["statistic"][0])
    assert set(found["weights"]["status"]) == {"too short: 60 samples, window 120"}
    np.testing.assert_array_equal(found["weights"]["w_g1"], 0.5)
    assert set(found["arch_lm"]["status"]) == {"ok"}


@pytest.mark.parametrize("samples", [0, 7])
def test_far_too_short(tmp_path, samples):
    values = np.concatenate([noise(samples, 2), noise(40, 2)])
    rest = np.r_[np.ones(samples), np.zeros(40)]
    # A few samples at rest, or none at all: then all 40 are used, which is too few too.
    found = run_all(tmp_path, values, rest=rest, kind="free")
    for name in ("garch", "dcc", "arch_lm"):
        assert set(found[name]["status"]) == {"too short"}
    assert np.isnan(found["arch_lm"]["statistic"]).all()
    assert set(found["weights"]["status"]) == {f"too short: {samples or 40} samples, window 120"}


def test_one_gyro(tmp_path):
    found = run_all(tmp_path, noise(200, 1))
    assert set(found["dcc"]["status"]) == {"one gyro"}
    assert np.isnan(found["dcc"]["a"]).all()
    np.testing.assert_array_equal(found["weights"]["w_g1"], 1.0)


@pytest.mark.parametrize("definition", ["level", "difference", "residual"])
def test_a_gyro_that_sticks(tmp_path, definition):
    values = noise(300, 3)
    values[100:230, 1] = 0.02
    found = run_all(tmp_path, values, definition=definition)
    stuck = (found["garch"]["window"] == 2) & (found["garch"]["gyro"] == "g2")
    assert found["garch"]["status"][stuck].tolist() == ["no variance"]
    rows = found["weights"]
    out = rows["status"] == "without g2: no variance"
    # In-sample: the newest 50 of window [100, 220); causal: the 50 after it; for two models.
    assert out.sum() == 2 * (50 + 50)
    np.testing.assert_array_equal(rows["w_g2"][out], 0)
    np.testing.assert_allclose(rows["w_g1"][out] + rows["w_g3"][out], 1)


def test_identical_gyros(tmp_path):
    values = noise(200, 2)
    values[:, 1] = values[:, 0]
    found = run_all(tmp_path, values)
    assert set(found["dcc"]["status"]) == {"not positive definite"}
    assert np.isnan(found["dcc"]["p_value"]).all()
    told = found["weights"]["status"] == "correlation not positive definite, taken as 0"
    assert told.any()
    np.testing.assert_allclose(found["weights"]["w_g1"][told], 0.5)


def test_only_rest_is_used_where_there_is_rest(tmp_path):
    values = noise(300, 2)
    rest = np.ones(300)
    rest[100:110] = 0
    values[100:110] += 50.0
    found = run_all(tmp_path, values, rest=rest, kind="free")
    assert len(found["weights"]["time"]) == 4 * 290
    # The longest stretch is 190 s long; windows [100, 220), [150, 270) lie in it.
    assert found["dcc"]["start"].tolist() == [100, 100, 150]
    assert found["garch"]["omega"].max() < 0.01
    moving = run_all(tmp_path, values, rest=rest, kind="sinusoid")
    assert len(moving["weights"]["time"]) == 4 * 300


def test_drift_shows_in_the_level_and_not_when_detrended(tmp_path):
    values = noise(600, 1) + 0.2 * np.sin(2 * np.pi * np.arange(600) / 300)[:, None]
    found = run_all(tmp_path, values)["arch_lm"]
    level, detrended, whitened, _ = found["statistic"]
    assert level > 100
    assert detrended < 12
    assert whitened < 12
