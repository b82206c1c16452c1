"""The reference engine: the libraries that users already trust.

garch   : GARCH by arch
dcc     : DCC by SciPy's SLSQP, with the two-step standard errors of pymgarch
weights : constrained minimum-variance weights by cvxpy
allan   : Allan deviation by allantools
kalman  : filters by filterpy
statespace : likelihood and smoother of a state space by filterpy
frames  : frames of a serial dump by NumPy
adaptive : extended Kalman filter and bank of filters by filterpy
text    : lines of a text log by Python

Each is a module, loaded at first use: `vgyro.engine.get("reference").garch.fit_garch(...)`.
"""

from __future__ import annotations

from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    # The hash of a task's code follows import statements: modules that are loaded by name must stand here too.
    from vgyro.engine.protocols.engines import Modules
    from vgyro.engine.reference import adaptive, allan, dcc, frames, garch, kalman, statespace, text, weights

    # An error of types here: a module is not what its protocol says.
    _modules: Modules = adaptive, allan, dcc, frames, garch, kalman, statespace, text, weights

MODULES = ("adaptive", "garch", "dcc", "weights", "allan", "kalman", "statespace", "frames", "text")


def __getattr__(name: str) -> ModuleType:
    # The libraries take seconds to import: a job pays only for those that it uses.
    if name in MODULES:
        return import_module(f"{__name__}.{name}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
