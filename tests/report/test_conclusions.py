"""Conclusions follow from the figures by the stated rules; the figures here are made up to be on one side of a rule."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vgyro.report.conclusions.best import best_method, best_of_all
from vgyro.report.conclusions.section import bad_gyros, conclude
from vgyro.report.fusion.moved import failing
from vgyro.report.model import ArrayPart, DatasetPart
from vgyro.tasks.common import Task
from vgyro.tasks.pages.report import read_dataset_part

GYROS = ("g1", "g2", "g3", "g4")


@pytest.fixture(scope="module")
def dataset(report_task: Task) -> DatasetPart:
    return read_dataset_part(report_task)


def array_of(dataset: DatasetPart) -> ArrayPart:
    return next(array for array in dataset.arrays if array.anchor == "rest-x")


def with_metric(dataset: DatasetPart, method: str, metric: str, value: float) -> DatasetPart:
    """The data set with one figure of the array rest-x changed."""
    array = array_of(dataset)
    table = {name: column.copy() for name, column in array.tables["metrics"].items()}
    mask = (table["method"] == method) & (table["metric"] == metric)
    assert mask.any()
    for name in ("value", "low", "high"):
        table[name][mask] = value
    return with_array(dataset, array, {"metrics": table})


def with_error(dataset: DatasetPart, method: str, value: float) -> DatasetPart:
    """The data set with one method's error 1σ in motion changed."""
    array = next(one for one in dataset.arrays if one.anchor == "sine-x")
    table = {name: column.copy() for name, column in array.tables["metrics"].items()}
    mask = (table["method"] == method) & (table["metric"] == "error_sigma")
    for name in ("value", "low", "high"):
        table[name][mask] = value
    return with_array(dataset, array, {"metrics": table})


def with_g4_at(dataset: DatasetPart, sigma: float, arw: float, allan: float) -> DatasetPart:
    """The data set with the noisy gyro at these multiples of the median of the other three."""
    values = array_of(dataset).values()
    for metric, factor in (("sigma", sigma), ("arw_1s", arw)):
        median = float(np.median([values[gyro, ""][metric].value for gyro in GYROS[:3]]))
        dataset = with_metric(dataset, "g4", metric, factor * median)
    return with_allan(dataset, "g4", allan)


def with_array(dataset: DatasetPart, array: ArrayPart, tables: dict) -> DatasetPart:
    """The data set with some tables of one array changed."""
    changed = replace(array, tables={**array.tables, **tables})
    recordings = tuple(
        replace(part, arrays=tuple(changed if one is array else one for one in part.arrays))
        for part in dataset.recordings
    )
    return replace(dataset, recordings=recordings)


def with_allan(dataset: DatasetPart, gyro: str, factor: float, from_tau: float = 0.0) -> DatasetPart:
    """The data set with one gyro's Allan curve of rest-x at a multiple of the median of the others from a τ on."""
    array = array_of(dataset)
    table = {name: column.copy() for name, column in array.tables["allan"].items()}
    others = [table["deviation"][table["series"] == name] for name in GYROS if name != gyro]
    mask = table["series"] == gyro
    median = np.median(others, axis=0)
    scale = np.where(table["tau"][mask] >= from_tau, factor, 1.0)
    for name, spread in (("deviation", 1.0), ("low", 0.95), ("high", 1.05)):
        table[name][mask] = median * scale * spread
    return with_array(dataset, array, {"allan": table})


def test_a_gyro_that_is_bad_at_long_times_only_is_found(dataset: DatasetPart) -> None:
    quiet = with_g4_at(dataset, 1.0, 1.0, 1.0)
    assert bad_gyros(quiet) == []
    (bad,) = bad_gyros(with_allan(quiet, "g1", 3.5, from_tau=50.0))
    assert bad.gyro == "g1"
    assert bad.factor > 3


def test_a_tone_above_the_shortest_averaging_time_is_not_held_against_a_gyro(dataset: DatasetPart) -> None:
    quiet = with_g4_at(dataset, 1.0, 1.0, 1.0)
    array = array_of(quiet)
    table = {name: column.copy() for name, column in array.tables["allan"].items()}
    mask = (table["series"] == "g2") & (table["tau"] < 0.1)
    assert mask.any()
    for name in ("deviation", "low", "high"):
        table[name][mask] *= 4
    assert bad_gyros(with_array(quiet, array, {"allan": table})) == []


