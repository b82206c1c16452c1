"""Engines: sets of modules (garch, dcc, weights, allan, kalman) that compute the same things in different ways."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

from vgyro.errors import EngineError

if TYPE_CHECKING:
    # The hash of a task's code follows import statements: an engine that is loaded by name must stand here too.
    from vgyro.engine import native, reference  # noqa: F401

ENGINES = ("native", "reference")


def get(name: str) -> ModuleType:
    """Return the engine called `name`; its modules are attributes, loaded at first use.

    raises : EngineError, listing the engines there are
    """
    if name not in ENGINES:
        raise EngineError(f"unknown engine {name!r}", remedy=f"Known engines: {', '.join(ENGINES)}")
    return import_module(f"vgyro.engine.{name}")
