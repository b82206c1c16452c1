"""Frames built by hand: struct and bitwise checksums, no code of the package."""

import struct
from functools import reduce
from pathlib import Path

import numpy as np

BOARDS = Path(__file__).resolve().parents[2] / "config" / "boards"


def crc(data: bytes, width: int, polynomial: int, init: int) -> int:
    """Not reflected CRC, bit by bit."""
    register, top, mask = init, 1 << (width - 1), (1 << width) - 1
    for byte in data:
        register ^= byte << (width - 8)
        for _ in range(8):
            register = ((register << 1) ^ polynomial if register & top else register << 1) & mask
    return register


def crc16(data: bytes, init: int = 0xFFFF) -> int:
    return crc(data, 16, 0x1021, init)


def crc32(data: bytes) -> int:
    return crc(data, 32, 0x04C11DB7, 0xFFFFFFFF)


def dsp6_frame(counter: int, gyros, temperatures=(0,) * 6) -> bytes:
    body = b"\xeb\x90" + struct.pack(">H12h", counter % 65536, *gyros, *temperatures)
    return body + struct.pack(">H", crc16(body))


def dsp6_text_line(counter: int, gyros, temperatures=(0,) * 6) -> bytes:
    body = ",".join(str(int(value)) for value in ("0", counter % 65536, *gyros, *temperatures))
    body = "VG" + body[1:]
    return f"${body}*{reduce(lambda a, b: a ^ b, body.encode()):02X}\r\n".encode()


def mimu_packet(counter: int, ticks: int, values) -> bytes:
    body = b"\xaa" + struct.pack(">HBI48h", counter % 65536, 0x64, ticks % 2**32, *values)
    return body + struct.pack(">H", sum(body) % 65536)


def dsp6_stream(count: int, seed: int = 1, first: int = 0) -> tuple[list[bytes], np.ndarray]:
    """Frames with counters first, first + 1, … and the gyro counts [count, 6] in them."""
    rng = np.random.default_rng(seed)
    values = rng.integers(-32000, 32000, (count, 12))
    return [dsp6_frame(first + i, row[:6].tolist(), row[6:].tolist()) for i, row in enumerate(values)], values[:, :6]


def mimu_stream(count: int, seed: int = 1) -> tuple[list[bytes], np.ndarray]:
    """Packets 0.016 s apart, and the 48 values in each."""
    rng = np.random.default_rng(seed)
    values = rng.integers(-3000, 3000, (count, 48))
    return [mimu_packet(i, 4_294_000_000 + 1_024_000 * i, row.tolist()) for i, row in enumerate(values)], values
