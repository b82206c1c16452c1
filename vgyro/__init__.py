"""Arrays of MEMS gyroscopes, offline: decode, calibrate, fuse, measure, report."""

from __future__ import annotations


def __getattr__(name: str) -> str:
    # importlib.metadata takes longer to load than the engine.
    if name == "__version__":
        from importlib.metadata import version

        return version("vgyro")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
