"""Which window's model gives which sample's weights, by hand, and what the weights may know."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from vgyro.engine.covariance import conditional_covariance
from vgyro.engine.independent import nnls_weights
from vgyro.engine.models import DccModel
from vgyro.volatility import Window, WindowModels, stretches, weights_of_windows, windows
from vgyro.volatility.rolling import rows_needed
from vgyro.volatility.series import window_residuals

MODES = ("in_sample", "causal")
DEFINITIONS = ["level", "demeaned", "difference", "residual"]


def marked(found, marks, n=2):
    """Constant-variance models that their weights give away: h of the first gyro is the mark, of the others 1."""
    count = len(found)
    omega = np.ones((count, n))
    omega[:, 0] = marks
    return WindowModels(
        start=np.array([window.start for window in found], dtype=np.int64),
        length=found[0].length if found else 1,
        omega=omega,
        alpha=np.zeros((count, n)),
        beta=np.zeros((count, n)),
        a=np.zeros(count),
        b=np.zeros(count),
        target=np.tile(np.eye(n), (count, 1, 1)),
        note=np.zeros(count, dtype=int),
    )


def live(found, n=3, seed=0):
    """Models in which everything moves."""
    rng = np.random.default_rng(seed)
    count = len(found)
    still = marked(found, 1.0, n)
    return WindowModels(
        still.start, still.length, rng.uniform(0.05, 0.2, (count, n)), rng.uniform(0.02, 0.2, (count, n)),
        rng.uniform(0.3, 0.75, (count, n)), rng.uniform(0.02, 0.1, count), rng.uniform(0.5, 0.85, count),
        np.tile(0.3 + 0.7 * np.eye(n), (count, 1, 1)), still.note,
    )  # fmt: skip


def said(found):
    return np.array(found.statuses, dtype=object)[found.status]


def test_windows_by_hand():
    assert windows(np.zeros(10), 4, 3) == [(0, 4), (3, 7), (6, 10)]
    assert windows(np.array([0] * 5 + [1] * 6), 4, 2) == [(0, 4), (5, 9), (7, 11)]
    assert windows(np.zeros(3), 4, 1) == []
    assert windows(np.zeros(0), 4, 1) == []
    # Liu et al.: 3600 points, window 360, step 30.
    assert len(windows(np.zeros(3600), 360, 30)) == 109


@pytest.mark.parametrize("modes", [("in_sample",), ("causal",), MODES])
def test_bookkeeping_by_hand(modes):
    # Windows [0, 4), [3, 7), [6, 10) of 12 samples, step 3.
    expected = {"in_sample": [1, 1, 1, 1, 2, 2, 2, 3, 3, 3, 3, 3], "causal": [np.nan] * 4 + [1, 1, 1, 2, 2, 2, 3, 3]}
    models = marked(windows(np.zeros(12), 4, 3), [1, 2, 3])
    found = weights_of_windows(np.ones((12, 2)), models, [Window(0, 12)], "level", modes, "dcc", 3)
    assert tuple(found) == modes
    for mode in modes:
        marks = np.array(expected[mode], dtype=float)
        assert found[mode].begin == 0
        np.testing.assert_allclose(found[mode].deviation[:, 0] ** 2, marks)
        np.testing.assert_array_equal(said(found[mode]), np.where(np.isnan(marks), "no model yet", "ok"))
        np.testing.assert_array_equal(found[mode].weights[np.isnan(marks)], 0.5)
        known = ~np.isnan(marks)
        np.testing.assert_allclose(found[mode].weights[known, 0], (1 / marks[known]) / (1 / marks[known] + 1))
        np.testing.assert_allclose(found[mode].sigma[known] ** 2, 1 / (1 / marks[known] + 1))


def test_each_stretch_begins_again():
    segment = np.array([0] * 7 + [1] * 2 + [2] * 5)
    models = marked(windows(segment, 4, 3), [1, 2, 3])
    runs = stretches(segment)
    found = weights_of_windows(np.ones((14, 2)), models, runs, "level", MODES, "ccc", 3, too_short="x")
    marks = found["causal"].deviation[:, 0] ** 2
    np.testing.assert_allclose(marks, [np.nan] * 4 + [1] * 3 + [np.nan] * 2 + [np.nan] * 4 + [3])
    assert list(said(found["causal"])[[0, 7, 9, 13]]) == ["no model yet", "x", "no model yet", "ok"]
    marks = found["in_sample"].deviation[:, 0] ** 2
    np.testing.assert_allclose(marks, [1] * 4 + [2] * 3 + [np.nan] * 2 + [3] * 5)


@pytest.fixture
def broken_series():
    """Nine stretches, some too short for a window, some without a tail; models of which some lack gyros, or all."""
    segment = np.repeat(np.arange(9), [10, 100, 5, 40, 41, 39, 210, 130, 17])
    found = windows(segment, 40, 9)
    models = live(found, 4)
    omega, target, note = models.omega, models.target, models.note
    omega[[3, 7], 1] = np.nan
    omega[9] = np.nan
    omega[-1, :3] = np.nan
    target[5] = 1.0
    note[[3, 7, -1]], note[9] = 1, 2
    models.a[[2, 5]] = 0.0
    models = WindowModels(
        models.start, 40, omega, models.alpha, models.beta, models.a, models.b, target, note,
        ("", "without g2: no variance", "stuck"),
    )  # fmt: skip
    return np.random.default_rng(1).standard_normal((len(segment), 4)), models, stretches(segment)


@pytest.mark.parametrize("definition", DEFINITIONS)
@pytest.mark.parametrize("correlation", ["dcc", "ccc"])
def test_the_chunks_do_not_matter(broken_series, definition, correlation):
    values, models, runs = broken_series
    whole = weights_of_windows(values, models, runs, definition, MODES, correlation, 9)
    for size in (1, 2, 7):
        parts = []
        for first in range(0, len(models.start), size):
            part = models.part(slice(first, first + size))
            need = rows_needed(part, runs, 9)
            parts.append(
                weights_of_windows(
                    values[need.start : need.stop], part, runs, definition, MODES, correlation, 9, offset=need.start
                )
            )
        for mode in MODES:
            begins = [part[mode].begin for part in parts]
            assert begins[0] == 0
            assert all(
                second == first + len(part[mode].weights)
                for (first, second), part in zip(pairwise([*begins, len(values)]), parts, strict=True)
            )
            for name in ("weights", "sigma", "deviation", "status"):
                together = np.concatenate([getattr(part[mode], name) for part in parts])
                np.testing.assert_array_equal(together, getattr(whole[mode], name))


@pytest.mark.parametrize("definition", DEFINITIONS)
def test_samples_against_their_window_alone(broken_series, definition):
    # Expected: r_t of the one window, the covariance in NumPy, scipy.optimize.nnls.
    values, models, runs = broken_series
    found = weights_of_windows(values, models, runs, definition, MODES, "dcc", 9)
    for number, mode in (
        (0, "in_sample"),
        (1, "in_sample"),
        (1, "causal"),
        (4, "causal"),
        (30, "causal"),
        (3, "causal"),
    ):
        window = Window(int(models.start[number]), int(models.start[number]) + 40)
        run = next(run for run in runs if run.start <= window.start < run.stop)
        gyros = np.isfinite(models.omega[number])
        r = window_residuals(values, window, definition, 15, min(9, run.stop - window.stop), run.start)[:, gyros]
        model = DccModel(
            models.omega[number, gyros], models.alpha[number, gyros], models.beta[number, gyros], models.a[number],
            models.b[number], models.target[number][np.ix_(gyros, gyros)],
        )  # fmt: skip
        H = conditional_covariance(r, 40, model)
        sample = window.stop - 1 if mode == "in_sample" else window.stop + 2
        w = nnls_weights(H[sample - window.start])
        np.testing.assert_allclose(found[mode].weights[sample, gyros], w, atol=1e-11)
        np.testing.assert_array_equal(found[mode].weights[sample, ~gyros], 0.0)
        assert found[mode].sigma[sample] == pytest.approx(np.sqrt(w @ H[sample - window.start] @ w))


def test_the_reference_engine_gives_the_same(broken_series):
    values, models, runs = broken_series
    native, reference = (
        weights_of_windows(values, models, runs, "difference", MODES, "dcc", 9, engine=engine)
        for engine in ("native", "reference")
    )
    for mode in MODES:
        np.testing.assert_array_equal(said(native[mode]), said(reference[mode]))
        for name in ("weights", "sigma", "deviation"):
            np.testing.assert_allclose(getattr(native[mode], name), getattr(reference[mode], name), atol=1e-11)


def test_ccc_is_dcc_of_a_and_b_zero():
    # Bollerslev (1990): the correlation is the target throughout, whatever the a and b that DCC found.
    values = np.random.default_rng(0).standard_normal((300, 3))
    models = live(windows(np.zeros(300), 100, 30))
    still = replace(models, a=np.zeros(len(models.a)), b=np.zeros(len(models.b)))
    runs = [Window(0, 300)]
    ccc = weights_of_windows(values, models, runs, "level", MODES, "ccc", 30)
    dcc = weights_of_windows(values, still, runs, "level", MODES, "dcc", 30)
    moving = weights_of_windows(values, models, runs, "level", MODES, "dcc", 30)
    for mode in MODES:
        np.testing.assert_array_equal(ccc[mode].weights, dcc[mode].weights)
        assert not np.allclose(ccc[mode].weights, moving[mode].weights, rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("definition", DEFINITIONS)
@pytest.mark.parametrize("correlation", ["dcc", "ccc"])
def test_causal_weights_know_nothing_of_the_sample_and_what_follows(definition, correlation):
    values = np.random.default_rng(0).standard_normal((300, 3))
    # The models are given, so that only the state that is carried forward can look ahead.
    models = live(windows(np.zeros(300), 100, 30))

    def weights_of(series):
        return weights_of_windows(series, models, [Window(0, 300)], definition, ["causal"], correlation, 30)[
            "causal"
        ].weights

    before = weights_of(values)
    for now in (100, 131, 175, 290):
        changed = values.copy()
        changed[now:] = 50.0
        after = weights_of(changed)
        np.testing.assert_array_equal(before[: now + 1], after[: now + 1])
        assert not np.allclose(before[now + 1 : now + 3], after[now + 1 : now + 3])


def test_in_sample_knows_its_window():
    values = np.random.default_rng(0).standard_normal((200, 3))
    changed = values.copy()
    changed[99] = 50.0
    models = live(windows(np.zeros(200), 100, 30))
    first, second = (
        weights_of_windows(series, models, [Window(0, 200)], "level", ["in_sample"], "dcc", 30)["in_sample"].weights
        for series in (values, changed)
    )
    assert not np.allclose(first[0], second[0])


def test_covariance_by_hand():
    # Expected: H = D R D with both recursions written out, started from the window's own mean square.
    rng = np.random.default_rng(5)
    r = rng.standard_normal((8, 2))
    target = np.array([[1.0, 0.3], [0.3, 1.0]])
    omega, alpha, beta, a, b = np.array([0.1, 0.2]), np.array([0.2, 0.1]), np.array([0.6, 0.7]), 0.1, 0.7
    found = conditional_covariance(r, 5, DccModel(omega, alpha, beta, a, b, target))
    h, q = omega + (alpha + beta) * np.mean(r[:5] ** 2, axis=0), target
    for t in range(8):
        scale = np.sqrt(h / np.diag(q))
        np.testing.assert_allclose(found[t], q * np.outer(scale, scale), rtol=1e-12)
        z = r[t] / np.sqrt(h)
        h, q = omega + alpha * r[t] ** 2 + beta * h, (1 - a - b) * target + a * np.outer(z, z) + b * q
    constant = conditional_covariance(r, 5, DccModel(omega, alpha, beta, 0.0, b, target))
    size = np.sqrt(np.diagonal(constant, axis1=1, axis2=2))
    np.testing.assert_allclose(constant[:, 0, 1] / (size[:, 0] * size[:, 1]), 0.3)


def test_a_first_sample_without_difference_takes_the_next_covariance():
    r = np.random.default_rng(5).standard_normal((8, 2))
    given = np.array([0.1, 0.2]), np.array([0.2, 0.1]), np.array([0.6, 0.7]), 0.1, 0.7, np.eye(2)
    full = conditional_covariance(r[1:], 7, DccModel(*given))
    r[0] = np.nan
    found = conditional_covariance(r, 8, DccModel(*given))
    np.testing.assert_array_equal(found[1:], full)
    np.testing.assert_array_equal(found[0], found[1])


def test_a_gyro_without_a_model_has_no_weight():
    models = marked([Window(0, 6)], 4.0, 3)
    models.omega[0, 1], models.target[0, 1], models.target[0, :, 1] = np.nan, np.nan, np.nan
    models.note[0] = 1
    broken = WindowModels(**{**vars(models), "notes": ("", "without g2: no variance")})
    found = weights_of_windows(np.ones((6, 3)), broken, [Window(0, 6)], "level", ["in_sample"], "dcc", 3)["in_sample"]
    np.testing.assert_allclose(found.weights, [[0.2, 0.0, 0.8]] * 6)
    assert np.isnan(found.deviation[:, 1]).all()
    assert set(said(found)) == {"without g2: no variance"}


def test_no_model_at_all_or_no_usable_covariance():
    models = marked([Window(0, 6)], 4.0)
    runs, values = [Window(0, 6)], np.ones((6, 2))
    models.target[0] = 1.0
    found = weights_of_windows(values, models, runs, "level", ["in_sample"], "dcc", 3)["in_sample"]
    np.testing.assert_array_equal(found.weights, 0.5)
    assert set(said(found)) == {"not positive definite"}
    models.omega[0] = np.nan
    found = weights_of_windows(values, models, runs, "level", ["in_sample"], "dcc", 3)["in_sample"]
    np.testing.assert_array_equal(found.weights, 0.5)
    assert np.isnan(found.sigma).all()
    assert set(said(found)) == {"no variance"}


def test_no_window():
    empty = marked([], [])
    found = weights_of_windows(np.ones((0, 2)), empty, [Window(0, 3), Window(3, 5)], "level", MODES, "dcc", 3)
    for mode in MODES:
        np.testing.assert_array_equal(found[mode].weights, np.full((5, 2), 0.5))
        assert set(said(found[mode])) == {"too short"}
    assert rows_needed(empty, [Window(0, 3)], 3) == (0, 0)


def test_one_gyro():
    models = marked([Window(0, 6)], 4.0, 1)
    found = weights_of_windows(np.ones((6, 1)), models, [Window(0, 6)], "level", ["in_sample"], "dcc", 3)["in_sample"]
    np.testing.assert_array_equal(found.weights, 1.0)
    np.testing.assert_allclose(found.sigma, 2.0)
