"""The registry, and the methods without a filter."""

import math
from dataclasses import replace

import numpy as np
import pytest

from vgyro.config import FusionOptions, VolatilityOptions
from vgyro.errors import ConfigError, DataError
from vgyro.fusion import METHODS, ArrayRates, CannotRun, FilterParameters, SampleWeights, run_methods, select
from vgyro.fusion.registry import failure

DEFINITIONS = ("level", "residual")
PARAMETERS = FilterParameters(block_hz=10.0, moment_window_s=5.0, ewma_time_s=2.0)


def weights_for(samples, gyros):
    """Distinct weights for each model, mode and definition, so that a mix-up shows."""
    rng = np.random.default_rng(2)
    keys = [(m, o, d) for m in ("dcc", "ccc") for o in ("in_sample", "causal") for d in DEFINITIONS]
    return {key: SampleWeights.of(rng.dirichlet(np.ones(gyros), samples), np.arange(samples)) for key in keys}


def deviations_for(samples, gyros):
    """Conditional standard deviations of the same blocks."""
    table = np.random.default_rng(3).uniform(0.5, 1.5, (samples, gyros))
    return {key: SampleWeights.of(table, np.arange(samples)) for key in weights_for(1, gyros)}


def every(weights):
    """Weights [T, N] of all samples."""
    return np.concatenate(list(weights.pieces()))


def test_every_method_runs_and_is_described(make_array):
    array = make_array(4000, [0.05, 0.1, 0.1, 0.3], truth=1.0, weights=weights_for(4000, 4))
    array = replace(array, deviations=deviations_for(4000, 4))
    outcomes = list(run_methods(array, PARAMETERS, select("all"), DEFINITIONS))
    assert {outcome.method.name for outcome in outcomes} == set(METHODS)
    # Once each, but CCC and DCC in both modes for each definition.
    assert len(outcomes) == len({outcome.column for outcome in outcomes}) == len(METHODS) + 4
    for outcome in outcomes:
        assert outcome.method.source
        assert outcome.method.title
        assert outcome.fused is not None, outcome.note
        assert outcome.fused.rate.shape == (4000,)
        assert np.isfinite(outcome.fused.rate).all()
        assert outcome.fused.rate.mean() == pytest.approx(1.0, abs=0.1)
        known = math.isfinite(outcome.fused.dc_gain)
        assert not known or 0 < outcome.fused.dc_gain <= 1
        assert outcome.method.operations(4) > 0
        weights = outcome.fused.weights
        if weights is not None:
            weights = every(weights) if isinstance(weights, SampleWeights) else weights
            np.testing.assert_allclose(weights.sum(axis=-1), 1.0, atol=1e-12)
    names = [name for name in METHODS if METHODS[name].name != name]
    assert names == []


@pytest.mark.parametrize("name", [name for name in METHODS if METHODS[name].causal])
def test_a_causal_method_does_not_look_ahead(make_array, name):
    array = make_array(4000, [0.05, 0.1, 0.1, 0.3], weights=weights_for(4000, 4))
    changed = array.rate.copy()
    changed[2500:] += 7.0
    parameters = replace(PARAMETERS, definition="level")
    before, after = (METHODS[name].fuse(replace(array, rate=rate), parameters).rate for rate in (array.rate, changed))
    np.testing.assert_array_equal(before[:2500], after[:2500])
    assert not np.array_equal(before[2500:], after[2500:])


def test_two_sided_moments_look_ahead(make_array):
    array = make_array(4000, [0.05, 0.1, 0.1, 0.3])
    changed = array.rate.copy()
    changed[2500:, 0] *= 9.0
    before, after = (
        METHODS["ewma_two_sided"].fuse(replace(array, rate=rate), PARAMETERS) for rate in (array.rate, changed)
    )
    assert (every(before.weights)[2499] != every(after.weights)[2499]).all()


