"""The native engine: C kernels and their thin binding.

garch   : GARCH(1,1), four series in lockstep, exact Newton, many starts
dcc     : DCC(1,1) with two-step standard errors, and the test of constant correlation
weights : constrained minimum-variance weights by an active set, and the path of the conditional covariance
allan   : overlapping Allan deviation
kalman  : filters and smoother of a scalar rate
statespace : likelihood and smoother of a state space that one series measures
frames  : frames of a serial dump: synchronisation and checksums
adaptive : extended Kalman filter of scale errors, bank of filters
text    : lines of a text log: cells, numbers and stamps

Each is a module, loaded at first use: `vgyro.engine.get("native").garch.fit_garch(...)`. The kernels are compiled
for several instruction sets and chosen at run time; their results have the same bits on each, and for any number of
threads.
"""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import TYPE_CHECKING, Any

from vgyro.errors import EngineError

if TYPE_CHECKING:
    # The hash of a task's code follows import statements: modules that are loaded by name must stand here too.
    from vgyro.engine.native import adaptive, allan, dcc, frames, garch, kalman, statespace, text, weights
    from vgyro.engine.protocols.engines import Modules

    # An error of types here: a module is not what its protocol says.
    _modules: Modules = adaptive, allan, dcc, frames, garch, kalman, statespace, text, weights

    # Compiled: they have no Python source to read types from.
    _adaptive: Any
    _allan: Any
    _cpu: Any
    _dcc: Any
    _frames: Any
    _garch: Any
    _kalman: Any
    _statespace: Any
    _text: Any
    _weights: Any

MODULES = ("adaptive", "garch", "dcc", "weights", "allan", "kalman", "statespace", "frames", "text")


def __getattr__(name: str) -> ModuleType:
    if name not in MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        return import_module(f"{__name__}.{name}")
    except ImportError:
        if find_spec(f"{__name__}._{name}") is not None:
            raise
        raise EngineError(
            f"the native engine is not built: {__name__}._{name} is missing",
            remedy="run `make env`; it needs a C compiler (Debian: sudo apt-get install gcc libc6-dev python3-dev)",
        ) from None
