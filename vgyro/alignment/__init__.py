"""Gyros of several clocks on one time, and delays between gyros of one board, from their common motion."""

from vgyro.alignment.clock import (
    AMBIGUOUS,
    FOUND,
    NO_COMMON_MOTION,
    STATUSES,
    TOO_SHORT,
    ClockEvidence,
    ClockFit,
    refuse_clock,
    relative_clock,
)
from vgyro.alignment.delays import Delays, relative_delays
from vgyro.alignment.interpolation import interpolate, noise_gain
from vgyro.alignment.streams import AlignedStream, positions, resample, stretches

__all__ = [
    "AMBIGUOUS",
    "FOUND",
    "NO_COMMON_MOTION",
    "STATUSES",
    "TOO_SHORT",
    "AlignedStream",
    "ClockEvidence",
    "ClockFit",
    "Delays",
    "interpolate",
    "noise_gain",
    "positions",
    "refuse_clock",
    "relative_clock",
    "relative_delays",
    "resample",
    "stretches",
]