def test_average_and_median(make_array):
    array = make_array(200, np.full(5, 0.1))
    np.testing.assert_allclose(METHODS["average"].fuse(array, PARAMETERS).rate, array.rate.mean(axis=1), rtol=1e-14)
    np.testing.assert_array_equal(METHODS["median"].fuse(array, PARAMETERS).rate, np.median(array.rate, axis=1))


def test_inverse_variance(make_array):
    # Expected: 1/N² : 1/0.1², 1/0.2² → 0.8, 0.2; and for K of 0.003 and 0.001 → 0.1, 0.9.
    array = make_array(50, [0.1, 0.2])
    array = replace(array, noise=replace(array.noise, rrw=np.array([0.003, 0.001])))
    np.testing.assert_allclose(METHODS["inverse_variance_arw"].fuse(array, PARAMETERS).weights, [0.8, 0.2])
    fused = METHODS["inverse_variance_rrw"].fuse(array, PARAMETERS)
    np.testing.assert_allclose(fused.weights, [0.1, 0.9])
    np.testing.assert_allclose(fused.rate, array.rate @ [0.1, 0.9])


@pytest.mark.parametrize("missing", [math.nan, 0.0])
def test_coefficient_that_was_not_found(make_array, missing):
    array = make_array(50, [0.1, 0.2])
    array = replace(array, noise=replace(array.noise, rrw=np.array([0.003, missing])))
    with pytest.raises(CannotRun, match=r"rate random walk.*gyro 2 of 2"):
        METHODS["inverse_variance_rrw"].fuse(array, PARAMETERS)


def block_squares(array, size):
    return array.rate.reshape(-1, size, array.rate.shape[1]).mean(axis=1) ** 2


def test_rolling_moment_by_its_definition(make_array):
    # Expected: the mean of the last 50 blocks' squares, written as a loop.
    array = make_array(4000, [0.05, 0.1, 0.3])
    weights = every(METHODS["rolling_moment"].fuse(array, PARAMETERS).weights)
    square = block_squares(array, 20)
    for block in (0, 9, 10, 49, 50, 120, 199):
        past = square[max(0, block - 50) : block]
        expected = 1 / past.mean(axis=0) if len(past) >= 10 else np.ones(3)
        for sample in (20 * block, 20 * block + 19):
            np.testing.assert_allclose(weights[sample], expected / expected.sum(), rtol=1e-9)


@pytest.mark.parametrize("name", ["ewma_causal", "ewma_two_sided"])
def test_ewma_by_its_definition(make_array, name):
    # Expected: Σ e^(-age/τ)·square / Σ e^(-age/τ), written as a loop; τ = 2 s = 20 blocks.
    array = make_array(4000, [0.05, 0.1, 0.3])
    weights = every(METHODS[name].fuse(array, PARAMETERS).weights)
    square = block_squares(array, 20)
    for block in (10, 57, 199):
        number = np.arange(len(square))
        age = np.exp(-np.abs(number - block) / 20)
        if name == "ewma_causal":
            age[number >= block] = 0
        expected = 1 / (age @ square / age.sum())
        np.testing.assert_allclose(weights[20 * block + 7], expected / expected.sum(), rtol=1e-9)


def test_moments_follow_a_change(make_array):
    # The first gyro gets ten times worse in the middle: its weight must fall from near 1/2 to near 1/100.
    array = make_array(20000, [0.1, 0.1], seed=4)
    rate = array.rate.copy()
    rate[10000:, 0] *= 10
    for name in ("rolling_moment", "ewma_causal", "ewma_two_sided"):
        weights = every(METHODS[name].fuse(replace(array, rate=rate), PARAMETERS).weights)
        assert weights[6000:9000, 0].mean() == pytest.approx(0.5, abs=0.1)
        assert weights[15000:, 0].mean() < 0.03


