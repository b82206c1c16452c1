"""Engines are found by name."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from vgyro import engine
from vgyro.errors import EngineError


def test_reference_engine_has_its_modules():
    assert callable(engine.get("reference").garch.fit_garch)
    assert callable(engine.get("reference").dcc.fit_dcc)


def test_unknown_engine_lists_the_known_ones():
    with pytest.raises(EngineError, match=r"unknown engine 'abacus'.*reference"):
        engine.get("abacus")


def test_unknown_module():
    with pytest.raises(AttributeError, match="abacus"):
        _ = engine.get("reference").abacus


def test_an_engine_is_found_without_loading_its_libraries():
    # A job pays only for the libraries that it uses; another process shows what is loaded.
    code = "import sys; from vgyro import engine, volatility; engine.get('reference'); "
    code += (
        "sys.exit(any(name in sys.modules for name in ('arch', 'pymgarch', 'cvxpy', 'statsmodels', 'scipy.signal')))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_an_engine_that_is_not_built_says_so(root: Path, tmp_path: Path):
    # Expected: the remedy, not a traceback about names. The package without its compiled files stands for that machine.
    shutil.copytree(root / "vgyro", tmp_path / "vgyro", ignore=shutil.ignore_patterns("*.so", "__pycache__"))
    code = (
        "import numpy as np\nfrom vgyro.errors import EngineError\nfrom vgyro.volatility import fit_garch\n"
        "try:\n    fit_garch(np.zeros((50, 1)))\nexcept EngineError as error:\n    print(error)"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "the native engine is not built" in done.stdout, done.stderr
    assert "make env" in done.stdout
