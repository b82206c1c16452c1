"""Faults of single gyros: found by parity, put on the right gyro, with their begin and end."""

from vgyro.fusion.faults.search import find_faults, limits_of

__all__ = ["find_faults", "limits_of"]
