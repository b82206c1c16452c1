"""docs/architecture.md says what is there: stages as the rules run them, rooms as the modules import."""

import importlib
import re
import subprocess
import sys
from itertools import chain
from pathlib import Path

import pytest

from vgyro.cli.architecture import architecture
from vgyro.cli.architecture.rooms import FOUNDATION, House, direct
from vgyro.cli.architecture.stages import Stage, StageFile, makers, stages
from vgyro.cli.architecture.walk import WALK


@pytest.fixture(scope="module")
def known(root):
    return stages(root)


@pytest.fixture(scope="module")
def house(root):
    return House(root)


def test_every_rule_that_runs_a_task_is_a_stage(root, known):
    text = "".join(path.read_text() for path in sorted((root / "workflow/rules").glob("*.smk")))
    assert len(known) == len(re.findall(r"code\(\"", text)) == len({stage.name for stage in known})
    for stage in known:
        assert stage.words, stage.name
        importlib.import_module(f"vgyro.tasks.{stage.task}")


def test_a_stage_reads_and_writes_what_its_command_names(root, known):
    """The shell commands of the rules name the same files another time."""
    for stage in known:
        text = next(path.read_text() for path in (root / "workflow/rules").glob("*.smk")
                    if re.search(rf"^(rule|checkpoint) {stage.name}:", path.read_text(), re.M))  # fmt: skip
        shell = re.search(rf"^\w+ {stage.name}:.*?    shell:\n(.*?)(?=^\S|\Z)", text, re.M | re.S)[1]
        assert re.findall(r"--output (\w+)", shell) == [file.name for file in stage.writes], stage.name
        assert set(re.findall(r"--input (\w+)", shell)) <= {file.name for file in stage.reads}, stage.name


def test_who_makes_what_a_stage_reads(known):
    made = {stage.name: set(makers(stage, known)) for stage in known}
    assert made["decode"] == set()
    assert made["fuse"] == {"convert", "noise", "volatility", "faults"}
    assert made["volatility"] == {"series", "volatility_chunk"}
    assert made["effects"] == {"series", "measure", "volatility"}
    assert {"measure", "crosscheck", "bekk", "effects", "more_gyros", "screen"} <= made["report"]
    assert made["index"] == {"report"}


def test_files_that_pass_away_are_read_only_by_who_asks_for_them():
    def of(name, *files, reads=()):
        return Stage(name, "", tuple(StageFile(one, "", False) for one in reads), files, "", ())

    part = of("part", StageFile("table", "table.1", True))
    whole = of("whole", StageFile("table", "table", False), reads=("table",))
    reader = of("reader", reads=("table",))
    assert makers(whole, [part, whole, reader]) == ["part"]
    assert makers(reader, [part, whole, reader]) == ["whole"]


def test_every_module_is_in_a_room(root, house):
    files = {path.relative_to(root).as_posix() for path in (root / "vgyro").rglob("*.py")} - {"vgyro/__init__.py"}
    text = architecture()
    linked = set(re.findall(r"\(\.\./(vgyro/[\w/]+\.py)\)", text))
    assert linked == {path for path in files if not path.endswith("__init__.py")}
    assert all(house.words.values()), [name for name, words in house.words.items() if not words]
    assert house.room_of("figure") == house.room_of("units") == FOUNDATION
    assert house.room_of("more_gyros") == "more_gyros"
    assert house.folder_of("fusion.motion.models") == "fusion.motion"


def test_imports_are_those_that_python_makes(root, house):
    """Expected: what a fresh interpreter has loaded after importing a module whose imports are all at its top."""
    code = "import sys, vgyro.units; print(*sorted(n[6:] for n in sys.modules if n.startswith('vgyro.')))"
    loaded = {}
    for name in ("calibration.scale", "metrics.figures", "fusion.events"):
        program = code.replace("vgyro.units", f"vgyro.{name}")
        done = subprocess.run([sys.executable, "-c", program], cwd=root, capture_output=True, text=True, check=True)
        loaded[name] = set(done.stdout.split())
    for name, found in loaded.items():
        assert set(house.imports[name]) <= found, name
    assert "figure" in house.imports["metrics.figures"]
    assert house.imports["units"] == ()


def test_a_drawing_leaves_out_what_a_longer_way_replaces():
    assert direct({"a": ["b", "c"], "b": ["c"], "c": []}) == {"a": ["b"], "b": ["c"], "c": []}
    assert direct({"a": ["b", "c"], "b": [], "c": []}) == {"a": ["b", "c"], "b": [], "c": []}
    with pytest.raises(ValueError, match="a loop: a → b → a"):
        direct({"a": ["b"], "b": ["a"]})


def test_nothing_is_reached_less_in_the_drawing(house):
    def reached(edges, name):
        return {name}.union(*(reached(edges, other) for other in edges.get(name, [])))

    edges = house.rooms_imported()
    drawn = direct(edges)
    assert all(reached(edges, room) == reached(drawn, room) for room in edges)
    assert sum(map(len, drawn.values())) < sum(map(len, edges.values()))


def test_the_walk_is_short_and_exists(root):
    assert len(WALK) <= 12
    for path, words in WALK:
        text = (root / path).read_text()
        names = [name for name in re.findall(r"`(\w+)`", words.partition(":")[0] + words[:80]) if name in text]
        assert names, f"{path} has none of the names in: {words}"


def test_a_file_of_the_walk_reaches_the_next_ones(house):
    """The first file's imports, at any depth, hold all others."""
    start, found = "tasks.fusion.fuse", set()
    waiting = [start]
    while waiting:
        name = waiting.pop()
        if name not in found:
            found.add(name)
            waiting += house.imports[name]
    names = [Path(path).with_suffix("").as_posix().removeprefix("vgyro/").replace("/", ".") for path, _ in WALK]
    assert set(names) <= found | set(chain(*(house.imports[name] for name in found)))
