"""Gyros that are stuck, copies, or of unknown noise: left out by the methods that invert a covariance, and named."""

from dataclasses import replace

import numpy as np
import pytest

from vgyro.fusion import METHODS, ArrayNoise, CannotRun, FilterParameters, run_methods, select
from vgyro.fusion.events import FaultEvent
from vgyro.fusion.rest_scales import own_scales
from vgyro.fusion.unusable import on_usable, usable_gyros

PARAMETERS = FilterParameters()
LEAVE_OUT = (
    "bayard_ploen", "chang_2008", "stubberud_2008", "al_majed", "jiang_markov", "jiang_random_walk", "xue_2012",
    "chang_2012", "vaccaro_zaki", "scale_wise_all", "scale_wise_large", "inverse_variance_arw", "inverse_variance_rrw",
    "frequency_weights",
)  # fmt: skip
ARW = np.array([0.05, 0.1, 0.1, 0.3])


def changed(array, gyro, values, measured=True):
    """The array with other values of one gyro.  measured : ARW and correlation are those that such a record gives"""
    rate = array.rate.copy()
    rate[:, gyro] = values
    noise = array.noise
    if measured:
        arw, correlation = noise.arw.copy(), noise.correlation.copy()
        sd = rate.std(axis=0)
        arw[gyro] = sd[gyro] / np.sqrt(array.rate_hz)
        if sd.all():
            correlation = np.corrcoef(rate.T)
        noise = replace(noise, arw=arw, correlation=correlation, scales=own_scales(replace(array, rate=rate)))
    return replace(array, rate=rate, noise=noise)


def without(array, gyro):
    kept = [place for place in range(array.rate.shape[1]) if place != gyro]
    return replace(array, rate=array.rate[:, kept], noise=array.noise.of(kept))


@pytest.mark.parametrize("measured", [True, False])
@pytest.mark.parametrize("name", LEAVE_OUT)
def test_a_stuck_gyro(make_array, name, measured):
    # Expected: the method on the array without it. Not measured: the noise is of a record in which it still moved.
    array = changed(make_array(2000, ARW), 2, 0.7, measured)
    alone, fused = (METHODS[name].fuse(one, PARAMETERS) for one in (without(array, 2), array))
    np.testing.assert_allclose(fused.rate, alone.rate, rtol=1e-9, atol=1e-12)
    assert fused.note.startswith("gyro 3 is left out: it is 0.7 deg/s in every sample")
    if alone.weights is not None:
        np.testing.assert_allclose(fused.weights, np.insert(alone.weights, 2, 0.0), rtol=1e-9)


@pytest.mark.parametrize("name", LEAVE_OUT)
def test_two_equal_channels(make_array, name):
    array = make_array(2000, ARW)
    array = changed(array, 3, array.rate[:, 1])
    alone, fused = (METHODS[name].fuse(one, PARAMETERS) for one in (without(array, 3), array))
    np.testing.assert_allclose(fused.rate, alone.rate, rtol=1e-9, atol=1e-12)
    assert fused.note.startswith("gyro 4 is left out: it is a copy of gyro 2")


@pytest.mark.parametrize("name", ["bayard_ploen", "chang_2008", "jiang_markov", "chang_2012"])
def test_copies_in_the_record_of_the_noise_alone(make_array, name):
    # In this recording they differ; the correlation that was measured elsewhere makes R singular.
    array = make_array(200, ARW)
    correlation = np.eye(4)
    correlation[0, 2] = correlation[2, 0] = 1 - 1e-16
    with pytest.raises(CannotRun, match="gyros 1 and 3 are copies of each other"):
        METHODS[name].fuse(replace(array, noise=replace(array.noise, correlation=correlation)), PARAMETERS)


@pytest.mark.parametrize("values", ["stuck", "copy", "zero"])
def test_nothing_fails(make_array, values):
    # No row of the whole table ends with an error, whatever it makes of such an array.
    array = make_array(4000, [0.05, 0.1, 0.1, 0.3, 0.1])
    array = changed(array, 4, {"stuck": -1.5, "zero": 0.0, "copy": array.rate[:, 0]}[values])
    outcomes = list(run_methods(array, PARAMETERS, select("all"), ("residual",)))
    assert [(outcome.method.name, outcome.note) for outcome in outcomes if outcome.failed] == []


def test_which_are_usable(make_array):
    rate = make_array(5000, np.full(6, 0.1)).rate
    rate[:, 1], rate[:, 4], rate[:, 5] = 2.0, rate[:, 0], 3.0
    rate[4999, 5] = 3.1
    found = usable_gyros(replace(make_array(5000, np.full(6, 0.1)), rate=rate))
    assert found.kept == [0, 2, 3, 5]
    assert found.note == (
        "gyro 2 is left out: it is 2 deg/s in every sample; gyro 5 is left out: it is a copy of gyro 1"
    )


def test_where_no_gyro_differs_none_is_left_out(make_array):
    array = make_array(100, [0.1, 0.1, 0.1])
    same = replace(array, rate=np.tile(array.rate[:, :1], (1, 3)))
    still = replace(array, rate=np.ones((100, 3)))
    for one in (same, still):
        assert usable_gyros(one).kept == [0, 1, 2]
        np.testing.assert_allclose(METHODS["bayard_ploen"].fuse(one, PARAMETERS).rate, one.rate[:, 0])


def test_one_of_two(make_array):
    array = make_array(100, [0.1, 0.1])
    array.rate[:, 1] = 0.0
    with pytest.raises(CannotRun, match="fewer than two gyros can be used: gyro 2 is left out: it is 0 deg/s"):
        METHODS["chang_2012"].fuse(array, PARAMETERS)


def test_what_the_method_is_given(make_array):
    # Noise, missing samples, faults of the gyros that are left, under their new numbers.
    array = make_array(50, ARW, correlation=np.eye(4) + 0.1 * (1 - np.eye(4)))
    array.rate[:, 1] = 0.0
    missing = np.zeros((50, 4), dtype=bool)
    missing[3, 2] = True
    faults = tuple(FaultEvent(gyro, "burst", 0, 5, 9.0, 2.0, "1") for gyro in (0, 1, 3))
    given = []

    def look(part, parameters):
        given.append(part)
        return METHODS["average"].fuse(part, parameters)

    on_usable(look)(replace(array, missing=missing, faults=faults), PARAMETERS)
    (part,) = given
    np.testing.assert_array_equal(part.rate, array.rate[:, [0, 2, 3]])
    np.testing.assert_array_equal(part.noise.arw, ARW[[0, 2, 3]])
    np.testing.assert_array_equal(part.noise.correlation, np.eye(3) + 0.1 * (1 - np.eye(3)))
    kept = np.ix_(range(20), [0, 2, 3], [0, 2, 3])
    np.testing.assert_array_equal(part.noise.scales.covariance, array.noise.scales.covariance[kept])
    assert part.missing[3].tolist() == [False, True, False]
    assert [fault.gyro for fault in part.faults] == [0, 2]


def test_noise_of_some_gyros_without_scales():
    noise = ArrayNoise(np.arange(3.0), np.arange(3.0), np.eye(3)).of([2, 0])
    assert noise.arw.tolist() == [2.0, 0.0]
    assert noise.scales is None
