"""The figures of L's Table 3 on a series whose truth is known."""

import math

import numpy as np
import pytest

from vgyro.config import MetricsOptions
from vgyro.papers.series import SlowSeries, extremes, paired_ratios, series_figures

SECONDS = 7200
PLACE = {"recording": "static", "axis": "z"}


@pytest.fixture(scope="module")
def series():
    """Three gyros of white noise 0.02, 0.04, 0.06 deg/s at 1 Hz with offsets, and their average."""
    rng = np.random.default_rng(7)
    gyros = rng.normal(size=(SECONDS, 3)) * (0.02, 0.04, 0.06) + (0.01, -0.03, 0.05)
    return [("g1", ""), ("g2", ""), ("g3", ""), ("average", "")], np.column_stack([gyros, gyros.mean(axis=1)])


@pytest.fixture(scope="module")
def found(series):
    names, values = series
    slow = SlowSeries(names, values, np.zeros(SECONDS, dtype=int), 1.0)
    return series_figures(PLACE, slow, 3, MetricsOptions(bootstrap=100))


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
    chosen = extremes(found.metrics, ["g1", "g2", "g3"], "g3")
    assert chosen == {"best_single": ("g1", ""), "worst_healthy": ("g2", "")}


def test_paired_ratios_know_that_the_noise_is_shared(series):
    names, values = series
    over = {"average": ("average", "")}
    halved = np.column_stack([values, 0.5 * values[:, 3]])
    slow = SlowSeries([*names, ("half", "")], halved, np.zeros(SECONDS, dtype=int), 1.0)
    rows = paired_ratios(PLACE, slow, over, MetricsOptions(bootstrap=100))
    for metric in ("mean", "sigma", "arw_1s"):
        # The same noise at half the size: the ratio has no scatter at all.
        row = figure(rows, "half", metric)
        assert (row["value"], row["low"], row["high"]) == pytest.approx((0.5, 0.5, 0.5))
        single = figure(rows, "g3", metric)
        assert single["low"] < single["value"] < single["high"]
    # 0.06 over the average's √(0.02² + 0.04² + 0.06²)/3 deg/s.
    sigma = figure(rows, "g3", "sigma")
    assert sigma["low"] < 0.18 / math.sqrt(0.0056) < sigma["high"]
