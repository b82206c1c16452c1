"""Faults of single gyros: found by parity, put on the right gyro, with their begin and end."""

from vgyro.fusion.faults.search import FaultSearch, find_faults, search_faults
from vgyro.fusion.faults.words import ALL_KINDS, sentence

__all__ = ["ALL_KINDS", "FaultSearch", "find_faults", "search_faults", "sentence"]
