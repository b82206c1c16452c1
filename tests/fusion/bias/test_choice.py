"""How walks and models are chosen, rule by rule: likelihoods that are given, both sides of each bound."""

import math
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from vgyro.fusion import ArrayNoise, ArrayRates
from vgyro.fusion.bias import followed
from vgyro.fusion.bias.blocks import SlowBlocks
from vgyro.fusion.bias.choice import _highest, _Search
from vgyro.fusion.bias.followed import BiasCase
from vgyro.fusion.bias.model import BiasEvidence, Walk
from vgyro.fusion.bias.smoother import Filtered


@pytest.mark.parametrize("top", [-1.3, 0.0, 0.77])
def test_the_highest_point_of_a_parabola(top):
    # Closed form: 5 - 3·(log s - top)².
    scale, value = _highest(lambda scales: 5.0 - 3.0 * (np.log(scales) - top) ** 2, (math.exp(-3), math.exp(2)))
    assert math.log(scale) == pytest.approx(top, abs=1e-9)
    assert value == pytest.approx(5.0, abs=1e-9)
    # Highest at an end: the end.
    assert _highest(lambda scales: np.log(scales), (0.1, 8.0)) == pytest.approx((8.0, math.log(8.0)))


def search(together, fading, each):
    """A search in which models have these gains, 2Δ log likelihood over the walks as given."""
    lasting, fades = Walk(np.full(3, 2.0), gain=together), Walk(np.full(3, 2.0), 50.0, fading)
    return SimpleNamespace(
        information=None,
        given=np.ones(3),
        bounds=(0.1, 10.0),
        values=lambda _, walks: [0.0] * len(walks),
        _together=lambda *_: (lasting, fades),
        _each=lambda *_: (np.array([1.0, 2.0, 3.0]), each / 2.0),
    )


@pytest.mark.parametrize(
    ("gains", "rrw", "tau_s"),
    [
        ((3.8, 0.0, 0.0), [1.0] * 3, math.inf), ((3.9, 0.0, 0.0), [2.0] * 3, math.inf),
        ((3.9, 7.7, 0.0), [2.0] * 3, math.inf), ((3.9, 7.8, 0.0), [2.0] * 3, 50.0),
        ((3.9, 7.8, 15.5), [2.0] * 3, 50.0), ((3.9, 7.8, 15.7), [1.0, 2.0, 3.0], 50.0),
        ((0.0, 0.0, 7.7), [1.0] * 3, math.inf), ((0.0, 0.0, 7.9), [1.0, 2.0, 3.0], math.inf),
    ],
)  # fmt: skip
def test_another_walk_is_believed_from_five_percent_on(gains, rrw, tau_s):
    # Expected: the 95 % quantiles of chi², 3.841 of one degree of freedom, 7.815 of three (tables).
    found = _Search.best(search(*gains), slopes=True)
    assert (found.rrw.tolist(), found.tau_s) == (rrw, tau_s)


def test_walks_of_each_are_sought_until_the_likelihood_is_flat():
    # Closed form: the likelihood -½·Σ(log K - 1)², begun at K = 1, where its slope is 1 each: K = e of all; a ratio
    # between them would cost, so there is none.
    def likelihood(_, walk):
        away = np.log(walk.rrw) - 1.0
        return -0.5 * float(away @ away), -away

    fake = SimpleNamespace(bounds=(1e-3, 1e3), _likelihood=likelihood)
    found, value = _Search._each(fake, None, np.ones(3), math.inf)
    np.testing.assert_allclose(np.log(found), 1.0, atol=0.5)
    assert value > -0.5 * 3 * 0.25


@pytest.mark.parametrize(("gain", "looked"), [(3.9, False), (4.1, True)])
def test_a_warm_up_is_looked_for_where_walks_are_far_from_the_record(monkeypatch, gain, looked):
    # Rule: four units of ln(blocks), and from 60 blocks on.
    price = math.log(100)
    asked = []
    monkeypatch.setattr(followed, "quick_gains", lambda *_: asked.append(1) or [-1e9])

    class Blocks(list):
        time = np.arange(100.0)

    case = SimpleNamespace(
        blocks=Blocks(range(100)), walk=None, arw=None, parameters=SimpleNamespace(has=lambda _: True),
        _evidence=lambda *_: None, array=SimpleNamespace(noise=SimpleNamespace(rrw=None)),
    )  # fmt: skip
    plain = SimpleNamespace(choice=SimpleNamespace(walk=Walk(np.ones(3), gain=gain * price)), common=0.0, evidence=None)
    assert BiasCase._or_course(case, plain) is plain
    assert bool(asked) == looked


@pytest.mark.parametrize(("anchored", "known"), [(False, False), (False, True), (True, False)])
def test_what_all_share_is_not_seen_without_an_anchor(anchored, known):
    # By definition: sums over the gyros of the biases, and of slopes that are not known, say nothing of either.
    rows = np.random.default_rng(1).standard_normal((40, 7))
    nothing = np.zeros(0)
    given = Filtered(nothing, nothing, nothing, nothing, nothing, rows.T @ rows, 0.0)
    fake = SimpleNamespace(anchored=anchored, plain=3, gyros=3, known_slopes=known, unseen=np.zeros(0, dtype=int))
    squares = BiasEvidence._cleared(fake, given).squares
    biases, slopes = (np.abs(squares[part].sum(axis=0)).max() < 1e-9 for part in (slice(1, 4), slice(4, 7)))
    assert (biases, slopes) == (not anchored, not anchored and not known)


def test_pieces_of_samples_lie_in_one_stretch_each():
    # By definition: the samples asked for, cut where a stretch begins, each with the blocks whose middles are in it and
    # next to it.
    segment = np.repeat([0, 1, 2], [1000, 500, 700])
    zero = np.zeros(2200)
    noise = ArrayNoise(np.ones(2), np.ones(2), np.eye(2))
    blocks = SlowBlocks.of(ArrayRates(np.zeros((2200, 2)), 100.0, segment, zero == 0, noise))
    for rows, edges in ((slice(0, 2200), (0, 1000, 1500, 2200)), (slice(300, 1600), (300, 1000, 1500, 1600)),
                        (slice(1000, 1500), (1000, 1500)), (slice(200, 900), (200, 900))):  # fmt: skip
        pieces = list(blocks.pieces(rows))
        assert [(one.start, one.stop) for one, _ in pieces] == list(pairwise(edges))
        for samples, near in pieces:
            assert len(set(blocks.stretch[near])) == 1
            inside = (blocks.middle >= samples.start) & (blocks.middle < samples.stop)
            assert set(np.flatnonzero(inside)) <= set(range(near.start, near.stop))
            assert near.stop - near.start <= inside.sum() + 2
