"""Frames against struct, binascii, zlib and the published golden vectors."""

import binascii
import struct
import zlib
from collections.abc import Callable

import numpy as np
import pytest

from vgyro.board import Board, Checksum
from vgyro.errors import ConfigError, DataError
from vgyro.simulate import encode_frames
from vgyro.simulate.serial.encode import crc, encode, to_bytes

NINE = np.frombuffer(b"123456789", dtype=np.uint8)[None, :]


@pytest.mark.parametrize(
    ("width", "polynomial", "init", "reflected", "xor_out", "value"),
    [
        (16, 0x1021, 0xFFFF, False, 0, 0x29B1),  # CRC-16/CCITT-FALSE
        (16, 0x1021, 0, False, 0, 0x31C3),  # CRC-16/XMODEM
        (32, 0x04C11DB7, 0xFFFFFFFF, False, 0, 0x0376E6E7),  # CRC-32/MPEG-2
        (32, 0x04C11DB7, 0xFFFFFFFF, True, 0xFFFFFFFF, 0xCBF43926),  # CRC-32
        (8, 0x07, 0, False, 0, 0xF4),  # CRC-8
    ],
)
def test_published_check_values(width, polynomial, init, reflected, xor_out, value) -> None:
    spec = Checksum(
        family="crc",
        width=width,
        polynomial=polynomial,
        init=init,
        reflected=reflected,
        xor_out=xor_out,
        span=(0, 9),
        at=9,
    )
    assert crc(NINE, spec)[0] == value


def test_crc_of_random_rows_equals_the_standard_library() -> None:
    rows = np.random.default_rng(1).integers(0, 256, (50, 28), dtype=np.uint8)
    ccitt = Checksum(family="crc", width=16, polynomial=0x1021, init=0xFFFF, span=(0, 28), at=28)
    assert crc(rows, ccitt).tolist() == [binascii.crc_hqx(row.tobytes(), 0xFFFF) for row in rows]
    zip32 = Checksum(
        family="crc", width=32, polynomial=0x04C11DB7, init=0xFFFFFFFF, reflected=True, xor_out=0xFFFFFFFF,
        span=(0, 28), at=28,
    )  # fmt: skip
    assert crc(rows, zip32).tolist() == [zlib.crc32(row.tobytes()) for row in rows]


def test_dsp6_frames_equal_those_of_struct(dsp6: Board) -> None:
    generator = np.random.default_rng(2)
    counts = {name: generator.integers(-32768, 32768, 40) for name in dsp6.channels if name != "counter"}
    data = encode_frames(dsp6, np.arange(65520, 65560), counts)
    expected = b""
    for row in range(40):
        body = struct.pack(
            ">2sH12h",
            b"\xeb\x90",
            (65520 + row) % 65536,
            *[counts[f"{kind}{n}"][row] for kind in "gt" for n in range(1, 7)],
        )
        expected += body + struct.pack(">H", binascii.crc_hqx(body, 0xFFFF))
    assert data == expected


def test_dsp6_text(board: Callable[[str], Board]) -> None:
    counts = {f"g{n}": np.array([10 * n, -n]) for n in range(1, 7)} | {f"t{n}": np.array([n, n]) for n in range(1, 7)}
    encoded = encode(board("dsp6-text"), np.array([65535, 65536]), counts)
    bodies = ["VG,65535,10,20,30,40,50,60,1,2,3,4,5,6", "VG,0,-1,-2,-3,-4,-5,-6,1,2,3,4,5,6"]
    lines = []
    for body in bodies:
        total = 0
        for character in body.encode():
            total ^= character
        lines.append(f"${body}*{total:02X}\r\n".encode())
    assert encoded.data == b"".join(lines)
    assert encoded.starts.tolist() == [0, len(lines[0])]


