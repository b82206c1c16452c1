"""Likelihood and smoother of a state space, in both engines, against the dense Gaussian posterior and closed forms."""

import math
import os
import subprocess
import sys

import numpy as np
import pytest

from vgyro import engine
from vgyro.engine.linear import StateSpace
from vgyro.errors import DataError, EngineError

ENGINES = ("native", "reference")
# States and pole; coloured noise takes one of the states that there are.
JOINT = [(states, pole) for states in range(1, 12) for pole in (0.0, 0.6) if states < 11 or not pole]


def model_of(states, pole=0.0, regimes=1, seed=3):
    """A stable state space with full matrices; each regime has its own transition, and ten times the process."""
    rng = np.random.default_rng(seed)
    F = np.stack([0.97 * np.linalg.qr(rng.standard_normal((states, states)))[0] for _ in range(regimes)])
    root = 0.3 * rng.standard_normal((regimes, states, states))
    Q = root @ root.transpose(0, 2, 1) * 10.0 ** np.arange(regimes)[:, None, None]
    reads, wanted, start = rng.standard_normal((3, states))
    return StateSpace(F, Q, reads, wanted, start, np.eye(states) * 4.0, pole)


def measured(samples=60, seed=1):
    """A series, variances from 0.02 to 2, some samples that say nothing, and a regime for each sample."""
    rng = np.random.default_rng(seed)
    z, r = rng.standard_normal(samples), 10.0 ** rng.uniform(-1.7, 0.3, samples)
    r[[0, 7, 8, 30]] = np.inf
    z[[7, 30]] = np.nan
    regime = np.zeros(samples, dtype=np.uint8)
    regime[20:33], regime[45:52] = 1, 2
    return z, r, regime


def dense(z, r, model, regime):
    """Log-likelihood of all samples, and mean and variance of c'x_t, by the joint covariance of path and samples."""
    samples, states = len(z), len(model.reads)
    F, Q = (np.reshape(one, (-1, states, states))[regime] for one in (model.transition, model.process))
    path = np.zeros((samples, states, samples, states))
    mean = np.zeros((samples, states))
    mean[0], path[0, :, 0] = model.start, model.spread
    for t in range(1, samples):
        mean[t] = F[t] @ mean[t - 1]
        path[t, :, :t] = np.einsum("ij,jsk->isk", F[t], path[t - 1, :, :t])
        path[:t, :, t] = path[t, :, :t].transpose(1, 2, 0)
        path[t, :, t] = F[t] @ path[t - 1, :, t - 1] @ F[t].T + Q[t]
    told = np.flatnonzero(np.isfinite(r))
    lag = np.abs(np.subtract.outer(told, told))
    noise = np.sqrt(np.outer(r[told], r[told])) * model.pole**lag
    wanted = np.einsum("i,tisj,j->ts", model.wanted, path, model.reads)[:, told]
    covariance = np.einsum("i,tisj,j->ts", model.reads, path, model.reads)[np.ix_(told, told)] + noise
    rest = z[told] - mean[told] @ model.reads
    gain = np.linalg.solve(covariance, wanted.T).T
    own = np.einsum("i,titj,j->t", model.wanted, path, model.wanted)
    likelihood = -0.5 * (np.linalg.slogdet(2 * np.pi * covariance)[1] + rest @ np.linalg.solve(covariance, rest))
    return likelihood, mean @ model.wanted + gain @ rest, own - np.einsum("ts,ts->t", gain, wanted)


@pytest.mark.parametrize("which", ENGINES)
@pytest.mark.parametrize(("states", "pole"), JOINT)
def test_against_the_joint_posterior(which, states, pole):
    # Expected: the Gaussian posterior given all samples, from the dense covariance of the whole path.
    module, model = engine.get(which).statespace, model_of(states, pole, regimes=3)
    z, r, regime = measured()
    likelihood, mean, variance = dense(z, r, model, regime)
    found = module.smooth(z, r, model, regime)
    np.testing.assert_allclose(found[0], mean, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found[1], variance, rtol=1e-9)
    total, count = module.log_likelihood(z, r, model, regime=regime)
    assert total == pytest.approx(likelihood, rel=1e-11)
    assert count == 56


