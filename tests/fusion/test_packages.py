"""Methods of other installed packages: small packages, made here, that a subprocess finds on its path."""

import json
import os
import re
import subprocess
import sys
import textwrap
import tomllib
from dataclasses import replace

import pytest

from vgyro.fusion import METHODS
from vgyro.fusion.installed import _sources
from vgyro.fusion.packages import _wrong_field

HEAD = """
import json, logging
import numpy as np
from vgyro.fusion import METHODS, ArrayNoise, ArrayRates, FilterParameters, run_methods, select
from vgyro.fusion.registry import LEFT_OUT

def array(gyros=4):
    rate = np.random.default_rng(1).standard_normal((400, gyros))
    noise = ArrayNoise(np.full(gyros, 0.1), np.full(gyros, 0.001), np.eye(gyros))
    return ArrayRates(rate, 100.0, np.zeros(400, dtype=np.int32), np.ones(400, dtype=bool), noise)
"""
GOOD = """
from vgyro.fusion import Fused, Method

def fuse(array, parameters):
    return Fused.undelayed(array.rate[:, 0].copy())

def method(name="first_gyro", **more):
    return Method(name, "First gyro", "me", True, (), fuse, **more)
"""


def install(folder, name, version, module, source, entries):
    """What pip leaves of a package: its module, and a folder of metadata with its entry points."""
    folder.mkdir(exist_ok=True)
    (folder / f"{module}.py").write_text(textwrap.dedent(source), encoding="utf-8")
    about = folder / f"{name.replace('-', '_')}-{version}.dist-info"
    about.mkdir()
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n", encoding="utf-8")
    listed = "".join(f"{entry} = {value}\n" for entry, value in entries.items())
    (about / "entry_points.txt").write_text(f"[vgyro.methods]\n{listed}", encoding="utf-8")


def run(root, folders, code, head=HEAD):
    """Standard output, as JSON, and standard error of a program that sees these folders."""
    path = os.pathsep.join(map(str, [root, *folders]))
    done = subprocess.run(
        [sys.executable, "-c", head + textwrap.dedent(code)],
        env={**os.environ, "PYTHONPATH": path}, cwd=root, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout), done.stderr


@pytest.fixture
def example(root, tmp_path):
    """The package of docs/extending.md, as it is printed there."""
    text = (root / "docs/extending.md").read_text(encoding="utf-8")
    text = text[text.index("## A fusion method in a package of your own") :]
    project = tomllib.loads(re.search(r"```toml\n(.*?)```", text, re.DOTALL).group(1))
    source = re.search(r"```python\n(.*?)```", text, re.DOTALL).group(1)
    (module,) = project["tool"]["setuptools"]["py-modules"]
    about = project["project"]
    install(tmp_path / "site", about["name"], about["version"], module, source, about["entry-points"]["vgyro.methods"])
    return tmp_path / "site"


def test_the_example_of_the_documentation_runs(root, example):
    found, errors = run(root, [example], """
        one = METHODS["winsorised_mean"]
        outcomes = list(run_methods(array(), FilterParameters(), select(["winsorised_mean", "average"]), ()))
        few = list(run_methods(array(2), FilterParameters(), select(["winsorised_mean"]), ()))
        ordered = np.sort(array().rate, axis=1)
        expected = ordered[:, 1:3].mean(axis=1)
        print(json.dumps({
            "family": one.family, "package": one.package, "source": one.source, "last": list(METHODS)[-1],
            "states": [outcome.state for outcome in outcomes], "names": [o.method.name for o in outcomes],
            "error": float(np.abs(outcomes[1].fused.rate - expected).max()), "few": few[0].note, "left": LEFT_OUT,
        }))
    """)  # fmt: skip
    assert found["family"] == "other"
    assert found["package"] == "winsor-gyro 1.0"
    assert found["source"] == "Tukey (1962), Ann. Math. Stat. 33, 1-67; package winsor-gyro 1.0"
    assert found["last"] == "winsorised_mean"
    assert found["names"] == ["average", "winsorised_mean"]
    assert found["states"] == ["ran", "ran"]
    assert found["error"] < 1e-12
    assert found["few"] == "fewer than three gyros."
    assert found["left"] == []
    assert errors == ""


