"""Verdicts on synthetic figures: each rule reaches each verdict that it can reach."""

import math

import pytest

from vgyro.papers import PAPERS, Claim, Ours, PaperEvidence, judge, load_paper
from vgyro.papers.claims import ratio
from vgyro.papers.implied_cells import implied_figures

A, B = {"artefact": "metrics", "method": "a"}, {"artefact": "metrics", "method": "b"}


def evidence(**figures):
    rows = [{"method": name, "value": v, "low": low, "high": high} for name, (v, low, high) in figures.items()]
    return PaperEvidence({"metrics": rows}, ("a", "b"))


def outcome(rule, found, implied=None):
    claim = Claim.model_validate({"name": "n", "text": "t", "where": "w", "rule": rule})
    return judge(claim, found, implied or {})


def test_value_rule():
    rule = {"kind": "value", "means": "x", "figure": A, "below": 1.0}
    assert outcome(rule, evidence(a=(0.5, 0.4, 0.6))).outcome == "holds"
    assert outcome(rule, evidence(a=(1.5, 1.4, 1.6))).outcome == "does not hold"
    straddles = outcome(rule, evidence(a=(0.9, 0.7, 1.1)))
    assert straddles.outcome == "cannot be decided"
    assert "both sides" in straddles.reason
    missing = outcome(rule, evidence(b=(1.0, 0.9, 1.1)))
    assert missing.outcome == "cannot be decided"
    assert "missing" in missing.reason


def test_value_rule_without_power_leaves_it_open():
    rule = {"kind": "value", "means": "p", "figure": A, "below": 0.05, "undecided_if_not": "no power"}
    assert outcome(rule, evidence(a=(0.01, math.nan, math.nan))).outcome == "holds"
    weak = outcome(rule, evidence(a=(0.2, math.nan, math.nan)))
    assert weak.outcome == "cannot be decided"
    assert "no power" in weak.reason


def test_value_rule_of_each_gyro():
    rule = {"kind": "value", "means": "p", "figure": {"artefact": "metrics", "method": "$each"}, "below": 0.05}
    both = evidence(a=(0.01, math.nan, math.nan), b=(0.02, math.nan, math.nan))
    assert outcome(rule, both).outcome == "holds"
    one = outcome(rule, evidence(a=(0.01, math.nan, math.nan), b=(0.5, math.nan, math.nan)))
    assert one.outcome == "does not hold"
    assert "p of b" in one.reason


def test_ratio_rule():
    rule = {"kind": "ratio", "means": "a over b", "of": A, "to": B, "below": 0.8}
    assert outcome(rule, evidence(a=(0.5, 0.49, 0.51), b=(1.0, 0.98, 1.02))).outcome == "holds"
    assert outcome(rule, evidence(a=(1.0, 0.98, 1.02), b=(1.0, 0.98, 1.02))).outcome == "does not hold"
    assert outcome(rule, evidence(a=(0.8, 0.7, 0.9), b=(1.0, 0.98, 1.02))).outcome == "cannot be decided"
    assert outcome(rule, evidence(a=(0.8, 0.7, 0.9), b=(0.0, 0.0, 0.0))).outcome == "cannot be decided"


def test_ratio_limits_add_relative_widths_in_quadrature():
    found = ratio(Ours(2.0, 1.94, 2.06), Ours(1.0, 0.96, 1.04))
    assert (found.value, found.low, found.high) == pytest.approx((2.0, 1.9, 2.1))


def test_a_paired_ratio_decides_by_itself():
    rule = {"kind": "ratio", "paired": True, "means": "a over b", "of": A, "to": B, "below": 0.97}
    found = outcome(rule, evidence(a=(0.9, 0.5, 1.4), b=(1.0, 0.6, 1.5)))
    assert found.outcome == "holds"
    assert "[" not in found.reason


def test_two_sided_bounds():
    rule = {"kind": "ratio", "means": "a over b", "of": A, "to": B, "above": 0.9, "below": 1.1}
    assert outcome(rule, evidence(a=(1.0, 0.99, 1.01), b=(1.0, 0.99, 1.01))).outcome == "holds"
    for value in (0.5, 2.0):
        assert outcome(rule, evidence(a=(value, value, value), b=(1.0, 1.0, 1.0))).outcome == "does not hold"


def test_implied_rule():
    rule = {"kind": "implied", "figure": "f", "means": "f", "above": 4.085, "below": 4.095}
    assert outcome(rule, evidence(), {"f": 4.09}).outcome == "holds"
    assert outcome(rule, evidence(), {"f": 4.12}).outcome == "does not hold"


def test_built_in_rule_is_never_decided():
    assert outcome({"kind": "built_in", "because": "built so"}, evidence()).reason == "built so"


def test_all_rule_takes_the_worst():
    part = {"kind": "value", "means": "x", "below": 1.0}
    rule = {"kind": "all", "rules": [{**part, "figure": A}, {**part, "figure": B}]}
    good, bad = (0.5, 0.4, 0.6), (1.5, 1.4, 1.6)
    assert outcome(rule, evidence(a=good, b=good)).outcome == "holds"
    assert outcome(rule, evidence(a=good)).outcome == "cannot be decided"
    assert outcome(rule, evidence(a=bad)).outcome == "does not hold"


def test_a_rule_without_bounds_is_refused():
    with pytest.raises(ValueError, match="needs above or below"):
        outcome({"kind": "value", "means": "x", "figure": A}, evidence())


def test_the_comment_of_the_verdict_is_added_and_no_other():
    rule = {"kind": "value", "means": "x", "figure": A, "below": 1.0}
    claim = Claim.model_validate(
        {"name": "n", "text": "t", "where": "w", "rule": rule, "comment": {"does not hold": "too large"}}
    )
    assert judge(claim, evidence(a=(2.0, 1.9, 2.1)), {}).reason.endswith("; too large")
    assert "too large" not in judge(claim, evidence(a=(0.5, 0.4, 0.6)), {}).reason


@pytest.mark.parametrize("name", PAPERS)
def test_every_claim_can_be_judged_without_any_figure(name):
    paper = load_paper(name)
    for claim in paper.claims:
        verdict = judge(claim, PaperEvidence({}, ()), implied_figures(paper))
        decided_by_equations = claim.rule.kind == "implied"
        assert (verdict.outcome != "cannot be decided") == decided_by_equations
        assert verdict.reason


def test_the_printed_factor_of_bias_drift_does_not_hold():
    # 272.41 / 6 / 11.02 = 4.12, printed 4.09.
    paper = load_paper("liu2015")
    claims = {claim.name: judge(claim, PaperEvidence({}), implied_figures(paper)).outcome for claim in paper.claims}
    assert claims["improvement factor of bias drift"] == "does not hold"
    assert claims["improvement factor of the mean"] == "holds"
