"""Mixtures of normal densities of different sizes, against scipy's normal law and quadrature."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from vgyro.fusion.heavy_tails.scale_mixture import BINS, ScaleMixture, fitted, histogram, middles

SIZES, SHARES = np.array([0.8, 2.0, 9.0]), np.array([0.7, 0.25, 0.05])


def density(x):
    return float(SHARES @ norm.pdf(x, scale=SIZES))


def slope(x):
    """f' of it."""
    return float(SHARES @ (-x / SIZES**2 * norm.pdf(x, scale=SIZES)))


def test_a_normal_density():
    # Closed form: f = φ, -f'/(x·f) = 1, Fisher's information 1.
    found = ScaleMixture.normal()
    square = np.array([1e-3, 0.5, 4.0, 100.0])
    np.testing.assert_allclose(found.weight(square), 1.0)
    np.testing.assert_allclose(found.log_density(square), norm.logpdf(np.sqrt(square)) + 0.5 * np.log(2 * np.pi))
    assert found.information == pytest.approx(1.0, rel=1e-3)
    assert found.parameters(100.0) == 0


def test_a_mixture():
    # Expected: scipy's densities, ∫ f'²/f by quadrature; weights between bins of 9 % are straight lines.
    found = ScaleMixture.of(SIZES, 2.0 * SHARES)
    x = np.array([0.1, 0.7, 2.0, 5.0, 20.0])
    log = np.log([density(one) for one in x]) + 0.5 * np.log(2 * np.pi)
    np.testing.assert_allclose(found.log_density(x**2), log, rtol=1e-9)
    np.testing.assert_allclose(found.weight(x**2), [-slope(one) / one / density(one) for one in x], rtol=0.01)
    information = 2.0 * quad(lambda one: slope(one) ** 2 / density(one), 0, 60, points=[1, 5, 20])[0]
    assert found.information == pytest.approx(information, rel=2e-3)
    # By definition: two numbers for each component but one, of those of half a sample or more.
    assert found.parameters(1000.0) == 4
    assert found.parameters(9.0) == 2
    assert len(ScaleMixture.of(np.ones(2), np.array([1.0, 1e-13])).sizes) == 1


def test_histogram():
    # By definition: bins of an eighth of an octave, from x² = 2⁻¹² on; what lies beyond is in the last.
    counts = histogram(np.array([0.0, 2.0**-12, 1.0, 1.05, 2.0**0.125, 1e300]))
    assert counts.sum() == 6
    assert np.flatnonzero(counts).tolist() == [0, 96, 97, BINS - 1]
    assert counts[[0, 96]].tolist() == [2.0, 2.0]
    assert middles()[96] == pytest.approx(2.0**0.0625)


@pytest.mark.parametrize("share", [0.0, 0.05])
def test_samples_far_off_are_told_from_none(share):
    # Truth: normal noise, and one sample in twenty of eight times the size: information of that mixture.
    rng = np.random.default_rng(1)
    x = rng.standard_normal(50_000) * np.where(rng.random(50_000) < share, 8.0, 1.0)
    found = fitted(histogram(x**2))
    far = found.sizes > 4.0
    assert found.shares[far].sum() == pytest.approx(share, abs=0.01)
    if share:
        truth = ScaleMixture.of(np.array([1.0, 8.0]), np.array([1 - share, share]))
        assert found.information == pytest.approx(truth.information, rel=0.02)
    else:
        assert found.information == pytest.approx(1.0, rel=0.02)
