"""vgyro simulate: the data set it writes is one that vgyro check and vgyro decode accept."""

import pytest

TWIN = """\
name: pair
title: two gyros at rest
board: tiny
seed: 1
gyros:
  all: {arw_deg_rt_h: 6.0}
recordings:
- {name: rest, kind: static, duration_s: 5}
"""


@pytest.fixture
def twin(project):
    path = project / "config/twins/pair.yaml"
    path.write_text(TWIN)
    return path


def test_a_twin_becomes_a_data_set(project, twin, vgyro):
    outcome = vgyro("simulate", twin.stem)
    assert (outcome.code, outcome.err) == (0, "")
    assert outcome.out == "raw/pair: simulated; next: snakemake --cores 2\n"
    assert "simulated: true" in (project / "raw/pair/dataset.yaml").read_text()
    assert vgyro("check").code == 0
    assert "500 good, 0 lost" in vgyro("decode", "raw/pair/rest.bin", "--board", "tiny").out


def test_the_seed_decides_the_bytes(project, twin, vgyro):
    for name, seed in (("a", 5), ("b", 5), ("c", 6)):
        assert vgyro("simulate", twin, "--out", project / name, "--seed", seed).code == 0
    a, b, c = ((project / name / "rest.bin").read_bytes() for name in "abc")
    assert a == b
    assert a != c


def test_a_data_set_is_overwritten_only_by_force(twin, vgyro):
    assert vgyro("simulate", twin.stem).code == 0
    outcome = vgyro("simulate", twin.stem)
    assert (outcome.code, outcome.err) == (
        2,
        "vgyro: raw/pair: there is a data set already. Give another folder by --out, or --force.\n",
    )
    assert vgyro("simulate", twin.stem, "--force").code == 0


@pytest.mark.usefixtures("twin")
def test_an_unknown_twin_gets_the_nearest(vgyro):
    outcome = vgyro("simulate", "piar")
    assert (outcome.code, outcome.err) == (2, "vgyro: there is no twin 'piar' in config/twins; did you mean 'pair'?\n")
    assert vgyro("simulate", "nowhere/x.yaml").code == 2


def test_a_wrong_twin_is_named_with_its_lines(twin, vgyro):
    twin.write_text(TWIN.replace("kind: static", "kind: statik"))
    outcome = vgyro("simulate", "pair")
    assert outcome.code == 3
    assert outcome.err.startswith("vgyro: config/twins/pair.yaml:8: recordings.0.kind: expected one of calibration,")
