"""The demo board on both engines: C kernels and libraries must tell the same story.

Tolerances. Figures without a fitted window: 1e-9 of their size. Figures of DCC and CCC weights: a tenth of the width of
their own 95 % interval, because two searches may end on different points of a flat likelihood; the τ of a lowest point
may then be the next one. Smoothed by a model of five states: 1e-6 of size and interval, for rounding grows in it.
Likelihoods: a search that starts from a grid misses the best of several optima now and then. The bounds are those of
the tests of the engine: worse by more than 1e-5 a sample in less than 0.5 % of the windows, by 1e-3 in none.
"""

import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from cpu_time import longest_jobs, of_children, of_fixed_work

from vgyro.fusion import METHODS

pytestmark = [pytest.mark.workflow, pytest.mark.timeout(1800)]

FITTED = ("dcc_", "ccc_", "waegli_guerrier")
# The EKF, the bank and the other smoothed rows run on the same functions of the engines, which are compared sample by
# sample in tests/engine and tests/fusion: by filterpy they would take many minutes here.
LEFT_OUT = ("stubberud_2008", "al_majed", "average_smoothed", "median_smoothed", "parity_smoothed", "residual_smoothed",
            "dcc_smoothed")  # fmt: skip
KEY = ["recording", "axis", "method", "definition", "true_rate", "metric"]
MOST_CPU = 95.0
"""Of the demo, in units of tests/workflow/cpu_time.py; 73 when this was written, on a busy machine."""
LIKELIHOOD_A_SAMPLE, MISSES, NOWHERE = 1e-5, 0.005, 1e-3


@dataclass(frozen=True)
class Runs:
    """Engine → results/demo; of the native one the CPU time of all processes over that of a fixed piece of work."""

    results: dict[str, Path]
    cpu: float
    longest: str


@pytest.fixture(scope="module")
def both_runs(demo_lab) -> Runs:
    lab, kept, cpu, longest = demo_lab, {}, 0.0, ""
    done: list[subprocess.CompletedProcess[str]] = []
    fixed = of_fixed_work()
    methods = [name for name in METHODS if name not in LEFT_OUT]
    for engine in ("native", "reference"):
        config = lab.folder / "config/config.yaml"
        text = config.read_text(encoding="utf-8")
        text = text.replace("engine: native", f"engine: {engine}").replace("methods: all", f"methods: {methods}")
        config.write_text(text, encoding="utf-8")
        assert f"engine: {engine}" in config.read_text(encoding="utf-8")
        seconds = of_children(lambda: done.append(lab.run("--cores", "2")))
        assert done[-1].returncode == 0, done[-1].stdout
        if engine == "native":
            cpu = 2.0 * seconds / (fixed + of_fixed_work())
            longest = longest_jobs(lab.folder / "results/benchmarks")
        kept[engine] = lab.folder / f"kept-{engine}"
        shutil.copytree(lab.folder / "results/demo", kept[engine])
    return Runs(kept, cpu, longest)


@pytest.fixture(scope="module")
def runs(both_runs: Runs) -> dict[str, Path]:
    """Engine → results/demo."""
    return both_runs.results


def test_the_demo_takes_no_more_cpu_time_than_it_did(both_runs: Runs) -> None:
    # From decoding to the page, environment made. A ratio, as the same machine does both at about the same time.
    assert both_runs.cpu < MOST_CPU, both_runs.longest


def joined(runs: dict[str, Path], name: str, key: list[str]) -> pd.DataFrame:
    """Rows of all tables of that name of both runs, side by side; every row must be in both."""
    tables = []
    for folder in runs.values():
        parts = []
        for path in sorted(folder.rglob(f"{name}.parquet")):
            parts.append(pd.read_parquet(path).assign(place=str(path.parent.relative_to(folder))))
        tables.append(pd.concat(parts))
    both = tables[0].merge(
        tables[1], on=["place", *key], how="outer", suffixes=("_native", "_reference"), indicator=True
    )
    assert (both["_merge"] == "both").all()
    return both


def test_every_figure_is_the_same_within_the_tolerance(runs):
    both = joined(runs, "metrics", KEY)
    difference = (both["value_native"] - both["value_reference"]).abs()
    assert (both["value_native"].isna() == both["value_reference"].isna()).all()
    width = (both["high_reference"] - both["low_reference"]).fillna(0.0)
    fitted = both["method"].str.startswith(FITTED)
    smoothed = both["method"] == "recommended"
    exact = 1e-9 * both["value_reference"].abs() + 1e-15
    exact = exact + np.where(smoothed, 1e-6 * (both["value_reference"].abs() + width), 0.0)
    next_tau = fitted & (both["metric"] == "bias_drift_tau")
    allowed = np.where(fitted, exact + 0.1 * width + 1e-3 * both["value_reference"].abs(), exact)
    allowed = np.where(next_tau, 0.3 * both["value_reference"].abs(), allowed)
    wrong = both[difference > allowed]
    assert not len(wrong), wrong[
        [*KEY, "value_native", "value_reference", "low_reference", "high_reference"]
    ].to_string()
    assert fitted.any()
    assert (~fitted).any()


def test_no_likelihood_of_the_native_engine_is_worse(runs):
    for name, key in (("garch", ["window", "gyro"]), ("dcc", ["window"])):
        both = joined(runs, name, key)
        fitted = both["log_likelihood_reference"].notna() & (both["status_reference"] != "failed")
        samples = both["stop_native"] - both["start_native"]
        if name == "dcc":
            # The second stage is only comparable where both margins are the same fit.
            same = both["log_likelihood_ccc_native"] - both["log_likelihood_ccc_reference"]
            fitted &= same.abs() < 1e-4
        lack = (both["log_likelihood_reference"] - both["log_likelihood_native"])[fitted] / samples[fitted]
        assert fitted.mean() > 0.5
        assert (lack > LIKELIHOOD_A_SAMPLE).mean() < MISSES, both.loc[lack.idxmax()].to_string()
        assert lack.max() < NOWHERE, both.loc[lack.idxmax()].to_string()


def test_the_cross_check_of_the_native_run_passes(runs):
    paths = sorted(runs["native"].rglob("crosscheck.parquet"))
    rows = pd.concat([pd.read_parquet(path) for path in paths])
    assert len(rows) > 20
    assert rows["passed"].all(), rows[~rows["passed"]].to_string()
