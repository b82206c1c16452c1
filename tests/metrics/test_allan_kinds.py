"""Modified, Hadamard and robust Allan deviations: published figures, Stable32, allantools, closed forms."""

import allantools
import numpy as np
import pytest

from vgyro import engine
from vgyro.engine import ENGINES
from vgyro.errors import TooShort
from vgyro.metrics import allan_deviation

NBS14_PHASE = [0.0, 103.11111, 123.22222, 157.33333, 166.44444, 48.55555, -96.33333, -2.22222, 111.88889, 0.0]

# Riley, NIST SP 1065, tables 30 and 31, as reprinted in the tests of allantools: σ at τ = 1, 2 and at τ = 1, 10, 100.
TEN_POINTS = {
    "overlapping": [91.22945, 85.95287],
    "modified": [91.22945, 74.78849],
    "hadamard": [70.80607, 85.61487],
}
THOUSAND_POINTS = {
    "overlapping": [2.922319e-01, 9.159953e-02, 3.241343e-02],
    "modified": [2.922319e-01, 6.172376e-02, 2.170921e-02],
    "hadamard": [2.943883e-01, 9.581083e-02, 3.237638e-02],
}
# Non-overlapping ones, which are those of block means at τ = 1 block.
TEN_POINTS_APART = {"overlapping": 115.8082, "hadamard": 116.7980}
THOUSAND_POINTS_APART = {
    "overlapping": [9.965736e-02, 3.897804e-02],
    "hadamard": [1.052754e-01, 3.910860e-02],
}

# Stable32 1.60 on PHASE.DAT (the phase of the 1000 points without their mean), as kept by the tests of allantools:
# τ, σ and its limits at a confidence of 0.683, white noise given.
STABLE32 = {
    "overlapping": [
        (1, 2.8515e-01, 2.9223e-01, 2.9987e-01), (2, 1.9520e-01, 2.0102e-01, 2.0738e-01),
        (4, 1.3931e-01, 1.4479e-01, 1.5098e-01), (8, 1.0038e-01, 1.0570e-01, 1.1198e-01),
        (16, 5.7696e-02, 6.1915e-02, 6.7217e-02), (32, 4.3654e-02, 4.8082e-02, 5.4202e-02),
        (64, 3.1755e-02, 3.6237e-02, 4.3377e-02), (128, 2.3045e-02, 2.7674e-02, 3.7027e-02),
    ],
    "modified": [
        (1, 2.8515e-01, 2.9223e-01, 2.9987e-01), (2, 1.5336e-01, 1.5821e-01, 1.6355e-01),
        (4, 1.0322e-01, 1.0780e-01, 1.1304e-01), (8, 6.9840e-02, 7.4192e-02, 7.9481e-02),
        (16, 3.8022e-02, 4.1376e-02, 4.5809e-02), (32, 3.0466e-02, 3.4255e-02, 3.9933e-02),
        (64, 2.3687e-02, 2.7871e-02, 3.5511e-02), (128, 1.4874e-02, 1.8669e-02, 2.8584e-02),
    ],
    "hadamard": [
        (1, 2.8635e-01, 2.9439e-01, 3.0315e-01), (2, 1.9491e-01, 2.0125e-01, 2.0825e-01),
        (4, 1.3777e-01, 1.4368e-01, 1.5043e-01), (8, 1.0388e-01, 1.0987e-01, 1.1704e-01),
        (16, 5.6173e-02, 6.0638e-02, 6.6369e-02), (32, 4.0664e-02, 4.5095e-02, 5.1382e-02),
        (64, 2.9271e-02, 3.3824e-02, 4.1477e-02), (128, 2.3761e-02, 2.9147e-02, 4.1367e-02),
    ],
}  # fmt: skip

ESTIMATORS = {
    "overlapping": (allantools.oadev, 2, False),
    "modified": (allantools.mdev, 2, True),
    "hadamard": (allantools.ohdev, 3, False),
}


def nbs14_series() -> np.ndarray:
    """The 1000 values of NBS Monograph 140, by its generator."""
    values = [1234567890]
    for _ in range(999):
        values.append(16807 * values[-1] % 2147483647)
    return np.array(values) / 2147483647


@pytest.mark.parametrize("name", ENGINES)
@pytest.mark.parametrize("kind", TEN_POINTS)
def test_nbs14(kind: str, name: str):
    ten = allan_deviation(np.diff(NBS14_PHASE), 1.0, np.array([1.0, 2.0]), kind=kind, engine=name)
    np.testing.assert_allclose(ten.deviation, TEN_POINTS[kind], rtol=1e-6)
    thousand = allan_deviation(nbs14_series(), 1.0, np.array([1.0, 10.0, 100.0]), kind=kind, engine=name)
    np.testing.assert_allclose(thousand.deviation, THOUSAND_POINTS[kind], rtol=1e-6)
    assert thousand.kind == kind