def test_the_configuration_knows_its_name(root, example):
    found, _ = run(root, [example], """
        from pathlib import Path
        from types import SimpleNamespace as N
        from vgyro.cli.check import _unknown_methods
        known = lambda *names: N(
            config=N(analysis=N(fusion=N(methods=names))), datasets={})
        path = Path("config/config.yaml")
        print(json.dumps([len(_unknown_methods(known("winsorised_mean"), path)),
                          [str(one) for one in _unknown_methods(known("winsorized_mean"), path)]]))
    """)  # fmt: skip
    assert found[0] == 0
    assert "did you mean 'winsorised_mean'" in found[1][0]


def test_the_accuracy_benchmark_ranks_it(root, example):
    found, _ = run(root, [example], """
        from benchmarks.accuracy.run import score
        from benchmarks.accuracy.scenario import load
        scenario = load("plain").shorter(60.0, 60.0)
        rows = score(scenario, 1, ["average", "winsorised_mean"])
        print(json.dumps([[row["method"], row["family"], row["state"], row["part"]] for row in rows]))
    """)  # fmt: skip
    for part in {row[3] for row in found}:
        mine = [row for row in found if row[3] == part]
        assert mine == [["average", "baseline", "ran", part], ["winsorised_mean", "other", "ran", part]]


def test_the_documents_of_vgyro_do_not_list_it(root, example):
    found, _ = run(root, [example], """
        from vgyro.cli.formats_guide import file_formats
        print(json.dumps("winsorised_mean" in file_formats()))
    """)  # fmt: skip
    assert found is False


def test_what_an_entry_point_may_be(root, tmp_path):
    source = (
        GOOD
        + """
one = method("one")
several = [method("two"), method("three")]
def made(): return method("four")
def made_several(): return (method("five"), method("six"))
"""
    )
    entries = {name: f"kinds:{name}" for name in ("one", "several", "made", "made_several")}
    install(tmp_path, "kinds", "2.0", "kinds", source, entries)
    found, _ = run(root, [tmp_path], "print(json.dumps([n for n, m in METHODS.items() if m.package == 'kinds 2.0']))")
    assert found == ["four", "five", "six", "one", "two", "three"]


BROKEN = {
    "raises": ("raise ValueError('no licence')\n", "x = broken:method", "ValueError: no licence"),
    "ends": ("import sys; sys.exit('bye')\n", "x = broken:method", "SystemExit: bye"),
    "no module": ("", "x = not_there:method", "ModuleNotFoundError: No module named 'not_there'"),
    "no name": (GOOD, "x = broken:nothing", "AttributeError: module 'broken' has no attribute 'nothing'"),
    "no method": ("thing = 7\n", "x = broken:thing", "7 is no vgyro.fusion.Method"),
    "a clash": (
        GOOD + "def f(): return method('average')\n",
        "x = broken:f",
        "'average' is taken by a method of vgyro",
    ),
    "a bad name": (GOOD + "def f(): return method('My Mean')\n", "x = broken:f", "the name 'My Mean' does not do"),
    "a column": (GOOD + "def f(): return method('sd_average')\n", "x = broken:f", "the name 'sd_average' does not do"),
    "no function": (GOOD + "def f(): return method(inferred=None)\n", "x = broken:f", "first_gyro: inferred is None"),
}


@pytest.mark.parametrize("kind", BROKEN)
def test_a_broken_package_is_named_and_left_out(root, tmp_path, kind):
    source, entry, reason = BROKEN[kind]
    install(tmp_path / "a", "broken-gyro", "0.1", "broken", source, dict([entry.split(" = ")]))
    install(tmp_path / "b", "good-gyro", "1.0", "good", GOOD, {"x": "good:method"})
    found, errors = run(root, [tmp_path / "a", tmp_path / "b"], """
        theirs = [name for name, one in METHODS.items() if one.package]
        print(json.dumps([LEFT_OUT, theirs, METHODS["average"].package]))
    """)  # fmt: skip
    (problem,), names, ours = found
    assert problem.startswith("package broken-gyro 0.1, entry point 'x' of vgyro.methods")
    assert reason in problem
    assert problem.endswith("it is left out")
    assert names == ["first_gyro"]
    assert ours == ""
    # One line on the terminal, without a traceback.
    assert errors.strip() == problem


