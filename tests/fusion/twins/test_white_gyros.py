"""Identical white gyros without a fault: whoever adapts must not lose to the plain average."""

from __future__ import annotations

from dataclasses import replace

import pytest
from harness import NO_DCC, OURS, OURS_UNSMOOTHED, case, error_sd, ratio_of, run

from vgyro.simulate import parse_twin

SEEDS, FEW = range(1, 9), range(1, 4)
ALIKE = 1.01
WHITE = """
name: white
board: dsp6
seed: 1
gyros: {{all: {{arw_deg_rt_h: 6}}}}
recordings:
  - {{name: calibration, kind: calibration, motion: {{kind: rate_table, rates: [0, 100]}}}}
  - {{name: static, kind: static, duration_s: {seconds}}}
  - {{name: random, kind: random, duration_s: {seconds}, motion: {{kind: random, sd: 7, bandwidth_hz: 0.5}}}}
"""


def ratio(recording, seeds, seconds):
    """Error s.d. of ours over that of the average, both at full bandwidth."""
    twin = parse_twin(WHITE.format(seconds=seconds), "white")
    sds: dict[str, list[float]] = {OURS_UNSMOOTHED: [], "average": []}
    for seed in seeds:
        one = case(twin, recording, seed, volatility=NO_DCC)
        fused = run(one, list(sds)).fused
        for name in sds:
            sds[name].append(error_sd(one, fused[name].rate))
    return ratio_of(sds[OURS_UNSMOOTHED], sds["average"])


@pytest.mark.parametrize("recording", ["static", "random"])
def test_three_seeds(recording):
    assert ratio(recording, FEW, 120).mean <= ALIKE


@pytest.mark.full
@pytest.mark.parametrize("recording", ["static", "random"])
@pytest.mark.parametrize("seconds", [60, 600, 1800])
def test_not_worse_than_the_average(recording, seconds):
    found = ratio(recording, SEEDS, seconds)
    assert found.high <= ALIKE, str(found)


@pytest.mark.full
def test_smoothing_does_not_lose_it_again():
    # One smoother over both: the motion's model is by likelihood for each.
    twin = parse_twin(WHITE.format(seconds=600), "white")
    sds: dict[str, list[float]] = {OURS: [], "average_smoothed": []}
    for seed in SEEDS:
        one = case(twin, "random", seed, volatility=NO_DCC)
        one = replace(one, parameters=replace(one.parameters, motion_models=("jerk",)))
        fused = run(one, list(sds)).fused
        for name in sds:
            sds[name].append(error_sd(one, fused[name].rate))
    found = ratio_of(sds[OURS], sds["average_smoothed"])
    assert found.high <= ALIKE, str(found)
