"""What all gyros of an array do at once is no fault of one. Expected: the sizes that are put in."""

import numpy as np
import pytest

from vgyro.fusion.faults.candidate import SuspectedFault
from vgyro.fusion.faults.levels.alike import of_the_array
from vgyro.fusion.faults.levels.drift_variance import Slow

BLOCKS, LENGTH, GYROS = 400, 150, 6


def accused(others, noise=0.0, first=0, evidence=50.0, kind="drift"):
    """Is a gyro that settles by 1 from block `first` on accused, where the others do `others` of it, either sign?"""
    rng, since = np.random.default_rng(2), np.arange(BLOCKS) - first
    form = np.where((since >= 0) & (since < LENGTH), np.exp(-since / 40.0), 0.0)
    sizes = np.array([1.0, *(others * np.array([1, -1, 1, -1, 1]))])
    means = form[:, None] * sizes + noise * rng.standard_normal((BLOCKS, GYROS))
    everything, run = np.ones(BLOCKS, bool), np.zeros(BLOCKS, int)
    parts = [Slow(mean, np.full(BLOCKS, max(noise, 1e-3) ** 2), everything, run) for mean in means.T]
    return not of_the_array(SuspectedFault(0, kind, first, first + LENGTH, evidence, 1.0, "deg/s"), parts)


@pytest.mark.parametrize(("others", "found"), [(0.08, True), (0.13, False)])
def test_a_drift_from_the_start_is_settling_where_the_others_do_a_tenth_of_it(others, found):
    assert accused(others) == found


@pytest.mark.parametrize(("others", "found"), [(0.12, True), (0.15, False)])
def test_a_later_drift_is_the_arrays_where_the_others_do_a_fifth_of_it(others, found):
    """A fifth is their deviation by the median: .6745 · .2 = .135 of each."""
    assert accused(others, first=100) == found


def test_evidence_too_weak_to_show_that_the_others_do_less_accuses_no_gyro_from_the_start():
    """Noise alone gives the others sizes of about .15 of it: later on it is taken off, at the start it is not."""
    form = np.exp(-np.arange(LENGTH) / 40.0)
    noise = 0.15 * float(np.sqrt(np.sum((form - form.sum() / BLOCKS) ** 2)))
    assert not accused(0.0, noise, evidence=1 / 0.15)
    assert accused(0.0, noise, first=100, evidence=1 / 0.15)
