"""Published check values: CRC catalogue ("123456789"), VectorNav, NMEA-style and Xsens manuals' examples."""

import struct

import numpy as np
import pytest
from storage_frames import dsp6_frame

from vgyro.board import Board, Checksum
from vgyro.engine.reference.frames import checksum, verifier
from vgyro.storage import decode_dump
from vgyro.storage.dumps.text_scan import xor_of


def of(text: bytes, **rule) -> int:
    data = np.frombuffer(text, dtype=np.uint8)[None]
    return int(checksum(data, Checksum(span=(0, len(text)), at=len(text), **rule))[0])


@pytest.mark.parametrize(
    ("rule", "expected"),
    [
        ({"width": 16, "polynomial": 0x1021, "init": 0xFFFF}, 0x29B1),  # CRC-16/CCITT-FALSE
        ({"width": 16, "polynomial": 0x1021, "init": 0}, 0x31C3),  # CRC-16/XMODEM
        ({"width": 32, "polynomial": 0x04C11DB7, "init": 0xFFFFFFFF}, 0x0376E6E7),  # CRC-32/MPEG-2
        ({"width": 8, "polynomial": 0x07}, 0xF4),  # CRC-8/SMBUS
        (
            {"width": 32, "polynomial": 0x04C11DB7, "init": 0xFFFFFFFF, "reflected": True, "xor_out": 0xFFFFFFFF},
            0xCBF43926,  # CRC-32/ISO-HDLC
        ),
        ({"width": 16, "polynomial": 0x1021, "reflected": True}, 0x2189),  # CRC-16/KERMIT
        ({"width": 16, "polynomial": 0x1021, "init": 0xB2AA, "reflected": True}, 0x63D0),  # CRC-16/RIELLO
    ],
)
def test_crc_check_values_of_the_catalogue(rule, expected):
    assert of(b"123456789", family="crc", **rule) == expected


def test_padding_adds_zero_bytes():
    rule = {"width": 32, "polynomial": 0x04C11DB7, "init": 0xFFFFFFFF}
    assert of(b"12345678901234", family="crc", pad_to=4, **rule) == of(b"12345678901234\0\0", family="crc", **rule)


def test_sum_wraps_at_its_width():
    assert of(bytes([200, 100]), family="sum", width=8) == 300 % 256


def test_xor_of_the_vectornav_command():
    text = b"$VNRRG,11*73"
    assert xor_of(text, np.array([1]), np.array([text.index(b"*")]))[0] == 0x73


def test_xsens_example_sums_to_zero():
    # FAFF000001: the bytes after the preamble, checksum included, add up to 0 modulo 256.
    text = (
        "{name: x, title: x, rate_hz: 1, frame: {kind: binary, sync: FA FF 00, length: 5, fields: [{name: n, type: u8,"
        " at: 3}], checksum: {family: sum, width: 8, span: [1, 5], equals: 0}}, gyros: [{name: g, field: n, axis: z,"
        " scale: 1}]}"
    )
    check = verifier(_board(text).layout)
    good, bad = bytes.fromhex("FAFF000001"), bytes.fromhex("FAFF000002")
    assert check(np.frombuffer(good + bad, dtype=np.uint8), np.array([0, 5])).tolist() == [True, False]


def test_vectornav_example_gives_yaw_pitch_and_roll(tmp_path):
    text = (
        "{name: ypr, title: YPR, rate_hz: 40, frame: {kind: binary, sync: FA, length: 18, byte_order: little,"
        " constants: {1: 01 08 00}, fields: [{name: a, type: f32, at: 4, count: 3}], checksum: {family: crc, width: 16,"
        " polynomial: 0x1021, init: 0, span: [1, 16], at: 16, byte_order: big}}, gyros: [{name: g, field: a1, axis: z,"
        " scale: 1}]}"
    )
    path = tmp_path / "vn.bin"
    path.write_bytes(bytes.fromhex("FA01080093502E42833EF13F48B504BB9288"))
    counts = decode_dump([path], _board(text)).counts
    assert [float(counts[name][0]) for name in ("a1", "a2", "a3")] == pytest.approx(
        [43.578686, 1.8847202, -0.0020249654], rel=1e-7
    )


def test_verifier_holds_for_good_rows_only(board):
    frames = [bytearray(dsp6_frame(i, [i] * 6)) for i in range(4)]
    frames[2][9] ^= 1
    data = np.frombuffer(b"".join(frames), dtype=np.uint8)
    assert verifier(board("dsp6").layout)(data, np.arange(0, 120, 30)).tolist() == [True, True, False, True]


def _board(text: str) -> Board:
    import yaml

    return Board.model_validate(yaml.safe_load(text))


def test_stored_value_in_both_byte_orders():
    from vgyro.engine.reference.frames import stored_value

    data = np.frombuffer(struct.pack(">I", 0x01020304), dtype=np.uint8)
    assert stored_value(data, np.array([0]), 4, "big")[0] == 0x01020304
    assert stored_value(data, np.array([0]), 4, "little")[0] == 0x04030201
