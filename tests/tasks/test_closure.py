"""The code hash decides what runs again: it must see every module that a task can reach, and no other."""

import ast
import shutil
from pathlib import Path

import pytest

from vgyro.config import Analysis, FaultOptions, MetricsOptions
from vgyro.tasks import closure
from vgyro.tasks.common import Task, UndeclaredOption


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the package, to edit."""
    root = tmp_path / "vgyro"
    shutil.copytree(closure.ROOT, root, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(closure, "ROOT", root)
    closure.forget()
    yield root
    closure.forget()


def changed_by_edit(package: Path, file: str, tasks: list[str]) -> set[str]:
    before = {task: closure.code_hash(f"vgyro.tasks.{task}") for task in tasks}
    path = package / file
    path.write_text(path.read_text(encoding="utf-8") + "\n# edited\n", encoding="utf-8")
    closure.forget()
    return {task for task in tasks if closure.code_hash(f"vgyro.tasks.{task}") != before[task]}


DECODE, CONVERT, CALIBRATE = "rates.decode", "rates.convert", "calibration.calibrate"
FUSE, NOISE, MEASURE, REPORT = "fusion.fuse", "fusion.noise", "figures.measure", "pages.report"
TASKS = [DECODE, CALIBRATE, CONVERT, "volatility.assemble", FUSE, NOISE, MEASURE, REPORT]


def test_editing_metrics_changes_the_stages_that_measure(package: Path) -> None:
    assert changed_by_edit(package, "metrics/allan/deviation.py", TASKS) == {NOISE, MEASURE}


def test_editing_a_filter_does_not_fit_the_windows_again(package: Path) -> None:
    assert changed_by_edit(package, "fusion/papers/rate_filters.py", TASKS) == {FUSE}


def test_editing_the_report_changes_the_report_alone(package: Path) -> None:
    assert changed_by_edit(package, "report/page.py", TASKS) == {REPORT}


def test_editing_a_template_changes_the_report_alone(package: Path) -> None:
    assert changed_by_edit(package, "report/templates/page.html", TASKS) == {REPORT}


def test_editing_the_decoder_changes_decoding_alone(package: Path) -> None:
    changed = changed_by_edit(package, "storage/dumps/scan.py", TASKS)
    assert changed == {DECODE}, "the stages after it read tables only"


def test_editing_units_changes_everything_that_converts(package: Path) -> None:
    assert {MEASURE, NOISE} <= changed_by_edit(package, "units.py", TASKS)


def test_imports_inside_functions_count() -> None:
    # vgyro.engine loads the reference engine when it is asked for, not before.
    assert "vgyro.engine.reference.garch" in closure.import_closure("vgyro.tasks.volatility.assemble")


@pytest.mark.parametrize(
    "module",
    [
        *(f"binary.{name}" for name in ("parquet", "ulog", "bag", "numpy_file", "matlab", "mat5")),
        "text.fast",
        "joined",
    ],
)
def test_every_reader_of_logs_counts_for_decoding(module: str) -> None:
    assert f"vgyro.storage.logs.{module}" in closure.import_closure("vgyro.tasks.rates.decode")


FOLDER = Path(closure.__file__).parent
EVERY = [
    ".".join(path.relative_to(FOLDER).with_suffix("").parts)
    for path in sorted(FOLDER.rglob("*.py"))
    if "SECTIONS = " in path.read_text("utf-8")
]


@pytest.mark.parametrize("task", EVERY)
def test_what_a_task_asks_for_it_names(task: str) -> None:
    """Every `task.section("x", …)` and `task.engine` of its module is in its SECTIONS, and these are sections."""
    source = closure._source(f"vgyro.tasks.{task}").read_text(encoding="utf-8")
    asked = {node.args[0].value for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Call)
             and isinstance(node.func, ast.Attribute) and node.func.attr == "section"}  # fmt: skip
    asked |= {"engine"} if "task.engine" in source else set()
    declared = set(closure.sections_of(f"vgyro.tasks.{task}"))
    assert asked <= declared
    assert declared <= {"manifest", "board", *Analysis.model_fields}


@pytest.mark.parametrize("task", sorted({*EVERY} - {"pages.report"}))  # The page shows all of them.
def test_what_a_task_names_is_asked_for(task: str) -> None:
    """By its module or another that it reaches: a section that nobody reads would re-run it for nothing."""
    modules = (name for name in closure.import_closure(f"vgyro.tasks.{task}") if name.startswith("vgyro.tasks."))
    sources = [closure._source(name).read_text(encoding="utf-8") for name in modules]
    for section in closure.sections_of(f"vgyro.tasks.{task}"):
        asked = "task.engine" if section == "engine" else f'task.section("{section}"'
        assert any(asked in source for source in sources), section


def test_a_module_that_names_no_sections() -> None:
    with pytest.raises(ValueError, match=r"vgyro\.tasks\.common names no SECTIONS"):
        closure.sections_of("vgyro.tasks.common")


def test_what_is_not_given_is_no_default() -> None:
    task = Task({}, {}, {"axis": "z", "analysis": {"metrics": {}}}, "")
    assert task.section("metrics", MetricsOptions) == MetricsOptions()
    with pytest.raises(UndeclaredOption, match="'faults' is asked for"):
        task.section("faults", FaultOptions)
    with pytest.raises(UndeclaredOption, match="'engine'"):
        _ = task.engine
    with pytest.raises(UndeclaredOption, match="'kind'"):
        task.option("kind")
