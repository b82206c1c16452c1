"""Rules of the search's state that a method shows by itself."""

from types import SimpleNamespace

import numpy as np
import pytest

from vgyro.fusion.faults.candidate import SuspectedFault
from vgyro.fusion.faults.state import State


def is_event(kind, first, last, run, counts=None):
    """Of 2000 blocks, which count, or not."""
    counts = np.ones(2000, dtype=bool) if counts is None else counts
    state = SimpleNamespace(run=run, sums=range(2000), _counts=lambda *_: counts.copy())
    return State._is_event(state, SuspectedFault(0, kind, first, last, 9.0, 1.0, "1"), (kind,))


@pytest.mark.parametrize(("right", "event"), [(49, False), (50, True)])
def test_what_is_right_for_a_twentieth_of_its_run(right, event):
    # Rule: a step is off from its own run, of 1000 blocks here, noise and scale from the whole recording.
    run = np.repeat([0, 1], 1000)
    assert is_event("step", right, 1000, run) == event
    assert is_event("noise", right, 1000, run)
    assert is_event("scale", 2 * right, 2000, run) == event
    counts = np.arange(2000) < 1000
    assert not is_event("drift", 1000, 1500, run, counts)
    assert is_event("noise", 1000, 1500, run, counts)
