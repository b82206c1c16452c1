"""The noise of an array as a model: fitted to Allan covariances, and drawn again."""

import math

import numpy as np
import pytest

from vgyro.metrics import CrossAllan
from vgyro.metrics.allan.coefficient_limits import Drawing
from vgyro.metrics.intervals import drift
from vgyro.metrics.intervals.drift import DriftModel, draw, fit_drift

TAU = 2.0 ** np.arange(10)
FLICKER = 2 * math.log(2) / math.pi
EDF = 1536.0 / TAU
WHITE = np.array([[1.0, 0.2, 0.6], [0.2, 1.5, 0.85], [0.6, 0.85, 0.725]])  # the third is the mean of the others
WALK = 1e-3 * np.array([[2.0, -0.5, 0.75], [-0.5, 1.0, 0.25], [0.75, 0.25, 0.5]])
NOTHING = np.zeros((3, 3))


def covariances(white: np.ndarray, flicker: np.ndarray, walk: np.ndarray) -> CrossAllan:
    each = TAU[:, None, None]
    covariance = white / each + FLICKER * flicker + walk * each / 3
    unknown = np.zeros_like(covariance)
    return CrossAllan(TAU, covariance, unknown, unknown, unknown, np.broadcast_to(EDF[:, None, None], covariance.shape))


@pytest.mark.parametrize("flicker", [NOTHING, 0.01 * WHITE], ids=["without flicker", "with flicker"])
def test_exact_covariances_give_their_terms(flicker):
    model = fit_drift(covariances(WHITE, flicker, WALK), 2)
    assert model is not None
    np.testing.assert_allclose(model.white, WHITE, atol=2e-3)
    np.testing.assert_allclose(model.flicker, flicker, atol=1.5e-3)
    np.testing.assert_allclose(model.walk, WALK, atol=1.5e-5)
    assert model.correlation(0)[0, 1] == pytest.approx(0.2 / math.sqrt(1.5), abs=2e-3)
    assert model.correlation(1e9)[0, 1] == pytest.approx(-0.5 / math.sqrt(2), abs=2e-2)


def test_weights_settle(monkeypatch):
    # Expected: the fit of ten passes; the weights of each are from the curve of the one before, those of the first from
    # the covariances as they were measured, whose errors they then share.
    rng = np.random.default_rng(1)
    exact = covariances(WHITE, NOTHING, WALK)
    errors = rng.chisquare(np.maximum(EDF, 2.0)) / np.maximum(EDF, 2.0)
    noisy = CrossAllan(TAU, exact.covariance * errors[:, None, None], *(4 * [exact.edf]))
    found = fit_drift(noisy, 2)
    monkeypatch.setattr(drift, "PASSES", 10)
    settled = fit_drift(noisy, 2)
    monkeypatch.setattr(drift, "PASSES", 1)
    first = fit_drift(noisy, 2)
    np.testing.assert_allclose(found.walk, settled.walk, rtol=0.03, atol=1e-6)
    assert not np.allclose(first.walk, settled.walk, rtol=0.06, atol=1e-6)


def test_white_noise_has_no_drift():
    model = fit_drift(covariances(WHITE, NOTHING, NOTHING), 2)
    assert model is not None
    assert not model.drifts
    np.testing.assert_allclose(model.white, WHITE, rtol=1e-9)
    assert fit_drift(covariances(WHITE, NOTHING, NOTHING), 2, shortest=100.0) is None
    assert fit_drift(covariances(NOTHING, NOTHING, NOTHING), 2) is None


@pytest.mark.parametrize(
    ("white", "walk", "mean", "within"),
    [(1.0, 0.0, 1 / 512, 1.0 - 1 / 512), (0.0, 1.0, 512 / 3, 512 / 6)],
    ids=["white noise", "random walk"],
)
def test_what_is_drawn_has_the_variances_of_the_model(white, walk, mean, within):
    # Closed forms over 512 s of 1 s means: N²/T and K²T/3 for the mean, N²/1 s and K²T/6 about it. The size is hardly
    # in doubt: a billion degrees of freedom.
    one = np.ones((1, 1))
    model = DriftModel(white * one, 0 * one, walk * one, 1e9)
    drawn = draw(model, 1, 512.0, TAU[:8], 1.0, Drawing(1000, 1))
    # 1000 draws: 4.5 % of a variance with one degree of freedom.
    assert np.mean(drawn.mean**2) == pytest.approx(mean, rel=0.15)
    assert np.mean(drawn.variance) == pytest.approx(within, rel=0.15)
    np.testing.assert_allclose(drawn.variance_expected.mean(), np.mean(drawn.variance), rtol=1e-3)
    wanted = white / 128 if white else walk / 3
    np.testing.assert_allclose(drawn.lowest_expected**2, wanted, rtol=1e-3)
    assert np.median(drawn.lowest**2) == pytest.approx(wanted, rel=0.3)


def test_flicker_alone_and_what_is_not_known_of_its_size():
    # Closed form: σ² = (2 ln2/π)B² at any τ. With ν degrees of freedom the size scatters as ν/χ².
    one = np.ones((1, 1))
    sure = draw(DriftModel(0 * one, one, 0 * one, 1e9), 1, 512.0, TAU[:8], 1.0, Drawing(300, 2))
    np.testing.assert_allclose(sure.lowest_expected**2, FLICKER, rtol=1e-3)
    doubtful = draw(DriftModel(0 * one, one, 0 * one, 5.0), 1, 512.0, TAU[:8], 1.0, Drawing(2000, 2))
    # Median of χ² with 5 degrees of freedom: 4.351.
    assert np.median(doubtful.variance_expected) == pytest.approx(np.mean(sure.variance) * 5 / 4.351, rel=0.06)


def test_poses_do_not_share_their_noise():
    # Eight stretches of a random walk: about each one's own mean K²·64/6; the mean of all has an eighth of K²·64/3.
    one = np.ones((1, 1))
    drawn = draw(DriftModel(0 * one, 0 * one, one, 1e9), 8, 64.0, TAU[:5], 1.0, Drawing(500, 3))
    assert np.mean(drawn.variance) == pytest.approx(64 / 6, rel=0.1)
    assert np.mean(drawn.mean**2) == pytest.approx(64 / 3 / 8, rel=0.2)
