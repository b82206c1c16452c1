"""One method that ends with an error: it alone, in one line, with the traceback in the log."""

import logging
from dataclasses import replace

import numpy as np
import pytest

from vgyro.errors import DataError, EngineError
from vgyro.fusion import METHODS, CannotRun, FilterParameters, Fused, Method, run_methods, select
from vgyro.fusion import registry as module

PARAMETERS = FilterParameters()


def raising(error):
    def fuse(array, parameters):  # noqa: ARG001
        raise error

    return fuse


def returning(value):
    return lambda array, parameters: value  # noqa: ARG005


def outcomes(array, fuse, package=""):
    """The method between two others: what comes of the three."""
    odd = Method("odd", "Odd", "test", True, (), fuse, package=package)
    methods = [METHODS["average"], odd, METHODS["median"]]
    first, found, last = run_methods(array, PARAMETERS, methods, ())
    assert (first.state, last.state) == ("ran", "ran")
    return found


BUGS = [
    (np.linalg.LinAlgError("Singular matrix"), "LinAlgError: Singular matrix"),
    (FloatingPointError("overflow encountered in exp"), "FloatingPointError: overflow encountered in exp"),
    (ValueError("shapes (3,) and (4,) not aligned\nand more"), "ValueError: shapes (3,) and (4,) not aligned"),
    (ZeroDivisionError(), "ZeroDivisionError"),
    (MemoryError(), "MemoryError"),
    (SystemExit(3), "SystemExit: 3"),
    (RuntimeError("x" * 1000), "RuntimeError: " + "x" * 300),
]


@pytest.mark.parametrize(("error", "reason"), BUGS, ids=lambda value: type(value).__name__)
def test_a_bug_ends_its_method_alone(make_array, caplog, error, reason):
    found = outcomes(make_array(60, [0.1, 0.1]), raising(error))
    assert (found.state, found.fused, found.column) == ("failed", None, "")
    assert found.note == f"failed: {reason} (a bug in vgyro; the traceback is in the log)"
    assert "odd failed" in caplog.text
    assert "Traceback" in caplog.text


@pytest.mark.parametrize("error", [DataError("too few blocks"), EngineError("the smoothed rate is not finite")])
def test_what_vgyro_foresees_but_not_here(make_array, error):
    found = outcomes(make_array(60, [0.1, 0.1]), raising(error))
    assert found.note == f"failed: {error.what}"
    assert found.state == "failed"


def test_a_bug_of_another_package_is_its_own(make_array):
    found = outcomes(make_array(60, [0.1, 0.1]), raising(DataError("oh")), package="acme-gyro 1.2")
    assert found.note == "failed: DataError: oh (a bug in package acme-gyro 1.2; the traceback is in the log)"


def test_what_cannot_run_has_not_failed(make_array, caplog):
    found = outcomes(make_array(60, [0.1, 0.1]), raising(CannotRun("fewer than three gyros")))
    assert (found.state, found.note) == ("cannot run", "fewer than three gyros.")
    assert caplog.text == ""


RETURNED = [
    (None, "TypeError: it returned NoneType, not Fused"),
    (np.zeros(60), "TypeError: it returned ndarray, not Fused"),
    (Fused(np.zeros(59)), "ValueError: its rate is no array [60] of real numbers"),
    (Fused(np.zeros((60, 2))), "ValueError: its rate is no array [60] of real numbers"),
    (Fused(np.zeros(60, dtype=complex)), "ValueError: its rate is no array [60] of real numbers"),
    (Fused([0.0] * 60), "ValueError: its rate is no array [60] of real numbers"),
    (Fused(np.zeros(60), sd=np.zeros(1)), "ValueError: its sd is no array [60] of real numbers"),
]


@pytest.mark.parametrize(("value", "reason"), RETURNED, ids=range(len(RETURNED)))
def test_what_is_no_rate(make_array, value, reason):
    found = outcomes(make_array(60, [0.1, 0.1]), returning(value))
    assert found.note == f"failed: {reason} (a bug in vgyro; the traceback is in the log)"


def test_a_rate_that_is_not_finite(make_array, caplog):
    rate = np.zeros(60)
    rate[7:9] = np.nan
    with caplog.at_level(logging.ERROR):
        found = outcomes(make_array(60, [0.1, 0.1]), returning(Fused(rate)))
    assert (found.state, found.note) == ("failed", "failed: of its rate 2 of 60 samples are not finite")
    assert found.note in caplog.text


def test_a_method_cannot_change_the_rates(make_array):
    array = make_array(60, [0.1, 0.1])
    before = array.rate.copy()

    def spoil(array, parameters):  # noqa: ARG001
        array.rate[:] = 0.0
        return Fused.undelayed(array.rate[:, 0].copy())

    found = outcomes(array, spoil)
    assert found.state == "failed"
    assert "read-only" in found.note
    np.testing.assert_array_equal(array.rate, before)
    assert array.rate.flags.writeable
    # Rates that are read-only beforehand stay so.
    array.rate.flags.writeable = False
    assert outcomes(array, returning(Fused(np.zeros(60)))).state == "ran"
    assert not array.rate.flags.writeable


def test_a_bug_inside_a_method_of_ours(make_array, monkeypatch):
    # As reached through the registry: a kernel that raises does not end the rows after it.
    def broken(*args, **kwargs):  # noqa: ARG001
        raise np.linalg.LinAlgError("SVD did not converge")

    monkeypatch.setattr(module.bayard_ploen, "modes", broken)
    found = list(run_methods(make_array(200, [0.1, 0.2]), PARAMETERS, select(["bayard_ploen", "chang_2008"]), ()))
    assert [one.state for one in found] == ["failed", "ran"]
    assert "SVD did not converge" in found[0].note


def test_the_state_of_an_array_of_one(make_array):
    (found,) = run_methods(make_array(60, [0.1]), PARAMETERS, select(["average"]), ())
    assert found.state == "cannot run"
    bad = make_array(60, [0.1, 0.1])
    (found,) = run_methods(replace(bad, rate=bad.rate * np.nan), PARAMETERS, select(["average"]), ())
    assert found.state == "cannot run"
