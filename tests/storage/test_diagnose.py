"""What is wrong with a board file, told from the dump; nothing is said that the dump does not prove."""

import struct
import zlib
from functools import reduce

import numpy as np
import pytest
from storage_frames import crc, dsp6_frame, dsp6_stream

from vgyro.board import Board
from vgyro.storage import Refused, decode_dump
from vgyro.storage.dumps.diagnose import diagnose

COUNT = 400


@pytest.fixture
def changed(board):
    """dsp6 with other keys of its frame and checksum."""

    def make(checksum=None, **frame) -> Board:
        data = board("dsp6").model_dump()
        data["frame"].update(frame)
        data["frame"]["checksum"].update(checksum or {})
        return Board.model_validate(data)

    return make


def stream(count=COUNT) -> bytes:
    return b"".join(dsp6_stream(count)[0])


def other(make_frame, count=COUNT) -> bytes:
    """Frames of random counts that `make_frame(body)` ends with another checksum."""
    rng = np.random.default_rng(4)
    rows = rng.integers(-2000, 2000, (count, 12)).tolist()
    return b"".join(make_frame(b"\xeb\x90" + struct.pack(">H12h", index, *row)) for index, row in enumerate(rows))


WRONG = {
    "byte order": ({"byte_order": "little"}, {}, "with byte_order: big every checksum is right (400 of 400 frames): "
                   "set frame.byte_order: big in the board file"),
    "order of the checksum": ({}, {"byte_order": "little"}, "with checksum.byte_order: big every"),
    "init": ({}, {"init": 0}, "with checksum.init: 0xFFFF every checksum is right (400 of 400 frames): "
             "set frame.checksum.init: 0xFFFF in the board file"),
    "xor_out": ({}, {"xor_out": 0xFFFF}, "with checksum.xor_out: 0x0000 every checksum is right"),
    "reflected": ({}, {"reflected": True}, "with checksum.reflected: false every checksum is right"),
    "polynomial": ({}, {"polynomial": 0x8005}, "with checksum.polynomial: 0x1021 every checksum is right"),
    "polynomial and more": ({}, {"polynomial": 0x8005, "reflected": True, "init": 0}, "with checksum.polynomial: 0x1021"
                            ", checksum.init: 0xFFFF, checksum.reflected: false every"),
    "span begins late": ({}, {"span": [2, 28]}, "with checksum.span: [0, 28] every checksum is right"),
    "span ends early": ({}, {"span": [0, 27]}, "with checksum.span: [0, 28] every checksum is right"),
    "family": ({}, {"family": "sum"}, "with checksum.family: crc"),
    "sync": ({"sync": "AA 55"}, {}, "with sync: EB 90 every checksum is right"),
    "sync the other way round": ({"sync": "90 EB"}, {}, "with sync: EB 90 every checksum is right"),
    "length": ({"length": 32}, {"span": [0, 30], "at": 30}, "with length: 30, checksum.at: 28, checksum.span: [0, 28]"
               " every checksum is right"),
    "constants": ({"sync": "EB", "constants": {"1": "91"}}, {}, "with constants.1: 90 every checksum is right"),
    "counter alone": ({"byte_order": "little"}, {"byte_order": "big"}, "the counter steps by 256: with byte_order: big"
                      " it steps by 1: set frame.byte_order: big in the board file"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_every_wrong_key_of_dsp6_gets_its_sentence(changed, name):
    frame, checksum, expected = WRONG[name]
    (said,) = diagnose(stream(), changed(checksum, **frame))
    assert said.startswith(expected)


def test_a_right_board_gets_none(board):
    assert diagnose(stream(), board("dsp6")) == []
    damaged = bytearray(stream())
    for place in range(0, len(damaged), 90):
        damaged[place + 7] ^= 1
    assert diagnose(bytes(damaged), board("dsp6")) == []


@pytest.mark.parametrize("name", ["dsp6", "mimu4444", "kvh1750", "stim300", "xsens-mti", "vectornav-imu", "ahrs400"])
def test_noise_gets_none(board, name):
    assert diagnose(np.random.default_rng(1).bytes(100_000), board(name)) == []
    assert diagnose(bytes(100_000), board(name)) == []
    assert diagnose(b"", board(name)) == []


def test_frames_that_do_not_prove_anything_get_none(changed):
    # One frame again and again: any checksum can be made to fit.
    assert diagnose(dsp6_frame(1, [5] * 6) * 400, changed({"init": 0})) == []
    # Fifteen frames are too few, sixteen are enough.
    assert diagnose(stream(15), changed({"init": 0})) == []
    assert len(diagnose(stream(17), changed({"init": 0}))) == 1


@pytest.mark.parametrize(
    ("make", "length", "keys"),
    [
        (lambda body: body + struct.pack(">H", crc(body, 16, 0x1021, 0)), 30, "checksum.init: 0x0000"),
        (lambda body: body + struct.pack("<H", crc(body, 16, 0x1021, 0xFFFF)), 30, "checksum.byte_order: little"),
        (lambda body: body + struct.pack(">H", crc(body, 16, 0x1021, 0xFFFF) ^ 0xFFFF), 30, "checksum.xor_out: 0xFFFF"),
        (lambda body: body + struct.pack(">H", sum(body) & 0xFFFF), 30, "checksum.family: sum"),
        (lambda body: body + struct.pack(">H", crc(body[2:], 16, 0x1021, 0xFFFF)), 30, "checksum.span: [2, 28]"),
        (lambda body: body + struct.pack(">H", crc(body, 16, 0x1021, 0xBEEF)), 30, "checksum.xor_out: 0x"),
    ],
)  # fmt: skip
def test_dumps_with_another_checksum(board, make, length, keys):
    (said,) = diagnose(other(make), board("dsp6"))
    assert said.startswith(f"with {keys}")
    assert len(make(bytes(28))) == length


def test_crc_32_of_zip_and_a_sum_of_one_byte(changed):
    data = other(lambda body: body + struct.pack("<I", zlib.crc32(body)))
    said = diagnose(data, changed({}, length=32))[0]
    assert "checksum.width: 32" in said
    assert "polynomial: 0x04C11DB7" in said
    assert "reflected: true" in said
    data = other(lambda body: body + bytes([sum(body) & 255]))
    assert "checksum.width: 8" in diagnose(data, changed({}, length=30))[0]


def test_a_xor_is_not_taken_for_a_sum_or_crc(board):
    data = other(lambda body: body + bytes([0, reduce(int.__xor__, body)]))
    assert diagnose(data, board("dsp6")) == []


def test_gyros_in_the_wrong_byte_order_are_rough(board):
    counts = np.random.default_rng(1).normal(0, 3, (COUNT, 6)).round().astype(int).tolist()
    data = b"".join(dsp6_frame(index, row) for index, row in enumerate(counts))
    read = board("dsp6").model_dump()
    read["frame"]["fields"][1]["byte_order"] = "little"
    (said,) = diagnose(data, Board.model_validate(read))
    assert said.startswith("with byte_order: big the gyros change ")
    assert said.endswith(" less from frame to frame: set byte_order: big for field g in the board file")


def test_the_refusal_and_the_record_say_it(dump, changed):
    path = dump(stream())
    with pytest.raises(Refused, match=r"With checksum\.init: 0xFFFF every checksum is right"):
        decode_dump([path], changed({"init": 0}))
    with pytest.raises(Refused, match="The counter steps by 256: with byte_order: big it steps by 1"):
        decode_dump([path], changed({"byte_order": "big"}, byte_order="little"))
