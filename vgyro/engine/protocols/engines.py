"""An engine: one module for each domain."""

from __future__ import annotations

from typing import Protocol, TypeAlias

from vgyro.engine.protocols.filters import Adaptive, Kalman, StateSpaces
from vgyro.engine.protocols.noise import Allan
from vgyro.engine.protocols.reading import Frames, Text
from vgyro.engine.protocols.volatility import Dcc, Garch, Weights

Modules: TypeAlias = tuple[Adaptive, Allan, Dcc, Frames, Garch, Kalman, StateSpaces, Text, Weights]
"""What each engine's package says that its modules are."""


class Engine(Protocol):
    """The modules of an engine; each is loaded when it is first asked for."""

    @property
    def adaptive(self) -> Adaptive:
        """Filters that adapt themselves to the array."""

    @property
    def allan(self) -> Allan:
        """Allan variances."""

    @property
    def dcc(self) -> Dcc:
        """Dynamic conditional correlation."""

    @property
    def frames(self) -> Frames:
        """Frames of a serial dump."""

    @property
    def garch(self) -> Garch:
        """Conditional variance."""

    @property
    def kalman(self) -> Kalman:
        """Filters and smoother of a scalar rate."""

    @property
    def statespace(self) -> StateSpaces:
        """Likelihood and smoother of a state space."""

    @property
    def text(self) -> Text:
        """Lines of a text log."""

    @property
    def weights(self) -> Weights:
        """Minimum-variance weights."""
