"""The unit of stamps that are plain numbers."""

import numpy as np
import pytest
from stamps import run

from vgyro.errors import DataError
from vgyro.storage.clocks import guess_unit

K = np.arange(1000)


@pytest.mark.parametrize(
    ("name", "step", "unit"),
    [
        ("t_us", 10_000, "us"),
        ("millis", 10, "ms"),
        ("Time (ms)", 5, "ms"),
        ("timestamp_ns", 10_000_000, "ns"),
        ("timestampNs", 10_000_000, "ns"),
        ("TIME_US", 2500, "us"),
        ("Zeit [s]", 0.01, "s"),
        ("Time (min)", 0.01 / 60, "min"),
        ("time", 0.01, "s"),
        ("t", 10, "ms"),
        ("t", 2500, "us"),
        ("t", 10_000_000, "ns"),
        ("comments", 10, "ms"),
    ],
)
def test_names_and_steps(name, step, unit):
    assert guess_unit(K * step, name)[0] == unit


@pytest.mark.parametrize(("scale", "unit"), [(1, "s"), (1e3, "ms"), (1e6, "us"), (1e9, "ns")])
def test_dates_since_1970(scale, unit):
    stamps = (1.7e9 + K * 0.25) * scale
    assert guess_unit(stamps if scale == 1 else stamps.astype(np.int64))[0] == unit


@pytest.mark.parametrize(("step", "unit"), [(1 / 5.1, "s"), (1 / 4.9, "ms"), (1 / 19_900, "s"), (1 / 20_100, "s")])
def test_plausible_rates(step, unit):
    """Above 20 kHz no unit fits but s, for want of a better one."""
    assert guess_unit(K * step)[0] == unit


@pytest.mark.parametrize(("rate", "unit"), [(100 / 2.9, "us"), (100 / 3.1, "us"), (0.1, "ms"), (0.12, "ms")])
def test_the_declared_rate_corrects_a_name(rate, unit):
    """10 000 ticks: 100 Hz in us, 0.1 Hz in ms. A name yields to a rate that another unit fits."""
    assert guess_unit(K * 10_000, "t_us", rate)[0] == unit


@pytest.mark.parametrize(("rate", "unit"), [(1.24, "ms"), (1.26, "us")])
def test_how_near_a_declared_rate_must_be(rate, unit):
    assert guess_unit(K * 1000, "", rate)[0] == unit


def test_units_that_are_set():
    assert run(K * 10, unit="us").record.rate_hz == pytest.approx(1e5)
    assert run(K / 6000, unit="min").record.rate_hz == pytest.approx(100)
    with pytest.raises(DataError, match="no unit of time"):
        run(K, unit="fortnight")
    assert run(K * 10, name="millis").record.unit_why == "the name 'millis' says so"
