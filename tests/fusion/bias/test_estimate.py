"""Slow errors: against the joint Gaussian posterior of all blocks, computed densely, and exact properties."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from vgyro.errors import DataError
from vgyro.fusion import ArrayNoise, ArrayRates, FilterParameters, SampleWeights
from vgyro.fusion.bias.blocks import SlowBlocks
from vgyro.fusion.bias.estimate import combined_without, slow_errors, slow_variance
from vgyro.fusion.bias.model import BiasEvidence, BlockNoise, Walk, log_likelihood, posterior
from vgyro.fusion.bias.prior import Prior
from vgyro.fusion.bias.smoother import run_filters
from vgyro.fusion.events import FaultEvent

MOVING = FilterParameters(in_motion=True)
ARW = np.array([0.02, 0.05, 0.03, 0.04])
RRW = np.array([0.003, 0.0, 0.01, 0.002])
CORRELATION = 0.75 * np.eye(4) + 0.25
RATE_HZ, SAMPLES = 4.0, 250
BIASES, SLOPES = np.array([0.02, 0.05, 0.1, 0.03]), np.array([0.01, 0.04, 0.02, 0.03])
"""Variances beforehand, (deg/s)² and (deg/s/K)²."""


@pytest.fixture
def recording():
    """Four gyros, 62 blocks of four samples and one of two, biases that walk, a motion that all share."""
    rng = np.random.default_rng(5)
    root = np.linalg.cholesky(CORRELATION).T
    walk = np.cumsum(rng.standard_normal((SAMPLES, 4)) @ root * RRW / np.sqrt(RATE_HZ), axis=0)
    white = rng.standard_normal((SAMPLES, 4)) @ root * ARW * np.sqrt(RATE_HZ)
    motion = 10.0 * np.sin(np.arange(SAMPLES) / 7.0)
    rate = np.array([0.1, -0.2, 0.3, 0.05]) + walk + white + motion[:, None]
    still = np.zeros(SAMPLES, dtype=bool)
    noise = ArrayNoise(ARW, RRW, CORRELATION)
    return ArrayRates(rate, RATE_HZ, np.zeros(SAMPLES, dtype=int), still, noise)


def plain(array):
    return array


def anchored(array):
    at_rest = np.zeros(SAMPLES, dtype=bool)
    at_rest[:39], at_rest[170:200] = True, True
    rate = array.rate.copy()
    rate[at_rest] -= 10.0 * np.sin(np.arange(SAMPLES) / 7.0)[at_rest, None]
    return replace(array, rate=rate, at_rest=at_rest)


def faulty(array):
    faults = [
        (2, "drift", 50, 83, 0.4),
        (0, "stuck", 60, 70, np.nan),
        (1, "burst", 60, 71, 9.0),
        (3, "noise", 0, 30, 3),
    ]
    events = tuple(FaultEvent(gyro, kind, start, stop, 9.0, size, "") for gyro, kind, start, stop, size in faults)
    return replace(array, faults=events)


def warm(array):
    temperature = 30.0 + 8.0 * np.cos(np.arange(SAMPLES) / 20.0)
    slopes = np.array([0.2, -0.1, 0.3, 0.0])
    return replace(array, rate=array.rate + slopes * temperature[:, None], temperature=temperature)


def gapped(array):
    segment = np.repeat([0, 1, 2], [101, 3, SAMPLES - 104])
    return replace(array, segment=segment, stretch_time=np.array([5.0, 40.0, 300.0]))


def everything(array):
    return gapped(warm(anchored(faulty(array))))


def variances(array, blocks):
    """Variances [B, N] of a sample, twice as large in every third block."""
    return array.noise.arw**2 * array.rate_hz * np.where(np.arange(len(blocks)) % 3 == 0, 2.0, 1.0)[:, None]


def one_prior(evidence, _):
    """A prior of one part."""
    slopes = SLOPES if evidence.has_slopes else []
    variance = np.concatenate([BIASES, evidence.steps, slopes])
    return Prior(np.ones(1), variance[None], np.eye(len(variance)))


def dense(array, blocks, variance, prior, slopes, tau=np.inf):
    """Joint prior covariance [BN, BN] of the biases; measured combinations M [m, BN], their values, noise covariance.

    A block in motion measures the differences to the first gyro that is used, one at rest each gyro.
    """
    number, gyros = len(blocks), array.rate.shape[1]
    time = blocks.time - blocks.time[0]
    apart, least = abs(np.subtract.outer(time, time)), np.minimum.outer(time, time)
    shared = least if np.isinf(tau) else tau / 2 * np.exp(-apart / tau)
    walk = np.outer(array.noise.rrw, array.noise.rrw) * array.noise.correlation
    covariance = np.einsum("bc,ij->bicj", shared, walk) + np.diag(prior[:gyros])[None, :, None, :]
    for event in array.faults:
        after = blocks.first >= event.stop
        if event.kind in ("drift", "step"):
            covariance[:, event.gyro, :, event.gyro] += event.size**2 * np.outer(after, after)
    if slopes:
        degrees = np.add.reduceat(array.temperature, blocks.first) / blocks.length
        degrees = degrees - np.average(degrees, weights=blocks.length)
        covariance += np.einsum("b,c,ij->bicj", degrees, degrees, np.diag(prior[-gyros:]))
    means = np.add.reduceat(array.rate, blocks.first, axis=0) / blocks.length[:, None]
    rows, values, noises = [], [], []
    for index in range(number):
        samples = slice(blocks.first[index], blocks.first[index] + blocks.length[index])
        bad = {one.gyro for one in array.faults if one.start < samples.stop and one.stop > samples.start}
        used = [gyro for gyro in range(gyros) if gyro not in bad]
        measure = np.eye(gyros)[used]
        if not array.at_rest[samples].all():
            measure = measure[1:] - measure[:1]
        sigma = np.sqrt(variance[index] / blocks.length[index])
        rows.append(np.zeros((len(measure), number, gyros)))
        rows[-1][:, index] = measure
        values.append(measure @ means[index])
        noises.append(measure @ (np.outer(sigma, sigma) * array.noise.correlation) @ measure.T)
    noise = np.zeros((sum(map(len, noises)),) * 2)
    at = 0
    for one in noises:
        noise[at : at + len(one), at : at + len(one)] = one
        at += len(one)
    shape = number * gyros
    return covariance.reshape(shape, shape), np.concatenate(rows).reshape(-1, shape), np.concatenate(values), noise


@pytest.mark.parametrize("tau", [np.inf, 15.0])
@pytest.mark.parametrize("change", [plain, anchored, faulty, warm, gapped, everything])
def test_against_the_dense_posterior(recording, change, tau, monkeypatch):
    # Expected: the joint Gaussian of all biases, conditioned on all differences and anchors at once, for one prior.
    monkeypatch.setattr("vgyro.fusion.bias.estimate.empirical_prior", one_prior)
    array = change(recording)
    blocks = SlowBlocks.of(array)
    variance = variances(array, blocks)
    slow = slow_errors(array, MOVING, variance, blocks=blocks, walk=Walk(RRW, tau))
    assert (slow.temperature is not None) == (change in (warm, everything))
    assert slow.anchored == (change in (anchored, everything))
    steps = [event.size**2 for event in array.faults if event.kind == "drift"]
    prior = np.concatenate([BIASES, steps, SLOPES])
    before, measure, values, noise = dense(array, blocks, variance, prior, slow.temperature is not None, tau)
    gain = np.linalg.solve(measure @ before @ measure.T + noise, measure @ before).T
    after = before - gain @ measure @ before
    number, gyros = slow.bias.shape
    marginal = after.reshape(number, gyros, number, gyros)[np.arange(number), :, np.arange(number), :]
    np.testing.assert_allclose(slow.bias, (gain @ values).reshape(number, gyros), atol=1e-8)
    np.testing.assert_allclose(slow.covariance, marginal, atol=1e-8 * marginal.max())


def test_a_mixture_of_priors(recording):
    # Expected: mean and covariance of the mixture of what each gives, by the law of total variance.
    blocks = SlowBlocks.of(recording)
    none = np.zeros(len(blocks), dtype=bool)
    evidence = BiasEvidence.of(recording, blocks, BlockNoise(variances(recording, blocks), CORRELATION), none)
    filtered = evidence.filtered(evidence.information(), Walk(RRW))
    share, prior = np.array([0.2, 0.3, 0.5]), np.array([[0.1] * 4, [0.01, 0.02, 0.3, 0.01], [1.0, 2.0, 0.1, 4.0]])
    each = [posterior(filtered, one) for one in prior]
    mean = sum(part * one.mean for part, one in zip(share, each, strict=True))
    second = sum(part * (one.covariance + np.outer(one.mean, one.mean)) for part, one in zip(share, each, strict=True))
    found = Prior(share, prior, np.eye(4)).posterior(filtered)
    np.testing.assert_allclose(found.mean, mean, atol=1e-12)
    np.testing.assert_allclose(found.covariance, second - np.outer(mean, mean), atol=1e-12)


@pytest.mark.parametrize("tau", [np.inf, 15.0])
@pytest.mark.parametrize("change", [plain, anchored, gapped])
def test_likelihood_against_the_dense_one(recording, change, tau):
    # Expected: the ratio of two densities of all differences and anchors (scipy), of another walk and another prior.
    array = change(recording)
    blocks, prior = SlowBlocks.of(array), np.array([0.1, 0.2, 0.3, 0.4])
    variance = variances(array, blocks)
    resting = blocks.all(array.at_rest)
    evidence = BiasEvidence.of(array, blocks, BlockNoise(variance, CORRELATION), resting)
    found, expected = [], []
    for scale in (1.0, 3.0):
        filtered = evidence.filtered(evidence.information(), Walk(scale * RRW, tau))
        found.append(log_likelihood(filtered, scale * prior))
        scaled = replace(array, noise=replace(array.noise, rrw=scale * RRW))
        before, measure, values, noise = dense(scaled, blocks, variance, scale * prior, False, tau)
        expected.append(multivariate_normal(cov=measure @ before @ measure.T + noise).logpdf(values))
    assert found[1] - found[0] == pytest.approx(expected[1] - expected[0], abs=1e-7)


def test_a_part_of_the_blocks_is_the_rest_not_measured(recording):
    # Expected: the likelihood of all blocks, with gyros of no weight in those left out.
    array = faulty(recording)
    blocks = SlowBlocks.of(array)
    variance = variances(array, blocks)
    kept = np.flatnonzero(np.arange(len(blocks)) % 5 < 3)
    unused = np.where(np.isin(np.arange(len(blocks)), kept)[:, None], variance, np.inf)
    none = np.zeros(len(blocks), dtype=bool)
    part = BiasEvidence.of(array, blocks, BlockNoise(variance, CORRELATION), none).part(kept)
    whole = BiasEvidence.of(array, blocks, BlockNoise(unused, CORRELATION), none)
    one, other = (evidence.filtered(evidence.information(), Walk(RRW, 20.0)) for evidence in (part, whole))
    prior = np.full(5, 0.1)
    assert log_likelihood(one, prior) == pytest.approx(log_likelihood(other, prior), abs=1e-8)


def test_merged_blocks_say_the_same_of_what_stands_still(recording):
    # Expected: biases that do not walk have the likelihood of the single blocks.
    blocks = SlowBlocks.of(recording)
    none = np.zeros(len(blocks), dtype=bool)
    evidence = BiasEvidence.of(recording, blocks, BlockNoise(variances(recording, blocks), CORRELATION), none)
    single = evidence.information()
    merged = single.merged(np.arange(0, len(blocks), 7))
    assert len(merged.gap) == 9
    squares = [run_filters(one, np.zeros((1, 4, 4)), np.array([np.inf]))[0].squares for one in (single, merged)]
    np.testing.assert_allclose(squares[1], squares[0], atol=1e-8 * abs(squares[0]).max())


@pytest.mark.parametrize("change", [plain, faulty, warm, gapped])
def test_a_motion_that_all_share_passes_as_it_is(recording, change):
    # Expected: z of the moved rates less z is the motion, to rounding.
    array = change(recording)
    motion = 200.0 * np.sin(np.arange(SAMPLES) / 3.0) + 50.0
    weights = np.array([0.4, 0.1, 0.3, 0.2])
    z = []
    for one in (array, replace(array, rate=array.rate + motion[:, None])):
        z.append(combined_without(one, weights, slow_errors(one, MOVING, ARW**2 * RATE_HZ)))
    np.testing.assert_allclose(z[1] - z[0], motion, atol=1e-10)


def test_alike_gyros_are_averaged(make_array):
    # Expected: the average, but for a constant, which the prior of the initial biases sets.
    array = make_array(4000, np.full(5, 0.1), rate_hz=20.0, correlation=0.8 * np.eye(5) + 0.2, at_rest=False)
    slow = slow_errors(array, MOVING, array.noise.arw**2 * 20.0)
    weights = np.full(5, 0.2)
    left = combined_without(array, weights, slow) - array.rate.mean(axis=1)
    assert abs(slow.bias).max() > 1e-3
    np.testing.assert_allclose(left, left.mean(), atol=1e-10)


def test_no_anchors_where_all_of_it_rests(recording):
    resting = replace(recording, at_rest=np.ones(SAMPLES, dtype=bool))
    slow = slow_errors(resting, FilterParameters(), ARW**2 * RATE_HZ)
    assert not slow.anchored
    assert "at rest as a whole: no anchors, or its rate would be set to zero" in slow.note
    # Anchors that are off change nothing but the note.
    off = slow_errors(anchored(recording), replace(MOVING, anchors="off"), ARW**2 * RATE_HZ)
    unknown = slow_errors(replace(anchored(recording), at_rest=recording.at_rest), MOVING, ARW**2 * RATE_HZ)
    assert not off.anchored
    assert "anchors are off" in off.note
    np.testing.assert_array_equal(off.bias, unknown.bias)


def test_blocks_partly_at_rest_are_in_motion(recording):
    # 39 samples at rest: nine blocks of four as a whole; the tenth is in motion. 170-200: blocks 43 to 49.
    array = anchored(recording)
    blocks = SlowBlocks.of(array)
    assert np.flatnonzero(blocks.all(array.at_rest)).tolist() == [*range(9), *range(43, 50)]


def test_blocks_of_the_stretches(recording):
    blocks = SlowBlocks.of(gapped(recording))
    assert blocks.length[[24, 25, 26, 27]].tolist() == [4, 1, 3, 4]
    assert blocks.stretch[[25, 26, 27]].tolist() == [0, 1, 2]
    # 101 samples from 5 s: the last is at 30 s; 3 from 40 s: the middle is a sample after the first.
    np.testing.assert_allclose(blocks.time[[0, 25, 26, 27]], [5.375, 30.0, 40.25, 300.375])
    assert blocks.length.sum() == SAMPLES


def test_means_of_what_is_constant_in_other_blocks(recording):
    # Expected: each sample given its value, then averaged.
    blocks = SlowBlocks.of(gapped(recording))
    first = np.array([0, 3, 9, 90, 103, 240])
    values = np.random.default_rng(1).random((6, 4))
    samples = values[np.searchsorted(first, np.arange(SAMPLES), side="right") - 1]
    expected = [samples[a : a + n].mean(axis=0) for a, n in zip(blocks.first, blocks.length, strict=True)]
    np.testing.assert_allclose(blocks.mean_of(first, values), expected, atol=1e-12)


def test_taken_out_between_the_middles_of_the_blocks(recording, monkeypatch):
    # Expected: numpy's interpolation stretch by stretch; the same by every form of weights, in pieces of any size.
    monkeypatch.setattr("vgyro.fusion.bias.blocks.PIECE", 37)
    monkeypatch.setattr("vgyro.fusion.blocks.PIECE", 41)
    array = gapped(recording)
    slow = slow_errors(array, MOVING, ARW**2 * RATE_HZ)
    bias, blocks = np.empty((SAMPLES, 4)), slow.blocks
    for number, part in enumerate(array.stretches()):
        inside = blocks.stretch == number
        for gyro in range(4):
            middles = blocks.first[inside] + (blocks.length[inside] - 1) / 2
            bias[part, gyro] = np.interp(np.arange(part.start, part.stop), middles, slow.bias[inside, gyro])
    fixed = np.array([0.4, 0.1, 0.3, 0.2])
    np.testing.assert_allclose(combined_without(array, fixed, slow), (array.rate - bias) @ fixed, atol=1e-12)
    changing = SampleWeights.of(np.random.default_rng(2).dirichlet(np.ones(4), 25), np.arange(SAMPLES) // 10)
    each = np.concatenate(list(changing.pieces()))
    expected = np.sum((array.rate - bias) * each, axis=1)
    np.testing.assert_allclose(combined_without(array, changing, slow), expected, atol=1e-12)
    np.testing.assert_allclose(combined_without(array, each, slow), expected, atol=1e-12)


def test_variance_of_what_is_left(recording):
    # Expected: u'Pu, block by block.
    slow = slow_errors(recording, MOVING, ARW**2 * RATE_HZ)
    changing = SampleWeights.of(np.random.default_rng(2).dirichlet(np.ones(4), 25), np.arange(SAMPLES) // 10)
    each = np.concatenate(list(changing.pieces()))[slow.blocks.first + slow.blocks.length // 2]
    expected = [u @ P @ u for u, P in zip(each, slow.covariance, strict=True)]
    np.testing.assert_allclose(slow_variance(changing, slow), expected, rtol=1e-10)
    np.testing.assert_allclose(slow_variance(each, slow), expected, rtol=1e-10)
    np.testing.assert_allclose(slow_variance(each[3], slow)[3], expected[3], rtol=1e-10)


def test_what_does_not_fit_is_refused(recording):
    with pytest.raises(DataError, match="shape"):
        slow_errors(recording, MOVING, np.ones(3))
    with pytest.raises(DataError, match="positive definite"):
        slow_errors(recording, MOVING, ARW**2, np.ones((4, 4)))
