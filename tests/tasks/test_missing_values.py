"""A channel with gaps of its own: what lacks values, and what that may change. From frames to figures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from task_chain import DEFINITIONS, RATE_HZ, Chain, white

from vgyro.storage.tables import read_columns
from vgyro.tasks.fusion.noise_record import read_noise
from vgyro.tasks.pages.rates import read_rates
from vgyro.tasks.rates.rates_file import read_array, read_temperature
from vgyro.tasks.volatility import effects

GYROS = ("g1", "g2", "g3", "g4")
SECONDS = 60
SAMPLES = round(SECONDS * RATE_HZ)
HALF_WAY = SAMPLES // 2
LOST = slice(4500, 4503)


def isolated(rate: np.ndarray) -> None:
    rate[np.random.default_rng(3).choice(SAMPLES, 20, replace=False), 1] = np.nan


def ends(rate: np.ndarray) -> None:
    rate[HALF_WAY:, 1] = np.nan


def half_rate(rate: np.ndarray) -> None:
    rate[1::2, 1] = np.nan


def lost_rows(rate: np.ndarray) -> None:
    rate[LOST] = np.nan


def nothing(rate: np.ndarray) -> None:
    del rate


CASES = {one.__name__: one for one in (isolated, ends, half_rate, lost_rows)}


@pytest.fixture(scope="module")
def chains(tmp_path_factory):
    """Case → the same array, made to lack what the case lacks, through all tasks."""
    made: dict[str, Chain] = {}

    def of(case: str) -> Chain:
        if case not in made:
            rate = white(SECONDS, len(GYROS), seed=5)
            CASES.get(case, nothing)(rate)
            made[case] = Chain(tmp_path_factory.mktemp(case), GYROS, volatility=True)
            made[case].frames(rate)
            made[case].all()
        return made[case]

    return of


def finite(column: np.ndarray) -> bool:
    return bool(np.isfinite(column).all())


@pytest.mark.parametrize("case", CASES)
def test_every_method_runs_that_runs_without_gaps(chains, case):
    whole, chain = chains("complete"), chains(case)
    assert chain.columns() == whole.columns()
    fused = chain.table("fused")
    assert all(finite(values) for values in fused.values())
    # None of them leaves the array: the average of four gyros of 0.05 deg/s stays within six of its deviations.
    expected = whole.table("fused")["average"]
    kept = np.ones(SAMPLES, dtype=bool)
    kept[LOST] = case != "lost_rows"
    assert np.abs(fused["average"] - expected)[kept].max() < 6 * 0.05


@pytest.mark.parametrize("case", CASES)
def test_what_lacks_is_nan_in_the_rates_and_counted(chains, case):
    chain = chains(case)
    rates, frames = chain.table("rates"), chain.table("frames")
    for gyro in GYROS:
        np.testing.assert_array_equal(np.isnan(rates[gyro]), np.isnan(frames[gyro]))
    missing = {gyro: int(np.isnan(frames[gyro]).sum()) for gyro in GYROS}
    assert chain.metadata("rates")["missing"] == missing
    assert chain.metadata("rates").get("lost_rows") == ({"z": 3} if case == "lost_rows" else None)
    assert not {"missing", "lost_rows"} & set(chains("complete").metadata("rates"))


@pytest.mark.parametrize("case", [name for name in CASES if name != "lost_rows"])
def test_noise_of_the_others_does_not_change_by_a_digit(chains, case):
    whole, chain = chains("complete"), chains(case)
    others = [gyro for gyro in GYROS if gyro != "g2"]
    for name in ("arw", "arw_low", "arw_high", "rrw", "bias_instability"):
        assert [chain.noise()[name][gyro] for gyro in others] == [whole.noise()[name][gyro] for gyro in others]
    ours, theirs = (np.array(one.noise()["correlation"])[np.ix_([0, 2, 3], [0, 2, 3])] for one in (chain, whole))
    np.testing.assert_array_equal(ours, theirs)
    figures, before = chain.metrics(), whole.metrics()
    for gyro in others:
        for metric in ("arw", "arw_1s", "bias_drift", "mean", "sigma"):
            assert figures[gyro, metric][0] == before[gyro, metric][0]


@pytest.mark.parametrize(("case", "factor"), [("isolated", 1.0), ("ends", 1.0), ("half_rate", np.sqrt(2))])
def test_noise_of_the_gyro_itself(chains, case, factor):
    # White noise of which every second sample is missing has √2 times the angle random walk.
    whole, chain = chains("complete"), chains(case)
    for value, low, high in [
        (factor * whole.noise()["arw"]["g2"], chain.noise()["arw_low"]["g2"], chain.noise()["arw_high"]["g2"]),
        (factor * whole.metrics()["g2", "arw"][0], *chain.metrics()["g2", "arw"][1:]),
        (whole.metrics()["g2", "sigma"][0], *chain.metrics()["g2", "sigma"][1:]),
        (whole.metrics()["g2", "mean"][0], *chain.metrics()["g2", "mean"][1:]),
    ]:
        assert low <= value <= high
    rate = {"half_rate": 2}.get(case, 1)
    allan = chain.table("allan")
    assert allan["tau"][allan["series"] == "g2"].min() == pytest.approx(rate / RATE_HZ)
    correlation = np.array(chain.noise()["correlation"])
    assert np.abs(correlation - np.eye(4)).max() < 0.1


def test_lost_rows_are_in_no_figure(chains):
    whole, chain = chains("complete"), chains("lost_rows")
    file = read_array(chain.folder / "rates.parquet", list(GYROS), "z")
    np.testing.assert_array_equal(np.flatnonzero(~file.at_rest), np.arange(LOST.start, LOST.stop))
    assert finite(file.rate)
    # In a straight line between the neighbours of what is common, at each gyro's own offset.
    common = file.rate.mean(axis=1)
    np.testing.assert_allclose(np.diff(common[LOST.start - 1 : LOST.stop + 1], 2), 0, atol=1e-6)
    for name in (*GYROS, "average", "recommended"):
        assert chain.metrics()[name, "missing"][0] == 3
        low, high = chain.metrics()[name, "arw"][1:]
        assert low <= whole.metrics()[name, "arw"][0] <= high


@pytest.mark.parametrize(("case", "found"), [("isolated", []), ("ends", [("g2", "dropout")]), ("half_rate", []),
                                             ("lost_rows", []), ("complete", [])])  # fmt: skip
def test_faults(chains, case, found):
    table = chains(case).table("faults")
    assert list(zip(table["gyro"], table["kind"], strict=True)) == found
    if found:
        assert table["start"][0] == HALF_WAY / RATE_HZ
        assert table["stop"][0] == (SAMPLES - 1) / RATE_HZ
        assert "to the end" in table["sentence"][0]


def test_a_gyro_that_ended_has_no_part_in_what_is_fused_then(chains):
    # Of three gyros of equal noise the average has 2/√3 times the deviation that it has of four.
    whole, chain = (chains(case).table("fused")["average"][HALF_WAY:] for case in ("complete", "ends"))
    assert chain.std() / whole.std() == pytest.approx(2 / np.sqrt(3), rel=0.05)
    assert abs(chain.mean() - whole.mean()) < 5 * 0.05 / np.sqrt(HALF_WAY)


def test_filled_values_are_those_of_the_others_at_the_own_offset(chains):
    file = read_array(chains("half_rate").folder / "rates.parquet", list(GYROS), "z")
    others = np.delete(file.rate, 1, axis=1)
    step = (file.rate[:, 1] - others.mean(axis=1))[1::2]
    # Truth: biases apart by what they are, known to 0.05 deg/s over the root of 500 values of ten seconds.
    complete = read_array(chains("complete").folder / "rates.parquet", list(GYROS), "z")
    assert complete.missing is None
    expected = complete.rate[:, 1].mean() - np.delete(complete.rate, 1, axis=1).mean()
    assert np.abs(step - expected).max() < 5 * 0.05 / np.sqrt(500)
    np.testing.assert_array_equal(file.missing[:, 1], np.arange(SAMPLES) % 2 == 1)


@pytest.mark.parametrize("case", CASES)
def test_volatility_of_the_others_goes_on(chains, case):
    chain = chains(case)
    series, garch = chain.table("series"), read_columns(chain.folder / "level/garch.parquet")
    others = [gyro for gyro in GYROS if gyro != "g2"]
    assert all(finite(series[gyro]) for gyro in others)
    assert finite(garch["omega"][np.isin(garch["gyro"], others)])
    after = series["time"] >= HALF_WAY / RATE_HZ
    assert np.isnan(series["g2"][after]).all() == (case == "ends")
    assert finite(series["g2"][~after])
    weights = read_columns(chain.folder / "level/weights.parquet")
    assert all(finite(weights[f"w_{gyro}"]) for gyro in GYROS)
    if case == "ends":
        late = (weights["time"] > HALF_WAY / RATE_HZ + 15) & (weights["model"] == "dcc")
        assert late.any()
        assert not weights["w_g2"][late].any()
        status = garch["status"][(garch["gyro"] == "g2") & (garch["time_start"] > HALF_WAY / RATE_HZ)]
        assert set(status) == {"failed"}


@pytest.mark.parametrize("case", CASES)
def test_the_cross_check_agrees(chains, case):
    rows = chains(case).crosscheck()
    assert len(rows["check"]) > 10
    assert rows["passed"].all()


def test_effects_of_a_gyro_that_ended(chains):
    chain = chains("ends")
    inputs = {"series": "series.parquet", "tones": "tones.parquet", "garch": ["level/garch.parquet"]}
    chain.run(effects, inputs, ("effects",), definition=DEFINITIONS[0])
    verdicts = dict(zip(chain.table("effects")["gyro"], chain.table("effects")["verdict"], strict=True))
    assert verdicts["g2"] == "values missing"
    assert "values missing" not in {verdicts[gyro] for gyro in GYROS if gyro != "g2"}


def test_a_gyro_without_any_value_has_no_figures(tmp_path):
    rate = white(60, 4, seed=5)
    rate[:, 1] = np.nan
    chain = Chain(tmp_path, GYROS, volatility=True)
    chain.frames(rate)
    chain.all()
    assert all(finite(values) for values in chain.table("fused").values())
    assert chain.noise()["arw"]["g2"] is None
    assert not any(name == "g2" for name, _ in chain.metrics())
    assert list(chain.table("faults")["kind"]) == ["dropout"]
    assert np.isnan(read_noise(tmp_path / "noise.json", list(GYROS)).arw[1])


def test_in_motion_the_noise_is_that_of_the_differences(tmp_path):
    time = np.arange(6000) / RATE_HZ
    rate = white(60, 4, seed=5) + 10 * np.sin(2 * np.pi * 0.5 * time)[:, None]
    half_rate(rate[:6000])
    chain = replace(Chain(tmp_path, GYROS), kind="sinusoid")
    chain.frames(rate)
    chain.all()
    assert all(finite(values) for values in chain.table("fused").values())
    assert "differences" in chain.noise()["method"]
    assert chain.noise()["arw"]["g1"] == pytest.approx(0.005, rel=0.25)


def test_a_thermometer_at_one_hertz(tmp_path):
    celsius = 25 + np.arange(6000) / 1000
    slow = np.where(np.arange(6000) % 100 == 0, celsius, np.nan)
    chains = {}
    for name, values in (("fast", celsius), ("slow", slow)):
        (tmp_path / name).mkdir()
        chains[name] = Chain(tmp_path / name, GYROS, temperature=True)
        chains[name].frames(white(60, 4, seed=5), values)
    chains["fast"].convert()
    chains["slow"].all()
    rates = {name: chain.table("rates") for name, chain in chains.items()}
    np.testing.assert_array_equal(rates["slow"]["g1"], rates["fast"]["g1"])
    assert np.isnan(rates["slow"]["temp_t"]).sum() == 5940
    assert rates["slow"]["at_rest"].all()
    files = {name: read_array(tmp_path / name / "rates.parquet", list(GYROS), "z") for name in chains}
    found = {name: read_temperature(file, ["temp_t"]) for name, file in files.items()}
    np.testing.assert_allclose(found["slow"][:5901], found["fast"][:5901], atol=1e-3)
    assert finite(found["slow"])
    assert all(finite(values) for values in chains["slow"].table("fused").values())
    assert finite(read_rates(tmp_path / "slow/rates.parquet", list(GYROS)).temperatures["t"])
    none = tmp_path / "none"
    none.mkdir()
    chains["none"] = Chain(none, GYROS, temperature=True)
    chains["none"].frames(white(60, 4, seed=5), np.full(6000, np.nan))
    chains["none"].all()
    assert read_temperature(read_array(none / "rates.parquet", list(GYROS), "z"), ["temp_t"]) is None
