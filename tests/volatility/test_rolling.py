"""Which window's model gives which sample's weights, by hand, and what the weights may know."""

import numpy as np
import pytest

from vgyro.volatility import ModelWindow, Window, longest_stretch, rolling_weights, windows
from vgyro.volatility.rolling import conditional_covariance


def inverse_variance(covariance):
    """Weights of a diagonal H, in closed form."""
    weights = 1 / np.diagonal(covariance, axis1=1, axis2=2)
    return weights / weights.sum(axis=1, keepdims=True)


def marked(window, mark, n=2):
    """A constant-variance model that its weights give away: h of the first gyro is `mark`, of the others 1."""
    omega = np.ones(n)
    omega[0] = mark
    return ModelWindow(window, omega, np.zeros(n), np.zeros(n), 0.0, 0.0, np.eye(n))


def marks(found):
    return np.round(found.deviation[:, 0] ** 2, 9)


def test_windows_by_hand():
    assert windows(np.zeros(10), 4, 3) == [(0, 4), (3, 7), (6, 10)]
    assert windows(np.array([0] * 5 + [1] * 6), 4, 2) == [(0, 4), (5, 9), (7, 11)]
    assert windows(np.zeros(3), 4, 1) == []
    assert windows(np.zeros(0), 4, 1) == []
    # Liu et al.: 3600 points, window 360, step 30.
    assert len(windows(np.zeros(3600), 360, 30)) == 109
    assert longest_stretch(np.array([0, 0, 1, 1, 1, 2])) == (2, 5)
    assert longest_stretch(np.zeros(0)).length == 0


@pytest.mark.parametrize(
    ("mode", "expected"),
    [
        # Windows [0, 4), [3, 7), [6, 10) of 12 samples, step 3.
        ("in_sample", [1, 1, 1, 1, 2, 2, 2, 3, 3, 3, 3, 3]),
        ("causal", [np.nan] * 4 + [1, 1, 1, 2, 2, 2, 3, 3]),
    ],
)
def test_bookkeeping_by_hand(mode, expected):
    values = np.ones((12, 2))
    models = [marked(window, mark) for mark, window in enumerate(windows(np.zeros(12), 4, 3), start=1)]
    found = rolling_weights(values, np.zeros(12), models, "level", mode, "dcc", inverse_variance, 3)
    np.testing.assert_array_equal(marks(found), expected)
    waiting = np.isnan(expected)
    np.testing.assert_array_equal(found.status, np.where(waiting, "no model yet", "ok"))
    np.testing.assert_array_equal(found.weights[waiting], 0.5)
    known = np.array(expected)[~waiting]
    np.testing.assert_allclose(found.weights[~waiting, 0], (1 / known) / (1 / known + 1))
    np.testing.assert_allclose(found.sigma[~waiting] ** 2, 1 / (1 / known + 1))


def test_each_segment_begins_again():
    segment = np.array([0] * 7 + [1] * 2 + [2] * 5)
    models = [marked(window, mark) for mark, window in enumerate(windows(segment, 4, 3), start=1)]
    assert len(models) == 3
    found = rolling_weights(
        np.ones((14, 2)), segment, models, "level", "causal", "ccc", inverse_variance, 3, too_short="x"
    )
    np.testing.assert_array_equal(marks(found), [np.nan] * 4 + [1] * 3 + [np.nan] * 2 + [np.nan] * 4 + [3])
    assert list(found.status[[0, 7, 9, 13]]) == ["no model yet", "x", "no model yet", "ok"]


def live(window, seed, n=3):
    rng = np.random.default_rng(seed)
    target = np.full((n, n), 0.3) + 0.7 * np.eye(n)
    return ModelWindow(window, rng.uniform(0.05, 0.2, n), np.full(n, 0.1), np.full(n, 0.8), 0.05, 0.9, target)


@pytest.mark.parametrize("definition", ["level", "demeaned", "difference", "residual"])
@pytest.mark.parametrize("model", ["dcc", "ccc"])
def test_causal_weights_know_nothing_of_the_sample_and_what_follows(definition, model):
    values = np.random.default_rng(0).standard_normal((300, 3))
    # The models are given, so that only the state that is carried forward can look ahead.
    models = [live(window, seed) for seed, window in enumerate(windows(np.zeros(300), 100, 30))]

    def weights_of(series):
        return rolling_weights(
            series, np.zeros(300), models, definition, "causal", model, inverse_variance, 30, span=15
        ).weights

    before = weights_of(values)
    for now in (100, 131, 175, 290):
        changed = values.copy()
        changed[now:] = 50.0
        # A window that ends after `now` has another model then; those before must not notice.
        models_before = [window for window in models if window.window.stop <= now]
        last = models_before[-1].window.stop + 30 if len(models_before) < len(models) else 300
        after = weights_of(changed)
        np.testing.assert_array_equal(before[: now + 1], after[: now + 1])
        assert last > now
        assert not np.allclose(before[now + 1 : now + 3], after[now + 1 : now + 3])


