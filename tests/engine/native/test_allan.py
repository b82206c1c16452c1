"""Allan kernels against allantools, the reference engine and the definition; bits on every path."""

import itertools
import subprocess
import sys

import allantools
import numpy as np
import pytest

from vgyro.engine.native import allan
from vgyro.engine.reference import allan as reference

RATE_HZ = 200.0


def series(kind: str, samples: int) -> np.ndarray:
    white = np.random.default_rng(1).standard_normal(samples)
    walk = np.cumsum(np.random.default_rng(2).standard_normal(samples))
    return {
        "white": white,
        "biased": 300 + white,
        "drifting": white + 0.01 * walk,
        "line": white + np.linspace(-50, 50, samples),
        "single": white.astype(np.float32),
    }[kind]


def factors_of(samples: int) -> np.ndarray:
    return np.unique(np.geomspace(1, max(samples // 3, 1), 40).astype(np.int64))


@pytest.mark.parametrize("estimator", ["overlapping", "modified", "hadamard"])
@pytest.mark.parametrize("kind", ["white", "biased", "drifting", "single"])
@pytest.mark.parametrize("samples", [3, 4, 5, 11, 2047, 2050, 300_001])
def test_differences_equal_allantools(kind: str, samples: int, estimator: str):
    rate, factors = series(kind, samples), factors_of(samples)
    sums, counts = allan.differences(rate, factors, kind=estimator)
    expected, number = reference.differences(rate, factors, kind=estimator)
    np.testing.assert_array_equal(counts, number)
    # allantools sums the angle of the modified variance up over the whole series.
    np.testing.assert_allclose(sums, expected, rtol=1e-9 if estimator == "modified" else 1e-12)


def test_a_day_at_200_hz_equals_allantools():
    rate = series("drifting", 17_280_000)
    factors = np.array([1, 7, 200, 6_350, 1_000_003, 5_760_000])
    sums, counts = allan.differences(rate, factors)
    _, expected, _, number = allantools.oadev(rate, RATE_HZ, "freq", factors / RATE_HZ)
    np.testing.assert_array_equal(counts, number)
    np.testing.assert_allclose(np.sqrt(sums / counts), expected, rtol=1e-12)


def test_factors_that_do_not_fit_have_no_differences():
    sums, counts = allan.differences(np.arange(10.0) ** 2, np.array([4, 5, 100]))
    np.testing.assert_array_equal(counts, [3, 0, 0])
    # Means of four of k² rise by 4²·… : θ(k+8) - 2θ(k+4) + θ(k) over 4, from the definition.
    means = [np.mean(np.arange(k, k + 4.0) ** 2) for k in range(7)]
    assert sums[0] == pytest.approx(sum((means[k + 4] - means[k]) ** 2 / 2 for k in range(3)), rel=1e-12)
    assert not sums[1:].any()


@pytest.mark.parametrize("kind", ["white", "biased", "drifting", "line", "single"])
@pytest.mark.parametrize("samples", [4, 13, 5_000, 100_003])
def test_lag_products_equal_the_reference(kind: str, samples: int):
    rate, factors = series(kind, samples), np.append(factors_of(samples), samples)
    squares, products = allan.lag_products(rate, factors)
    expected_squares, expected_products = reference.lag_products(rate, factors)
    assert not squares[-1].any()
    np.testing.assert_allclose(squares, expected_squares, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(products, expected_products, rtol=1e-9, atol=1e-9 * expected_squares.max())


def test_stretches_are_summed_without_bridging():
    rate, edges = series("drifting", 50_000), np.array([0, 3, 10, 10, 5_000, 20_001, 20_050, 50_000])
    factors = np.array([1, 2, 3, 16, 500, 5_000, 9_000, 15_000])
    for share, kind in itertools.product((2, 3, 4), ("modified", "hadamard", "overlapping")):
        sums, counts = allan.differences(rate, factors, edges, share, kind)
        expected, number = reference.differences(rate, factors, edges, share, kind)
        np.testing.assert_array_equal(counts, number)
        np.testing.assert_allclose(sums, expected, rtol=1e-9 if kind == "modified" else 1e-12)
    assert number[-1] == 0 < number[4]
    found = allan.lag_products(rate, factors, edges, 30)
    for ours, theirs in zip(found, reference.lag_products(rate, factors, edges, 30), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-9 * ours.max())
    with pytest.raises(ValueError, match="edges"):
        allan.differences(rate, factors, np.array([0, 60_000]))


LOSSY_EDGES = np.array([0, 700, 701, 20_000, 60_000])


def lossy_series() -> tuple[np.ndarray, np.ndarray]:
    """Rates and slots: 60 000 slots in four stretches, of which single ones and a run of 500 are lost."""
    there = np.random.default_rng(3).random(60_000) > 0.02
    there[30_000:30_500] = False
    there[LOSSY_EDGES[:-1]] = True
    return series("drifting", 60_000)[there], np.flatnonzero(there)


@pytest.mark.parametrize("kind", ["overlapping", "modified", "hadamard"])
@pytest.mark.parametrize("share", [2, 3, 4])
def test_differences_over_losses_equal_the_reference(kind: str, share: int):
    rate, slot = lossy_series()
    factors = np.array([1, 2, 3, 9, 10, 31, 63, 64, 127, 128, 200, 1000, 5000, 9999, 20_000, 50_000])
    total, have = allan.slot_sums(rate, slot, LOSSY_EDGES)
    expected_total, expected_have = reference.slot_sums(rate, slot, LOSSY_EDGES)
    np.testing.assert_allclose(total, expected_total, atol=1e-9 * np.abs(total).max())
    np.testing.assert_array_equal(have, expected_have)
    ours = allan.differences_over_losses(total, have, LOSSY_EDGES, factors, share, kind)
    theirs = reference.differences_over_losses(expected_total, expected_have, LOSSY_EDGES, factors, share, kind)
    np.testing.assert_allclose(ours[0], theirs[0], rtol=1e-9)
    np.testing.assert_allclose(ours[1], theirs[1], rtol=1e-9, atol=1e-9)
    for one, two in zip(ours[2:], theirs[2:], strict=True):
        np.testing.assert_array_equal(one, two)
    assert not ours[2][-1]
    assert np.all(ours[2] <= ours[3])


def test_a_difference_over_a_loss_by_hand():
    # Slots 0 … 19 without 7: means over ten slots, of nine and of ten samples. Rates k², so means differ by their sums.
    slot = np.delete(np.arange(20), 7)
    rate = slot.astype(float) ** 2
    total, have = allan.slot_sums(rate, slot, np.array([0, 20]))
    sums, excess, counts, possible = allan.differences_over_losses(total, have, np.array([0, 20]), np.array([10]), 2)
    assert (counts[0], possible[0]) == (1, 1)
    assert sums[0] == pytest.approx((np.mean(rate[9:]) - np.mean(rate[:9])) ** 2 / 2, rel=1e-12)
    assert excess[0] == pytest.approx((1 / 9 + 1 / 10 - 2 / 10) / 2, rel=1e-12)


def test_without_a_loss_the_sums_are_the_strict_ones():
    rate, factors, edges = series("drifting", 30_000), np.array([1, 5, 64, 127]), np.array([0, 10_000, 30_000])
    for kind in ("overlapping", "modified", "hadamard"):
        parts = (*allan.slot_sums(rate, np.arange(30_000), edges), edges)
        sums, excess, counts, possible = allan.differences_over_losses(*parts, factors, 4, kind)
        expected, number = allan.differences(rate, factors, edges, 4, kind)
        np.testing.assert_allclose(sums, expected, rtol=1e-9)
        np.testing.assert_allclose(excess, 0, atol=1e-9)
        np.testing.assert_array_equal(counts, number)
        np.testing.assert_array_equal(possible, number)


def test_no_sample_and_no_factor():
    total, have = allan.slot_sums(np.empty(0), np.empty(0, int), np.array([0, 5]))
    found = allan.differences_over_losses(total, have, np.array([0, 5]), np.array([1]))
    assert [part.tolist() for part in found] == [[0.0], [0.0], [0], [4]]
    assert allan.differences_over_losses(total, have, np.array([0, 5]), np.empty(0, int))[2].size == 0


@pytest.mark.parametrize("value", [3.0, 0.1, -1e-7])
def test_constant_series_has_nothing(value: float):
    for kind in ("overlapping", "modified", "hadamard"):
        assert not allan.differences(np.full(501, value), np.array([1, 10]), kind=kind)[0].any()
    assert not allan.lag_products(np.full(501, value), np.array([1, 10]))[0].any()


@pytest.mark.parametrize("kind", ["overlapping", "modified", "hadamard"])
@pytest.mark.parametrize("alpha", [-4, -3, -2, -1, 0, 1, 2])
def test_degrees_of_freedom_equal_allantools(alpha: int, kind: str):
    for factor in (1, 2, 5, 20, 25, 26, 33, 34, 100, 101, 12_345, 576_000):
        samples = factor * np.array([3, 4, 5, 6, 7, 10, 100, 1000]) + np.array([0, 0, 30, 1, 0, 1, 0, 0])
        np.testing.assert_allclose(
            allan.degrees_of_freedom(alpha, factor, samples, kind),
            reference.degrees_of_freedom(alpha, factor, samples, kind),
            rtol=1e-11,
        )


def test_limits_equal_scipy():
    deviation, edf = np.array([1.0, 0.3, 2.0]), np.array([1.2, 146.177, 3e7])
    np.testing.assert_allclose(
        allan.limits(deviation, edf, 0.95), reference.limits(deviation, edf, 0.95), rtol=1e-9
    )  # fmt: skip


BITS = """
import numpy as np
from vgyro.engine.native import allan
rate = np.random.default_rng(1).standard_normal(2_000_003)
factors = np.unique(np.geomspace(1, 600_000, 30).astype(np.int64))
found = [*allan.lag_products(rate, factors)]
slot, edges = np.arange(rate.size) + np.arange(rate.size) // 50, np.array([0, 900_000, 2_040_003])
parts = allan.slot_sums(rate, slot, edges)
for kind in ("overlapping", "modified", "hadamard"):
    found += allan.differences(rate, factors, kind=kind)
    found += allan.differences_over_losses(*parts, edges, factors, 3, kind)
for values in (*parts, *found):
    print(__import__("hashlib").sha256(values.tobytes()).hexdigest())
"""


def test_same_bits_for_threads_and_instruction_sets(monkeypatch: pytest.MonkeyPatch):
    found = set()
    for isa, threads in (("", "1"), ("", "3"), ("baseline", "1"), ("baseline", "2")):
        monkeypatch.setenv("VGYRO_ISA", isa)
        monkeypatch.setenv("VGYRO_THREADS", threads)
        found.add(subprocess.run([sys.executable, "-c", BITS], check=True, capture_output=True, text=True).stdout)
    assert len(found) == 1
    assert len(found.pop()) > 1000
