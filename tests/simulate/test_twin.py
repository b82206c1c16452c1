"""Twin files: mistakes are named, manifests are valid, and the shipped twins hold the papers' figures."""

from pathlib import Path

import numpy as np
import pytest

from vgyro.config import Analysis, override_analysis
from vgyro.dataset import parse_manifest
from vgyro.simulate import (
    Twin,
    allan_minimum,
    check_against_board,
    expected_allan,
    manifest_of,
    manifest_yaml,
    parse_twin,
    truth_of,
)
from vgyro.validation import InvalidFile

SHIPPED = ("calibration", "demo", "faulty", "jiang2012", "liu2015")
HEAD = "name: t\nboard: dsp6\nseed: 1\n"
# As printed in Liu et al. (2015), Table 3: mean deg/s, 1σ deg/s, ARW deg/√h, bias drift deg/h.
LIU = {
    "g1": (0.0086, 0.0418, 1.74, 38.02),
    "g2": (0.0092, 0.0436, 1.74, 38.88),
    "g3": (0.0110, 0.0545, 1.86, 42.52),
    "g4": (0.1022, 0.1051, 2.94, 73.19),
    "g5": (0.0082, 0.0484, 1.85, 47.02),
    "g6": (0.0066, 0.0446, 1.73, 32.78),
}


def shipped(root: Path, name: str) -> Twin:
    path = root / f"config/twins/{name}.yaml"
    return parse_twin(path.read_text(encoding="utf-8"), str(path))


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_twins_are_valid(root: Path, dsp6, name: str) -> None:
    twin = shipped(root, name)
    assert twin.name == name
    assert check_against_board(twin, dsp6, name) == []
    manifest = manifest_of(twin)
    assert manifest.simulated
    assert manifest.twin == name
    assert parse_manifest(manifest_yaml(manifest), "dataset.yaml") == manifest


def test_references_of_the_manifest(twin: Twin) -> None:
    manifest = manifest_of(twin)
    table = manifest.recording("table").reference
    assert table is not None
    assert table.kind == "plateaus"
    assert [plateau.rate for plateau in table.plateaus] == [0, 100, -50]
    assert manifest.recording("still").reference is None
    assert manifest.recording("shaken").reference.file == "shaken_reference.parquet"
    swing = manifest.recording("swing").reference
    assert (swing.amplitude, swing.frequency_hz, swing.phase_rad) == (60, 0.25, 0)
    assert manifest.recording("swing").rate_hz == 500


def test_analysis_of_a_twin_may_be_partial() -> None:
    # A step above the default window is right where config.yaml's window is longer.
    recordings = "recordings: [{name: a, kind: static, duration_s: 1}]\n"
    twin = parse_twin(HEAD + f"gyros: {{}}\n{recordings}analysis: {{volatility: {{step: 500}}}}", "t.yaml")
    manifest = manifest_of(twin)
    assert manifest.analysis is not None
    assert manifest.analysis.model_dump(exclude_unset=True) == {"volatility": {"step": 500}}


@pytest.mark.parametrize("name", ["jiang2012", "liu2015", "demo", "endurance"])
def test_bekk_is_for_the_twins_of_the_papers(root: Path, name: str) -> None:
    options = override_analysis(Analysis(), manifest_of(shipped(root, name)).analysis)
    assert options.bekk == (name in ("jiang2012", "liu2015"))


