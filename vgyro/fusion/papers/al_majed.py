"""Multi-filter adaptive estimation of the rate, in the style of Al-Majed & Alsuwaidan (2009).

The paper itself could not be read. What is known of it: a bank of Kalman filters for different correlations of the
gyros' noise, weighted by how probable their innovations are. All else is inferred: see INFERRED.
"""

from __future__ import annotations

import numpy as np

from vgyro import engine as engines
from vgyro.fusion import design
from vgyro.fusion.types import ArrayNoise, ArrayRates, CannotRun, FilterParameters, Fused, cannot_run

INFERRED = (
    "the whole bank; rate: random walk; one correlation for every pair of gyros, with the measured ARW; process noises "
    "from multiples of the configured bandwidth; equal probabilities at the start, none below 1e-4 later; biases are "
    "not estimated"
)
LEAST = 1e-4
"""Below it no member's probability falls, so that each can come back."""
DIFFUSE = 100.0
"""Standard deviation of the rate at the start, over that of the noise of a sample."""


def al_majed(array: ArrayRates, parameters: FilterParameters) -> Fused:
    """Σ p·w over a bank of random-walk filters, one for each correlation ρ_j and process noise q_k.

    R_j = diag(ARW)·C(ρ_j)·diag(ARW)/T, C(ρ) with ρ off its diagonal, for ρ of `bank_correlations`. q_k = m_k²·q for m
    of `bank_bandwidths`; q is `parameters.q` or what gives `bandwidth_hz` with the measured R (bandwidth ∝ √q).
    After each sample p_jk ∝ p_jk·|S|^-½·exp(-½e'S⁻¹e), none below LEAST before they are made to add up to 1. Each
    member has its own time-varying variance. They start equally probable, from the mean of the first sample with
    DIFFUSE times the s.d. of a sample; after a gap the rates start anew and the probabilities are kept.

    A constant rate adds itself: the members start at the mean of the first sample, so by induction each x_jk rises by
    that rate; the innovations e, hence p, stay as they are; and Σp = 1.
    """
    noise = array.noise.with_arw(parameters.arw)
    covariances = np.array([_covariance(noise, one) for one in parameters.bank_correlations]) / array.period
    q = _process_noise(noise, parameters)
    multiples = np.array(parameters.bank_bandwidths)
    members = len(covariances), len(multiples)
    probability = np.full(members, 1.0 / (members[0] * members[1]))
    run = engines.get(parameters.engine).adaptive.filter_bank

    fused, average = np.empty(len(array.rate)), np.zeros(members)
    variance = DIFFUSE**2 * float(np.max(covariances[0].diagonal()))
    for part in array.stretches():
        start = float(np.mean(array.rate[part.start], dtype=float))
        fused[part], probability, mean = run(
            array.rate[part], covariances, multiples**2 * q * array.period, start, variance, probability, LEAST
        )
        average += mean * (part.stop - part.start) / len(fused)
    return Fused(fused, note=_note(parameters, q, probability, average), passes=0)


def operations(gyros: int) -> float:
    """Floating-point operations a sample of the default bank of 3 x 3 filters; an exponential counts 40."""
    noises = len(FilterParameters.bank_correlations)
    members = noises * len(FilterParameters.bank_bandwidths)
    others = gyros - 1
    return float(others + noises * others * (gyros + 4) + members * (17 + 40 + 9))


def _covariance(noise: ArrayNoise, correlation: float) -> np.ndarray:
    """Continuous covariance [N, N] with one correlation for every pair."""
    gyros = len(noise.arw)
    unknown = np.flatnonzero(~(np.isfinite(noise.arw) & (noise.arw > 0)))
    if len(unknown):
        which = ", ".join(str(index + 1) for index in unknown)
        raise CannotRun(f"no angle random walk was found for gyro {which} of {gyros}")
    if not -1.0 / (gyros - 1) < correlation < 1.0:
        raise CannotRun(
            f"{gyros} gyros cannot all have the correlation {correlation:g} with each other: no positive definite R",
            "fusion.bank_correlations",
            f"give values above {-1.0 / (gyros - 1):.4g} and below 1",
        )
    return np.outer(noise.arw, noise.arw) * ((1.0 - correlation) * np.eye(gyros) + correlation)


def _process_noise(noise: ArrayNoise, parameters: FilterParameters) -> float:
    if parameters.q is not None:
        return parameters.q
    with cannot_run():
        return design.q_for_bandwidth(design.information(noise.R), parameters.bandwidth_hz)


def _note(parameters: FilterParameters, q: float, last: np.ndarray, average: np.ndarray) -> str:
    """Parameters, and the probabilities after the last sample and on average."""
    correlations = _shares("ρ", parameters.bank_correlations, last.sum(axis=1), average.sum(axis=1))
    bandwidths = _shares("×", parameters.bank_bandwidths, last.sum(axis=0), average.sum(axis=0))
    return f"q = {q:.4g} deg²/s³ at ×1; probabilities at the end (on average): {correlations}; {bandwidths}"


def _shares(sign: str, values: tuple[float, ...], last: np.ndarray, average: np.ndarray) -> str:
    rows = zip(values, last, average, strict=True)
    return ", ".join(f"{sign} {value:g}: {now:.3f} ({mean:.3f})" for value, now, mean in rows)
