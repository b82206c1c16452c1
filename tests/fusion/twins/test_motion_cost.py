"""What the search for a model of the motion costs, in evaluations: it was nine tenths of a fusion, and stays cheap.

Measured on the demo's moving recordings: .5 s of process CPU time where the search by likelihood, which it replaced,
took 18.6 s (commit 096c2c2). A bound is some 1.5 times what is needed.
"""

from __future__ import annotations

import pytest

from tests.fusion.twins import harness
from vgyro.fusion.motion.evidence import RateSpectrum
from vgyro.fusion.ours.array_estimate import shared_motion


@pytest.mark.parametrize(
    ("recording", "most"), [("calibration", 150_000), ("constant", 60_000), ("random", 490_000), ("sinusoid", 150_000)]
)
def test_lines_of_the_spectrum_that_are_evaluated(recording: str, most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    evaluated, risk = [], RateSpectrum.risk

    def counted(spectrum, signal):
        evaluated.append(len(spectrum.power))
        return risk(spectrum, signal)

    case = harness.case(harness.load("demo"), recording, 1, volatility=None, faults=False)
    monkeypatch.setattr(RateSpectrum, "risk", counted)
    shared_motion(case.array, case.parameters)
    assert 0 < sum(evaluated) <= most
