"""Weights of the native engine, against exact arithmetic, quadprog, scipy and the reference engine."""

from fractions import Fraction

import numpy as np
import pytest
from quadprog import solve_qp

from vgyro.engine.covariance import usable
from vgyro.engine.independent import nnls_weights
from vgyro.engine.models import DccModel
from vgyro.engine.native import weights
from vgyro.engine.reference import weights as reference
from vgyro.errors import EngineError
from vgyro.volatility.check import covariance_after


def scaled(correlation, deviation):
    """Covariance of a correlation; exactly symmetric."""
    covariance = correlation * np.outer(deviation, deviation)
    return (covariance + covariance.T) / 2


def random_correlation(rng, n, extra=3):
    draw = rng.standard_normal((n, n + extra))
    covariance = draw @ draw.T
    size = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(size, size)
    np.fill_diagonal(correlation, 1.0)
    return correlation


def hard_problems(count, n=6, spread=4.0, seed=1):
    """Covariances [count, n, n] in turn: of condition up to 1e10; equal correlations up to .99999; one factor with
    signs. Standard deviations differ by up to 10**spread."""
    rng = np.random.default_rng(seed)
    found = []
    for kind in np.arange(count) % 3:
        if kind == 0:
            rotation = np.linalg.qr(rng.standard_normal((n, n)))[0]
            covariance = (rotation * 10 ** (-rng.uniform(0, 10) * np.linspace(0, 1, n))) @ rotation.T
        elif kind == 1:
            rho = 1 - 10 ** -rng.uniform(0.3, 5)
            covariance = np.full((n, n), rho) + (1 - rho) * np.eye(n)
        else:
            load = np.sqrt(1 - 10 ** -rng.uniform(0.3, 5, n)) * rng.choice([-1, 1], n)
            covariance = np.outer(load, load)
            np.fill_diagonal(covariance, 1.0)
        size = np.sqrt(np.diag(covariance))
        found.append(scaled(covariance / np.outer(size, size), 10 ** rng.uniform(0, spread, n)))
    return np.array(found)


def by_quadprog(H):
    """Goldfarb and Idnani's dual method, on the problem scaled to a unit diagonal, without which it often gives up."""
    size = np.sqrt(np.diag(H))
    constraints = np.column_stack([size.min() / size, np.eye(len(H))])
    bounds = np.append(1.0, np.zeros(len(H)))
    return solve_qp(H / np.outer(size, size), np.zeros(len(H)), constraints, bounds, 1)[0] * size.min() / size


def exactly(H, support):
    """H w = λ on the support, Σw = 1, in rational arithmetic: w, and Hw - λ of all rows."""
    index = np.flatnonzero(support)
    exact = [[Fraction(float(value)) for value in row] for row in H]
    rows = [[exact[i][j] for j in index] + [Fraction(1)] for i in index]
    for column in range(len(rows)):
        for row in range(len(rows)):
            if row != column:
                factor = rows[row][column] / rows[column][column]
                rows[row] = [x - factor * y for x, y in zip(rows[row], rows[column], strict=True)]
    solution = [row[-1] / row[k] for k, row in enumerate(rows)]
    w = [Fraction(0)] * len(H)
    for i, value in zip(index, solution, strict=True):
        w[i] = value / sum(solution)
    return w, [sum(h * x for h, x in zip(row, w, strict=True)) - 1 / sum(solution) for row in exact]


def test_kkt_conditions_of_hard_problems():
    # Expected: Hw = λ where w > 0, Hw >= λ elsewhere, λ = w'Hw, evaluated in extended precision. Row i in units of
    # √(h_ii · min h): rounding of w alone moves it by about 1e-16 of that.
    H = hard_problems(5000)
    w = weights.min_variance_weights(H)
    assert np.linalg.cond(H / np.sqrt(np.einsum("kii,kjj->kij", H, H))).max() > 5e9
    assert 0.5 < (w == 0).any(axis=1).mean() < 1
    assert (w >= 0).all()
    np.testing.assert_allclose(w.sum(axis=1), 1.0, atol=1e-15)
    gradient = np.einsum("kij,kj->ki", H.astype(np.longdouble), w.astype(np.longdouble))
    excess = gradient - np.einsum("ki,ki->k", gradient, w)[:, None]
    variance = np.einsum("kii->ki", H)
    residual = np.where(w > 0, np.abs(excess), np.maximum(-excess, 0))
    assert (residual / np.sqrt(variance * variance.min(axis=1, keepdims=True))).max() < 1e-14


