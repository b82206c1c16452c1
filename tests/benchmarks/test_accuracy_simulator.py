"""The simulator of the accuracy benchmark against closed forms, and its scenarios as data."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import yaml

from benchmarks.accuracy import effects
from benchmarks.accuracy.run import trial_arrays
from benchmarks.accuracy.scenario import FOLDER, Scenario, load, names
from benchmarks.accuracy.signals import balanced, decay_of, poles_in_a_row, stream
from benchmarks.accuracy.simulate import simulate

SHORT = {"rest_s": 200.0, "motion_s": 200.0}


def scenario(**changes: object) -> Scenario:
    """The base with short recordings and changes."""
    return Scenario.model_validate({**SHORT, **changes})


def noise_of(one: Scenario, part: str = "motion", seed: int = 1) -> np.ndarray:
    """Errors [T, N] without their means."""
    recording = getattr(simulate(one, seed), part)
    errors = recording.rate - recording.truth[:, None]
    return errors - errors.mean(axis=0)


def test_every_file_is_a_scenario_in_the_order() -> None:
    files = {path.stem for path in FOLDER.glob("*.yaml")}
    assert files == {*names(), "base", "order"}
    assert len(set(names())) == len(names())
    titles = [load(name).title for name in names()]
    assert all(titles)
    assert len(set(titles)) == len(titles), "two scenarios have the same title"


@pytest.mark.parametrize("name", names())
def test_every_scenario_can_be_made(name: str) -> None:
    one = load(name).shorter(40.0, 60.0)
    trial = simulate(one, 3)
    assert (trial.rest is None) == (one.rest_s == 0)
    for part in one.score:
        recording = getattr(trial, part)
        assert recording.rate.shape == (len(recording.truth), one.gyros)
        assert recording.known.deviation.shape == recording.rate.shape
        assert np.isfinite(recording.truth).all()
        assert (np.diff(recording.time) > 0).all()
        assert all(0 <= fault.start < fault.stop <= len(recording.truth) for fault in recording.faults)


def test_an_unknown_scenario_has_the_nearest_name() -> None:
    with pytest.raises(KeyError, match="did you mean 'plain'"):
        load("plane")


def test_a_nested_group_extends_that_of_its_parent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.yaml").write_text("motion: {sd: 5, pole_hz: .5}", encoding="utf-8")
    (tmp_path / "b.yaml").write_text("extends: a\nmotion: {sd: 7}", encoding="utf-8")
    monkeypatch.setattr("benchmarks.accuracy.scenario.FOLDER", tmp_path)
    assert load("b").motion.sd == 7
    assert load("b").motion.pole_hz == 0.5


def test_the_same_seed_gives_the_same_and_common_numbers() -> None:
    first, again = simulate("plain", 5), simulate("plain", 5)
    assert np.array_equal(first.motion.rate, again.motion.rate)
    assert np.array_equal(first.motion.truth, simulate("stuck", 5).motion.truth)
    assert not np.array_equal(first.motion.truth, simulate("plain", 6).motion.truth)


def test_white_noise_has_n_times_the_root_of_the_rate() -> None:
    one = scenario(rrw=0.0, arw=(0.02, 0.05), rate_hz=100.0)
    assert noise_of(one).std(axis=0) == pytest.approx([0.2, 0.5], rel=4 / math.sqrt(2 * 20_000))


def test_a_random_walk_grows_by_k_squared_a_second() -> None:
    one = scenario(rrw=0.3, arw=(1e-9,) * 16, bias_sd=0.0)
    last = np.concatenate([simulate(one, seed).rest.rate[-1] for seed in range(1, 20)])  # type: ignore[union-attr]
    assert last.std() == pytest.approx(0.3 * math.sqrt(200.0), rel=4 / math.sqrt(2 * len(last)))


def test_motion_has_its_size_and_its_poles() -> None:
    motion = simulate(scenario(motion={"sd": 20.0, "pole_hz": 1.0, "poles": 3}, motion_s=2000.0), 1).motion.truth
    assert motion.std() == pytest.approx(20.0, rel=0.05)
    # Three equal poles of continuous time: autocorrelation (1 + x + x²/3)·exp(-x), x = 2π·f·t.
    lag = 5
    x = 2 * math.pi * 1.0 * lag / 50.0
    found = np.mean(motion[lag:] * motion[:-lag]) / np.mean(motion**2)
    assert found == pytest.approx((1 + x + x * x / 3) * math.exp(-x), abs=0.01)


def test_poles_in_a_row_have_unit_variance_and_no_seam() -> None:
    many = np.array([poles_in_a_row(stream(seed, "x"), 4000, decay_of(1.0, 50.0), 2) for seed in range(200)])
    assert many[:, 2000].std() == pytest.approx(1.0, rel=0.15)


def test_groups_are_correlated_and_the_others_not() -> None:
    one = scenario(rrw=0.0, groups=[{"gyros": [0, 1], "rho": -0.8}, {"gyros": [2, 3, 4], "rho": 0.5}])
    found = np.corrcoef(noise_of(one).T)
    assert found[0, 1] == pytest.approx(-0.8, abs=0.03)
    assert found[2, 4] == pytest.approx(0.5, abs=0.03)
    assert found[0, 2] == pytest.approx(0.0, abs=0.04)


def test_heavy_tails_keep_the_variance_and_outliers_add_to_it() -> None:
    student = noise_of(scenario(rrw=0.0, tails={"dof": 5}, motion_s=1000.0))
    plain = np.asarray(Scenario().arw) * math.sqrt(50.0)
    assert student.std(axis=0) == pytest.approx(plain, rel=0.05)
    assert np.mean((student / plain) ** 4) == pytest.approx(3 * 3 / (5 - 4), rel=0.5)
    outliers = noise_of(scenario(rrw=0.0, tails={"share": 0.02, "factor": 10}, motion_s=1000.0))
    assert outliers.std(axis=0) == pytest.approx(plain * math.sqrt(0.98 + 0.02 * 100), rel=0.1)


def test_scale_errors_are_the_slope_against_the_truth() -> None:
    recording = simulate(scenario(scale={"low": 0.01, "high": 0.03}, motion={"sd": 50.0}, bias_sd=0.0), 2).motion
    slope = (recording.rate.T @ recording.truth) / (recording.truth @ recording.truth) - 1
    assert slope == pytest.approx(recording.known.scale, abs=2e-4)
    assert ((np.abs(recording.known.scale) >= 0.01) & (np.abs(recording.known.scale) <= 0.03)).all()


def test_a_physical_pole_delays_by_its_time_constant() -> None:
    bandwidth = {"poles_hz": [40.0, 20.0], "late": [0.0, 3.0], "oversample": 32}
    one = scenario(rate_hz=200.0, arw=(1e-9, 1e-9), rrw=0.0, bias_sd=0.0, bandwidth=bandwidth)
    recording = simulate(one, 1).motion
    slope = np.gradient(recording.truth, 1 / 200.0)
    lag = -((recording.rate - recording.truth[:, None]) * slope[:, None]).mean(axis=0) / np.mean(slope**2)
    # Of a first-order pole 1/(2π·f); the discrete pole at 32 × the rate is late by half a made sample less.
    made = 0.5 / (32 * 200.0)
    assert lag == pytest.approx([1 / (2 * math.pi * 40) - made, 1 / (2 * math.pi * 20) - made + 3 / 200], rel=0.02)


def test_coloured_noise_has_the_density_of_the_white_one_at_low_frequency() -> None:
    bandwidth = {"poles_hz": [40.0, 40.0], "motion": False}
    one = scenario(rate_hz=200.0, arw=(0.03, 0.03), rrw=0.0, bandwidth=bandwidth, motion_s=1000.0)
    means = noise_of(one)[:200_000].reshape(-1, 100, 2).mean(axis=1)
    assert means.std(axis=0) == pytest.approx(0.03 / math.sqrt(0.5) * np.ones(2), rel=0.06)
    assert noise_of(one).std() == pytest.approx(0.03 * math.sqrt(math.pi * 40.0), rel=0.1)


def test_rounding_and_clipping() -> None:
    recording = simulate(scenario(quantum=0.5, full_scale=(30.0,) * 6), 1).motion
    steps = np.diff(recording.rate, axis=0) / 0.5
    assert steps == pytest.approx(np.rint(steps), abs=1e-9)
    rounding = (recording.rate - recording.known.values)[recording.known.usable]
    assert np.abs(rounding).max() <= 0.25 + 1e-9
    assert rounding.std() == pytest.approx(0.5 / math.sqrt(12), rel=0.01)
    assert np.abs(recording.known.values).max() == 30.0
    assert np.array_equal(~recording.known.usable, np.abs(recording.known.values) >= 30.0)


def test_faults_are_where_they_are_said_to_be() -> None:
    faults = [
        {"gyro": 1, "sort": "stuck", "start_s": 50, "stop_s": 60},
        {"gyro": 2, "sort": "absurd", "start_s": 100, "size": 1500},
        {"gyro": 3, "sort": "burst", "count": 3, "seconds": 5, "factor": 8},
    ]
    recording = simulate(scenario(faults=faults), 1).motion
    assert (recording.rate[2500:3000, 1] == recording.rate[2499, 1]).all()
    assert recording.rate[5000, 2] == 1500.0
    assert [fault.sort for fault in recording.faults].count("burst") == 3
    errors = recording.rate[:, 3] - recording.truth
    inside = np.zeros(len(errors), dtype=bool)
    for fault in recording.faults:
        if fault.sort == "burst":
            assert fault.stop - fault.start == 250
            inside[fault.start : fault.stop] = True
    assert errors[inside].std() / errors[~inside].std() == pytest.approx(8.0, rel=0.15)


def test_gaps_lose_samples_and_the_times_tell() -> None:
    whole = simulate(scenario(), 1).motion
    recording = simulate(scenario(gaps={"count": 5, "shortest_s": 1, "longest_s": 2}), 1).motion
    steps = np.rint(np.diff(recording.time) * 50).astype(int)
    assert np.array_equal(np.flatnonzero(steps > 1), np.flatnonzero(np.diff(recording.segment)))
    assert len(recording.stretch_time) == recording.segment[-1] + 1
    kept = np.rint(recording.time * 50).astype(int)
    assert np.array_equal(recording.rate, whole.rate[kept])


def test_biases_of_eight_seeds_are_orthogonal() -> None:
    for gyros in (2, 6, 8):
        drawn = np.array([balanced(seed, "bias", gyros) for seed in range(9, 17)])
        assert drawn.T @ drawn / 8 == pytest.approx(np.eye(gyros), abs=1e-12)
    wide = np.array([balanced(seed, "bias", 16) for seed in range(1, 9)])
    assert np.mean(wide**2) == pytest.approx(1.0)


@pytest.mark.parametrize("gyros", [4, 6, 16])
def test_biases_of_eight_seeds_tell_their_common_part_as_they_do_on_average(gyros: int) -> None:
    """Expected 1, in closed form: E[1/χ²] of N - 1 degrees of freedom is 1/(N - 3)."""
    drawn = np.array([balanced(seed, "bias", gyros) for seed in range(9, 17)])
    told = drawn.var(axis=1, ddof=1) * (gyros - 1) / (gyros - 3) / gyros
    assert np.mean(drawn.mean(axis=1) ** 2 / told) == pytest.approx(1.0, abs=0.02)


def test_shorter_shrinks_stretches_and_counts() -> None:
    short = load("bursts").shorter(60.0, 180.0)
    assert (short.rest_s, short.motion_s, short.faults[0].count) == (60.0, 180.0, 2)
    assert load("stuck").shorter(60.0, 180.0).faults[0].start_s == pytest.approx(80.0)
    assert load("rate_1000").shorter(600.0, 900.0) == load("rate_1000")


def test_changing_noise_has_its_mean_variance() -> None:
    one = scenario(rrw=0.0, volatility={}, motion_s=4000.0)
    known = simulate(one, 1).motion.known
    assert np.mean((known.deviation / (np.asarray(one.arw) * math.sqrt(50.0))) ** 2) == pytest.approx(1.0, abs=0.15)
    assert np.diagonal(known.correlation, axis1=1, axis2=2) == pytest.approx(1.0)


def test_temperature_moves_the_biases() -> None:
    one = scenario(temperature={"ramp_k": 30.0, "per_k": 0.01, "spread": 0.0})
    assert np.ptp(effects.slow_offset(one, 1, "motion", 1000), axis=0) == pytest.approx(0.3 * np.ones(6))
    assert simulate(one, 1).motion.temperature is not None
    hidden = scenario(temperature={"logged": False})
    assert simulate(hidden, 1).motion.temperature is None


def test_files_are_yaml_of_known_keys() -> None:
    for path in FOLDER.glob("*.yaml"):
        if path.stem != "order":
            own = yaml.safe_load(path.read_text(encoding="utf-8"))
            assert set(own) <= set(Scenario.model_fields), path.name


def test_at_rest_every_method_is_judged_at_a_rate_that_it_is_not_told() -> None:
    """As in the pipeline: at rest the truth is zero, and what draws toward zero would look good."""
    trial = simulate("tails_t4", 1)
    arrays = trial_arrays(trial)
    assert trial.rest is not None
    np.testing.assert_allclose(arrays["rest"].array.rate, trial.rest.rate + 0.05)
    assert (arrays["rest"].injected, arrays["motion"].injected) == (0.05, 0.0)
    np.testing.assert_array_equal(arrays["motion"].array.rate, trial.motion.rate)
