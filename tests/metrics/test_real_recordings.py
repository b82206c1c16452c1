"""What is true of the real recordings (facts of their SOURCE.md and of a look at the data, not of this code)."""

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from vgyro.calibration import find_rest
from vgyro.metrics import (
    AllanCurve,
    allan_deviation,
    correlation_matrix,
    noise_coefficients,
    noise_density,
    read_curve,
    spectral_density,
    without_means,
)

MIMU_HZ, ADIS_HZ = 62.5, 100.0


@pytest.fixture(scope="module")
def mimu(shared_data: Path) -> dict[str, dict[str, AllanCurve]]:
    """Capture → gyro → Allan curve over the rest poses, each pose's mean removed."""
    found = {}
    for capture in ("exp_1", "exp_2"):
        table = pq.read_table(shared_data / "mimu4444-array" / f"{capture}.parquet")
        names = [name for name in table.column_names if "_g" in name]
        rates = np.column_stack([table.column(name).to_numpy() / 16.4 for name in names])
        still = find_rest(rates, MIMU_HZ)
        segment = np.cumsum(np.diff(still, prepend=False))[still]
        inside = np.column_stack([without_means(column, segment) for column in rates[still].T])
        found[capture] = {
            name.replace("_g", "_"): allan_deviation(inside[:, column], MIMU_HZ, segment=segment)
            for column, name in enumerate(names)
        }
    return found


def at_one_second(mimu: dict, gyro: str) -> np.ndarray:
    """60·σ(1 s), deg/√h, in both captures."""
    return np.array([60 * read_curve(curves[gyro], 1.0)[0] for curves in mimu.values()])


def test_imu4_y_is_three_times_as_noisy_as_its_neighbours(mimu: dict):
    # Neighbours on the same axis of the board and the same side of it: y of IMUs 2 and 6.
    for curves in mimu.values():
        bad, *good = (curves[gyro].deviation[0] for gyro in ("imu4_y", "imu2_y", "imu6_y"))
        assert 2.3 < bad / np.mean(good) < 4.5
    ratio = at_one_second(mimu, "imu4_y") / np.mean([at_one_second(mimu, g) for g in ("imu2_y", "imu6_y")], axis=0)
    assert np.all((ratio > 2.3) & (ratio < 4))


def test_the_z_gyros_are_healthy(mimu: dict):
    figures = np.array([at_one_second(mimu, f"imu{number}_z") for number in range(1, 9)])
    assert np.all((figures > 0.55) & (figures < 0.95))


@pytest.mark.parametrize("gyro", ["imu4_y", "imu5_y", "imu1_x", "imu7_x", "imu8_x"])
def test_bad_gyros_stand_out_at_one_second(mimu: dict, gyro: str):
    healthy = max(at_one_second(mimu, f"imu{number}_z").max() for number in range(1, 9))
    assert at_one_second(mimu, gyro).max() > 1.7 * healthy


def test_imu7_y_is_bad_at_the_sample_rate(mimu: dict):
    for curves in mimu.values():
        healthy = np.median([curves[f"imu{number}_z"].deviation[0] for number in range(1, 9)])
        assert curves["imu7_y"].deviation[0] > 2 * healthy


def test_a_curve_that_is_no_power_law_says_so(mimu: dict):
    for curves in mimu.values():
        bad, good = (noise_coefficients(curves[gyro], replicates=50) for gyro in ("imu7_x", "imu5_z"))
        assert not bad.reliable
        assert "does not describe" in bad.note
        assert good.reliable
        assert 60 * good.N.value == pytest.approx(0.8, rel=0.1)


@pytest.mark.parametrize("recording", ["rec2", "rec3", "rec4"])
def test_adis_curves(shared_data: Path, recording: str):
    # ADIS16405 data sheet: 2.0 deg/√h typical, in-run bias stability 0.007 deg/s = 25 deg/h. Nine curves of one unit.
    table = pq.read_table(shared_data / "adis16405-static" / f"{recording}.parquet")
    rates = np.column_stack([table.column(f"gyro_{axis}").to_numpy() * 0.05 for axis in "xyz"])
    for column in range(3):
        curve = allan_deviation(rates[:, column], ADIS_HZ)
        fit = noise_coefficients(curve, replicates=100)
        assert curve.tau[-1] > 2800
        assert 60 * fit.N.value == pytest.approx(2.4, rel=0.12)
        assert fit.reliable
        assert 20 < 3600 * fit.B.value < 45
        density = noise_density(spectral_density(rates[:, column], ADIS_HZ), (0.5, 10.0)).value
        assert density == pytest.approx(fit.N.value, rel=0.03)
    correlation = correlation_matrix(rates.T, ADIS_HZ)
    assert np.abs(correlation.value[np.triu_indices(3, 1)]).max() < 0.1