def test_kkt_residual_in_units_of_the_smallest_variance():
    H = hard_problems(5000, spread=2.0, seed=2)
    w = weights.min_variance_weights(H).astype(np.longdouble)
    gradient = np.einsum("kij,kj->ki", H.astype(np.longdouble), w)
    excess = gradient - np.einsum("ki,ki->k", gradient, w)[:, None]
    residual = np.where(w > 0, np.abs(excess), np.maximum(-excess, 0)).max(axis=1)
    assert (residual / np.einsum("kii->ki", H).min(axis=1)).max() < 1e-12


def test_against_quadprog():
    H = hard_problems(5000)
    np.testing.assert_allclose(weights.min_variance_weights(H), [by_quadprog(matrix) for matrix in H], atol=1e-8)


def test_against_exact_arithmetic():
    # Expected: the KKT conditions of rational arithmetic hold on the support, and its weights.
    H = hard_problems(300, seed=3)
    for matrix, w in zip(H, weights.min_variance_weights(H), strict=True):
        expected, excess = exactly(matrix, w > 0)
        assert min(expected) >= 0
        assert min(excess) >= 0
        np.testing.assert_allclose(w, np.array(expected, dtype=float), atol=5e-14)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 6, 7, 12, 32])
def test_any_number_of_gyros(n):
    # Expected: scipy.optimize.nnls on the equivalent least-squares problem.
    rng = np.random.default_rng(n)
    H = np.array([scaled(random_correlation(rng, n), np.exp(0.5 * rng.standard_normal(n))) for _ in range(101)])
    np.testing.assert_allclose(weights.min_variance_weights(H), [nnls_weights(matrix) for matrix in H], atol=1e-12)


def test_ties_by_hand():
    # Expected: Hw = λ holds for a gyro of weight zero, too: it lies on the border between two supports.
    H = np.array([[[1, 1], [1, 2]], [[2, 1], [1, 1]], [[1, 0.5], [0.5, 0.5]], [[1, 0], [0, 1]]], dtype=float)
    expected = [[1, 0], [0, 1], [0, 1], [0.5, 0.5]]
    np.testing.assert_array_equal(weights.min_variance_weights(H), expected)
    three = np.array([[[1, 1, 1], [1, 2, 1.5], [1, 1.5, 3]]], dtype=float)
    np.testing.assert_array_equal(weights.min_variance_weights(three), [[1, 0, 0]])


def test_what_cannot_be_used_has_no_weights():
    rng = np.random.default_rng(4)
    H = np.array([random_correlation(rng, 4) for _ in range(30)])
    vectors = np.linalg.qr(rng.standard_normal((4, 4)))[0]
    H[1], H[2, 0, 0], H[3, 2, 1], H[4, 0, 0], H[5, 1, 1] = np.nan, np.inf, np.nan, 0.0, -1.0
    H[6], H[7] = 1.0, 0.0
    for k, smallest in enumerate([1e-10, 1e-11, 4e-12, 2e-13, 0.0, -1e-12, -0.1], start=8):
        H[k] = (vectors * [smallest, 0.3, 1.0, 2.0]) @ vectors.T
    H[3] = (H[3] + H[3].T) / 2
    expected = usable((H + H.transpose(0, 2, 1)) / 2)
    assert 10 < expected.sum() < 25
    np.testing.assert_array_equal(np.isfinite(weights.min_variance_weights(H)).all(axis=1), expected)


def path(count, n=6):
    """Covariances that follow from one another, with supports that change."""
    rng = np.random.default_rng(7)
    time = np.arange(count)[:, None] / 40
    deviation = np.exp(0.8 * np.sin(time * rng.uniform(0.5, 2, n) + rng.uniform(0, 6, n)))
    return random_correlation(rng, n, 30) * deviation[:, :, None] * deviation[:, None, :]


@pytest.mark.parametrize("H", [path(2501), hard_problems(2501), hard_problems(1100, n=9)], ids=["path", "hard", "nine"])
def test_the_bits_do_not_depend_on_the_batch(H):
    together = weights.min_variance_weights(H)
    assert len(np.unique(together > 0, axis=0)) > 5
    order = np.random.default_rng(0).permutation(len(H))
    np.testing.assert_array_equal(weights.min_variance_weights(H[order]), together[order])
    for start, stop in ((0, 1), (3, 5), (7, 1030), (100, 1099)):
        np.testing.assert_array_equal(weights.min_variance_weights(H[start:stop]), together[start:stop])


def windows(count, length, inside, n, seed=5):
    """Arguments of conditional_weights but begin and end: every third window has constant correlation."""
    rng = np.random.default_rng(seed)
    r = 0.05 * rng.standard_normal((count, length, n))
    alpha, beta = rng.uniform(0, 0.2, (count, n)), rng.uniform(0, 0.75, (count, n))
    a, b = rng.uniform(0, 0.1, count), rng.uniform(0, 0.85, count)
    a[::3] = 0.0
    target = np.array([random_correlation(rng, n) for _ in range(count)])
    return [r, inside, 10 ** rng.uniform(-5, -3, (count, n)), alpha, beta, a, b, target]


