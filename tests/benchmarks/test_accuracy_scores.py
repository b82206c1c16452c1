"""Scores, summaries, ranks, demands and bounds of the accuracy benchmark: the arithmetic."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from benchmarks.accuracy import bounds
from benchmarks.accuracy.ablation import by_part, changes
from benchmarks.accuracy.compare import differences
from benchmarks.accuracy.demands import demands
from benchmarks.accuracy.ledger import LEDGER, Ledger, timed
from benchmarks.accuracy.scores import errors_of, fault_score, honesty_of, second_means
from benchmarks.accuracy.summary import Line, Row, geometric, pooled, ranks, summarised
from benchmarks.accuracy.trial import TrueFault
from vgyro.fusion.events import FaultEvent

TIME = np.arange(6000) / 100.0


def event(gyro: int, start: int, stop: int) -> FaultEvent:
    return FaultEvent(gyro, "noise", start, stop, 9.0, 2.0, "1")


def test_errors_count_without_ten_seconds_at_both_ends() -> None:
    error = np.where((TIME < 9.99) | (TIME > 50.0), 100.0, 0.3)
    error[1000:5000:2] += 0.2
    found = errors_of(error, np.zeros(6000), TIME, 100.0)
    assert found.sd == pytest.approx(0.1, rel=1e-3)
    assert found.rms == pytest.approx(math.hypot(0.4, 0.1), rel=1e-3)
    assert found.sd_1s == pytest.approx(0.0, abs=1e-9)
    assert found.rms_1s == pytest.approx(0.4)


def test_seconds_with_too_many_gaps_do_not_count() -> None:
    time = np.delete(TIME[:300], np.r_[100:120, 250:255])
    assert second_means(np.floor(time), time, 100.0).tolist() == [0.0, 2.0]


def test_honesty() -> None:
    error = np.random.default_rng(1).normal(size=6000)
    found = honesty_of(error, np.full(6000, 2.0), np.zeros(6000), TIME)
    assert found.nees == pytest.approx(0.25, rel=0.1)
    assert found.coverage == pytest.approx(1.0, abs=1e-3)
    assert math.isnan(honesty_of(error, None, np.zeros(6000), TIME).nees)


def test_faults_found_missed_invented() -> None:
    faults = [TrueFault((2,), "stuck", 3000, 4000), TrueFault((3,), "noise", 1000, 2000)]
    found = fault_score([event(2, 2900, 4000), event(2, 6000, 6100), event(4, 0, 10)], faults, 100.0)
    assert (found.true, found.found, found.named, found.stray, found.invented) == (2, 1, 1, 1, 1)
    assert not found.right
    assert fault_score([event(2, 3000, 4000), event(3, 900, 2100)], faults, 100.0).right
    assert not fault_score([event(2, 3000, 4000), event(3, 900, 1500), event(3, 1600, 2100)], faults, 100.0).right


def test_one_of_two_equal_channels_may_be_named_not_both() -> None:
    faults = [TrueFault((4, 1), "copy", 0, 6000)]
    assert fault_score([event(1, 0, 6000)], faults, 100.0).right
    assert fault_score([event(1, 0, 6000), event(4, 0, 6000)], faults, 100.0).invented == 1


def test_an_excused_gyro_may_be_named_once() -> None:
    assert fault_score([], [], 100.0, excused=(0,)).right
    assert fault_score([event(0, 0, 10)], [], 100.0, excused=(0,)).right
    assert not fault_score([event(0, 0, 10), event(0, 50, 60)], [], 100.0, excused=(0,)).right


def row(method: str, seed: int, ratio: float, **changes: object) -> Row:
    """A row in which the average's errors are 2, the oracle's .5."""
    names = ("sd", "rms", "sd_1s", "rms_1s")
    found: Row = {"scenario": "plain", "part": "motion", "seed": seed, "method": method, "state": "ran", "note": ""}
    found |= dict.fromkeys(names, 2.0 * ratio) | {"nees": 1.0, "coverage": 0.95, "cpu_s": 1.0, "without": ""}
    found |= {
        f"{who}_{name}": size for who, size in (("average", 2.0), ("best_gyro", 3.0), ("oracle", 0.5)) for name in names
    }
    found |= {"oracle_kind": "exact", "oracle_nees": 1.0, "spoilt_average": False, "faults_invented": 0}
    return found | changes


def lines(*rows: Row) -> list[Line]:
    return summarised(rows)


def test_ratios_are_of_errors_rms_over_the_seeds() -> None:
    [line] = lines(row("a", 1, 0.5), row("a", 2, 2.0), row("b", 1, 0.25), row("b", 2, 0.25))
    assert line.ratio("a", "full") == pytest.approx(math.sqrt((0.5**2 + 2.0**2) / 2))
    assert line.ratio("b", "full", "oracle") == pytest.approx(1.0)
    assert line.oracle["sd"] == pytest.approx(0.25)
    assert line.seeds == 2


def test_at_rest_the_rms_error_counts() -> None:
    [line] = lines(row("a", 1, 1.0, part="rest", rms=1.0))
    assert line.ratio("a", "full") == pytest.approx(0.5)
    assert line.label == "plain, at rest"


def test_the_interval_is_students() -> None:
    found = geometric([math.exp(0.1), math.exp(0.2), math.exp(0.3)])
    assert math.log(found.high) - 0.2 == pytest.approx(4.3027 * 0.1 / math.sqrt(3), rel=1e-4)
    assert math.isnan(geometric([2.0]).low)


def test_the_interval_of_a_ratio_is_of_the_jackknife() -> None:
    """Closed form with three seeds: the logarithm of the ratio of sums without each."""
    rows = [{"a": one, "b": 1.0} for one in (1.0, 1.2, 0.9)]
    found = pooled(rows, "a", "b")
    without = np.log([(1.44 + 0.81) / 2, (1.0 + 0.81) / 2, (1.0 + 1.44) / 2]) / 2
    error = math.sqrt(2 / 3 * np.sum((without - without.mean()) ** 2))
    assert math.log(found.high / found.value) == pytest.approx(4.3027 * error, rel=1e-4)
    assert math.log(found.value / found.low) == pytest.approx(4.3027 * error, rel=1e-4)
    assert math.isnan(pooled(rows[:1], "a", "b").low)


def test_an_average_that_is_right_by_chance_decides_nothing() -> None:
    """Two methods of one bias each, .1 and .2 (1σ): on one seed the first is ten thousand times as good by luck."""
    rows = [{"a": 1e-5, "b": 0.2}, {"a": 0.14, "b": 0.01}, {"a": 0.1, "b": 0.3}]
    assert pooled(rows, "a", "b").value == pytest.approx(math.sqrt((1e-10 + 0.0196 + 0.01) / (0.04 + 1e-4 + 0.09)))


def test_who_does_not_run_on_every_seed_is_last() -> None:
    failed = row("b", 2, math.nan, state="failed", note="LinAlgError")
    [line] = lines(row("a", 1, 1.0), row("a", 2, 1.0), row("b", 1, 0.1), failed)
    assert math.isinf(line.ratio("b", "full"))
    assert [one.method for one in ranks([line], "full")] == ["a", "b"]
    assert line.cells["b"].note == "LinAlgError"


def test_equal_errors_share_a_rank() -> None:
    found = ranks(lines(row("a", 1, 1.0), row("b", 1, 1.0), row("c", 1, 2.0)), "full")
    assert [(one.method, one.mean, one.first) for one in found] == [("a", 1.5, 1), ("b", 1.5, 1), ("c", 3.0, 0)]


def test_demands_name_the_misses() -> None:
    found = demands(
        lines(
            row("average", 1, 1.0), row("recommended", 1, 1.5, nees=9.0, faults_invented=2),
            row("recommended_unsmoothed", 1, 1.01, nees=math.nan),
        )
    )  # fmt: skip
    over, behind, oracle, nees, right, invented = found
    assert over.misses == ("plain: recommended 1.5 (full rate)", "plain: recommended 1.5 (1 s means)")
    assert behind.holds
    assert not oracle.holds
    assert nees.misses == ("plain: 9",)
    assert right.lines == 0
    # Faults are those of the trial: of its first row.
    assert invented.holds


def test_bounds_pass_what_they_were_set_from_and_what_is_better(tmp_path: Path) -> None:
    def some(ratio: float, nees: float, invented: int) -> list[Line]:
        rows = [
            row(name, 1, ratio, nees=nees, faults_invented=invented)
            for name in ("recommended", "recommended_unsmoothed")
        ]
        return lines(*rows)

    bounds.write(bounds.of_lines(some(0.5, 3.0, 1)), tmp_path / "bounds.yaml")
    known = bounds.read(tmp_path / "bounds.yaml")
    assert bounds.broken(some(0.5, 3.0, 1), known) == []
    assert bounds.broken(some(0.3, 1.0, 0), known) == []
    assert len(bounds.broken(some(0.52, 3.0, 1), known)) == 4
    assert bounds.broken(some(0.5, 4.0, 1), known) == ["plain: NEES 4, between 0.6 and 3.09"]
    assert bounds.broken(some(0.5, 3.0, 2), known) == ["plain: faults invented 2, at most 1"]
    assert bounds.broken(some(0.5, 3.0, 1), {}) == ["plain: bounds.yaml has no bounds for it"]


def test_a_part_that_brings_and_one_that_costs() -> None:
    usual = [row("recommended", seed, 1.0) for seed in (1, 2)]
    left = [row("recommended", seed, 1.1, without="slow", cpu_s=0.5) for seed in (1, 2)]
    left += [row("recommended", seed, 0.9, without="risk", nees=2.0) for seed in (1, 2)]
    slow, risk = by_part(changes(usual, left))
    assert slow.brings[0].most == pytest.approx(1.1)
    assert slow.costs == []
    assert slow.cpu == pytest.approx(0.5)
    assert risk.costs[0].most == pytest.approx(0.9)
    assert risk.honest[0].honesty == pytest.approx(2.0)
    assert slow.honest == slow.not_honest == risk.not_honest == []


def test_before_and_after() -> None:
    before = [row("a", 1, 1.0, faults_invented=2), row("a", 2, 1.0, state="failed"), row("b", 1, 1.0)]
    [found] = differences(before, [row("a", 1, 0.5), row("a", 2, 0.5), row("c", 1, 1.0)])
    assert found.ratio["full"].value == pytest.approx(0.5)
    assert (found.gained, found.lost, found.invented) == (1, 0, (2, 0))


def test_what_is_shared_counts_for_all_who_need_it() -> None:
    def busy(seconds: float) -> None:
        entry = ledger.open[-1]
        entry.own += seconds

    ledger = Ledger()
    inner, outer = (1, "inner"), (1, "outer")

    def make_outer() -> None:
        ledger.need(inner)
        ledger.made(inner, lambda: busy(2.0), None)
        busy(1.0)

    ledger.made(outer, make_outer, None)
    assert ledger.cost(ledger.entries[outer]) == pytest.approx(3.0, abs=0.1)
    assert ledger.cost(ledger.entries[inner]) == pytest.approx(2.0, abs=0.1)


def test_timed_closes_what_it_opened() -> None:
    def fails() -> None:
        raise ValueError

    before = len(LEDGER.open)
    assert timed(lambda: 3)[0] == 3
    with pytest.raises(ValueError, match=r"^$"):
        timed(fails)
    assert len(LEDGER.open) == before