def test_overrides_go_over_all(root: Path) -> None:
    demo = shipped(root, "demo")
    truth = truth_of(demo, demo.recording("constant"), "g4")
    assert (truth.bias_deg_s, truth.scale_error, truth.arw) == (3.25, -0.012, 6.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "gyros: {all: {arw_deg_h: 6}}\nrecordings: [{name: a, kind: static, duration_s: 1}]",
            "did you mean 'arw_deg_rt_h'",
        ),
        ("gyros: {}\nrecordings: [{name: a, kind: static}]", "give duration_s"),
        ("gyros: {}\nrecordings: [{name: noise, kind: static, duration_s: 1}]", "no recording can be named 'noise'"),
        ("gyros: {}\nrecordings: [{name: a, kind: calibration, duration_s: 5}]", "needs motion of kind rate_table"),
        (
            "gyros: {all: {garch: {alpha: 0.5, beta: 0.6}}}\nrecordings: [{name: a, kind: static, duration_s: 1}]",
            "must be below 1",
        ),
        (
            "gyros: {all: {arw_deg_rt_h: 1}, g1: {garch: {alpha: .1, beta: .1, omega: 1}}}\n"
            "recordings: [{name: a, kind: static, duration_s: 1}]",
            "leave one of them out",
        ),
        (
            "gyros: {}\nrecordings: [{name: a, kind: static, duration_s: 1, "
            "faults: [{kind: drift, gyro: g1, start: 0}]}]",
            "needs a size",
        ),
    ],
)
def test_mistakes_are_named(text: str, message: str) -> None:
    with pytest.raises(InvalidFile, match=message):
        parse_twin(HEAD + text, "t.yaml")


def test_mistakes_against_the_board(dsp6) -> None:
    twin = parse_twin(
        HEAD + "gyros: {gyro1: {}}\ncorrelation: -0.3\nslow_correlation: [[1, 0.5], [0.5, 1]]\n"
        "recordings: [{name: a, kind: static, duration_s: 1, faults: [{kind: stuck, gyro: g9, start: 2}]}]",
        "t.yaml",
    )
    text = "\n".join(str(problem) for problem in check_against_board(twin, dsp6, "t.yaml"))
    for part in ("no gyro 'gyro1'", "must be above -0.2", "expected 6 rows of 6", "no gyro 'g9'", "after the end"):
        assert part in text


def test_jiang_has_the_printed_single_gyroscope(root: Path) -> None:
    # Jiang et al. (2012), Table 2. The 40 Hz pole takes 1.5·Tc of the variance at 1 s (METRICS: shape factor).
    twin = shipped(root, "jiang2012")
    truth = truth_of(twin, twin.recording("static"), "g1")
    tau, lowest = allan_minimum(truth)
    assert lowest * 3600 == pytest.approx(54.11, abs=0.01)
    assert tau == pytest.approx(131, abs=1)
    assert truth.rrw_deg_h_rt_h == 294.28
    at_one_second = np.sqrt(expected_allan(truth, np.array(1.0)) ** 2 - (truth.arw / 60) ** 2 * 1.5 * pole_time())
    assert at_one_second * 60 == pytest.approx(6.17, abs=0.01)


def pole_time() -> float:
    """Time constant by which means of noise behind the sampled pole lose variance: Σ of its correlations, 2φ/(1-φ²)."""
    phi = np.exp(-2 * np.pi * 40 / 200)
    return 2 * phi / (1 - phi**2) / 200


def flicker_variance(duration: float = 3600.0) -> float:
    """Variance of 1 Hz means of flicker with B = 1 that begins at 1/(2·duration), mean removed, by summing its bins."""
    k = np.arange(1, int(200 * duration))
    mean_removed = 1 - np.sinc(k / 2) ** 2
    return float(np.sum(mean_removed * np.sinc(k / (2 * duration)) ** 2 / k) / np.pi)


def slow_shape(twin: Twin, gyro: str) -> np.ndarray:
    """The part that is known, deg/s at 1 Hz: bias, self-heating, and the ramp of gyro 4."""
    time = np.arange(3600) + 0.5
    static, thermal = twin.recording("static"), twin.temperature
    truth = truth_of(twin, static, gyro)
    shape = truth.bias_deg_s + truth.temperature_coefficient * thermal.rise_k * (
        1 - np.exp(-time / thermal.time_constant_s)
    )
    for fault in static.faults:
        if fault.gyro == gyro and fault.kind == "drift":
            shape = shape + fault.size * np.clip((time - fault.start) / (3600 - fault.start), 0, None)
    return shape


