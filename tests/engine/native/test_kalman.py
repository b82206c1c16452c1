"""Filters and smoother of the native engine, against filterpy, scipy and closed forms."""

import os
import subprocess
import sys
from functools import partial

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from vgyro import engine
from vgyro.engine.native import kalman
from vgyro.errors import DataError, EngineError

TRANSITION, START, VARIANCE = 0.999, 1.0, 4.0


def measured(samples=203, gyros=6, seed=1, level=100.0):
    """A random walk that N gyros measure, with a covariance of their own for each sample."""
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((samples, gyros, gyros + 2)) * 0.1
    noise = root @ root.transpose(0, 2, 1)
    rate = level + 0.01 * np.cumsum(rng.standard_normal(samples))[:, None] + 0.1 * rng.standard_normal((samples, gyros))
    return rate, noise, 1e-4 * rng.uniform(0.5, 2.0, samples)


def by_filterpy(rate, transition, process, noise, start, variance):
    filter_ = KalmanFilter(dim_x=1, dim_z=rate.shape[1])
    filter_.x[:], filter_.P[:], filter_.F[:], filter_.H = start, variance, transition, np.ones((rate.shape[1], 1))
    states = []
    for index, z in enumerate(rate):
        filter_.predict(Q=process[index])
        filter_.update(z[:, None], R=noise[index])
        states.append((filter_.x[0, 0], filter_.P[0, 0]))
    return filter_, *np.array(states).T


@pytest.mark.parametrize("gyros", [1, 2, 3, 4, 5, 6, 9])
@pytest.mark.parametrize("samples", [1, 5, 64])
def test_filter_against_filterpy(samples, gyros):
    # Expected: filterpy, one sample after the other, with R and Q that change at every sample.
    rate, noise, process = measured(samples, gyros)
    _, estimate, variance = by_filterpy(rate, TRANSITION, process, noise, START, VARIANCE)
    found = kalman.kalman_filter(rate, TRANSITION, process, noise, START, VARIANCE)
    np.testing.assert_allclose(found[0], estimate, rtol=1e-10)
    np.testing.assert_allclose(found[1], variance, rtol=1e-10)


def test_smoother_against_filterpy():
    # Expected: filterpy's rts_smoother over what filterpy's filter left.
    rate, noise, process = measured()
    filter_, estimate, variance = by_filterpy(rate, TRANSITION, process, noise, START, VARIANCE)
    F = [np.array([[TRANSITION]])] * len(rate)
    x, P, _, _ = filter_.rts_smoother(estimate[:, None], variance[:, None, None], F, list(process[:, None, None]))
    found = kalman.rts_smoother(estimate, variance, TRANSITION, process)
    np.testing.assert_allclose(found[0], x[:, 0], rtol=1e-10)
    np.testing.assert_allclose(found[1], P[:, 0, 0], rtol=1e-10)


def test_filter_and_smoother_against_the_joint_posterior():
    # Expected: the Gaussian posterior of the whole path given all samples, by one dense linear system.
    samples, gyros = 30, 3
    rate, noise, process = measured(samples, gyros)
    estimate, variance = kalman.kalman_filter(rate, TRANSITION, process, noise, START, VARIANCE)
    smoothed, spread = kalman.rts_smoother(estimate, variance, TRANSITION, process)
    step = np.eye(samples) - TRANSITION * np.eye(samples, k=-1)
    drive = process.copy()
    drive[0] += TRANSITION**2 * VARIANCE
    mean = np.linalg.solve(step, np.r_[TRANSITION * START, np.zeros(samples - 1)])
    information = step.T @ np.diag(1 / drive) @ step
    weight = np.linalg.inv(noise).sum(axis=1)
    joint = np.linalg.inv(information + np.diag(weight.sum(axis=1)))
    path = joint @ (information @ mean + np.einsum("tn,tn->t", weight, rate))
    np.testing.assert_allclose(smoothed, path, rtol=1e-10)
    np.testing.assert_allclose(spread, np.diag(joint), rtol=1e-10)
    assert estimate[-1] == smoothed[-1]


@pytest.mark.parametrize(
    "name", ["kalman_filter", "rts_smoother", "constant_gain_filter", "low_pass", "settling_filter"]
)
def test_engines_agree(name):
    rate, noise, process = measured()
    signal = rate[:, 0]
    arguments = {
        "kalman_filter": (rate, TRANSITION, 1e-4, noise[0], START, VARIANCE),
        "rts_smoother": (signal, 0.01 + process, TRANSITION, 1e-4),
        "constant_gain_filter": (rate, 0.98, np.linspace(0.01, 0.06, 6), START),
        "low_pass": (signal, 0.97, 0.02, START),
        "settling_filter": (signal, 0.97, 0.9, START),
    }[name]
    ours, theirs = (getattr(engine.get(which).kalman, name)(*arguments) for which in ("native", "reference"))
    np.testing.assert_allclose(ours, theirs, rtol=1e-10)


def test_constant_noise_is_the_same_matrix_for_every_sample():
    rate, noise, _ = measured()
    every = np.broadcast_to(noise[3], noise.shape)
    once = kalman.kalman_filter(rate, 1.0, 1e-4, noise[3], START, VARIANCE)
    for a, b in zip(once, kalman.kalman_filter(rate, 1.0, 1e-4, every, START, VARIANCE), strict=True):
        np.testing.assert_array_equal(a, b)


def test_single_precision_and_column_order_change_nothing():
    rate, noise, process = measured()
    single = rate.astype(np.float32)
    run = partial(kalman.kalman_filter, transition=1.0, process=process, noise=noise, start=START, variance=VARIANCE)
    np.testing.assert_array_equal(run(np.asfortranarray(single))[0], run(single.astype(float))[0])


