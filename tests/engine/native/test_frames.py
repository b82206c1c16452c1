"""The C search for frames against that of NumPy: equal to the last bit, whatever the layout and the damage."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vgyro.board import BinaryFrame, Board
from vgyro.config import IntegrityOptions
from vgyro.engine.frames import DTYPES, FrameColumn
from vgyro.engine.native import frames as native
from vgyro.engine.reference import frames as reference
from vgyro.simulate import encode_frames
from vgyro.storage import decode_dump
from vgyro.storage.inputs import read_board

BOARDS = Path(__file__).parents[3] / "config/boards"
BINARY = ["dsp6", "mimu4444", "kvh1750", "stim300", "stim300-93", "xsens-mti", "vectornav-imu", "ahrs400"]

CHECKSUMS = [
    {"family": "none"},
    *({"family": "sum", "width": width, "byte_order": order} for width in (8, 16, 32) for order in ("big", "little")),
    *(
        {"family": "crc", "width": width, "polynomial": polynomial, "init": init, "reflected": reflected,
         "xor_out": xor_out, "pad_to": pad_to, "byte_order": order}
        for width, polynomial in ((8, 0x07), (16, 0x1021), (32, 0x04C11DB7))
        for init, reflected, xor_out, pad_to, order in (
            (0, False, 0, 1, "big"), (0xA5, True, 0, 4, "little"), (0xFF, False, 0x5A, 8, "little"))
    ),
]  # fmt: skip


def layout(length: int, sync: str, checksum: dict, constants: dict[int, str]) -> BinaryFrame:
    if checksum["family"] != "none":
        stored = length - checksum.get("width", 16) // 8
        checksum = {**checksum, "span": [0, stored], "at": stored}
    return BinaryFrame.model_validate({
        "kind": "binary", "sync": sync, "length": length, "constants": constants, "checksum": checksum,
        "fields": [{"name": "x", "type": "u8", "at": 1}],
    })  # fmt: skip


def spoilt(frame: BinaryFrame, rng: np.random.Generator, frames: int) -> np.ndarray:
    """Frames, right but for their checksum one time in two, among sync bytes and noise."""
    sync = bytes.fromhex(frame.sync)
    pieces = []
    for _ in range(frames):
        content = bytearray(rng.choice([*sync, 0, 1, 255], frame.length).astype(np.uint8).tobytes())
        content[: len(sync)] = sync
        for place, text in frame.constants.items():
            content[place : place + len(bytes.fromhex(text))] = bytes.fromhex(text)
        rule = frame.checksum
        if rule.family != "none" and rng.random() < 0.7:
            assert rule.at is not None
            covered = np.frombuffer(bytes(content[: rule.at]), dtype=np.uint8)[None]
            value = int(reference.checksum(covered, rule)[0])
            content[rule.at :] = value.to_bytes(rule.width // 8, rule.byte_order or frame.byte_order)
        pieces += [bytes(content), rng.choice([*sync, 7], int(rng.integers(0, 4))).astype(np.uint8).tobytes()]
    return np.frombuffer(b"".join(pieces)[int(rng.integers(0, 5)) :], dtype=np.uint8)


@pytest.mark.parametrize("checksum", CHECKSUMS, ids=str)
@pytest.mark.parametrize(("sync", "constants"), [("FA", {}), ("EB 90", {}), ("AA AA", {3: "AA 01"})])
@pytest.mark.parametrize("length", [9, 17, 31])
def test_candidates_are_those_of_numpy(checksum: dict, sync: str, constants: dict, length: int) -> None:
    frame = layout(length, sync, checksum, constants)
    rng = np.random.default_rng(length)
    ours, theirs = native.Finder(frame), reference.Finder(frame)
    some = 0
    for frames in (1, 2, 40):
        buffer = spoilt(frame, rng, frames)
        for part in (buffer, buffer[: length - 1], buffer[3:-1], np.full(200, buffer[0])):
            found, expected = ours.find(np.ascontiguousarray(part)), theirs.find(part)
            assert np.array_equal(found.good, expected.good)
            assert np.array_equal(found.failed, expected.failed)
            some += len(found.good)
    assert some > 20


def test_more_candidates_than_there_is_room_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(native, "ROOM", 3)
    frame = layout(16, "00", {"family": "sum", "width": 8}, {})
    buffer = np.zeros(2000, dtype=np.uint8)
    buffer[700] = 1
    found, expected = native.Finder(frame).find(buffer), reference.Finder(frame).find(buffer)
    assert np.array_equal(found.good, expected.good)
    assert np.array_equal(found.failed, expected.failed)
    assert len(found.good) > 1900


def test_sync_after_the_first_covered_byte_and_a_fixed_total() -> None:
    checksum = {"family": "sum", "width": 8, "span": [1, 5], "equals": 0}
    frame = BinaryFrame.model_validate({
        "kind": "binary", "sync": "FA FF", "length": 5, "constants": {2: "00"}, "checksum": checksum,
        "fields": [{"name": "x", "type": "u8", "at": 3}],
    })  # fmt: skip
    buffer = np.frombuffer(bytes.fromhex("00 FAFF000001 FAFF000002 FAFF00FF02"), dtype=np.uint8)
    found = native.Finder(frame).find(buffer)
    # By hand: FF + 00 + 00 + 01 and FF + 00 + FF + 02 are 0 modulo 256, FF + 00 + 00 + 02 is not.
    assert (found.good.tolist(), found.failed.tolist()) == ([1, 11], [6])


@pytest.mark.parametrize("order", ["big", "little"])
def test_columns_of_every_type(order) -> None:
    buffer = np.random.default_rng(1).integers(0, 256, 5000, dtype=np.uint8)
    places = np.sort(np.random.default_rng(2).integers(0, 4980, 700))
    columns = [FrameColumn(kind, at, order) for kind in DTYPES for at in (0, 5)]
    for ours, theirs in zip(
        native.read_columns(buffer, places, 20, columns),
        reference.read_columns(buffer, places, 20, columns),
        strict=True,
    ):
        assert ours.dtype == theirs.dtype
        assert ours.tobytes() == theirs.tobytes()
    with pytest.raises(IndexError, match="do not lie in a buffer"):
        native.read_columns(buffer, np.array([4981]), 20, columns)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_breaks_and_runs_are_those_of_numpy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 400))
    start = np.cumsum(rng.choice([30, 30, 30, 29, 61], count))
    counter = np.cumsum(rng.choice([1, 1, 1, 2], count)) % 16 if rng.random() < 0.8 else None
    expected = reference.breaks(start, 30, counter, 1, 16)
    assert np.array_equal(native.breaks(start, 30, counter, 1, 16), expected)
    values = rng.integers(0, rng.choice([2, 3, 40, 1000]), count).astype(rng.choice(list(DTYPES.values())))
    if values.dtype.kind == "f":
        values[rng.random(count) < 0.05] = np.nan
        values *= rng.choice([-1, 1], count)
    stuck = int(rng.integers(0, count))
    values[stuck : stuck + int(rng.integers(0, 200))] = values[stuck]
    time = 100 + np.cumsum(np.where(rng.random(count) < 0.02, rng.random(count), 0.005))
    since, least = time[0] - rng.choice([0, 1.5]), float(rng.choice([0, 0.005, 0.02, 1.0]))
    assert native.longest_run(values, time, since, least) == reference.longest_run(values, time, since, least)


def damaged_dump(board: Board, seed: int) -> bytes:
    """Frames with flipped, lost and inserted bytes, many of them sync bytes, a block sent again, and a gap."""
    rng = np.random.default_rng(seed)
    frames, length = 1500, board.layout.length
    data = bytearray(encode_frames(board, 65000 + np.arange(frames) + 40 * (np.arange(frames) > 900), {}))
    data[500 * length : 500 * length] = data[480 * length : 500 * length]
    sync = bytes.fromhex(board.layout.sync)
    for place in np.sort(rng.integers(0, len(data), 120))[::-1].tolist():
        match rng.integers(4):
            case 0:
                data[place] ^= 1 << int(rng.integers(8))
            case 1:
                del data[place : place + int(rng.integers(1, 60))]
            case 2:
                data[place:place] = sync * int(rng.integers(1, 30))
            case _:
                data[place : place + len(sync)] = sync
    return bytes(data)


@pytest.mark.parametrize("name", BINARY)
def test_a_damaged_dump_decodes_the_same_on_both_engines(tmp_path: Path, name: str) -> None:
    board = read_board(name, boards=BOARDS)
    path = tmp_path / "dump.bin"
    for seed in range(3):
        path.write_bytes(damaged_dump(board, seed))
        options = IntegrityOptions(min_good_share=0)
        ours, theirs = (decode_dump(path, board, options, engine=engine) for engine in ("native", "reference"))
        assert ours.integrity == theirs.integrity
        assert ours.integrity is not None
        assert ours.integrity.frames.good > 1000
        for mine, other in zip(
            [ours.counter, ours.time, ours.segment, *ours.counts.values()],
            [theirs.counter, theirs.time, theirs.segment, *theirs.counts.values()],
            strict=True,
        ):
            assert mine.tobytes() == other.tobytes()


@pytest.mark.parametrize("settings", [{"VGYRO_ISA": "baseline"}, {"VGYRO_THREADS": "1"}, {"VGYRO_THREADS": "3"}])
def test_the_same_bits_on_every_machine(tmp_path: Path, settings: dict[str, str]) -> None:
    board = read_board("dsp6", boards=BOARDS)
    (tmp_path / "dump.bin").write_bytes(damaged_dump(board, 7))
    program = (
        "import hashlib, sys\n"
        "from pathlib import Path\n"
        "from vgyro.config import IntegrityOptions\n"
        "from vgyro.storage import decode_dump\n"
        "from vgyro.storage.inputs import read_board\n"
        "board, options = read_board('dsp6', boards=Path(sys.argv[2])), IntegrityOptions(min_good_share=0)\n"
        "frames = decode_dump(sys.argv[1], board, options)\n"
        "parts = [frames.counter, frames.time, frames.segment, *frames.counts.values()]\n"
        "print(hashlib.sha256(b''.join(part.tobytes() for part in parts)).hexdigest(), frames.integrity)\n"
    )
    command = [sys.executable, "-c", program, str(tmp_path / "dump.bin"), str(BOARDS)]
    plain, other = (
        subprocess.run(command, env={**os.environ, **extra}, capture_output=True, text=True, check=True).stdout
        for extra in ({}, settings)
    )
    assert plain == other
    assert "good=" in plain