def test_two_packages_with_one_name(root, tmp_path):
    install(tmp_path / "a", "a-gyro", "1.0", "a_gyro", GOOD, {"x": "a_gyro:method"})
    install(tmp_path / "b", "b-gyro", "1.0", "b_gyro", GOOD, {"x": "b_gyro:method"})
    found, _ = run(root, [tmp_path / "b", tmp_path / "a"], """
        print(json.dumps([METHODS["first_gyro"].package, LEFT_OUT]))
    """)  # fmt: skip
    assert found[0] == "a-gyro 1.0"
    assert found[1][0].startswith("package b-gyro 1.0, entry point 'x'")
    assert "taken by package a-gyro 1.0" in found[1][0]


def test_a_package_that_reads_the_registry_while_it_is_loaded(root, tmp_path):
    source = "from vgyro.fusion import METHODS\n" + GOOD + "assert 'average' in METHODS\n"
    install(tmp_path, "curious", "1.0", "curious", source, {"x": "curious:method"})
    found, _ = run(root, [tmp_path], "print(json.dumps([METHODS['first_gyro'].package, LEFT_OUT]))")
    assert found == ["curious 1.0", []]


HASHES = """
    from vgyro.tasks.closure import code_hash
    print(json.dumps({task: code_hash(f"vgyro.tasks.{task}") for task in ("fusion.fuse", "rates.decode", "simulate")}))
"""


def test_a_new_version_or_source_runs_the_jobs_again(root, tmp_path):
    # And only those that reach the registry. Nothing of the package is imported for it.
    source = GOOD + "print('imported')\n"
    cases = {"none": None, "one": ("1.0", source), "again": ("1.0", source), "newer": ("1.1", source),
             "edited": ("1.0", source + "# edited\n")}  # fmt: skip
    found = {}
    for name, case in cases.items():
        folder = tmp_path / name
        if case is not None:
            install(folder, "good-gyro", case[0], "good", case[1], {"x": "good:method"})
        found[name], _ = run(root, [folder], HASHES, head="import json\n")
    assert found["one"] == found["again"]
    fuse = [found[name]["fusion.fuse"] for name in ("none", "one", "newer", "edited")]
    assert len(set(fuse)) == 4
    for task in ("rates.decode", "simulate"):
        assert len({one[task] for one in found.values()}) == 1, task


@pytest.mark.parametrize(
    ("field", "right", "wrong"),
    [
        ("needs", ((), ("arw", "rrw")), ("arw", ("arw", 1), ["arw"])), ("title", ("x",), (None, 1)),
        ("causal", (True,), (1, None)), ("same_at_any_rate", ({},), ("", ())), ("fuse", (len,), ("len",)),
    ],
)  # fmt: skip
def test_fields_of_a_method(field, right, wrong):
    assert {_wrong_field(replace(METHODS["average"], **{field: one})) for one in right} == {""}
    for one in wrong:
        assert _wrong_field(replace(METHODS["average"], **{field: one})) == f"average: {field} is {one!r}"


def test_sources_of_modules_and_packages(tmp_path, monkeypatch):
    # What is hashed: every Python file of a package, the file of a module; nothing of what is not there.
    (tmp_path / "some_package/inner").mkdir(parents=True)
    for name in ("some_module.py", "some_package/__init__.py", "some_package/one.py", "some_package/inner/two.py"):
        (tmp_path / name).write_text("")
    (tmp_path / "some_package/data.txt").write_text("")
    monkeypatch.syspath_prepend(str(tmp_path))
    inside = ["some_package/__init__.py", "some_package/inner/two.py", "some_package/one.py"]
    assert _sources("some_package") == [tmp_path / name for name in inside]
    assert _sources("some_module") == [tmp_path / "some_module.py"]
    assert _sources("no_such_module") == []
