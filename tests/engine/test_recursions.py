"""The recursions in NumPy: sample by sample, and by scipy.signal, to the bit."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.signal

from vgyro.engine import recursions


@pytest.mark.parametrize("samples", [1, 2, 400])
def test_both_ways_give_the_same_bits(samples: int, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(11)
    r = rng.standard_normal((samples, 4))
    omega, alpha, beta = (rng.uniform(0.0, 0.4, 4) for _ in range(3))
    target = np.full((4, 4), 0.2) + 0.8 * np.eye(4)

    def found() -> tuple[np.ndarray, np.ndarray]:
        return recursions.garch_variance(r, omega, alpha, beta), recursions.dcc_q(r, 0.03, 0.95, target)

    by_loop = found()
    monkeypatch.setattr(recursions, "SHORT", 0)
    by_scipy = found()
    for one, other in zip(by_scipy, by_loop, strict=True):
        np.testing.assert_array_equal(one, other)
        assert one.strides == other.strides
    expected = omega + (alpha + beta) * np.mean(r**2, axis=0)
    for t in range(samples):
        np.testing.assert_allclose(by_loop[0][t], expected, rtol=1e-12)
        expected = omega + alpha * r[t] ** 2 + beta * expected


def test_only_a_short_series_goes_sample_by_sample(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recursions, "SHORT", 10)
    calls = []

    def recorded(*given: np.ndarray) -> np.ndarray:
        calls.append(len(given[-1]))
        return given[-1]

    monkeypatch.setattr(scipy.signal, "lfilter", recorded)
    for samples in (10, 11):
        recursions.garch_variance(np.ones((samples, 1)), *np.full((3, 1), 0.1))
    assert calls == [11]
