"""Twin → dump → decoder: what the board sent comes back, whatever the board, and damage costs only what it hit."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from vgyro.board import Board
from vgyro.simulate import Twin, dump_of, simulate_recording
from vgyro.storage import decode_dump

NOISY = "{all: {arw_deg_rt_h: 6}}"
STILL = "kind: static, duration_s: 20"


@pytest.mark.parametrize(
    "name", ["dsp6", "dsp6-text", "mimu4444", "ahrs400", "kvh1750", "stim300", "xsens-mti", "vectornav-imu"]
)
def test_counts_come_back(quiet: Callable[..., Twin], board: Callable[[str], Board], tmp_path: Path, name: str) -> None:
    made = board(name)
    twin = quiet(STILL, NOISY)
    simulated = simulate_recording(twin, made, "run")
    path = tmp_path / "run.bin"
    path.write_bytes(dump_of(simulated, made, twin)[0])
    frames = decode_dump([path], made)
    assert frames.time == pytest.approx(simulated.time, abs=1e-6)
    for channel, sent in simulated.counts.items():
        # A float field holds seven digits.
        tolerance = 0 if sent.dtype.kind == "i" else 1e-6 * np.abs(sent).max()
        assert np.abs(frames.counts[channel] - sent).max() <= tolerance, channel


def test_damage_costs_only_the_frames_it_hit(quiet: Callable[..., Twin], dsp6: Board, tmp_path: Path) -> None:
    line = "{leading_bytes: 50, flips: 150, drops: 50, insertions: 50, cut_tail: 3, missing: [[5, 7]]}"
    twin = quiet(f"{STILL}, counter_start: 65000, line: {line}", NOISY)
    simulated = simulate_recording(twin, dsp6, "run")
    data, done = dump_of(simulated, dsp6, twin)
    path = tmp_path / "run.bin"
    path.write_bytes(data)
    frames = decode_dump([path], dsp6)
    rows = np.rint(frames.time * 200).astype(int)
    assert np.all(np.diff(rows) > 0)
    for channel, sent in simulated.counts.items():
        assert np.array_equal(frames.counts[channel], sent[rows]), channel
    hit = {frame for item in done if item.kind in {"flip", "drop", "insertion", "cut_tail"} for frame in _touched(item)}
    hit |= set(range(1000, 1400))
    assert set(range(4000)) - set(rows.tolist()) <= hit


def _touched(item) -> set[int]:
    """Rows whose bytes changed: only a drop can reach into the next frame."""
    lost = len(item.detail.partition(">")[0]) // 2
    return {item.frame, item.frame + 1} if item.offset % 30 + lost > 30 else {item.frame}
