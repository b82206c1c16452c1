"""Engines are found by name."""

import sys

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
    import subprocess

    code = "import sys; from vgyro import engine, volatility; engine.get('reference'); "
    code += (
        "sys.exit(any(name in sys.modules for name in ('arch', 'pymgarch', 'cvxpy', 'statsmodels', 'scipy.signal')))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