def test_the_noisy_gyro_is_named_with_its_factor(dataset: DatasetPart) -> None:
    (bad,) = bad_gyros(dataset)
    # Median of the 1σ 0.05, 0.052, 0.048, 0.16 is 0.051.
    assert (bad.gyro, bad.axis, bad.figure) == ("g4", "x", "1σ")
    assert bad.factor == pytest.approx(0.16 / 0.051)
    assert any("g4" in one.text and one.tone == "bad" for one in conclude(dataset))


def test_a_gyro_just_inside_the_rule_is_healthy(dataset: DatasetPart) -> None:
    dataset = with_g4_at(dataset, 1.9, 1.4, 1.9)
    assert bad_gyros(dataset) == []
    assert any(one.tone == "good" and "all 4 gyros" in one.text for one in conclude(dataset))


@pytest.mark.parametrize(("arw", "bad"), [(1.45, False), (1.6, True)])
def test_arw_has_the_tighter_rule(dataset: DatasetPart, arw: float, bad: bool) -> None:
    found = [one.gyro for one in bad_gyros(with_g4_at(dataset, 1.0, arw, 1.0))]
    assert found == (["g4"] if bad else [])


def test_the_best_method_is_that_at_equal_bandwidth(dataset: DatasetPart) -> None:
    array = array_of(dataset)
    # Raw 1σ favours the low-pass (3.4 against 2.9); at equal bandwidth it has 0.7 of that, less than DCC.
    assert best_method(array, "if_sigma").method == "jiang_random_walk"
    assert best_method(array, "if_sigma_equal").method == "dcc_causal", "not dcc_in_sample"


def test_the_best_causal_method_stands_beside_an_offline_one(dataset: DatasetPart) -> None:
    assert not any("Best causal" in one.text for one in conclude(dataset))
    better = with_metric(dataset, "recommended", "if_sigma_equal", 9.0)
    said = [one.text for one in conclude(better)]
    (best,) = [text for text in said if text.startswith("Best method at rest (axis x")]
    assert "Recommended (offline), improvement factor 9" in best
    (causal,) = [text for text in said if text.startswith("Best causal method at rest (axis x")]
    assert "Recommended" not in causal
    motion = next(text for text in said if text.startswith("In motion (axis x"))
    assert "(offline)" not in motion
    faster = with_error(dataset, "recommended", 0.001)
    (motion,) = [one.text for one in conclude(faster) if one.text.startswith("In motion (axis x")]
    assert "0.00100" in motion
    assert "by Recommended (offline), of the causal methods 0.01" in motion


def test_the_recommended_method_is_named_wherever_it_stands(dataset: DatasetPart) -> None:
    said = [one.text for one in conclude(with_metric(dataset, "recommended", "if_sigma_equal", 1.25))]
    (at_rest,) = [text for text in said if text.startswith("Recommended virtual gyro (axis x")]
    assert "improvement factor 1.25" in at_rest
    (motion,) = [
        one.text for one in conclude(with_error(dataset, "recommended", 9.0)) if one.text.startswith("In motion")
    ]
    assert "; the recommended method 9" in motion
    (motion,) = [
        one.text for one in conclude(with_error(dataset, "recommended", 0.001)) if one.text.startswith("In motion")
    ]
    assert "the recommended method" not in motion


def test_what_a_smoother_of_another_shape_reads_is_never_the_best(dataset: DatasetPart) -> None:
    array = array_of(with_metric(dataset, "average", "if_sigma_equal", 9.0))
    assert best_method(array, "if_sigma_equal").method == "average"
    table = {name: column.copy() for name, column in array.tables["metrics"].items()}
    row = (table["method"] == "average") & (table["metric"] == "if_sigma_equal")
    table["flags"] = np.where(row, "takes_part", table["flags"]).astype(object)
    limited = replace(array, tables={**array.tables, "metrics": table})
    assert best_method(limited, "if_sigma_equal").method != "average"


def test_the_headline_is_a_method_that_holds_at_the_added_rate(dataset: DatasetPart) -> None:
    # DCC by `level` and by `residual` are equal at rest; the mean of the first is half the added rate off.
    best = best_of_all(array_of(dataset))
    assert (best.name, best.figure) == (("dcc_causal", "residual"), "if_sigma_equal")


