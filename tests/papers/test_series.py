"""The figures of L's Table 3 on a series whose truth is known."""

import math

import numpy as np
import pytest

from vgyro.config import MetricsOptions
from vgyro.papers.series import series_figures, with_extremes

SECONDS = 7200
PLACE = {"recording": "static", "axis": "z"}


@pytest.fixture(scope="module")
def found():
    """Three gyros of white noise 0.02, 0.04, 0.06 deg/s at 1 Hz with offsets, and their average."""
    rng = np.random.default_rng(7)
    gyros = rng.normal(size=(SECONDS, 3)) * (0.02, 0.04, 0.06) + (0.01, -0.03, 0.05)
    values = np.column_stack([gyros, gyros.mean(axis=1)])
    names = [("g1", ""), ("g2", ""), ("g3", ""), ("average", "")]
    return series_figures(PLACE, names, 3, values, np.zeros(SECONDS, dtype=int), 1.0, MetricsOptions(bootstrap=100))


def figure(rows, method, metric):
    (row,) = [row for row in rows if (row["method"], row["metric"]) == (method, metric)]
    return row


@pytest.mark.parametrize(
    ("metric", "truth", "unit"),
    [
        ("mean", 0.01, "deg/s"),
        ("sigma", math.sqrt(0.02**2 + 0.04**2 + 0.06**2) / 3, "deg/s"),
        # White noise: σ(1 s) is the 1σ of a 1 Hz series, and ARW = 60·σ(1 s).
        ("arw_1s", 60 * math.sqrt(0.02**2 + 0.04**2 + 0.06**2) / 3, "deg/√h"),
    ],
)
def test_figures_of_the_average_hold_the_truth(found, metric, truth, unit):
    row = figure(found.metrics, "average", metric)
    assert row["low"] < truth < row["high"]
    assert row["unit"] == unit


def test_factors_are_eq_18(found):
    for metric in ("sigma", "arw_1s", "bias_drift"):
        singles = [figure(found.metrics, f"g{number}", metric)["value"] for number in (1, 2, 3)]
        factor = figure(found.factors, "average", metric)
        assert factor["value"] == pytest.approx(np.mean(singles) / figure(found.metrics, "average", metric)["value"])
        assert factor["unit"] == "1"
    # The mean is taken as a magnitude: (0.01 + 0.03 + 0.05)/3 / 0.01 = 3.
    mean = figure(found.factors, "average", "mean")
    assert mean["low"] < 3.0 < mean["high"]


def test_extremes_leave_the_faulty_gyro_out_of_the_healthy_ones(found):
    rows = with_extremes(found.metrics, ["g1", "g2", "g3"], "g3")
    assert figure(rows, "best_single", "mean")["note"] == "that of g1"
    worst = figure(rows, "worst_healthy", "mean")
    assert worst["note"] == "that of g2"
    assert 0 < worst["low"] < worst["value"] < worst["high"]
