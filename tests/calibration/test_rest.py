"""Rest found from the gyros: simulated motion, and the rest poses of real captures."""

import struct
from pathlib import Path

import numpy as np
import pytest

from vgyro.calibration import find_rest
from vgyro.config import RestOptions

MIMU_HZ, MIMU_SCALE = 62.5, 1 / 16.4
FRAME, HEADER, GYROS_OF_IMU = 106, 4, (3, 4, 5)


def runs(mask: np.ndarray) -> list[tuple[int, int]]:
    edges = np.diff(mask.astype(int), prepend=0, append=0)
    return list(zip(np.flatnonzero(edges == 1).tolist(), np.flatnonzero(edges == -1).tolist(), strict=True))


def mimu_rates(path: Path) -> np.ndarray:
    """The 24 gyros of a raw capture, deg/s, by the layout of its SOURCE.md."""
    data = path.read_bytes()[HEADER:]
    frames = [data[at : at + FRAME] for at in range(0, len(data) - FRAME + 1, FRAME)]
    assert all(frame[0] == 0xAA for frame in frames)
    counts = np.array([struct.unpack_from(">48h", frame, 8) for frame in frames]).reshape(-1, 8, 6)
    return counts[:, :, GYROS_OF_IMU].reshape(len(frames), 24) * MIMU_SCALE


def pauses(rng: np.random.Generator, gyros: int = 6, bias: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """5 × (20 s rest, 4 s motion) at 100 Hz, 1σ 0.5 deg/s, and the truth."""
    still = np.tile(np.repeat([True, False], [2000, 400]), 5)
    time = np.arange(still.size) / 100.0
    rate = bias + 0.5 * rng.standard_normal((still.size, gyros))
    rate[~still] += (60 * np.sin(2 * np.pi * time[~still]))[:, None]
    return rate, still


def test_pauses_between_motions():
    rate, still = pauses(np.random.default_rng(1))
    found = find_rest(rate, 100.0)
    assert not np.any(found & ~still)
    assert len(runs(found)) == 5
    assert found.sum() >= still.sum() - 5 * 2 * 100


def test_a_bias_is_not_motion_and_one_bad_gyro_is_not_either():
    rng = np.random.default_rng(2)
    rate, still = pauses(rng, bias=30.0)
    rate[3000:3300, 2] += 20 * rng.standard_normal(300)
    found = find_rest(rate, 100.0)
    assert found[3000:3300].all()
    assert not np.any(found & ~still)


def test_a_steady_turn_is_not_rest():
    rate = 0.5 * np.random.default_rng(3).standard_normal((12_000, 6))
    rate[5000:8000] += 10.0
    found = find_rest(rate, 100.0)
    assert not found[5000:8000].any()
    assert found[1000:4500].all()
    assert found[8500:11_000].all()


def test_rotation_about_one_axis_of_three_is_seen():
    rate, still = pauses(np.random.default_rng(4), gyros=12)
    rate[:, :8] = 0.5 * np.random.default_rng(5).standard_normal((rate.shape[0], 8))
    found = find_rest(rate, 100.0)
    assert not np.any(found & ~still)


def test_constant_motion_has_no_rest():
    time = np.arange(20_000) / 100.0
    rate = 60 * np.sin(2 * np.pi * 0.5 * time)[:, None] + 0.1 * np.random.default_rng(6).standard_normal((20_000, 3))
    assert not find_rest(rate, 100.0).any()


def test_short_pauses_and_gaps():
    rate, _ = pauses(np.random.default_rng(7))
    assert not find_rest(rate, 100.0, RestOptions(min_duration_s=25)).any()
    segment = np.repeat([0, 1], [1000, rate.shape[0] - 1000])
    found = find_rest(rate, 100.0, RestOptions(guard_s=1.0), segment)
    # The guard is cut on both sides of the gap.
    assert not found[900:1100].any()
    assert found[200:900].all()


@pytest.mark.parametrize(
    "rate", [np.zeros((500, 3)), np.zeros((0, 3)), np.random.default_rng(8).standard_normal((3, 2))]
)
def test_nothing_to_find(rate: np.ndarray):
    assert not find_rest(rate, 100.0).any()


@pytest.mark.parametrize(("capture", "poses"), [("exp_1", 20), ("exp_2", 20)])
def test_rest_poses_of_real_captures(shared_data: Path, capture: str, poses: int):
    # SOURCE.md: 20 rest poses of about 23 s each, about 465 s together, then rotation by hand for about 110 s. At the
    # end of exp_2 the board lies still once more for 11 s.
    rates = mimu_rates(shared_data / "mimu4444-array" / f"{capture}_data.bin")
    found = find_rest(rates, MIMU_HZ)
    lengths = np.array([stop - start for start, stop in runs(found)]) / MIMU_HZ
    long = lengths[lengths > 15]
    assert len(long) == poses
    assert len(lengths) - len(long) <= 1
    assert 430 < long.sum() < 480
    assert np.median(long) == pytest.approx(22.5, abs=1.0)
    moving = rates[-int(90 * MIMU_HZ) : -int(20 * MIMU_HZ)]
    assert not found[-int(90 * MIMU_HZ) : -int(20 * MIMU_HZ)].any()
    assert np.abs(moving).max() > 1900
