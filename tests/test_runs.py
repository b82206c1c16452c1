"""Runs against what itertools.groupby finds, sample by sample."""

from itertools import groupby

import numpy as np
import pytest

from vgyro.runs import run_starts, runs, true_runs


def grouped(*marks):
    """(key, first, one beyond the last) of each run, by the standard library."""
    found, first = [], 0
    for key, members in groupby(zip(*marks, strict=True)):
        size = len(list(members))
        found.append((key, first, first + size))
        first += size
    return found


@pytest.mark.parametrize("samples", [0, 1, 2, 50])
@pytest.mark.parametrize("kinds", [1, 2, 3])
def test_runs_are_those_of_groupby(samples, kinds):
    draw = np.random.default_rng(samples + kinds)
    first, second = draw.integers(0, kinds, samples), draw.random(samples) < 0.5
    for marks in ((first,), (second,), (first, second)):
        expected = [[start, stop] for _, start, stop in grouped(*(mark.tolist() for mark in marks))]
        assert runs(*marks).tolist() == expected
        assert runs(*marks).shape == (len(expected), 2)
        assert run_starts(*marks).tolist() == [start for start, _ in expected]
    expected = [[start, stop] for (key,), start, stop in grouped(second.tolist()) if key]
    assert true_runs(second).tolist() == expected
    assert true_runs(second).shape == (len(expected), 2)
