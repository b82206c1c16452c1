"""Methods of ours beside the paper's: which is the best, ratios, what an interval that holds 1 or a target says."""

import math

import pytest

from vgyro.dataset import Manifest
from vgyro.papers import PAPERS, PaperEvidence, load_paper
from vgyro.papers.beside import set_beside
from vgyro.papers.published import PublishedTable
from vgyro.tasks.papers.evidence import at_added_rate
from vgyro.tasks.papers.own import own_counts, own_methods

TABLE = {
    "number": 3,
    "title": "A table",
    "where": "Table 3",
    "unit": "deg/s",
    "select": {"artefact": "metrics", "definition": ""},
    "rows": [{"name": "Average", "select": {"method": "average"}}, {"name": "Filter", "select": {"method": "filter"}}],
    "columns": [{"name": "1σ", "select": {"metric": "sigma"}}],
    "values": [["1"], ["2"]],
    "variants": [{"name": "raw"}],
    "beside": {
        "methods": [{"name": "new", "select": {"method": "new"}}],
        "rivals": ["Average", "Filter"],
        "figures": [
            {"name": "1σ", "select": {"metric": "sigma"}},
            {"name": "paired", "select": {"metric": "mean", "absolute": True}, "paired": "ratios"},
            {"name": "Amplitude", "select": {"metric": "amplitude"}, "target": 62.83, "within": 0.5},
        ],
        "cases": [{"name": "at rest"}, {"name": "at {rate} deg/s", "suffix": "_moved"}],
    },
}


def table(**changes):
    record = {**TABLE, "beside": {**TABLE["beside"], **changes}}
    return PublishedTable.model_validate(record)


def row(method, metric, value, half, **more):
    about = {"method": method, "definition": "", "metric": metric, "unit": "deg/s"}
    return {**about, "value": value, "low": value - half, "high": value + half, **more}


def metrics(sigma=1.0, half=0.03, amplitude=62.8):
    return [
        row("average", "sigma", 2.0, 0.08), row("filter", "sigma", 4.0, 0.1), row("new", "sigma", sigma, half),
        row("average", "mean", 0.4, 0.1), row("filter", "mean", -0.1, 0.1), row("new", "mean", 0.2, 0.1),
        row("new", "amplitude", amplitude, 0.1),
    ]  # fmt: skip


def ratios():
    over = [("average", 0.5), ("filter", 2.0)]
    return [
        {**row("new", "mean", value, 0.1), "over_method": name, "over_definition": "", "unit": "1"}
        for name, value in over
    ]


def of(found, figure, method="new", case="at rest"):
    (one,) = [one for one in found if (one.figure, one.method, one.case) == (figure, method, case)]
    return one


def test_the_ratio_is_to_the_least_of_the_papers_methods():
    found = set_beside(table(), PaperEvidence({"metrics": metrics(), "ratios": ratios()}))
    sigma = of(found, "1σ")
    # Relative half-widths of 0.03/1 and 0.08/2 in quadrature: 0.05 of 0.5.
    assert (sigma.over, sigma.standing, sigma.own) == ("Average", "better", True)
    assert (sigma.ratio.value, sigma.ratio.low, sigma.ratio.high) == pytest.approx((0.5, 0.475, 0.525))
    # Of a mean the magnitude counts: the filter's 0.1, and the paired ratio to it is read, not computed.
    paired = of(found, "paired")
    assert (paired.over, paired.ratio.value, paired.standing) == ("Filter", 2.0, "worse")
    theirs = of(found, "1σ", "Filter")
    assert (theirs.own, theirs.over, theirs.standing, theirs.value.value) == (False, "", "none", 4.0)


@pytest.mark.parametrize(("sigma", "half", "standing"), [(1.98, 0.1, "undecided"), (2.5, 0.1, "worse")])
def test_an_interval_that_holds_1_decides_nothing(sigma, half, standing):
    found = set_beside(table(), PaperEvidence({"metrics": metrics(sigma, half), "ratios": ratios()}))
    assert of(found, "1σ").standing == standing


