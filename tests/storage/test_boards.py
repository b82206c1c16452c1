"""Every shipped board reads frames that are built by hand from its documented layout."""

import math

import numpy as np
import pytest
from storage_frames import ahrs, dsp6_frame, dsp6_text_line, dsp3000, kvh, mimu_packet, stim, vectornav, xsens

from vgyro.storage import decode_dump
from vgyro.storage.dumps.sniff import all_boards, sniff

COUNT = 300


@pytest.fixture
def decoded(dump, board):
    def run(name: str, frames: list[bytes]):
        return decode_dump([dump(b"".join(frames))], board(name))

    return run


def whole(result, count=COUNT):
    record = result.integrity
    assert (record.frames.good, record.frames.lost, record.frames.bad) == (count, 0, 0)
    assert not record.damage
    assert not record.gaps
    assert record.status == "good"
    return result


def columns(result, names):
    return np.column_stack([result.counts[name] for name in names])


def integers(low, high, shape, seed=3):
    return np.random.default_rng(seed).integers(low, high, shape)


def test_dsp6(decoded, board):
    values = integers(-32000, 32000, (COUNT, 12))
    result = whole(decoded("dsp6", [dsp6_frame(i, v[:6].tolist(), v[6:].tolist()) for i, v in enumerate(values)]))
    names = [*(f"g{k}" for k in range(1, 7)), *(f"t{k}" for k in range(1, 7))]
    assert np.array_equal(columns(result, names), values)
    assert result.counts["g1"].dtype == np.int16
    assert result.time[-1] == pytest.approx((COUNT - 1) / 200, abs=1e-12)
    assert "counter" not in result.counts
    # 5 V over 65536 counts, 5 mV/(deg/s), 8.4 mV/K, 2.5 V at 298 K.
    read = board("dsp6")
    assert read.gyros[0].scale == pytest.approx(5 / 65536 / 0.005, rel=1e-12)
    assert read.temperatures[0].scale == pytest.approx(5 / 65536 / 0.0084, rel=1e-12)
    assert read.temperatures[0].offset == pytest.approx(298 - 273.15)


def test_dsp6_text(decoded):
    values = integers(-32768, 32768, (COUNT, 12))
    result = whole(decoded("dsp6-text", [dsp6_text_line(i, v[:6], v[6:]) for i, v in enumerate(values)]))
    names = [*(f"g{k}" for k in range(1, 7)), *(f"t{k}" for k in range(1, 7))]
    assert np.array_equal(columns(result, names), values)


def test_mimu4444(decoded, board):
    values = integers(-32000, 32000, (COUNT, 48))
    result = whole(decoded("mimu4444", [mimu_packet(i, 1_024_000 * i, v.tolist()) for i, v in enumerate(values)]))
    names = [f"imu{k}_{c}" for k in range(1, 9) for c in ("ax", "ay", "az", "gx", "gy", "gz")]
    assert np.array_equal(columns(result, names), values)
    assert result.integrity.measured_rate_hz == pytest.approx(62.5)
    # Board x is imu1 gx and -imu2 gy, z is imu1 gz and -imu2 gz.
    read = board("mimu4444")
    signs = {axis: [(gyro.name, gyro.sign) for gyro in read.array(axis)] for axis in "xyz"}
    assert signs["x"][:3] == [("imu1_gx", 1), ("imu2_gy", -1), ("imu3_gx", 1)]
    assert signs["y"][:2] == [("imu1_gy", 1), ("imu2_gx", -1)]
    assert signs["z"][7] == ("imu8_gz", -1)
    assert all(len(read.array(axis)) == 8 for axis in "xyz")
    assert read.gyros[0].scale == pytest.approx(1 / 16.4)


def test_kvh1750(decoded, board):
    values = np.random.default_rng(3).normal(0, 1, (COUNT, 3)).astype(np.float32)
    result = whole(decoded("kvh1750", [kvh(i, v) for i, v in enumerate(values)]))
    assert np.array_equal(columns(result, ["gx", "gy", "gz"]), values)
    assert result.counter[-1] == COUNT - 1  # 0-127 wraps twice
    assert set(result.counts["temperature"]) == {31}
    assert board("kvh1750").gyros[0].scale == pytest.approx(180 / math.pi)


@pytest.mark.parametrize(("name", "head", "middle"), [("stim300", 0x90, b""), ("stim300-93", 0x93, bytes(range(20)))])
def test_stim300(decoded, board, name, head, middle):
    values = integers(-(2**23) + 1, 2**23 - 1, (COUNT, 3))
    frames = [stim(head, i, v.tolist(), middle) for i, v in enumerate(values)]
    assert len(frames[0]) == (38 if middle else 18)
    result = whole(decoded(name, frames))
    assert np.array_equal(columns(result, ["gx", "gy", "gz"]), values)
    assert board(name).gyros[0].scale == 2**-14


