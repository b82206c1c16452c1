"""A ULog written by hand, by its documented format: magic, then messages of a length, a letter and a content."""

import struct

MAGIC = b"ULog\x01\x12\x35\x01"
GYRO = "sensor_gyro:uint64_t timestamp;uint32_t device_id;float x;float y;float z;uint8_t[4] _padding0;"
COMBINED = "sensor_combined:uint64_t timestamp;float[3] gyro_rad;"
FIFO = (
    "sensor_gyro_fifo:uint64_t timestamp;uint64_t timestamp_sample;uint32_t device_id;float dt;float scale;"
    "int16_t[32] x;int16_t[32] y;int16_t[32] z;uint8_t samples;uint8_t[7] _padding0;"
)


def message(kind: str, content: bytes) -> bytes:
    return struct.pack("<HB", len(content), ord(kind)) + content


def head(*formats: str, start: int = 1000, flags: bytes = bytes(40)) -> bytes:
    made = MAGIC + struct.pack("<Q", start) + message("B", flags)
    made += message("I", b"\x0fchar[3] sys_name" + b"PX4")
    return made + b"".join(message("F", one.encode()) for one in formats)


def subscribed(number: int, name: str, instance: int = 0) -> bytes:
    return message("A", struct.pack("<BH", instance, number) + name.encode())


def data(number: int, layout: str, *values) -> bytes:
    return message("D", struct.pack(f"<H{layout}", number, *values))


def gyro(number: int, time: int, x: float, y: float, z: float) -> bytes:
    return data(number, "QIfff", time, 7, x, y, z)


def fifo(number: int, time: int, dt: float, scale: float, x: list[int]) -> bytes:
    padded = x + [0] * (32 - len(x))
    return data(number, "QQIff32h32h32hB", time + 50, time, 9, dt, scale, *padded, *padded, *padded, len(x))


def dropout(ms: int) -> bytes:
    return message("O", struct.pack("<H", ms))


SYNC = message("S", b"\x2f\x73\x13\x20\x25\x0c\xbb\x12")
