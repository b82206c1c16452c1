"""Faults of single gyros: found by parity, put on the right gyro, with their begin and end."""

from vgyro.fusion.faults.search import find_faults, limits_of
from vgyro.fusion.faults.words import ALL_KINDS, sentence

__all__ = ["ALL_KINDS", "find_faults", "limits_of", "sentence"]