def test_xsens_mti(decoded):
    values = np.random.default_rng(3).normal(0, 1, (COUNT, 3)).astype(np.float32)
    result = whole(decoded("xsens-mti", [xsens(i, v) for i, v in enumerate(values)]))
    assert np.array_equal(columns(result, ["gx", "gy", "gz"]), values)


def test_vectornav(decoded):
    values = np.random.default_rng(3).normal(0, 1, (COUNT, 3)).astype(np.float32)
    result = whole(decoded("vectornav-imu", [vectornav(i, v) for i, v in enumerate(values)]))
    assert np.array_equal(columns(result, ["gx", "gy", "gz"]), values)
    assert result.integrity.measured_rate_hz == pytest.approx(100)
    assert result.counts["temperature"][0] == pytest.approx(25.5)
    assert result.time[-1] == pytest.approx((COUNT - 1) * 0.01, abs=1e-9)


def test_ahrs400_has_many_false_frames_and_finds_the_true_ones(decoded, board):
    # Small negative rates are full of FF, which is the sync byte, and the sum has 8 bits only.
    values = integers(-50, 50, (4000, 3))
    result = whole(decoded("ahrs400", [ahrs(i, v.tolist()) for i, v in enumerate(values)]), 4000)
    assert np.array_equal(columns(result, ["gx", "gy", "gz"]), values)
    read = board("ahrs400")
    assert read.gyros[0].scale == pytest.approx(100 * 1.5 / 2**15)
    sensor = read.temperatures[0]
    assert 1500 * sensor.scale + sensor.offset == pytest.approx((1500 * 5 / 4096 - 1.375) * 44.4)


def test_kvh_dsp3000(decoded):
    values = np.round(np.random.default_rng(3).normal(0, 0.5, COUNT), 6)
    values[0] = 0.25
    result = decoded("kvh-dsp3000", [dsp3000(i, v) for i, v in enumerate(values)])
    assert np.array_equal(result.counts["rate"], values)
    assert result.time[-1] == pytest.approx((COUNT - 1) / 100)
    assert "neither time stamps nor a frame counter" in result.integrity.rate_note
    assert any("no checksum" in text for text in result.integrity.warnings)


def test_kvh_dsp3000_refuses_invalid_values_and_a_cut_first_line(decoded):
    # 23. may have been -123.: its beginning is not there.
    lines = [b"23.000000 1\r\n", b"0.500000 1\r\n", b"0.600000 0\r\n", b"-0.700000 1\r\n", b"0.750000 1\r\n", b"0.8000"]
    result = decoded("kvh-dsp3000", lines)
    assert result.counts["rate"].tolist() == [0.5, -0.7, 0.75]
    causes = [entry.cause for entry in result.integrity.damage]
    assert causes == ["leading bytes", "marked invalid by the board", "truncated at the end"]
    assert result.segment.tolist() == [0, 1, 1]


FRAMES = {
    "dsp6": lambda i: dsp6_frame(i, [i % 100] * 6),
    "dsp6-text": lambda i: dsp6_text_line(i, [i % 100] * 6),
    "mimu4444": lambda i: mimu_packet(i, 1_024_000 * i, [i % 100] * 48),
    "kvh1750": lambda i: kvh(i, [0.1 * i, 0, 0]),
    "stim300": lambda i: stim(0x90, i, [i, -i, 0]),
    "stim300-93": lambda i: stim(0x93, i, [i, -i, 0], bytes(20)),
    "xsens-mti": lambda i: xsens(i, [0.1 * i, 0, 0]),
    "vectornav-imu": lambda i: vectornav(i, [0.1 * i, 0, 0]),
    "ahrs400": lambda i: ahrs(i, [i % 100, -3, 5]),
    "kvh-dsp3000": lambda i: dsp3000(i, 0.001 * i),
}


@pytest.mark.parametrize("name", FRAMES)
def test_sniff_names_the_board(dump, boards, name):
    path = dump(b"".join(FRAMES[name](i) for i in range(COUNT)))
    best = sniff(path, all_boards(boards))[0]
    assert best.board == name
    assert best.frames == COUNT
    assert best.good_share > 0.8
    expected = {"mimu4444": 62.5, "vectornav-imu": 100}.get(name)
    assert best.rate_hz == (None if expected is None else pytest.approx(expected))


def test_boards_survive_the_way_through_the_workflow(boards):
    for read in all_boards(boards):
        assert type(read).model_validate(read.model_dump(mode="json")) == read
        assert read.source
    assert len(all_boards(boards)) == len(list(boards.glob("*.yaml")))
