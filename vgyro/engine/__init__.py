"""Engines: sets of modules (garch, dcc, weights, allan, kalman …) that compute the same things in different ways.

What each module must have, and what its functions mean, stands in vgyro.engine.protocols.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from vgyro.errors import EngineError

if TYPE_CHECKING:
    # The hash of a task's code follows import statements: an engine that is loaded by name must stand here too.
    from vgyro.engine import native, reference  # noqa: F401
    from vgyro.engine.protocols.engines import Engine

ENGINES = ("native", "reference")


def get(name: str) -> Engine:
    """Return the engine called `name`; its modules are attributes, loaded at first use.

    raises : EngineError, listing the engines there are
    """
    if name not in ENGINES:
        raise EngineError(f"unknown engine {name!r}", remedy=f"Known engines: {', '.join(ENGINES)}")
    return import_module(f"vgyro.engine.{name}")