def test_dead_channel_has_no_weight(make_array):
    array = make_array(4000, [0.1, 0.1, 0.1])
    rate = array.rate.copy()
    rate[:, 1] = 0.0
    for name in ("rolling_moment", "ewma_causal", "ewma_two_sided"):
        fused = METHODS[name].fuse(replace(array, rate=rate), PARAMETERS)
        assert (every(fused.weights)[1000:, 1] == 0).all()
        assert np.isfinite(fused.rate).all()
    silent = METHODS["ewma_causal"].fuse(replace(array, rate=np.zeros_like(rate)), PARAMETERS)
    assert (silent.rate == 0).all()


def test_moments_use_rest_only_where_it_is_known(make_array):
    # At rest, then a fast turn: the weights at the end must still be those of the noise.
    truth = np.where(np.arange(8000) < 4000, 0.0, 50.0)
    array = make_array(8000, [0.05, 0.3], truth=truth)
    resting = replace(array, at_rest=truth == 0)
    moving = replace(PARAMETERS, in_motion=True)
    for name in ("rolling_moment", "ewma_causal"):
        known = METHODS[name].fuse(resting, moving)
        assert every(known.weights)[-1, 0] > 0.9
        assert "rest" in known.note
        unknown = METHODS[name].fuse(replace(array, at_rest=np.zeros(8000, dtype=bool)), moving)
        assert every(unknown.weights)[-1, 0] < 0.7
        assert "motion" in unknown.note


def test_gaps(make_array):
    # Blocks begin anew after a gap; a stretch shorter than a block has equal weights.
    segment = np.repeat([0, 1, 2], [2005, 7, 1988])
    array = make_array(4000, [0.05, 0.3], segment=segment)
    fused = METHODS["ewma_causal"].fuse(array, PARAMETERS)
    weights = every(fused.weights)
    np.testing.assert_array_equal(weights[2005:2012], 0.5)
    np.testing.assert_array_equal(weights[2012], weights[2031])
    assert (weights[2031] != weights[2032]).all()
    np.testing.assert_array_equal(weights[2004], weights[1999])


def test_too_short_for_moments(make_array):
    array = make_array(100, [0.1, 0.1])
    for name in ("rolling_moment", "ewma_causal", "ewma_two_sided"):
        with pytest.raises(CannotRun, match="fewer than 10 blocks"):
            METHODS[name].fuse(array, PARAMETERS)


def test_conditional_weights_go_to_their_method(make_array):
    weights = weights_for(100, 3)
    array = make_array(100, [0.1, 0.1, 0.1], weights=weights)
    for (model, mode, definition), w in weights.items():
        fused = METHODS[f"{model}_{mode}"].fuse(array, replace(PARAMETERS, definition=definition))
        np.testing.assert_allclose(fused.rate, (array.rate * every(w)).sum(axis=1), rtol=1e-12)
    outcomes = run_methods(array, PARAMETERS, select(["dcc_causal"]), DEFINITIONS)
    assert [outcome.column for outcome in outcomes] == ["dcc_causal[level]", "dcc_causal[residual]"]


def test_warning_in_motion(make_array):
    array = make_array(100, [0.1, 0.1, 0.1], weights=weights_for(100, 3))
    array = replace(array, at_rest=np.zeros(100, dtype=bool))
    moving = replace(PARAMETERS, in_motion=True)
    notes = {o.definition: o.note for o in run_methods(array, moving, select(["dcc_causal"]), DEFINITIONS)}
    assert "bias" in notes["level"]
    assert notes["residual"] == ""
    assert all(o.note == "" for o in run_methods(array, PARAMETERS, select(["dcc_causal"]), DEFINITIONS))


def test_reason_why_there_are_no_weights(make_array):
    array = replace(make_array(60, [0.1, 0.1]), no_weights={("dcc", "causal", "level"): "too short: 60 samples"})
    (outcome,) = run_methods(array, PARAMETERS, select(["dcc_causal"]), ("level",))
    assert (outcome.fused, outcome.column, outcome.note) == (None, "", "too short: 60 samples.")