def white_variance(twin: Twin, gyro: str) -> float:
    static = twin.recording("static")
    gain = np.ones(3600)
    for fault in static.faults:
        if fault.gyro == gyro and fault.kind == "noise":
            gain[int(fault.start) :] *= fault.size
    return float((truth_of(twin, static, gyro).arw / 60) ** 2 * np.mean(gain**2))


def allan_variance(shape: np.ndarray, m: int) -> float:
    sums = np.concatenate([[0.0], np.cumsum(shape)])
    means = (sums[m:] - sums[:-m]) / m
    return float(np.mean((means[m:] - means[:-m]) ** 2) / 2)


@pytest.mark.parametrize("gyro", LIU)
def test_liu_expects_the_printed_single_gyroscopes(root: Path, gyro: str) -> None:
    # Closed forms in the comment of liu2015.yaml against the paper's Table 3, all four columns.
    twin = shipped(root, "liu2015")
    mean, sigma, arw, drift = LIU[gyro]
    b2 = (truth_of(twin, twin.recording("static"), gyro).bias_instability_deg_h / 3600) ** 2
    shape, white = slow_shape(twin, gyro), white_variance(twin, gyro)
    floor = 2 * np.log(2) / np.pi * b2
    assert shape.mean() == pytest.approx(mean, rel=0.01)
    assert np.sqrt(white * (1 - pole_time()) + flicker_variance() * b2 + shape.var()) == pytest.approx(sigma, rel=0.005)
    assert 60 * np.sqrt(white * (1 - 1.5 * pole_time()) + floor) == pytest.approx(arw, rel=0.005)
    curve = [
        white / m + floor + allan_variance(shape, m) for m in np.unique(np.rint(2 ** (np.arange(31) / 3)).astype(int))
    ]
    assert 3600 * np.sqrt(min(curve)) == pytest.approx(drift, rel=0.01)


def test_liu_expects_the_printed_average(root: Path) -> None:
    # Table 3, "Simple average": mean 0.0243, 1σ 0.0231, ARW 1.03, bias drift 19.91; the last was not a target.
    twin = shipped(root, "liu2015")
    shape = np.mean([slow_shape(twin, gyro) for gyro in LIU], axis=0)
    sds = np.sqrt([white_variance(twin, gyro) for gyro in LIU])
    b2 = sum((truth_of(twin, twin.recording("static"), g).bias_instability_deg_h / 3600) ** 2 for g in LIU) / 36
    assert isinstance(twin.correlation, float)
    white = ((sds**2).sum() * (1 - twin.correlation) + twin.correlation * sds.sum() ** 2) / 36
    floor = 2 * np.log(2) / np.pi * b2
    assert shape.mean() == pytest.approx(0.0243, rel=0.01)
    assert np.sqrt(white + flicker_variance() * b2 + shape.var()) == pytest.approx(0.0231, rel=0.01)
    assert 60 * np.sqrt(white * (1 - 1.5 * pole_time()) + floor) == pytest.approx(1.03, rel=0.01)
    curve = [
        white / m + floor + allan_variance(shape, m) for m in np.unique(np.rint(2 ** (np.arange(31) / 3)).astype(int))
    ]
    assert 3600 * np.sqrt(min(curve)) == pytest.approx(19.91, rel=0.02)


def test_liu_alpha_and_beta_are_those_of_table_2(root: Path) -> None:
    twin = shipped(root, "liu2015")
    assert twin.dcc is not None
    assert (twin.dcc.a, twin.dcc.b) == (0.0310, 0.9484)
    printed = {"g1": (0.031432, 0.685944), "g2": (0.039131, 0.904651), "g3": (0.086132, 0.865696),
               "g5": (0.039739, 0.906221), "g6": (0.057514, 0.681433)}  # fmt: skip
    for gyro, pair in printed.items():
        garch = twin.gyros[gyro].garch
        assert garch is not None
        assert (garch.alpha, garch.beta) == pair