@pytest.mark.parametrize("n", [1, 2, 5, 6, 9])
def test_the_path_against_the_reference_engine(n):
    # Expected: SciPy's filters for h and Q, cvxpy for the weights.
    given = windows(7, 60, 40, n)
    given[0][2, 0] = np.nan
    given[0][5, :3, 0] = np.nan
    found = weights.conditional_weights(*given, 0, 60)
    expected = reference.conditional_weights(*given, 0, 60)
    np.testing.assert_allclose(found.weights, expected.weights, atol=1e-11)
    np.testing.assert_allclose(found.deviation, expected.deviation, rtol=1e-12)
    np.testing.assert_allclose(found.sigma, expected.sigma, rtol=1e-12)
    assert found.good.all()
    np.testing.assert_array_equal(found.good, expected.good)


def test_the_path_against_plain_loops():
    # Expected: vgyro.volatility.check, the recursions once more as loops, and scipy.optimize.nnls.
    given = windows(5, 81, 80, 6)
    found = weights.conditional_weights(*given, 79, 81)
    for k in range(5):
        r, _, omega, alpha, beta, a, b, target = (x if isinstance(x, int) else x[k] for x in given)
        path = covariance_after(r[:80], DccModel(omega, alpha, beta, a, b if a else 0.0, target))
        for t, H in enumerate(path):
            w = nnls_weights(H)
            np.testing.assert_allclose(found.weights[k, t], w, atol=1e-10)
            np.testing.assert_allclose(found.deviation[k, t], np.sqrt(np.diag(H)), rtol=1e-12)
            assert found.sigma[k, t] == pytest.approx(np.sqrt(w @ H @ w), rel=1e-10)


def test_the_path_does_not_depend_on_the_batch_or_on_where_it_begins():
    given = windows(37, 50, 40, 6)
    given[0][3, 0] = np.nan
    whole = weights.conditional_weights(*given, 0, 50)
    part = weights.conditional_weights(*given, 30, 45)
    some = weights.conditional_weights(*(x if isinstance(x, int) else x[[30, 3, 8]] for x in given), 10, 50)
    for name in ("weights", "deviation", "sigma", "good"):
        np.testing.assert_array_equal(getattr(part, name), getattr(whole, name)[:, 30:45])
        np.testing.assert_array_equal(getattr(some, name), getattr(whole, name)[[30, 3, 8], 10:])


def test_windows_may_overlap_in_memory():
    given = windows(4, 50, 40, 3)
    series = np.random.default_rng(1).standard_normal((100, 3))
    view = np.lib.stride_tricks.sliding_window_view(series, 50, axis=0)[::10][:4].transpose(0, 2, 1)
    assert view.strides[1:] == (24, 8)
    for r in (view, np.asfortranarray(view), view.astype(np.float32)):
        given[0] = r
        found = weights.conditional_weights(*given, 30, 50)
        given[0] = np.array(r, dtype=float)
        np.testing.assert_array_equal(found.weights, weights.conditional_weights(*given, 30, 50).weights)


def test_equal_weights_where_the_covariance_cannot_be_used():
    given = windows(6, 30, 20, 3)
    given[0][1, 25, 2] = np.nan  # all that comes after
    given[7][2] = 1.0  # S is singular
    given[5][2] = 0.0
    found = weights.conditional_weights(*given, 0, 30)
    expected = np.ones((6, 30), dtype=bool)
    expected[1, 26:] = expected[2] = False
    np.testing.assert_array_equal(found.good, expected)
    np.testing.assert_array_equal(found.weights[~found.good], 1 / 3)
    np.testing.assert_array_equal(reference.conditional_weights(*given, 0, 30).good, expected)


def test_no_window_and_no_sample():
    assert weights.conditional_weights(*windows(2, 30, 20, 3), 7, 7).weights.shape == (2, 0, 3)
    nothing = [x[:0] if np.ndim(x) else x for x in windows(2, 30, 20, 3)]
    assert weights.conditional_weights(*nothing, 3, 7).good.shape == (0, 4)


def test_what_the_engine_refuses():
    with pytest.raises(EngineError, match="1 to 32 gyros, not 33"):
        weights.min_variance_weights(np.eye(33)[None])
    with pytest.raises(EngineError, match="samples 5 to 31"):
        weights.conditional_weights(*windows(2, 30, 20, 3), 5, 31)
