"""Arrays of MEMS gyroscopes, offline: decode, calibrate, fuse, measure, report."""

from importlib.metadata import version

__version__ = version("vgyro")