def test_share_of_equal_weights_is_told(make_array):
    weights = weights_for(100, 3)
    some = every(weights["dcc", "causal", "level"])
    some[:25] = 1 / 3
    weights["dcc", "causal", "level"] = SampleWeights.of(some, np.arange(100))
    (outcome,) = run_methods(
        make_array(100, [0.1] * 3, weights=weights), PARAMETERS, select(["dcc_causal"]), ("level",)
    )
    assert "equal weights for 25.0%" in outcome.note


def test_what_cannot_run_says_why(make_array):
    outcomes = {
        o.method.name: o for o in run_methods(make_array(60, [0.1, 0.1]), PARAMETERS, select("all"), ("level",))
    }
    for name in ("dcc_causal", "ccc_in_sample", "rolling_moment"):
        assert outcomes[name].fused is None
        assert outcomes[name].column == ""
        assert outcomes[name].note
    assert outcomes["jiang_markov"].fused is not None


def test_one_gyro(make_array):
    for outcome in run_methods(make_array(60, [0.1]), PARAMETERS, select("all"), ("level",)):
        assert outcome.fused is None
        assert outcome.note.startswith("one gyro")


def test_rates_that_are_not_finite(make_array):
    array = make_array(60, [0.1, 0.1])
    array.rate[3, 1] = np.nan
    (outcome,) = run_methods(array, PARAMETERS, select(["average"]), ())
    assert outcome.fused is None
    assert outcome.note == "1 of 60 samples are not finite"


def test_unknown_method():
    with pytest.raises(ConfigError, match="did you mean 'jiang_markov'"):
        select(["jiang_markof"])
    assert [method.name for method in select(["median", "average"])] == ["average", "median"]


def test_parameters_from_the_options():
    options = FusionOptions(arw_deg_rt_h=6.0, q_dynamic=1.9)
    rest, motion = (FilterParameters.of(options, in_motion) for in_motion in (False, True))
    assert (rest.bandwidth_hz, rest.q, rest.arw) == (1.0, None, pytest.approx(0.1))
    assert (motion.bandwidth_hz, motion.q, motion.in_motion) == (5.0, 1.9, True)
    assert VolatilityOptions().rate_hz == rest.block_hz


def test_shapes_that_do_not_fit(make_array):
    array = make_array(10, [0.1, 0.1])
    with pytest.raises(DataError, match="do not fit"):
        ArrayRates(array.rate, 200.0, array.segment[:5], array.at_rest, array.noise)


def test_the_guide_names_every_method(root):
    guide = (root / "docs/fusion.md").read_text(encoding="utf-8")
    assert [name for name in METHODS if f"`{name}`" not in guide] == []


@pytest.mark.parametrize("name", METHODS)
def test_what_a_method_needs(make_array, name):
    # `needs` is the whole truth: without it the method cannot run, without the other two it can.
    array = make_array(4000, [0.05, 0.1, 0.1], weights=weights_for(4000, 3))
    array = replace(array, deviations=deviations_for(4000, 3))
    unknown = np.full(3, math.nan)
    without = {
        "arw": replace(array, noise=replace(array.noise, arw=unknown)),
        "rrw": replace(array, noise=replace(array.noise, rrw=unknown)),
        "weights": replace(array, weights={}),
    }
    for what, poorer in without.items():
        (outcome,) = run_methods(poorer, PARAMETERS, select([name]), ("level",))
        assert (outcome.fused is None) == (what in METHODS[name].needs)


@pytest.mark.parametrize(("length", "said"), [(299, 299), (300, 300), (400, 300)])
def test_a_reason_is_three_hundred_characters_at_most(length, said):
    found = failure(METHODS["average"], ValueError("x" * length + "\nmore"))
    assert found == f"failed: ValueError: {'x' * said} (a bug in vgyro; the traceback is in the log)"
    assert failure(METHODS["average"], CannotRun("too short.")) == "failed: too short"