def test_a_method_that_wins_at_rest_and_fails_at_the_rate_is_named_with_its_figures(dataset: DatasetPart) -> None:
    (sentence,) = [one for one in conclude(dataset) if "fails at 0.05 deg/s (axis x" in one.text]
    assert sentence.tone == "warn"
    assert sentence.text.startswith("DCC weights, causal (level) improves 1σ")
    # 1σ is 1.1 times that at rest, below the rule's 1.5; the mean moves by 0.025, half the rate.
    assert "Mean −0.0240 deg/s, at rest 0.00100" in sentence.text
    assert "Bias drift, min σ" in sentence.text
    assert "1σ 0." not in sentence.text


@pytest.mark.parametrize(("mean", "fails"), [(0.0055, False), (0.0065, True)])
def test_a_mean_that_moves_by_more_than_a_tenth_of_the_rate_fails(
    dataset: DatasetPart, mean: float, fails: bool
) -> None:
    array = array_of(dataset)
    table = {name: column.copy() for name, column in array.tables["metrics"].items()}
    moved = table["true_rate"] != 0
    table["value"][moved & (table["metric"] == "mean")] = mean  # 0.001 at rest, the rate is 0.05
    table["value"][moved & (table["metric"] != "mean")] = 0.0
    found = failing(replace(array, tables={**array.tables, "metrics": table}))
    assert (("dcc_causal", "level") in found) is fails


def test_causal_dcc_wins_only_with_its_whole_interval(dataset: DatasetPart) -> None:
    texts = [one.text for one in conclude(dataset)]
    (sentence,) = [text for text in texts if text.startswith("Causal DCC")]
    assert "beats the simple baselines by 1σ" in sentence
    assert "does not beat the simple baselines by bias drift" in sentence


def test_limits_are_said(dataset: DatasetPart) -> None:
    text = " ".join(one.text for one in conclude(dataset))
    assert "Nominal scale for solo" in text
    assert "Recording broken was refused: only 12 % of its frames are good." in text
    assert "rest is too short for the floor of g1, g2" in text
    assert "rest lacks 0.49\u2009% of its frames" in text


def test_arch_verdicts_are_said_together(dataset: DatasetPart) -> None:
    texts = [one.text for one in conclude(dataset) if one.text.startswith("ARCH")]
    assert texts == [
        "ARCH effects of the level (axis x, rest): tone at 6.5 Hz: g1, g3; drift + disturbance: g2; "
        "no verdict (no variance): g4.",
        "ARCH effects of the level (axis z, rest): nothing: solo.",
    ]


def with_curves(dataset: DatasetPart, short: dict[str, float], second: dict[str, float]) -> DatasetPart:
    """The data set with Allan deviations of methods of rest-x, below 0.5 s and from there on, 5 % known."""
    array = array_of(dataset)
    table = {name: column.copy() for name, column in array.tables["allan"].items()}
    for series in short:
        mask = table["series"] == series
        assert mask.any()
        value = np.where(table["tau"][mask] < 0.5, short[series], second[series])
        for name, spread in (("deviation", 1.0), ("low", 0.95), ("high", 1.05)):
            table[name][mask] = value * spread
    return with_array(dataset, array, {"allan": table})


@pytest.mark.parametrize(("second", "said"), [(0.0008, True), (0.00098, False), (0.0012, False)])
def test_order_that_depends_on_the_averaging_time(dataset, second, said):
    # The rule: the lower limit of the one that is best at the shortest time, 0.00095 at 1 s, above the other's.
    array = array_of(dataset)
    full = [row["column"] for row in array.methods() if row["column"] and not np.isfinite(row["bandwidth_hz"])]
    assert {"average", "median"} <= set(full)
    worst = dict.fromkeys(full, 1.0)
    made = with_curves(
        dataset, {**worst, "average": 0.01, "median": 0.02}, {**worst, "average": 0.001, "median": second}
    )
    found = [
        one.text for one in conclude(made) if "depends on the averaging time" in one.text and "axis x, rest" in one.text
    ]
    assert len(found) == said
    if said:
        assert "0.80 of the former's" in found[0]


def test_what_the_calibration_suspects_is_said_first_and_in_red(dataset):
    calibration = {**dataset.calibration, "suspicions": ["table: the plateaus' rates look like rad/s"]}
    first = conclude(replace(dataset, calibration=calibration))[0]
    assert (first.text, first.tone) == ("Table: the plateaus' rates look like rad/s.", "bad")
    assert not any("rad/s" in one.text for one in conclude(dataset))
