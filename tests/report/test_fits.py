"""The map of the fits: counts and shares that are written down here."""

import dataclasses

import numpy as np
import pytest

from vgyro.engine.models import DCC_STATUSES, GARCH_STATUSES
from vgyro.report.conclusions.section import limits
from vgyro.report.model import GarchSummary, VolatilityPart
from vgyro.report.plots import Bars
from vgyro.report.volatility import fits
from vgyro.report.volatility.fits import STATUSES, fits_map, shares, status_counts
from vgyro.tasks.common import Task
from vgyro.tasks.pages.report import read_dataset_part

ROWS = [
    (0.0, 10.0, "g1", "converged", 6),
    (0.0, 10.0, "g1", "failed", 2),
    (0.0, 10.0, "dcc", "boundary: a = 0", 8),
    (10.0, 20.0, "g1", "boundary: α = 0", 1),
    (10.0, 20.0, "g1", "converged", 3),
]
NAMES = ("time_start", "time_stop", "subject", "status", "windows")
TABLE = {
    name: np.array([row[i] for row in ROWS], dtype=object if name in {"subject", "status"} else float)
    for i, name in enumerate(NAMES)
}


def test_every_status_of_the_engines_has_a_colour_and_a_meaning() -> None:
    assert set(STATUSES) == {*GARCH_STATUSES, *DCC_STATUSES}


def test_counts_of_the_table() -> None:
    assert status_counts(TABLE, "g1") == {"converged": 9, "failed": 2, "boundary: α = 0": 1}
    page = fits_map("x", ["g1", "g2"], TABLE)
    assert "8" in page
    assert "<th>g2" not in page
    assert "GARCH: integrated" not in page  # the status does not occur, so it is not explained
    assert "No window was fitted" in fits_map("x", ["g2"], {name: column[:0] for name, column in TABLE.items()})
    assert shares({"converged": 3, "failed": 1}).startswith("converged 75")


def test_the_shares_of_a_bin_fill_its_strip(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: dict[str, Bars] = {}

    def record(_identifier: str, _title: str, bars: list[Bars], *_: object, **__: object) -> str:
        drawn.update({kind.name: kind for kind in bars})
        return ""

    monkeypatch.setattr(fits, "bar_plot", record)
    fits_map("x", ["g1"], TABLE)
    # g1 is the upper of two strips, 1.08 to 1.92: 6 of 8 converged, then 2 of 8 failed; then 3 of 4 and 1 of 4.
    assert np.allclose(drawn["converged"].bottom, [1.08, 1.08])
    assert np.allclose(drawn["converged"].top, [1.08 + 0.84 * 0.75, 1.08 + 0.84 * 0.75])
    assert np.allclose(drawn["failed"].bottom, [1.08 + 0.84 * 0.75])
    assert np.allclose(drawn["failed"].top, [1.92])
    assert np.allclose(drawn["boundary: α = 0"].top, [1.92])
    assert np.allclose((drawn["boundary: a = 0"].bottom[0], drawn["boundary: a = 0"].top[0]), (0.08, 0.92))


def test_a_gyro_without_usable_fits_is_named(report_task: Task) -> None:
    dataset = read_dataset_part(report_task)
    part = dataset.recordings[1]
    lost = GarchSummary("g3", 200, 0.05, 0.9, {"converged": 180, "no variance": 14, "outlier-dominated": 6}, None)
    fine = dataclasses.replace(lost, gyro="g1", statuses={"converged": 150, "boundary: α = 0": 50})
    array = dataclasses.replace(part.arrays[0], volatility={"level": VolatilityPart(garch=(lost, fine))})
    changed = dataclasses.replace(part, arrays=(array,))
    texts = [one.text for one in limits(dataclasses.replace(dataset, recordings=(changed,)))]
    (found,) = [text for text in texts if "usable GARCH" in text]
    assert "g3 10\u2009% of the windows, mostly no variance (definition level)" in found
    assert "g1" not in found