@pytest.mark.parametrize("kind", TEN_POINTS_APART)
def test_nbs14_without_overlap(kind: str):
    pairs = np.diff(NBS14_PHASE)[:8].reshape(4, 2).mean(axis=1)
    one = allan_deviation(pairs, 1.0, np.array([1.0]), kind=kind)
    np.testing.assert_allclose(one.deviation, TEN_POINTS_APART[kind], rtol=1e-6)
    for length, expected in zip((10, 100), THOUSAND_POINTS_APART[kind], strict=True):
        means = nbs14_series().reshape(-1, length).mean(axis=1)
        one = allan_deviation(means, 1.0, np.array([1.0]), kind=kind)
        np.testing.assert_allclose(one.deviation, expected, rtol=1e-6)


@pytest.mark.parametrize("name", ENGINES)
@pytest.mark.parametrize("kind", STABLE32)
def test_stable32(kind: str, name: str):
    rate, rows = nbs14_series(), np.array(STABLE32[kind])
    curve = allan_deviation(rate, 1.0, rows[:, 0], kind=kind, engine=name)
    np.testing.assert_allclose(curve.deviation, rows[:, 2], rtol=1e-4)
    allan = engine.get(name).allan
    edf = np.array([float(allan.degrees_of_freedom(0, int(m), 1000, kind)) for m in rows[:, 0]])
    low, high = allan.limits(curve.deviation, edf, 0.6826894921370859)
    np.testing.assert_allclose(low, rows[:, 1], rtol=1e-3)
    np.testing.assert_allclose(high, rows[:, 3], rtol=1e-3)


@pytest.mark.parametrize("name", ENGINES)
@pytest.mark.parametrize("kind", ESTIMATORS)
@pytest.mark.parametrize("power", [0, -2, 2])
def test_equals_allantools(kind: str, name: str, power: int):
    white = np.random.default_rng(1).standard_normal(5001)
    rate = {0: white, -2: np.cumsum(white), 2: np.diff(white)}[power]
    curve = allan_deviation(rate, 50.0, engine=name, kind=kind)
    estimator, d, modified = ESTIMATORS[kind]
    _, expected, _, _ = estimator(rate, 50.0, "freq", taus=curve.tau)
    np.testing.assert_allclose(curve.deviation, expected, rtol=1e-9)
    steepest = -3 if kind == "hadamard" else -2
    for tau, value, low, high, edf, alpha in zip(
        curve.tau, curve.deviation, curve.low, curve.high, curve.edf, curve.exponent, strict=True
    ):
        # The formula for white noise of the angle ends where all differences overlap.
        m, alpha = round(tau * 50), max(int(alpha), steepest)
        alpha = 1 if alpha == 2 and not modified and len(rate) + 1 <= 2 * d * m else alpha
        theirs = allantools.edf_greenhall(alpha, d, m, len(rate) + 1, overlapping=True, modified=modified)
        assert edf == pytest.approx(theirs, rel=1e-6)
        assert (low, high) == pytest.approx(allantools.confidence_interval(value, theirs, 0.95), rel=1e-6)


def test_modified_white_noise_closed_form():
    # N²/τ·(m² + 1)/2m², Lesage & Ayi (1984): half of the Allan variance at long τ.
    curve = allan_deviation(np.random.default_rng(2).standard_normal(200_000), 1.0, kind="modified")
    m = curve.tau
    expected = np.sqrt((m**2 + 1) / (2 * m**3))
    assert np.all(np.abs(curve.deviation / expected - 1) < 5 / np.sqrt(2 * curve.edf))


@pytest.mark.parametrize("name", ENGINES)
def test_a_constant_drift_of_the_rate_is_nothing_to_hadamard(name: str):
    white = np.random.default_rng(3).standard_normal(20_000)
    with_drift = white + 1e-3 * np.arange(20_000)
    still, drifting = (allan_deviation(rate, 1.0, kind="hadamard", engine=name) for rate in (white, with_drift))
    np.testing.assert_allclose(drifting.deviation, still.deviation, rtol=1e-6)
    plain = allan_deviation(with_drift, 1.0)
    # R τ/√2 at the longest τ.
    assert plain.deviation[-1] == pytest.approx(1e-3 * plain.tau[-1] / np.sqrt(2), rel=0.05)


@pytest.mark.parametrize("kind", ["modified", "hadamard"])
def test_stretches_are_pooled(kind: str):
    # Sums over stretches: weighted by their counts, from allantools stretch by stretch.
    rate = np.random.default_rng(4).standard_normal(5000)
    segment = np.repeat([0, 1], [3000, 2000])
    curve = allan_deviation(rate + 100 * segment, 10.0, np.array([0.1, 1.0, 20.0]), segment, kind=kind)
    estimator, _, _ = ESTIMATORS[kind]
    (_, one, _, n), (_, two, _, k) = (
        estimator(part, 10.0, "freq", taus=curve.tau) for part in (rate[:3000], rate[3000:])
    )
    np.testing.assert_allclose(curve.deviation**2, (n * one**2 + k * two**2) / (n + k), rtol=1e-9)


