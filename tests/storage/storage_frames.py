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


def i24(value: int) -> bytes:
    return struct.pack(">i", value)[1:]


def stim(head: int, index: int, gyros, middle: bytes = b"") -> bytes:
    body = bytes([head]) + b"".join(i24(value) for value in gyros) + b"\0" + middle
    body += struct.pack(">BH", index % 256, 500)
    return body + struct.pack(">I", crc32(body + b"\0" * (-len(body) % 4)))


def kvh(index: int, gyros) -> bytes:
    body = b"\xfe\x81\xff\x55" + struct.pack(">3f3fBBh", *gyros, 0, 0, 1, 0x77, index % 128, 31)
    return body + struct.pack(">I", crc32(body))


def xsens(index: int, gyros) -> bytes:
    data = struct.pack(">HBH", 0x1020, 2, index % 65536) + struct.pack(">HB3f", 0x8020, 12, *gyros)
    body = b"\xff\x36" + bytes([len(data)]) + data
    return b"\xfa" + body + bytes([-sum(body) % 256])


def vectornav(index: int, gyros) -> bytes:
    body = b"\x01" + struct.pack(
        "<HQ3f3f3fff", 0x0601, 10_000_000 * index, 0, 0, -9.8, *gyros, 0.1, 0.2, 0.3, 25.5, 101.3
    )
    return b"\xfa" + body + struct.pack(">H", crc16(body, init=0))


def ahrs(index: int, gyros) -> bytes:
    body = struct.pack(">9hhH", *gyros, 0, 0, 0, 0, 0, 0, 1500, index % 65536)
    return b"\xff" + body + bytes([sum(body) % 256])


def dsp3000(index: int, rate: float) -> bytes:
    del index
    return b"%.6f 1\r\n" % rate


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
