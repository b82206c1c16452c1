"""Engines: sets of modules (garch, dcc, weights, allan, kalman) that compute the same things in different ways."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from vgyro.errors import EngineError

ENGINES = ("reference",)


def get(name: str) -> ModuleType:
    """Return the engine called `name`; its modules are attributes, loaded at first use.

    raises : EngineError, listing the engines there are
    """
    if name not in ENGINES:
        raise EngineError(f"unknown engine {name!r}", remedy=f"Known engines: {', '.join(ENGINES)}")
    return import_module(f"vgyro.engine.{name}")
