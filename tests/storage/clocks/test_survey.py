"""Stamps that say nothing, records, blocks, and stamps of no sense."""

import json

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from stamps import run

from vgyro.errors import DataError
from vgyro.storage.clocks import ClockOptions, survey
from vgyro.storage.clocks.stream import CHUNK

K = np.arange(20_000)


def test_single_precision_says_nothing():
    stamps = (1.7e9 + K / 100).astype(np.float32)
    with pytest.raises(DataError, match=r"advance by 128 s at a time.*single precision.*[Gg]ive `rate_hz`"):
        run(stamps)
    record, placed = run(stamps, rate_hz=100.0)
    assert (record.meaning, record.time_from, record.rate_hz, record.lost) == ("none", "rate", 100, 0)
    assert "single precision" in record.warnings[0]
    np.testing.assert_allclose(placed.time, K / 100)
    json.dumps(record.to_json(), allow_nan=False)


@pytest.mark.parametrize("stamps", [np.zeros(500), np.full(500, np.nan), np.arange(500)[::-1] * 1e5])
def test_stamps_that_never_advance(stamps):
    with pytest.raises(DataError):
        run(stamps)
    record, placed = run(stamps, np.ones(500, dtype=bool), rate_hz=50.0)
    assert (record.meaning, record.samples, len(placed.time)) == ("none", 500, 500)


@pytest.mark.parametrize(("resolution", "meaning"), [(3.9, "sampled"), (4.1, "none")])
def test_the_coarsest_stamps(resolution, meaning):
    assert run(np.floor(K / 100 / resolution) * resolution, unit="s", rate_hz=100.0).record.meaning == meaning


@pytest.mark.parametrize(("advances", "meaning"), [(9, "none"), (10, "sampled")])
def test_the_fewest_advances(advances, meaning):
    stamps = np.arange(30 * (advances + 1)) // 30
    assert run(stamps * 0.3, unit="s", rate_hz=100.0).record.meaning == meaning


@pytest.mark.parametrize("rows", [0, 1])
def test_too_few_rows(rows):
    with pytest.raises(DataError, match="do not tell the rate"):
        run(np.arange(rows) / 100)
    record, placed = run(np.arange(rows) / 100, rate_hz=100.0)
    assert (record.samples, record.lost, len(placed.time)) == (rows, 0, rows)


@pytest.mark.parametrize("rows", [2, 3, 5, 17, 100])
def test_few_rows(rows):
    record, placed = run(np.arange(rows) * 10, unit="ms")
    assert record.rate_hz == pytest.approx(100)
    np.testing.assert_allclose(placed.time, np.arange(rows) / 100)


@pytest.mark.parametrize(("declared", "warned"), [(101.9, False), (102.1, True)])
def test_a_declared_rate_that_contradicts_the_stamps(declared, warned):
    record = run(K / 100, unit="s", rate_hz=declared).record
    assert record.rate_hz == pytest.approx(100)
    assert any("was declared" in text for text in record.warnings) == warned


@pytest.mark.parametrize("options", [{"meaning": "perhaps"}, {"rate_hz": 0.0}, {"rate_hz": float("nan")}])
def test_options_of_no_sense(options):
    with pytest.raises(DataError):
        run(K / 100, **options)


def test_more_rows_than_were_surveyed():
    clock = survey([(K / 100, np.zeros(len(K), dtype=bool))], ClockOptions(unit="s"))
    clock.place(K / 100, np.zeros(len(K), dtype=bool))
    with pytest.raises(DataError, match="same blocks"):
        clock.place(K[:1] / 100, np.zeros(1, dtype=bool))
    clock.rewind()
    assert clock.place(K / 100, np.zeros(len(K), dtype=bool)).time[-1] == pytest.approx(199.99)


@pytest.mark.parametrize("kind", ["sampled", "arrival", "wraps", "held"])
def test_blocks_of_any_size_give_the_same(rng, kind):
    k = np.delete(np.arange(2 * CHUNK + 5000), [CHUNK - 1, CHUNK + 7, CHUNK + 8, 190_000])
    same = np.zeros(len(k), dtype=bool)
    stamps = k * 1e-3 + (rng.exponential(2e-3, len(k)) if kind == "arrival" else rng.normal(0, 2e-5, len(k)))
    stamps[CHUNK - 3 : CHUNK + 2] = np.nan
    stamps[100_000] = 0
    if kind == "wraps":
        stamps = (np.nan_to_num(stamps, nan=77.0) * 1e6).astype(np.int64) % 2**24
    if kind == "held":
        same = np.arange(len(k)) % 3 != 0
    options = {"unit": "us" if kind == "wraps" else "s"}
    whole = run(stamps, same, **options)
    assert whole.record.meaning == ("arrival" if kind == "arrival" else "sampled")
    assert whole.record.lost == (2 if kind == "held" else 4) or kind in ("wraps", "held")
    for block in (3777, 100_000, CHUNK):
        parts = run(stamps, same, block, **options)
        assert parts.record == whole.record
        for one, other in zip(parts.placed, whole.placed, strict=True):
            np.testing.assert_array_equal(one, other)


def lengths():
    return st.integers(1, 250)


STAMPS = st.one_of(
    arrays.arrays(np.float64, lengths(), elements=st.floats(allow_nan=True, allow_infinity=True)),
    arrays.arrays(np.float64, lengths(), elements=st.floats(-100, 100)),
    arrays.arrays(np.int64, lengths(), elements=st.integers(-(2**63), 2**63 - 1)),
    arrays.arrays(np.int64, lengths(), elements=st.integers(-2, 20)).map(np.cumsum),
    arrays.arrays(np.float32, lengths(), elements=st.floats(0, 100, width=32)).map(np.cumsum),
)
OPTIONS = st.fixed_dictionaries(
    {
        "rate_hz": st.sampled_from([None, 100.0]),
        "meaning": st.sampled_from(["auto", "sampled", "arrival"]),
        "unit": st.sampled_from(["auto", "s", "ns", "min"]),
        "wrap": st.sampled_from([None, 100.0, 65_536.0]),
        "day": st.booleans(),
    }
)


@pytest.mark.filterwarnings("error::RuntimeWarning")
@settings(max_examples=200, deadline=5000, suppress_health_check=list(HealthCheck), derandomize=True)
@given(STAMPS, st.integers(0, 99), st.integers(1, 50), OPTIONS)
def test_stamps_of_no_sense(stamps, seed, block, options):
    """Whatever the stamps: a DataError, or times that do not fall and losses that are not negative."""
    same = np.random.default_rng(seed).random(len(stamps)) < 0.3
    try:
        record, placed = run(stamps, same, **options)
    except DataError:
        return
    json.dumps(record.to_json(), allow_nan=False)
    assert len(placed.time) == record.samples == placed.keep.sum()
    assert np.isfinite(placed.time).all()
    assert (np.diff(placed.time)[np.diff(placed.segment) == 0] >= 0).all()
    assert (np.diff(placed.counter) >= 1).all()
    assert record.lost >= 0
    assert not len(placed.time) or placed.counter[-1] == len(placed.time) - 1 + record.lost
    parts = run(stamps, same, block, **options)
    assert parts.record == record
    for one, other in zip(parts.placed, placed, strict=True):
        np.testing.assert_array_equal(one, other)
