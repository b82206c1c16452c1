"""Files: dumps and logs of recordings in, artefacts in and out.

The public functions are looked up when they are asked for: whoever only reads and writes tables does not depend on the
code that decodes, and need not run again when it changes.
"""

from importlib import import_module
from typing import Any

_HOME = {
    "Frames": "vgyro.storage.frames",
    "Reader": "vgyro.storage.frames",
    "Integrity": "vgyro.storage.integrity",
    "Refused": "vgyro.storage.integrity",
    "decode_dump": "vgyro.storage.decode",
    "open_recording": "vgyro.storage.decode",
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)
