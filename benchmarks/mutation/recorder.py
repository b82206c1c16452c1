"""A pytest plugin: which functions of the deciding modules each test calls, and how long it takes.

    pytest -p benchmarks.mutation.recorder --calls-to PATH

Writes JSON: {test: {"seconds": CPU time, "calls": ["vgyro/…py::function", …]}}, of the tests that passed. What a
fixture calls counts for every test that asks for it. Calls in a process that a test starts are not seen.
"""

from __future__ import annotations

import json
import sys
import threading
import time
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from types import CodeType, FrameType

import pytest

from benchmarks.mutation.modules import deciding


class Recorder:
    """Stacks a set of code objects for each fixture and test that is under way."""

    def __init__(self, root: Path, out: Path) -> None:
        self.root, self.out = root, out
        self.under_way: list[set[CodeType]] = [set()]
        self.of_fixture: defaultdict[tuple[str, str], set[CodeType]] = defaultdict(set)
        self.of_test: defaultdict[str, set[CodeType]] = defaultdict(set)
        self.seconds: dict[str, float] = {}
        self.failed: set[str] = set()

    def _called(self, frame: FrameType, _event: str, _argument: object) -> None:
        self.under_way[-1].add(frame.f_code)

    def _listen(self) -> None:
        """Once more for each test: an exception while `_called` runs, as a timeout is, ends the tracing."""
        threading.settrace(self._called)
        sys.settrace(self._called)

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: pytest.FixtureDef[object]) -> Iterator[None]:
        self.under_way.append(set())
        try:
            self._listen()
            return (yield)
        finally:
            self._listen()
            self.of_fixture[fixturedef.baseid, fixturedef.argname] |= self.under_way.pop()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        self.under_way = [set()]
        self._listen()
        begun = time.process_time()
        try:
            return (yield)
        finally:
            self.seconds[item.nodeid] = time.process_time() - begun
            called = self.of_test[item.nodeid]
            called |= self.under_way[0]
            asked = set(getattr(item, "fixturenames", ()))
            for (base, name), codes in self.of_fixture.items():
                if name in asked and item.nodeid.startswith(base):
                    called |= codes

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if not report.passed:
            self.failed.add(report.nodeid)

    def pytest_sessionfinish(self) -> None:
        sys.settrace(None)
        known = set(deciding(self.root))
        found = {}
        for test in sorted(set(self.of_test) - self.failed):
            calls = {name for code in self.of_test[test] if (name := self._name(code, known))}
            found[test] = {"seconds": round(self.seconds[test], 3), "calls": sorted(calls)}
        self.out.write_text(json.dumps(found, indent=0, ensure_ascii=False), encoding="utf-8")

    def _name(self, code: CodeType, known: set[str]) -> str | None:
        path = Path(code.co_filename)
        if not path.is_relative_to(self.root):
            return None
        module = path.relative_to(self.root).as_posix()
        function = code.co_qualname.split(".<")[0]
        return f"{module}::{function}" if module in known and not function.startswith("<") else None


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--calls-to", type=Path, help="of the mutation run: file of what each test calls")


def pytest_configure(config: pytest.Config) -> None:
    config.pluginmanager.register(Recorder(config.rootpath, config.getoption("--calls-to").absolute()), "calls")
