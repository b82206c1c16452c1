"""What an engine is: one Protocol for each of its modules, where each function is explained once, for both engines.

volatility : GarchEngine, DccEngine and WeightsEngine
noise      : AllanEngine
filters    : KalmanEngine, StateSpaceEngine and AdaptiveEngine
reading    : FramesEngine and TextEngine
engines    : Engine, which has them all: what `vgyro.engine.get` returns

The modules of an engine stand for these by their functions, so that a call that does not fit is an error of types. How
an engine finds its figures, and how exactly, is said at its own functions.
"""
