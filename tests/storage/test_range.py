"""What lies out of a board's range: one rule for decode and convert, and a recording that is nowhere within it."""

import math

import numpy as np
import pytest

from vgyro.board import Board
from vgyro.config import IntegrityOptions
from vgyro.storage.frames import channel_watches, gyro_rails
from vgyro.storage.integrity import Ledger, Refused
from vgyro.storage.verdict import RecordingOutcome, conclude, refuse_if_needed

VALUES = 1000
SAMPLES = VALUES + 1  # the last one has no value


def board_of(gyros: int, adc: tuple[int, int] | None = None, **gyro: object) -> Board:
    """Gyros of ±300 deg/s at 0.01 deg/s a count about 20 counts, beside a thermometer."""
    names = [f"g{number + 1}" for number in range(gyros)]
    fields = [{"name": name, "type": "i32", "at": 2 + 4 * place} for place, name in enumerate((*names, "t"))]
    length = 6 + 4 * gyros
    frame = {"kind": "binary", "sync": "EB90", "length": length, "fields": fields, "checksum": {"family": "none"}}
    common = {"axis": "z", "scale": 0.01, "bias": 20.0, "range_deg_s": 300.0, **gyro}
    rows = [{"name": name, "field": name, **common} for name in names]
    temperature = [{"name": "t", "field": "t", "scale": 0.1, "offset": 0.0}]
    limits = {} if adc is None else {"adc": {"low": adc[0], "high": adc[1]}}
    return Board.model_validate({
        "name": "b", "title": "b", "rate_hz": 100.0, "frame": frame, "gyros": rows, "temperatures": temperature,
        **limits,
    })  # fmt: skip


def record_of(board: Board, columns: list[np.ndarray], options: IntegrityOptions, rates: bool = False):
    watches = channel_watches(board, rates)
    time = np.arange(SAMPLES) / 100.0
    for gyro, column in zip(board.gyros, columns, strict=True):
        watches[gyro.field].feed(column, time)
    outcome = RecordingOutcome(board, "rates" if rates else "counts", [], SAMPLES, 0, time[-1], 100.0, 100.0, 1)
    channels = {name: watch.record() for name, watch in watches.items()}
    record = conclude(outcome, Ledger(), channels, options, [])
    refuse_if_needed(record, options, "file.bin", lambda: "frames")
    return record


def clipped(share: float) -> np.ndarray:
    """Noise, a share of whose values is beyond the range."""
    values = np.random.default_rng(1).normal(0, 5, SAMPLES)
    values[: math.floor(share * (SAMPLES - 1))] = 40_000.0
    values[-1] = np.nan
    return values


@pytest.mark.parametrize(
    ("adc", "rates", "expected"),
    [
        (None, False, (20 - 30_000.0, 20 + 30_000.0)),
        (None, True, (-300.0, 300.0)),
        ((-100, 100), False, (-100.0, 100.0)),
        ((-100, 100), True, (-300.0, 300.0)),
    ],
)
def test_rails(adc, rates, expected):
    board = board_of(1, adc)
    assert gyro_rails(board, board.gyros[0], rates) == expected
    watch = channel_watches(board, rates)["g1"]
    assert (watch.low, watch.high) == expected
    unknown = board_of(1, range_deg_s=None)
    assert gyro_rails(unknown, unknown.gyros[0], rates) == (-np.inf, np.inf)


@pytest.mark.parametrize(("share", "refused"), [(0.9, False), (0.902, True)])
def test_share_of_the_samples(share, refused):
    if not refused:
        assert record_of(board_of(2), [clipped(share)] * 2, IntegrityOptions()).status == "suspect"
        return
    with pytest.raises(Refused) as caught:
        record_of(board_of(2), [clipped(share)] * 2, IntegrityOptions())
    message = str(caught.value)
    assert "more than 90 % of the samples of 2 of 2 gyros (g1, g2)" in message
    assert "right board" in message
    assert caught.value.integrity.status == "refused"
    # The other reasons stay, and this one is told once.
    reasons = caught.value.integrity.reasons
    assert reasons[0] == message
    assert sum("out of the range" in reason for reason in reasons) == 1


@pytest.mark.parametrize(("bad", "refused"), [(8, False), (9, True)])
def test_share_of_the_gyros(bad, refused):
    columns = [clipped(1.0)] * bad + [clipped(0.0)] * (10 - bad)
    if refused:
        with pytest.raises(Refused):
            record_of(board_of(10), columns, IntegrityOptions())
    else:
        assert record_of(board_of(10), columns, IntegrityOptions()).status == "suspect"


def test_the_limit_is_an_option():
    options = IntegrityOptions(refuse_clipped_share=0.5)
    with pytest.raises(Refused):
        record_of(board_of(2), [clipped(0.51)] * 2, options)
    assert record_of(board_of(2), [clipped(0.5)] * 2, options).status == "suspect"


def test_frames_that_are_not_good_come_first():
    board = board_of(2)
    outcome = RecordingOutcome(board, "counts", [], 10, 0, 0.1, 100.0, 100.0, 1)
    watches = channel_watches(board)
    for gyro in board.gyros:
        watches[gyro.field].feed(np.full(10, 1e6), np.arange(10) / 100.0)
    channels = {name: watch.record() for name, watch in watches.items()}
    record = conclude(outcome, Ledger(bad=90, lost=90), channels, IntegrityOptions(), [])
    with pytest.raises(Refused) as caught:
        refuse_if_needed(record, IntegrityOptions(), "file.bin", lambda: "look at the frames")
    assert "of the frames are good" in str(caught.value)
    assert "Look at the frames" in str(caught.value)