def test_vectornav_golden_vector() -> None:
    # Manufacturer's example: yaw, pitch, roll as three little-endian floats, CRC-16 of 1021 with init 0.
    golden = bytes.fromhex("FA01080093502E42833EF13F48B504BB9288")
    board = Board.model_validate({
        "name": "vn", "title": "", "rate_hz": 1, "gyros": [{"name": "g", "field": "a1", "axis": "z", "scale": 1}],
        "frame": {
            "kind": "binary", "sync": "FA", "length": 18, "byte_order": "little", "constants": {1: "01 08 00"},
            "fields": [{"name": "a", "type": "f32", "at": 4, "count": 3}],
            "checksum": {"family": "crc", "polynomial": 0x1021, "span": [1, 16], "at": 16, "byte_order": "big"},
        },
    })  # fmt: skip
    values = {"a1": np.array([43.578686]), "a2": np.array([1.8847202]), "a3": np.array([-0.0020249654])}
    assert encode_frames(board, np.array([0]), values) == golden


def test_xsens_bytes_after_the_preamble_sum_to_zero(board: Callable[[str], Board]) -> None:
    data = encode_frames(board("xsens-mti"), np.arange(5), {"gx": np.linspace(-1, 1, 5)})
    frames = [data[start : start + 25] for start in range(0, len(data), 25)]
    assert all(frame[:4] == bytes.fromhex("FAFF3614") and sum(frame[1:]) % 256 == 0 for frame in frames)
    assert struct.unpack(">f", frames[0][12:16])[0] == -1.0


def test_stim300_24_bit_and_padded_crc(board: Callable[[str], Board]) -> None:
    data = encode_frames(board("stim300"), np.array([257]), {"gx": np.array([-1]), "gy": np.array([0x123456])})
    assert data[:8] == b"\x90\xff\xff\xff\x12\x34\x56\x00"
    assert data[11] == 1
    spec = Checksum(family="crc", width=32, polynomial=0x04C11DB7, init=0xFFFFFFFF, span=(0, 16), at=16)
    padded = np.frombuffer(data[:14] + b"\0\0", dtype=np.uint8)[None, :]
    assert int.from_bytes(data[14:18], "big") == crc(padded, spec)[0]


def test_dsp3000_line(board: Callable[[str], Board]) -> None:
    assert encode_frames(board("kvh-dsp3000"), np.array([0]), {"rate": np.array([-12.5])}) == b"-12.500000 1\r\n"


def test_time_stamp_wraps(board: Callable[[str], Board]) -> None:
    mimu = board("mimu4444")
    assert mimu.timestamp is not None
    data = encode_frames(mimu, np.array([0, 1]), {}, time=np.array([0.0, 2**32 / 64e6 + 1.0]))
    assert struct.unpack(">I", data[106 + 4 : 106 + 8])[0] == 64_000_000
    assert int.from_bytes(data[104:106], "big") == sum(data[:104]) % 65536


@pytest.mark.parametrize("name", ["ahrs400", "kvh1750", "vectornav-imu", "stim300-93", "mimu4444", "dsp6", "xsens-mti"])
def test_every_board_gives_whole_frames(board: Callable[[str], Board], name: str) -> None:
    made = board(name)
    data = encode_frames(made, np.arange(7), {})
    assert len(data) == 7 * made.layout.length
    assert data.startswith(bytes.fromhex(made.layout.sync))


def test_what_does_not_fit_is_refused(dsp6: Board) -> None:
    with pytest.raises(DataError, match="do not fit a field of type i16"):
        encode_frames(dsp6, np.array([0]), {"g1": np.array([32768])})
    with pytest.raises(DataError, match="no channel 'g7'"):
        encode_frames(dsp6, np.array([0]), {"g7": np.array([0])})


def test_a_board_known_from_logs_sends_nothing(board: Callable[[str], Board]) -> None:
    with pytest.raises(ConfigError, match="no frame"):
        encode_frames(board("adis16405"), np.array([0]), {})


def test_little_endian_is_the_mirror() -> None:
    values = np.array([1, -2, 300])
    assert np.array_equal(to_bytes(values, "i24", "little"), to_bytes(values, "i24", "big")[:, ::-1])
