"""Files: dumps and logs of recordings in, artefacts in and out."""

from typing import TYPE_CHECKING

from vgyro.lazy import lazy_exports

if TYPE_CHECKING:
    from vgyro.storage.decode import decode_dump, open_recording
    from vgyro.storage.frames import Frames, Reader
    from vgyro.storage.integrity import Integrity, Refused

__all__ = ["Frames", "Integrity", "Reader", "Refused", "decode_dump", "open_recording"]

__getattr__ = lazy_exports(
    __name__,
    {
        **dict.fromkeys(("Frames", "Reader"), "frames"),
        **dict.fromkeys(("Integrity", "Refused"), "integrity"),
        **dict.fromkeys(("decode_dump", "open_recording"), "decode"),
    },
)
