"""Values that are missing and were filled in: which of them are a dropout."""

import numpy as np
import pytest

from vgyro.fusion import ArrayNoise, ArrayRates
from vgyro.fusion.faults.samples.no_rate import find_dead

RATE_HZ, SAMPLES = 100.0, 6000


def dropouts(*gone: slice | range, every: int = 1) -> list[tuple[int, int]]:
    """Events of the second of three gyros, which lacks these samples, and all but each `every`th."""
    rate = np.random.default_rng(1).standard_normal((SAMPLES, 3))
    missing = np.zeros(rate.shape, dtype=bool)
    missing[:, 1] = np.arange(SAMPLES) % every > 0
    for part in gone:
        missing[part, 1] = True
    noise = ArrayNoise(np.full(3, 0.1), np.full(3, 0.001), np.eye(3))
    array = ArrayRates(rate, RATE_HZ, np.zeros(SAMPLES, np.int32), np.ones(SAMPLES, bool), noise, missing=missing)
    found = find_dead(array)
    assert {(one.gyro, one.kind) for one in found} <= {(1, "dropout")}
    return [(one.start, one.stop) for one in found]


@pytest.mark.parametrize(("samples", "found"), [(99, False), (100, True)])
def test_a_second_without_a_value(samples, found):
    assert dropouts(slice(2000, 2000 + samples)) == ([(2000, 2000 + samples)] if found else [])


def test_several_stretches_and_single_values():
    assert dropouts(slice(3000, SAMPLES), *(slice(place, place + 1) for place in range(0, 2000, 100))) == [
        (3000, SAMPLES)
    ]
    spans = [(1000 * place, 1000 * place + 400) for place in range(6)]
    assert dropouts(*(slice(*span) for span in spans)) == spans
    assert dropouts(slice(0, SAMPLES)) == [(0, SAMPLES)]


@pytest.mark.parametrize("every", [2, 10, 200])
def test_a_slow_gyro_is_there(every):
    # One value every two seconds is its rate, not a fault.
    assert dropouts(every=every) == []


@pytest.mark.parametrize(("samples", "found"), [(80, False), (120, True)])
def test_a_slow_gyro_that_drops_out(samples, found):
    assert bool(dropouts(slice(2000, 2000 + samples), every=2)) == found


@pytest.mark.parametrize(("longer", "found"), [(8, False), (9, True)])
def test_much_longer_than_its_values_lie_apart(longer, found):
    # Of a gyro with a value every 0.5 s a stretch counts from ten times that on.
    assert bool(dropouts(slice(2000, 2000 + 50 * longer), every=50)) == found


@pytest.mark.parametrize(("counts", "stuck"), [(2, False), (3, True)])
def test_where_nothing_moves_by_a_count_a_value_may_stay(counts, stuck):
    """For two seconds the second of four gyros repeats a value; the others go to and fro between so many counts."""
    rng, step = np.random.default_rng(3), 0.5
    rate = step * np.rint(20.0 * np.sin(np.arange(SAMPLES) / 50.0)[:, None] + rng.standard_normal((SAMPLES, 4)))
    still = slice(2000, 2200)
    rate[still] = step * rng.integers(0, counts, (200, 4))
    rate[still, 1] = 0.0
    noise = ArrayNoise(np.full(4, 0.1), np.full(4, 0.001), np.eye(4))
    array = ArrayRates(rate, RATE_HZ, np.zeros(SAMPLES, np.int32), np.zeros(SAMPLES, bool), noise)
    assert [(one.gyro, one.kind) for one in find_dead(array)] == ([(1, "stuck")] if stuck else [])