def test_engines_agree_over_borders_of_chunks():
    # Expected: filterpy. The native smoother keeps its state every 1024 samples.
    model = model_of(3, 0.5, regimes=2)
    z, r, _ = measured(2500)
    regime = (np.arange(2500) // 100 % 3 == 0).astype(np.uint8)
    ours, theirs = (engine.get(which).statespace.smooth(z, r, model, regime) for which in ENGINES)
    np.testing.assert_allclose(ours, theirs, rtol=1e-8, atol=1e-9)
    totals = [engine.get(which).statespace.log_likelihood(z, r, model, 20, regime) for which in ENGINES]
    assert totals[0] == (pytest.approx(totals[1][0], rel=1e-11), totals[1][1])


@pytest.mark.parametrize("samples", [1023, 1024, 1025, 2048, 2049])
def test_any_length_around_a_chunk(samples):
    # Expected: the same numbers as of the existing scalar filter and smoother, for a random walk.
    rng = np.random.default_rng(7)
    z = np.cumsum(rng.standard_normal(samples)) + rng.standard_normal(samples)
    model = StateSpace([[1.0]], [[1.0]], np.ones(1), np.ones(1), np.zeros(1), np.array([[9.0]]))
    kalman = engine.get("native").kalman
    filtered = kalman.kalman_filter(z[:, None], 1.0, 1.0, np.eye(1), 0.0, 8.0)
    expected = kalman.rts_smoother(*filtered, 1.0, 1.0)
    np.testing.assert_allclose(engine.get("native").statespace.smooth(z, 1.0, model), expected, rtol=1e-10, atol=1e-10)


def test_the_likelihood_of_the_rest_given_the_first():
    # Expected: log p(all) - log p(first ones), both dense.
    model = model_of(3)
    z, r, regime = measured()
    regime[:] = 0
    first = 11
    expected = dense(z, r, model, regime)[0] - dense(z[:first], r[:first], model, regime[:first])[0]
    told = int(np.isfinite(r[:first]).sum())
    assert engine.get("native").statespace.log_likelihood(z, r, model, skip=told)[0] == pytest.approx(expected)


@pytest.mark.parametrize("scale", [1e-9, 1e9])
def test_neither_tiny_nor_large_variances_spoil_the_likelihood(scale):
    # Expected: z, √r and the state in other units change the log-likelihood by -log(scale) a sample, no more; the
    # determinant of 4000 samples is far outside of what a double holds.
    model = model_of(2)
    z, r, _ = measured(4000)
    z = np.nan_to_num(z)
    other = StateSpace(model.transition, model.process * scale**2, model.reads, model.wanted, model.start * scale,
                       model.spread * scale**2)  # fmt: skip
    native = engine.get("native").statespace
    (plain, count), (scaled, _) = (
        native.log_likelihood(z, r, model),
        native.log_likelihood(z * scale, r * scale**2, other),
    )
    assert scaled == pytest.approx(plain - count * math.log(scale), rel=1e-10)


def test_a_wide_start_is_a_diffuse_one():
    # Expected: a rate that does not move, after a start of variance 1e12: the weighted mean of all samples.
    rng = np.random.default_rng(2)
    r = rng.uniform(0.5, 2.0, 500)
    z = 7.0 + np.sqrt(r) * rng.standard_normal(500)
    model = StateSpace([[1.0]], [[0.0]], np.ones(1), np.ones(1), np.zeros(1), np.array([[1e12]]))
    mean, variance = engine.get("native").statespace.smooth(z, r, model)
    np.testing.assert_allclose(mean, np.sum(z / r) / np.sum(1 / r), rtol=1e-10)
    np.testing.assert_allclose(variance, 1 / np.sum(1 / r), rtol=1e-10)


@pytest.mark.parametrize("which", ENGINES)
def test_what_cannot_be_used_is_named(which):
    module, model = engine.get(which).statespace, model_of(2)
    z, r, regime = measured()
    for bad in (0.0, -1.0, np.nan):
        spoilt = r.copy()
        spoilt[40] = bad
        with pytest.raises(EngineError, match="sample 40: the variance r is not above zero"):
            module.smooth(z, spoilt, model)
    lost = z.copy()
    lost[41] = np.nan
    with pytest.raises(EngineError, match="sample 41: the rate is not finite"):
        module.log_likelihood(lost, r, model)
    with pytest.raises(DataError, match="do not fit"):
        module.smooth(z, r[:7], model)
    with pytest.raises(DataError, match="regime 2 is asked for, and the model has 1"):
        module.smooth(z, r, model, regime)
    with pytest.raises(DataError, match="12 states are too many"):
        module.smooth(z, r, model_of(11, 0.5))


@pytest.mark.parametrize("which", ENGINES)
def test_no_samples(which):
    module, model = engine.get(which).statespace, model_of(2)
    assert module.smooth(np.empty(0), 1.0, model)[1].shape == (0,)
    assert module.log_likelihood(np.empty(0), 1.0, model) == (0.0, 0)


HASH = """
import hashlib, numpy as np
from vgyro.engine.linear import StateSpace
from vgyro.engine.native import statespace
rng = np.random.default_rng(5)
results = []
for n in range(1, 5):
    F, root = 0.5 * np.eye(n) + 0.1, rng.standard_normal((n, n))
    model = StateSpace(F, root @ root.T, np.ones(n), np.ones(n), np.zeros(n), np.eye(n), 0.5)
    z, r = rng.standard_normal(3000), rng.uniform(0.1, 1.0, 3000)
    results += [*statespace.smooth(z, r, model), np.array(statespace.log_likelihood(z, r, model))]
print(hashlib.sha256(np.concatenate(results).tobytes()).hexdigest())
"""


def test_same_bits_for_any_threads_and_instruction_set():
    hashes = {
        subprocess.run([sys.executable, "-c", HASH], env=os.environ | extra, capture_output=True, check=True).stdout
        for extra in ({"VGYRO_THREADS": "1"}, {"VGYRO_THREADS": "3"}, {"VGYRO_ISA": "baseline"})
    }
    assert len(hashes) == 1