@pytest.mark.parametrize(("amplitude", "standing"), [(62.8, "met"), (62.3, "undecided"), (60.0, "missed")])
def test_a_target_is_met_where_the_whole_interval_is_near(amplitude, standing):
    one = of(set_beside(table(), PaperEvidence({"metrics": metrics(amplitude=amplitude)})), "Amplitude")
    assert (one.standing, one.over) == (standing, "")
    assert math.isnan(one.ratio.value)


def test_a_case_without_artefacts_is_left_out_and_the_rate_is_named():
    assert {one.case for one in set_beside(table(), PaperEvidence({"metrics": metrics()}))} == {"at rest"}
    moved = [{**one, "true_rate": 0.05} for one in metrics(sigma=3.0)]
    found = set_beside(table(), PaperEvidence({"metrics": metrics(), "metrics_moved": moved}))
    assert {one.case for one in found} == {"at rest", "at 0.05 deg/s"}
    assert of(found, "1σ", case="at 0.05 deg/s").standing == "worse"


def test_a_missing_figure_says_why():
    found = set_beside(table(), PaperEvidence({"metrics": []}))
    assert all(one.value.reason and one.standing == "none" for one in found)
    assert of(found, "1σ").ratio.reason == "the paper's methods have no such figure"


def test_a_rival_that_the_table_does_not_have_is_refused():
    with pytest.raises(ValueError, match="no 'Median' to compare with"):
        table(rivals=["Median"])


def test_figures_at_an_added_rate_are_the_moved_ones_and_those_that_do_not_move():
    rest = {"name": "rest", "kind": "static", "files": ["a"]}
    turning = {"name": "turning", "kind": "constant", "files": ["b"], "reference": {"kind": "constant", "rate": 40}}
    manifest = Manifest.model_validate({"board": "dsp6", "recordings": [rest, turning]})
    place = {"recording": "rest", "axis": "z"}
    rows = [
        row("average", "sigma", 1.0, 0.1, true_rate=0.0, **place),
        row("dcc", "sigma", 1.0, 0.1, true_rate=0.0, **place),
        row("dcc", "sigma", 5.0, 0.1, true_rate=0.05, **place),
        # Not an added rate: the table turned.
        row("average", "sigma", 7.0, 0.1, true_rate=40.0, recording="turning", axis="z"),
    ]
    found = {one["method"]: one["value"] for one in at_added_rate(rows, manifest)}
    assert found == {"average": 1.0, "dcc": 5.0}
    assert at_added_rate(rows[:2], manifest) == []


def test_the_part_of_the_page_counts_and_marks():
    evidence = PaperEvidence({"metrics": metrics(), "ratios": ratios()})
    found = set_beside(table(), evidence)
    ((name, said),) = own_counts({3: found})
    assert name == "new"
    assert said == (
        "2 ratios to the paper's best: 1 better, 0 undecided (the interval holds 1), 1 worse; "
        "1 targets: 1 met, 0 undecided, 0 missed"
    )
    text = str(own_methods(table(), found))
    for part in ("vgyro, not in the paper", "simulated", "methods of the paper, on the same board", "at rest"):
        assert part in text
    assert own_methods(table(), ()) == ""


def test_what_a_filter_does_by_its_shape_is_told():
    rows = metrics()
    rows[2]["note"] = "low-passed to 1 Hz; forward and back: by its shape alone it passes 0.88"
    text = str(own_methods(table(), set_beside(table(), PaperEvidence({"metrics": rows}))))
    assert "<li>forward and back: by its shape alone it passes 0.88</li>" in text


@pytest.mark.parametrize("name", PAPERS)
def test_every_table_of_virtual_gyroscopes_has_ours_beside_it(name):
    beside = {part.number: part.beside for part in load_paper(name).tables if part.beside}
    assert set(beside) == ({2, 3} if name == "jiang2012" else {3})
    for part in beside.values():
        assert [method.select["method"] for method in part.methods] == ["recommended", "recommended_unsmoothed"]
