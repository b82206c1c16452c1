"""vgyro check reads the data: mistakes that a manifest does not show."""

import binascii
import struct

import numpy as np
import pytest

RATES = (0.0, 50.0, -50.0, 100.0, -100.0, 20.0)
SPANS = [(5.0 + 20 * k, 18.0 + 20 * k, rate) for k, rate in enumerate(RATES)]


def dump(counts, order=">") -> bytes:
    bodies = [
        b"\xeb\x90" + struct.pack(order + "H2h", index % 65536, *row) for index, row in enumerate(counts.tolist())
    ]
    return b"".join(body + struct.pack(">H", binascii.crc_hqx(body, 0xFFFF)) for body in bodies)


def noise(count, seed=1):
    return np.random.default_rng(seed).normal(0, 20, (count, 2)).round().astype(int)


def turning() -> np.ndarray:
    time = np.arange(0, 130, 0.01)
    rate = np.zeros(len(time))
    for start, stop, value in SPANS:
        rate[(time >= start - 1) & (time <= stop + 1)] = value
    return noise(len(time)) + np.column_stack([10 * rate, 10 * rate]).astype(int)


def manifest(spans=SPANS, more="") -> str:
    plateaus = "".join(f"    - {{start: {a}, stop: {b}, rate: {rate}}}\n" for a, b, rate in spans)
    return (
        "board: tiny\nrecordings:\n- name: table\n  kind: calibration\n  files: a.bin\n"
        f"{more}  reference:\n    kind: plateaus\n    plateaus:\n{plateaus}"
    )


STATIC = "board: tiny\nrecordings:\n- name: a\n  kind: static\n  files: a.bin\n"


@pytest.fixture
def check(project, vgyro):
    def run(text, data, *options):
        folder = project / "raw/bench"
        folder.mkdir(exist_ok=True)
        (folder / "dataset.yaml").write_text(text)
        (folder / "a.bin").write_bytes(data)
        outcome = vgyro("check", *options)
        return outcome.code, [line.removeprefix("raw/bench/dataset.yaml:") for line in outcome.err.splitlines()]

    return run


def change_board(project, old, new):
    board = project / "config/boards/tiny.yaml"
    text = board.read_text()
    assert old in text
    board.write_text(text.replace(old, new))


def test_good_data_say_nothing(check):
    assert check(manifest(), dump(turning())) == (0, [])
    assert check(STATIC, dump(noise(3000))) == (0, [])


def test_quick_leaves_the_data_alone(check):
    assert check(STATIC, b"nothing", "--quick") == (0, [])
    code, lines = check(STATIC, b"nothing")
    assert code == 3
    assert "no good frame of board tiny" in lines[0]
    assert lines[0].startswith("5: recordings.0.files: ")


def test_two_gyros_of_one_channel(check, project):
    change_board(project, "{name: g2, field: g2", "{name: g2, field: g1")
    code, lines = check(STATIC, dump(noise(3000)))
    assert code == 3
    assert lines[0] == "3: recordings.0: gyros g1 and g2 read one channel, g1: mend `field` in the board file"


def test_two_equal_columns(check):
    counts = noise(3000)
    counts[:, 1] = counts[:, 0]
    code, lines = check(STATIC, dump(counts))
    assert code == 3
    assert lines[0].startswith("3: recordings.0: gyros g1 and g2 give the same numbers in all 3000 samples")


def test_rates_in_radians(check):
    spans = [(start, stop, rate / 57.29578) for start, stop, rate in SPANS]
    code, lines = check(manifest(spans), dump(turning()))
    assert code == 3
    assert "6: recordings.0.reference: the plateaus' rates look like rad/s: multiply them by 57.29578" in lines[0]


def test_plateaus_that_are_seven_seconds_late(check):
    spans = [(start + 7, stop + 7, rate) for start, stop, rate in SPANS]
    code, lines = check(manifest(spans), dump(turning()))
    assert code == 3
    assert lines[0].startswith("6: recordings.0.reference: the gyros are not steady on the plateaus: moving all")
    assert "moving all plateaus by -7.0 s makes them steady" in lines[0]


def test_plateaus_and_rests_after_the_end(check):
    code, lines = check(manifest([*SPANS, (500, 510, 7.0)]), dump(turning()))
    assert code == 3
    assert lines[0].startswith(
        "15: recordings.0.reference.plateaus.6: the plateau from 500 to 510 s lies after the end"
    )
    code, lines = check(STATIC + "  rest: [[0, 5], [40, 50]]\n", dump(noise(3000)))
    assert code == 3
    assert "6: recordings.0.rest.1: the rest from 40 to 50 s lies after the end of the recording, at 30 s" in lines[0]


def test_a_rate_that_the_stamps_contradict(check, project):
    change_board(project, "counter: {field: counter, modulus: 65536}",
                 "timestamp: {field: counter, tick_s: 0.01, wrap: 65536}")  # fmt: skip
    code, lines = check(STATIC + "  rate_hz: 1000\n", dump(noise(3000)))
    assert code == 3
    assert lines[0] == "6: recordings.0.rate_hz: rate_hz is 1000, but the time stamps say 100 Hz: set rate_hz: 100"


def test_a_wrong_byte_order_and_a_wrong_checksum(check, project):
    data = dump(noise(3000), "<")
    code, lines = check(STATIC, data)
    assert code == 3
    assert "the counter steps by 256: with byte_order: little it steps by 1" in lines[0].replace("The", "the")
    change_board(project, "init: 0xFFFF", "init: 0")
    code, lines = check(STATIC, dump(noise(3000)))
    assert code == 3
    assert "ith checksum.init: 0xFFFF every checksum is right (3000 of 3000 frames)" in lines[0]


def test_a_scale_that_is_a_little_off_is_a_warning_and_does_not_count(check):
    counts = turning()
    counts[:, 1] = counts[:, 1] * 0.8
    code, lines = check(manifest(), dump(counts))
    assert code == 0
    assert lines == [
        "warning: raw/bench/dataset.yaml:6: recordings.0.reference: the measured scale of gyro g2 is 1.25 times the"
        " nominal one"
    ]


def test_a_static_recording_that_moves_is_a_warning(check):
    counts = noise(6000)
    counts[2000:3500] += (2000 * np.sin(np.arange(1500) / 40)).astype(int)[:, None]
    code, lines = check(STATIC, dump(counts))
    assert code == 0
    assert lines[0].startswith(
        "warning: raw/bench/dataset.yaml:3: recordings.0: declared static, but the board moves in"
    )


def test_json_has_the_warnings_apart(check, vgyro, project):
    import json

    counts = noise(6000)
    counts[2000:3500] += (2000 * np.sin(np.arange(1500) / 40)).astype(int)[:, None]
    check(STATIC, dump(counts))
    record = json.loads(vgyro("check", "--json").out)
    assert record["ok"]
    assert [warning["key"] for warning in record["warnings"]] == ["recordings.0"]
    assert project.is_dir()
