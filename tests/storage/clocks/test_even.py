"""Even sampling behind stamps that are rounded, jittered, bundled, late or drifting."""

import numpy as np
import pytest
from stamps import run

K = np.arange(20_000)


def late(rng, scale):
    return np.abs(rng.normal(0, scale, len(K)))


@pytest.mark.parametrize(
    ("stamps", "rate"),
    [
        (K // 4 * 0.02, 200),
        (np.round(K / 800, 3), 800),
        (np.round(K / 2000, 3), 2000),
        (np.floor(K / 100), 100),
        (np.floor(K / 997 * 1000 + 1e-6), 997),
        (np.rint(K / 333 * 1000).astype(np.int64), 333),
        (np.rint(K / 90 * 100), 90),
    ],
)
def test_rounded_stamps(stamps, rate):
    unit = "s" if np.ptp(stamps) < 1000 else {997: "ms", 333: "ms", 90: "auto"}[rate]
    scale = {"s": 1.0, "ms": 1e-3, "auto": 1e-2}[unit]
    result = run(stamps if unit != "auto" else stamps / 100, unit="s" if unit == "auto" else unit)
    record = result.record
    assert (record.lost, record.restarts, record.even, record.time_from) == (0, 0, True, "line")
    # One-second stamps end anywhere within a second of 200.
    loose = 2e-4
    assert record.rate_hz == pytest.approx(rate, rel=loose)
    assert result.end_rate == pytest.approx(rate, rel=loose)
    # Within half a step of the resolution, but for where in that step the first stamp lies.
    apart = result.placed.time - (stamps - stamps[0]) * scale
    assert np.ptp(apart) <= record.resolution_s * 1.01


def test_a_doubled_stamp_in_a_thousand(rng):
    stamps = K / 200
    doubled = np.flatnonzero(rng.random(len(K)) < 1e-3)
    stamps[doubled[doubled > 0]] = stamps[doubled[doubled > 0] - 1]
    result = run(stamps)
    assert (result.record.lost, result.record.restarts, result.record.repeated) == (0, 0, 0)
    assert result.end_rate == pytest.approx(200, rel=2e-4)


def test_late_stamps_may_go_back(rng):
    stamps = K / 200 + late(rng, 0.003)
    assert (np.diff(stamps) < 0).any()
    result = run(stamps)
    assert (result.record.meaning, result.record.lost, result.record.restarts) == ("arrival", 0, 0)
    assert result.end_rate == pytest.approx(200, rel=2e-4)
    assert np.abs(result.placed.time - K / 200).max() < 1e-3


@pytest.mark.parametrize(("jitter", "time_from"), [(0.17, "stamps"), (0.25, "envelope")])
def test_jitter_below_a_fifth_of_a_period_is_sampling(rng, jitter, time_from):
    record = run(K / 100 + rng.normal(0, jitter / 100, len(K)), unit="s").record
    assert (record.even, record.time_from, record.lost, record.restarts) == (True, time_from, 0, 0)
    assert record.jitter_s == pytest.approx(jitter / 100, rel=0.2)


@pytest.mark.parametrize("burst", [3, 16, 64])
def test_bursts_and_stalls(rng, burst):
    arrival = np.ceil((K + 1) / burst) * burst / 1000 + (K % burst) * 1e-5
    arrival[5000:5900] = np.maximum(arrival[5000:5900], arrival[5900])
    result = run(arrival + rng.exponential(1e-5, len(K)), unit="s")
    assert (result.record.meaning, result.record.lost) == ("arrival", 0)
    assert result.end_rate == pytest.approx(1000, rel=2e-4)
    assert np.abs(result.placed.time - K / 1000).max() < 2e-3


def test_the_envelope_follows_a_drifting_clock(rng):
    k = np.arange(200_000)
    truth = k / 100 + 16e-3 * np.sin(2 * np.pi * k / 150_000)
    result = run(truth + rng.exponential(0.003, len(k)), unit="s")
    assert result.record.meaning == "arrival"
    assert np.abs(result.placed.time - (truth - truth[0])).max() < 5e-4
    # 16 ms · 2π / 1500 s is 67 ppm to either side.
    assert 100 < result.record.drift_ppm < 140


def test_drift_of_sampled_stamps_is_told_and_kept():
    k = np.arange(200_000)
    truth = k / 100 * (1 + 50e-6 * k / len(k))
    record, placed = run(np.rint(truth * 1e6).astype(np.int64), name="us")
    assert record.drift_ppm == pytest.approx(100 * 7 / 8, rel=0.05)
    np.testing.assert_allclose(placed.time, truth, atol=2e-6)


def test_the_uncertainty_of_the_rate_covers_its_error():
    errors = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        record = run(K / 200 + rng.normal(0, 0.0004, len(K)), unit="s").record
        errors.append((record.rate_hz - 200) / record.rate_sd_hz)
    assert 0.4 < np.std(errors) < 2


@pytest.mark.parametrize("meaning", ["sampled", "arrival"])
def test_the_meaning_can_be_set(rng, meaning):
    stamps = K / 200 + late(rng, 0.003)
    record, placed = run(stamps, meaning=meaning)
    assert record.meaning == meaning
    assert "as was set" in record.why
    if meaning == "sampled":
        assert np.abs(placed.time - (np.maximum.accumulate(stamps) - stamps[0])).max() < 1e-9
    assert record.lost == 0