def test_in_sample_knows_its_window():
    values = np.random.default_rng(0).standard_normal((200, 3))
    models = [live(window, seed) for seed, window in enumerate(windows(np.zeros(200), 100, 30))]
    changed = values.copy()
    changed[99] = 50.0
    first, second = (
        rolling_weights(v, np.zeros(200), models, "level", "in_sample", "dcc", inverse_variance, 30).weights
        for v in (values, changed)
    )
    assert not np.allclose(first[0], second[0])


def test_covariance_by_hand():
    # Expected: H = D R D with both recursions written out, started from the window's own mean square.
    rng = np.random.default_rng(5)
    r = rng.standard_normal((8, 2))
    target = np.array([[1.0, 0.3], [0.3, 1.0]])
    omega, alpha, beta, a, b = np.array([0.1, 0.2]), np.array([0.2, 0.1]), np.array([0.6, 0.7]), 0.1, 0.7
    model = ModelWindow(Window(0, 5), omega, alpha, beta, a, b, target)
    found, gyros = conditional_covariance(r, 5, model, "dcc")
    assert gyros.all()
    h, q = omega + (alpha + beta) * np.mean(r[:5] ** 2, axis=0), target
    for t in range(8):
        scale = np.sqrt(h / np.diag(q))
        np.testing.assert_allclose(found[t], q * np.outer(scale, scale), rtol=1e-12)
        z = r[t] / np.sqrt(h)
        h, q = omega + alpha * r[t] ** 2 + beta * h, (1 - a - b) * target + a * np.outer(z, z) + b * q
    constant, _ = conditional_covariance(r, 5, model, "ccc")
    size = np.sqrt(np.diagonal(constant, axis1=1, axis2=2))
    np.testing.assert_allclose(constant[:, 0, 1] / (size[:, 0] * size[:, 1]), 0.3)


def test_a_first_sample_without_difference_takes_the_next_covariance():
    r = np.random.default_rng(5).standard_normal((8, 2))
    model = live(Window(0, 8), 0, 2)
    full, _ = conditional_covariance(r[1:], 7, model, "dcc")
    r[0] = np.nan
    found, _ = conditional_covariance(r, 8, model, "dcc")
    np.testing.assert_array_equal(found[1:], full)
    np.testing.assert_array_equal(found[0], found[1])


def test_a_gyro_without_a_model_has_no_weight():
    model = marked(Window(0, 6), 4.0, 3)
    omega, target = model.omega.copy(), model.target.copy()
    omega[1], target[1, :], target[:, 1] = np.nan, np.nan, np.nan
    broken = ModelWindow(model.window, omega, model.alpha, model.beta, 0.0, 0.0, target, "without g2: no variance")
    found = rolling_weights(np.ones((6, 3)), np.zeros(6), [broken], "level", "in_sample", "dcc", inverse_variance, 3)
    np.testing.assert_allclose(found.weights[0], [0.2, 0.0, 0.8])
    assert np.isnan(found.deviation[0, 1])
    assert set(found.status) == {"without g2: no variance"}


def test_no_model_at_all_or_no_usable_covariance():
    model = marked(Window(0, 6), 4.0)
    none = ModelWindow(model.window, np.full(2, np.nan), model.alpha, model.beta, 0.0, 0.0, model.target, "stuck")
    found = rolling_weights(np.ones((6, 2)), np.zeros(6), [none], "level", "in_sample", "dcc", inverse_variance, 3)
    np.testing.assert_array_equal(found.weights, 0.5)
    assert set(found.status) == {"stuck"}

    def unusable(covariance):
        return np.full(covariance.shape[:2], np.nan)

    found = rolling_weights(np.ones((6, 2)), np.zeros(6), [model], "level", "in_sample", "dcc", unusable, 3)
    np.testing.assert_array_equal(found.weights, 0.5)
    assert set(found.status) == {"not positive definite"}


def test_one_gyro():
    found = rolling_weights(
        np.ones((6, 1)), np.zeros(6), [marked(Window(0, 6), 4.0, 1)], "level", "in_sample", "dcc", inverse_variance, 3
    )
    np.testing.assert_array_equal(found.weights, 1.0)
    np.testing.assert_allclose(found.sigma, 2.0)
