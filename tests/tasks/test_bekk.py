"""The task bekk: a small series with its fits in, one row a window, definition and model out."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import multivariate_normal
from task_options import complete

from vgyro.engine.covariance import conditional_covariance
from vgyro.engine.models import DccModel
from vgyro.storage.schemas import SCHEMAS
from vgyro.storage.tables import Provenance, read_columns, write_table
from vgyro.tasks.common import Task
from vgyro.tasks.volatility import assemble, bekk
from vgyro.tasks.volatility.stored import open_series, stored_model

GYROS = ["g1", "g2", "g3"]
DEFINITIONS = ("difference", "residual")
WINDOW, STEP, SAMPLES = 120, 40, 330
MODELS = ["ccc", "dcc", "bekk_scalar", "bekk_diagonal"]
TABLES = ("garch", "dcc", "arch_lm", "weights", "fits")


def task_of(folder: Path, inputs: dict, outputs: dict, **options: object) -> Task:
    fields = [{"name": gyro, "type": "i16", "at": 2 + 2 * index} for index, gyro in enumerate(GYROS)]
    frame = {"kind": "binary", "sync": "EB90", "length": 20, "fields": fields, "checksum": {"family": "none"}}
    gyros = [{"name": gyro, "field": gyro, "axis": "z", "scale": 0.01} for gyro in GYROS]
    board = {"name": "small", "title": "small", "rate_hz": 10.0, "frame": frame, "gyros": gyros}
    analysis = {
        "engine": "native",
        "volatility": {"window": WINDOW, "step": STEP, "definitions": DEFINITIONS},
        "crosscheck": {"windows": 3},
    }
    chosen = {
        "board": board,
        "axis": "z",
        "recording": "r",
        "kind": "static",
        "analysis": complete(analysis),
        **options,
    }
    places = {name: [folder / path for path in paths] for name, paths in inputs.items()}
    return Task(places, {name: folder / path for name, path in outputs.items()}, json.loads(json.dumps(chosen)), "code")


def make(folder: Path, values: np.ndarray) -> Task:
    """series.parquet with the fits of every definition; the task that reads them."""
    none = np.zeros(len(values), dtype=np.int32)
    columns = {"time": np.arange(len(values)) + 100.0, "segment": none, "stretch": none}
    columns |= {gyro: values[:, place] for place, gyro in enumerate(GYROS)}
    about = {"rate_hz": 1.0, "runs": [[0, len(values), 0]], "use": "all"}
    write_table(folder / "series.parquet", columns, "series", Provenance({}, "", ""), about)
    for definition in DEFINITIONS:
        (folder / definition).mkdir(parents=True)
        outputs = {name: f"{definition}/{name}.parquet" for name in TABLES}
        inputs = {"series": ["series.parquet"], "garch": [], "dcc": [], "weights": []}
        assemble.main(task_of(folder, inputs, outputs, definition=definition))
    inputs = {name: [f"{definition}/{name}.parquet" for definition in DEFINITIONS] for name in ("garch", "dcc")}
    return task_of(folder, {"series": ["series.parquet"], **inputs}, {"bekk": "bekk.parquet"})


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Task, dict]:
    """White noise whose size changes together, a third gyro twice as noisy."""
    rng = np.random.default_rng(5)
    size = np.exp(0.6 * np.sin(np.arange(SAMPLES) / 15))[:, None] * np.array([0.05, 0.06, 0.12])
    values = rng.standard_normal((SAMPLES, 3)) * size + 0.02 * rng.standard_normal((SAMPLES, 1))
    task = make(tmp_path_factory.mktemp("bekk"), values)
    bekk.main(task)
    return task, read_columns(task.output("bekk"))


def test_a_row_a_window_definition_and_model(made):
    _, found = made
    assert list(found) == [column.name for column in SCHEMAS["bekk"].columns]
    # Three of the windows that start at 0, 40, 80, 120 and 160: after the one at 200 there is no whole step.
    windows = found["window"][found["definition"] == "residual"][::4]
    assert len(set(windows)) == 3
    assert found["model"].tolist() == MODELS * 6
    assert found["window"].tolist() == np.tile(np.repeat(windows, 4), 2).tolist()
    assert (found["stop"] - found["start"] == WINDOW).all()
    assert (found["stop"] + STEP <= SAMPLES).all()
    assert (found["time_start"] == found["start"] + 100.0).all()
    assert np.isfinite(found["log_likelihood"]).all()
    assert (found["sigma"] > 0).all()
    assert found["parameters"].tolist() == [12, 14, 8, 12] * 6
    # The first difference of the stretch is not known: window 0 has a sample less.
    samples = WINDOW - ((found["definition"] == "difference") & (found["window"] == 0))
    np.testing.assert_allclose(found["bic"], found["parameters"] * np.log(samples) - 2 * found["log_likelihood"])


@pytest.mark.parametrize(("model", "definition"), [("dcc", "difference"), ("dcc", "residual"), ("ccc", "residual")])
def test_likelihood_and_sigma_by_another_route(made, model, definition):
    # H_t from the stored parameters, SciPy's normal density; the weights that the volatility stage stored.
    task, found = made
    folder = task.output("bekk").parent / definition
    array = open_series(Task(task.inputs, {}, {**task.options, "definition": definition}, ""))
    weights = read_columns(folder / "weights.parquet")
    causal = (weights["model"] == model) & (weights["mode"] == "causal")
    of = np.column_stack([weights[f"w_{gyro}"][causal] for gyro in GYROS])
    values = np.column_stack([read_columns(task.input("series"))[gyro] for gyro in GYROS])
    for row in np.flatnonzero((found["model"] == model) & (found["definition"] == definition)):
        number, stop = int(found["window"][row]), int(found["stop"][row])
        r = array.residuals(number)
        one = stored_model(array, folder / "garch.parquet", folder / "dcc.parquet", number)
        a, b = (float(one.a[0]), float(one.b[0])) if model == "dcc" else (0.0, 0.0)
        H = conditional_covariance(r, len(r), DccModel(one.omega[0], one.alpha[0], one.beta[0], a, b, one.target[0]))
        total = sum(multivariate_normal.logpdf(e, np.zeros(3), h) for e, h in zip(r, H, strict=True))
        assert found["log_likelihood"][row] == pytest.approx(total, abs=1e-6)
        ahead = slice(stop, stop + STEP)
        fused = np.sum(of[ahead] * values[ahead], axis=1)
        if definition == "difference":
            fused = np.sum(of[ahead] * np.diff(values, axis=0, prepend=0)[ahead], axis=1)
        else:
            # The first-pass rate beyond the window: the median's running mean, up to the sample itself.
            median = np.median(values, axis=1)
            fused -= [median[t - 7 : t + 1].mean() for t in range(ahead.start, ahead.stop)]
        assert found["sigma"][row] == pytest.approx(np.sqrt(np.mean(fused**2)), rel=1e-9)


def test_a_gyro_without_variance_and_a_short_series(tmp_path):
    values = np.random.default_rng(6).standard_normal((200, 3))
    values[:, 1] = 0.5
    task = make(tmp_path, values)
    bekk.main(task)
    found = read_columns(task.output("bekk"))
    # Two gyros are left: 3 parameters each and their correlation; 3 of Ω, and one or two pairs of a and b.
    assert set(found["parameters"]) == {7, 9, 5}
    assert np.isfinite(found["sigma"]).all()
    short = make(tmp_path / "short", values[:80])
    bekk.main(short)
    assert len(read_columns(short.output("bekk"))["window"]) == 0
