"""Files: dumps and logs of recordings in, artefacts in and out."""

from vgyro.storage.decode import Frames, Reader, decode_dump, open_recording

__all__ = ["Frames", "Reader", "decode_dump", "open_recording"]