def outliers(rng: np.random.Generator, rate: np.ndarray, share: float) -> np.ndarray:
    """rate with single samples 10 to 100 standard deviations off."""
    found = rate.copy()
    at = rng.choice(rate.size, int(share * rate.size), replace=False)
    found[at] += rng.choice([-1, 1], at.size) * rng.uniform(10, 100, at.size)
    return found


@pytest.mark.parametrize("share", [0.001, 0.01])
def test_outliers_hardly_move_the_robust_one(share: float):
    # Known truth: white noise and random walk, within five standard errors. The same series without outliers differs by
    # less than 3 % below 10 s; the overlapping one reads 1.5 and more for 1.
    rng = np.random.default_rng(5)
    rate = rng.standard_normal(200_000) + np.cumsum(0.002 * rng.standard_normal(200_000))
    spoiled = outliers(rng, rate, share)
    clean, robust = (allan_deviation(series, 200.0, kind="robust") for series in (rate, spoiled))
    m = robust.tau * 200
    truth = np.sqrt(1 / m + 0.002**2 * m / 3 * (1 + 1 / (2 * m**2)))
    error = 1 / np.sqrt(2 * robust.edf)
    assert np.all(np.abs(robust.deviation / truth - 1) < 5 * error)
    assert np.all(np.abs(robust.deviation / clean.deviation - 1)[m < 2000] < 0.03)
    plain = allan_deviation(spoiled, 200.0)
    assert plain.deviation[0] > 1.5


def test_a_heavy_stretch_hardly_moves_the_robust_one():
    # A hundredth of the recording has ten times the noise: the mean square doubles, the median hardly rises.
    rate = np.random.default_rng(6).standard_normal(200_000)
    rate[70_000:72_000] *= 10
    robust, plain = (allan_deviation(rate, 200.0, np.array([0.005, 0.1]), kind=k) for k in ("robust", "overlapping"))
    np.testing.assert_allclose(robust.deviation * np.sqrt(robust.tau * 200), 1, atol=0.04)
    assert np.all(plain.deviation * np.sqrt(plain.tau * 200) > 1.3)


@pytest.mark.parametrize("kind", ["modified", "hadamard", "robust"])
def test_limits_cover_the_truth(kind: str):
    # Chi² limits of white noise at τ = 20 of 1000: 95 % of 300 series, ± 3 binomial standard deviations.
    rng, inside = np.random.default_rng(7), 0
    truth = {"modified": np.sqrt(401 / (2 * 20**3)), "hadamard": 20**-0.5, "robust": 20**-0.5}[kind]
    for _ in range(300):
        curve = allan_deviation(rng.standard_normal(1000), 1.0, taus=np.array([20.0]), kind=kind)
        inside += curve.low[0] <= truth <= curve.high[0]
    assert inside >= 0.95 * 300 - 11


@pytest.mark.full
@pytest.mark.parametrize("kind", ["overlapping", "modified", "hadamard", "robust"])
@pytest.mark.parametrize("power", [0, -2])
def test_degrees_of_freedom_are_those_of_many_series(kind: str, power: int):
    # Var(σ²) = 2σ⁴/edf, over 600 series of known noise; its own standard error is 6 %. Those of the robust one are a
    # lower bound (docstring of metrics.robust): they may be half of the true ones.
    taus, rng, squares, edf = np.array([1.0, 8.0, 64.0]), np.random.default_rng(8), [], []
    for _ in range(600):
        white = rng.standard_normal(1000)
        curve = allan_deviation(np.cumsum(white) if power else white, 1.0, taus, kind=kind)
        squares.append(curve.deviation**2)
        edf.append(curve.edf)
    spread = np.var(squares, axis=0) / np.mean(squares, axis=0) ** 2 * np.median(edf, axis=0) / 2
    assert np.all(spread < 1.25)
    assert np.all(spread > (0.4 if kind == "robust" else 0.75))


def test_constant_too_short_and_unknown():
    for kind in ("modified", "hadamard", "robust"):
        assert not allan_deviation(np.full(3000, 3.0), 10.0, kind=kind).high.any()
        with pytest.raises(TooShort):
            allan_deviation(np.array([1.0, 2.0]), 1.0, kind=kind)
        with pytest.raises(TooShort):
            allan_deviation(np.empty(0), 1.0, kind=kind)
    with pytest.raises(ValueError, match="kind 'total'"):
        allan_deviation(np.arange(9.0), 1.0, kind="total")