def test_ill_conditioned_noise():
    # Expected: two gyros with a common variance c and an own variance of 1e-12·c say as much as their mean with the
    # variance c + 1e-12·c/2, and a common rate of 1e4 must come out to the last digits.
    common, own = 0.01, 1e-14
    noise = common + own * np.eye(2)
    rate = 1e4 + np.array([[1e-7, -1e-7]] * 50)
    estimate, variance = kalman.kalman_filter(rate, 1.0, 0.0, noise, 1e4, 1e6)
    np.testing.assert_allclose(estimate, 1e4, rtol=1e-14)
    np.testing.assert_allclose(variance, 1 / (np.arange(1, 51) / (common + own / 2) + 1e-6), rtol=1e-9)


@pytest.mark.parametrize("which", ["native", "reference"])
@pytest.mark.parametrize("sample", [0, 7, 202])
def test_what_cannot_be_used_is_named(which, sample):
    module = engine.get(which).kalman
    rate, noise, _ = measured()
    run = partial(module.kalman_filter, transition=1.0, process=1e-4, start=START, variance=VARIANCE)
    flat, lost, spoilt = noise.copy(), rate.copy(), noise.copy()
    flat[sample] = -np.eye(6)
    lost[sample, 4] = np.nan
    spoilt[sample, 2, 1] = np.inf
    with pytest.raises(EngineError, match=f"sample {sample}: .*not positive definite"):
        run(rate, noise=flat)
    with pytest.raises(EngineError, match=f"sample {sample}: the rate is not finite"):
        run(lost, noise=noise)
    with pytest.raises(EngineError, match=f"sample {sample}: the noise covariance R is not finite"):
        run(rate, noise=spoilt)
    with pytest.raises(EngineError, match=f"sample {sample}: the estimate"):
        module.rts_smoother(lost[:, 4], np.ones(203), 1.0, 1e-4)
    for recursion in (module.low_pass, module.settling_filter):
        with pytest.raises(EngineError, match=f"sample {sample}"):
            recursion(lost[:, 4], 0.9, 0.1, 0.0)
    with pytest.raises(EngineError, match=f"sample {sample}"):
        module.constant_gain_filter(lost, 1.0, np.full(6, 0.01), 0.0)


def test_gyros_that_are_copies_are_refused():
    # A singular R leaves a pivot of a few rounding errors, of either sign.
    rate, noise, _ = measured()
    noise[11, 5], noise[11, :, 5] = noise[11, 0], noise[11, :, 0]
    with pytest.raises(EngineError, match="sample 11"):
        kalman.kalman_filter(rate, 1.0, 1e-4, noise, START, VARIANCE)


def test_first_of_several_in_different_pieces():
    samples = 3 * kalman.PIECE
    rate = np.zeros((samples, 2))
    rate[[kalman.PIECE + 5, 2 * kalman.PIECE + 1], 1] = np.nan
    with pytest.raises(EngineError, match=f"sample {kalman.PIECE + 5}:"):
        kalman.kalman_filter(rate, 1.0, 1e-4, np.eye(2), START, VARIANCE)


@pytest.mark.parametrize("which", ["native", "reference"])
def test_no_samples(which):
    module = engine.get(which).kalman
    for part in module.kalman_filter(np.empty((0, 3)), 1.0, 1.0, np.eye(3), 0.0, 1.0):
        assert part.shape == (0,)
    assert module.rts_smoother(np.empty(0), np.empty(0), 1.0, 1.0)[1].shape == (0,)
    assert module.low_pass(np.empty(0), 0.9, 0.1, 0.0).shape == (0,)


def test_nothing_moves_without_variance():
    # Expected: a state that is known and does not move is its own smoothed value.
    smoothed, spread = kalman.rts_smoother(np.full(4, 2.0), np.zeros(4), 1.0, 0.0)
    np.testing.assert_array_equal(smoothed, 2.0)
    np.testing.assert_array_equal(spread, 0.0)


def test_shapes_that_do_not_fit():
    rate, noise, process = measured()
    with pytest.raises(DataError, match="noise"):
        kalman.kalman_filter(rate, 1.0, 1e-4, noise[:7], START, VARIANCE)
    with pytest.raises(DataError, match="process"):
        kalman.kalman_filter(rate, 1.0, process[:7], noise, START, VARIANCE)


HASH = """
import hashlib, numpy as np
from vgyro.engine.native import kalman
rng = np.random.default_rng(5)
T = 2 * kalman.PIECE + 3
root = rng.standard_normal((T, 6, 8))
rate = rng.standard_normal((T, 6))
estimate, variance = kalman.kalman_filter(rate, 0.99, 0.01, root @ root.transpose(0, 2, 1), 0.0, 1.0)
results = [estimate, variance, *kalman.rts_smoother(estimate, variance, 0.99, 0.01)]
results += [kalman.low_pass(estimate, 0.97, 0.03, 0.0), kalman.settling_filter(estimate, 0.97, 0.9, 0.0)]
print(hashlib.sha256(np.concatenate(results).tobytes()).hexdigest())
"""


def test_same_bits_for_any_threads_and_instruction_set():
    hashes = {
        subprocess.run([sys.executable, "-c", HASH], env=os.environ | extra, capture_output=True, check=True).stdout
        for extra in ({"VGYRO_THREADS": "1"}, {"VGYRO_THREADS": "3"}, {"VGYRO_ISA": "baseline"})
    }
    assert len(hashes) == 1
