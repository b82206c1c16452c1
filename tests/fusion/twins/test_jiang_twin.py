"""The twin of Jiang et al. (2012): ours against every row, at rest at equal bandwidth and in motion at 500 Hz."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
import pytest
import table3
from harness import NO_DCC, OURS, OURS_UNSMOOTHED, case, load, mean_of, ratio_of, run

from vgyro.fusion import METHODS, Fused

SEEDS, FEW = range(1, 9), range(1, 3)
TESTS = ("constant", "random", "sinusoid")
BANDWIDTH = 1.053
"""Hz, of the filters with the paper's q and the twin's ARW: docs/methods.md"""
ALIKE = 1.01
Figures = dict[str, dict[str, list[float]]]


def others(found: Figures) -> list[str]:
    """Rows of the papers and baselines."""
    return [name for name in found if METHODS[name.split("[")[0]].family != "ours"]


def dynamic(recording, seeds, names=None, twin=None) -> Figures:
    found: Figures = defaultdict(lambda: defaultdict(list))
    twin = twin or load("jiang2012")
    for seed in seeds:
        one = case(twin, recording, seed, volatility=NO_DCC)
        for column, fused in run(one, names).fused.items():
            for figure, value in table3.jiang_dynamic(one, fused).items():
                found[column][figure].append(value)
    return found


@pytest.fixture(scope="module")
def moving() -> dict[str, Figures]:
    return {recording: dynamic(recording, SEEDS) for recording in TESTS}


@pytest.fixture(scope="module")
def static() -> Figures:
    found: Figures = defaultdict(lambda: defaultdict(list))
    for seed in SEEDS:
        one = case(load("jiang2012"), "static", seed, volatility=NO_DCC)
        for column, fused in run(one).fused.items():
            if table3.low_pass_of(fused).other_shape:
                continue
            for figure, value in table3.jiang_static(one, fused, BANDWIDTH).items():
                found[column][figure].append(value)
    return found


@pytest.mark.full
@pytest.mark.parametrize("recording", TESTS)
def test_lowest_deviation_in_motion(moving, recording):
    found = moving[recording]
    ratios = {name: ratio_of(found[OURS]["sigma"], found[name]["sigma"]) for name in others(found)}
    assert {name: str(one) for name, one in ratios.items() if one.high >= 1} == {}
    # Rows of ours that are parts of it may be as good.
    for name in set(found) - set(others(found)):
        assert ratio_of(found[OURS]["sigma"], found[name]["sigma"]).mean <= ALIKE, name


@pytest.mark.full
def test_amplitude_and_delay(moving):
    for recording in ("random", "sinusoid"):
        ours = moving[recording][OURS]
        assert np.abs(np.array(ours["amplitude"]) - 1).max() <= 0.005
        # A tenth of a sample, 0.2 ms; the filter of the paper is 29 ms late.
        assert np.abs(ours["delay"]).max() <= 2e-4
    late = np.mean(moving["sinusoid"]["jiang_random_walk"]["delay"])
    assert late == pytest.approx(0.029, abs=0.002)


@pytest.mark.full
def test_lowest_deviation_at_rest_at_equal_bandwidth(static):
    ratios = {name: ratio_of(static[OURS]["sigma_equal"], static[name]["sigma_equal"]) for name in others(static)}
    assert {name: str(one) for name, one in ratios.items() if one.high >= 1} == {}


@pytest.mark.full
def test_at_rest_with_the_very_same_filter(static):
    # Six identical gyros with hardly any correlation: there is nothing to gain on the average, and nothing is lost.
    assert ratio_of(static[OURS_UNSMOOTHED]["sigma_equal"], static["average"]["sigma_equal"]).mean <= ALIKE
    assert ratio_of(static[OURS_UNSMOOTHED]["arw_1s"], static["average"]["arw_1s"]).mean <= ALIKE


@pytest.mark.full
def test_what_the_static_table_follows_from(static):
    # docs/methods.md: ARW computed at 1 s: average 2.64, random walk and Markov 2.32 deg/√h, ratio 0.880. The twin's
    # pole takes 0.2 % away. An hour knows σ(1 s) to 2 %, eight hours to 0.7 %; the ratio is of the same noise.
    average, walk, markov = (static[name]["arw_1s"] for name in ("average", "jiang_random_walk", "jiang_markov"))
    assert mean_of(average).mean == pytest.approx(2.64, rel=0.015)
    assert mean_of(walk).mean == pytest.approx(2.32, rel=0.015)
    assert mean_of(markov).mean == pytest.approx(2.32, rel=0.015)
    assert ratio_of(walk, average).mean == pytest.approx(0.880, abs=0.005)


@pytest.mark.full
def test_a_short_time_constant_gives_the_printed_markov_column():
    # docs/methods.md: τ = 0.5 s (gain 0.71) turns the printed average, 2.73, 22.72, 161.2, into 1.72, 16.15, 114.6.
    for seed in FEW:
        one = case(load("jiang2012"), "static", seed, volatility=None, faults=False, tau_s=0.5)
        ran = run(one, ["average", "jiang_markov"]).fused
        (arw, drift), (arw_average, drift_average) = (
            (found["arw_1s"], found["bias_drift"])
            for found in (table3.jiang_static(one, ran[name], BANDWIDTH) for name in ("jiang_markov", "average"))
        )
        assert 2.73 * arw / arw_average == pytest.approx(1.72, rel=0.01)
        assert 22.72 * drift / drift_average == pytest.approx(16.15, rel=0.01)
        slow = [np.polyfit(np.arange(60), rate_by_minute(ran[name]), 1)[0] for name in ("jiang_markov", "average")]
        assert 161.21 * slow[0] / slow[1] == pytest.approx(114.6, rel=0.01)


def rate_by_minute(fused: Fused) -> np.ndarray:
    return fused.rate.reshape(60, -1).mean(axis=1)


@pytest.mark.full
def test_what_the_dynamic_table_follows_from(moving):
    # docs/methods.md: sine of 62.8 deg/s: amplitude 62.73, raw 1σ 2.04, with the lag removed 0.174; constant 1σ 0.167.
    # The twin's sine has 62.83; the sensor's pole is left out of the truth. 120 s know a 1σ at 5.27 Hz to 2 %, eight of
    # them to 0.7 %.
    for name in ("jiang_random_walk", "jiang_markov"):
        sine, constant = moving["sinusoid"][name], moving["constant"][name]
        assert 62.8 * np.mean(sine["amplitude"]) == pytest.approx(62.73, abs=0.02)
        assert np.mean(sine["sigma"]) == pytest.approx(2.04, abs=0.03)
        assert np.mean(sine["aligned"]) == pytest.approx(0.174, abs=0.007)
        assert np.mean(constant["sigma"]) == pytest.approx(0.167, abs=0.005)


@pytest.mark.parametrize("recording", TESTS)
def test_one_minute_of_each_motion(recording):
    short = load("jiang2012", {"duration_s: 120": "duration_s: 60"})
    found = dynamic(recording, [1], [OURS, "average", "median", "jiang_random_walk", "chang_2012"], short)
    for name in others(found):
        assert found[OURS]["sigma"][0] < found[name]["sigma"][0], name
    if recording != "constant":
        assert found[OURS]["amplitude"][0] == pytest.approx(1, abs=0.005)
        assert abs(found[OURS]["delay"][0]) < 2e-4
