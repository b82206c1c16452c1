"""An engine's modules are what vgyro.engine.protocols says, and a call that does not fit is an error of types."""

from __future__ import annotations

import inspect
import re
import subprocess
import sys
from pathlib import Path
from typing import get_args

import pytest

from vgyro import engine
from vgyro.engine.native import MODULES
from vgyro.engine.protocols import engines, filters, noise, reading, volatility

PROTOCOLS = {
    "adaptive": filters.AdaptiveEngine,
    "allan": noise.AllanEngine,
    "dcc": volatility.DccEngine,
    "frames": reading.FramesEngine,
    "garch": volatility.GarchEngine,
    "kalman": filters.KalmanEngine,
    "statespace": filters.StateSpaceEngine,
    "text": reading.TextEngine,
    "weights": volatility.WeightsEngine,
}
METHODS = {("frames", "Finder"): reading.FrameFinder, ("text", "Parser"): reading.LineParser}
FUNCTIONS = [
    (module, name)
    for module, protocol in PROTOCOLS.items()
    for name, value in vars(protocol).items()
    if inspect.isfunction(value) and not name.startswith("_")
]


def parameters(function: object) -> list[tuple[str, object]]:
    """Names and defaults, in their order; self left out."""
    found = inspect.signature(function).parameters.values()
    return [(one.name, one.default) for one in found if one.name != "self"]


def test_every_module_has_its_protocol():
    assert set(PROTOCOLS) == set(MODULES) == {name for name in vars(engines.Engine) if not name.startswith("_")}
    assert set(get_args(engines.Modules)) == set(PROTOCOLS.values())
    assert len(FUNCTIONS) > 20


@pytest.mark.parametrize("which", engine.ENGINES)
@pytest.mark.parametrize(("module", "name"), FUNCTIONS)
def test_both_engines_take_the_same_arguments(which: str, module: str, name: str):
    given = getattr(getattr(engine.get(which), module), name)
    assert parameters(given) == parameters(getattr(PROTOCOLS[module], name))
    if (module, name) in METHODS:
        for method, value in vars(METHODS[module, name]).items():
            if inspect.isfunction(value) and not method.startswith("_"):
                assert parameters(getattr(given, method)) == parameters(value)


@pytest.mark.parametrize(("module", "name"), FUNCTIONS)
def test_every_function_is_explained_in_its_protocol(module: str, name: str):
    protocol = PROTOCOLS[module]
    assert inspect.getdoc(getattr(protocol, name))
    place = (
        f"{(METHODS.get((module, name)) or protocol).__module__}.{(METHODS.get((module, name)) or protocol).__name__}"
    )
    for which in engine.ENGINES:
        own = getattr(getattr(engine.get(which), module), name)
        if own.__module__ != "vgyro.engine.constant":
            assert inspect.getdoc(own).startswith(f"As {place}"), f"{which}: explained twice"


RIGHT = """
import numpy as np
from vgyro import engine
from vgyro.engine.models import GarchFit

def fit(r: np.ndarray) -> GarchFit:
    return engine.get("native").garch.fit_garch(r)

low, high = engine.get("reference").allan.limits(np.ones(3), np.ones(3), 0.9)
smoothed = engine.get("native").kalman.low_pass(np.ones(3), 0.5, 0.5, start=0.0)
"""
WRONG = """
import numpy as np
from vgyro import engine
from vgyro.engine.protocols.noise import AllanEngine

def measure(allan: AllanEngine) -> float:
    return allan.limits(np.ones(3), np.ones(3))  # confidence is missing, and two are returned
engine.get("native").garch.fit_garch(np.ones((30, 1)), 3)
engine.get("native").kalman.low_pass(np.ones(3), "0.5", 0.5, 0.0)
engine.get("reference").dcc.fit_dcc(np.ones((30, 2)), margin=None)
engine.get("reference").abacus
engine.get("native").weights.fit_garch(np.ones((30, 1)))
"""
WRONG_ENGINE = """
import numpy as np
from vgyro.engine.models import GarchFit
from vgyro.engine.native import garch, dcc
from vgyro.engine.protocols.volatility import DccEngine, GarchEngine

right: GarchEngine = garch
wrong: GarchEngine = dcc
"""


def test_a_wrong_call_of_an_engine_is_an_error_of_types(root: Path, tmp_path: Path):
    """Expected: an error on each wrong line, and none where the calls are right."""
    for name, text in (("right", RIGHT), ("wrong", WRONG), ("wrong_engine", WRONG_ENGINE)):
        (tmp_path / f"{name}.py").write_text(text, encoding="utf-8")
    files = [str(path) for path in sorted(tmp_path.glob("*.py"))]
    command = [sys.executable, "-m", "mypy", "--cache-dir", str(tmp_path / "cache"), *files]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
    errors = {(name, int(line)) for name, line in re.findall(r"(\w+)\.py:(\d+): error:", done.stdout)}
    assert errors == {("wrong", line) for line in range(7, 13)} | {("wrong_engine", 8)}, done.stdout + done.stderr
