"""An engine: one module for each domain."""

from __future__ import annotations

from typing import Protocol, TypeAlias

from vgyro.engine.protocols.filters import AdaptiveEngine, KalmanEngine, StateSpaceEngine
from vgyro.engine.protocols.noise import AllanEngine
from vgyro.engine.protocols.reading import FramesEngine, TextEngine
from vgyro.engine.protocols.volatility import DccEngine, GarchEngine, WeightsEngine

Modules: TypeAlias = tuple[
    AdaptiveEngine,
    AllanEngine,
    DccEngine,
    FramesEngine,
    GarchEngine,
    KalmanEngine,
    StateSpaceEngine,
    TextEngine,
    WeightsEngine,
]
"""What each engine's package says that its modules are."""


class Engine(Protocol):
    """The modules of an engine; each is loaded when it is first asked for."""

    @property
    def adaptive(self) -> AdaptiveEngine:
        """Filters that adapt themselves to the array."""

    @property
    def allan(self) -> AllanEngine:
        """Allan variances."""

    @property
    def dcc(self) -> DccEngine:
        """Dynamic conditional correlation."""

    @property
    def frames(self) -> FramesEngine:
        """Frames of a serial dump."""

    @property
    def garch(self) -> GarchEngine:
        """Conditional variance."""

    @property
    def kalman(self) -> KalmanEngine:
        """Filters and smoother of a scalar rate."""

    @property
    def statespace(self) -> StateSpaceEngine:
        """Likelihood and smoother of a state space."""

    @property
    def text(self) -> TextEngine:
        """Lines of a text log."""

    @property
    def weights(self) -> WeightsEngine:
        """Minimum-variance weights."""
