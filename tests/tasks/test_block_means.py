"""Columns of frames in pieces: the same means whatever the pieces, gaps and clipped samples respected."""

from pathlib import Path

import numpy as np
import pytest

from vgyro.board import Board, Temperature, parse_board
from vgyro.storage.tables import Provenance, TableWriter, read_column, write_table
from vgyro.tasks.rates.block_means import block_means, thermometer_of

NOWHERE = Provenance({}, "", "")


@pytest.fixture
def board(root: Path) -> Board:
    return parse_board((root / "config/boards/dsp6.yaml").read_text(encoding="utf-8"), "dsp6")


def columns(samples: int = 1050) -> dict[str, np.ndarray]:
    """100 Hz, with a gap of 0.4 s after sample 530; g1 counts its samples."""
    slot = np.arange(samples) + np.where(np.arange(samples) > 530, 40, 0)
    return {
        "time": slot / 100,
        "segment": (np.arange(samples) > 530).astype(np.int32),
        "g1": np.arange(samples, dtype=np.int16),
    }


def expected(table: dict[str, np.ndarray]) -> dict[int, float]:
    """Second → mean of its longest segment, by hand; seconds with fewer than 50 samples left out."""
    found = {}
    for second in range(11):
        for segment in (0, 1):
            inside = (np.floor(table["time"]) == second) & (table["segment"] == segment)
            if inside.sum() >= 50:
                found[second] = float(table["g1"][inside].mean())
    return found


@pytest.mark.parametrize("piece", [1, 7, 100, 333, 5000])
def test_means_do_not_depend_on_the_pieces(tmp_path: Path, piece: int) -> None:
    table = columns()
    with TableWriter(tmp_path / "f.parquet", "frames", NOWHERE, row_group=piece) as writer:
        writer.append(table)
    means = block_means(tmp_path / "f.parquet", ["g1", "g1"])
    by_hand = expected(table)
    assert np.floor(means.time).astype(int).tolist() == list(by_hand)
    assert means.values["g1"] == pytest.approx(list(by_hand.values()))
    assert means.segment.tolist() == [0] * 5 + [1] * (len(by_hand) - 5)
    np.testing.assert_array_equal(read_column(tmp_path / "f.parquet", "g1"), table["g1"])


def test_a_clipped_sample_hides_its_block(tmp_path: Path) -> None:
    table = columns()
    table["g1"][250] = 32767
    write_table(tmp_path / "f.parquet", table, "frames", NOWHERE)
    means = block_means(tmp_path / "f.parquet", ["g1"], rails={"g1": (-32768, 32767)})
    assert np.flatnonzero(np.isnan(means.values["g1"])).tolist() == [2]


def test_no_frames_give_no_means(tmp_path: Path) -> None:
    write_table(tmp_path / "f.parquet", columns(0), "frames", NOWHERE)
    means = block_means(tmp_path / "f.parquet", ["g1"])
    assert means.time.size == means.segment.size == means.values["g1"].size == 0


def test_whose_thermometer(board: Board) -> None:
    def with_thermometers(*owners: str | None) -> Board:
        made = tuple(
            Temperature(name=f"x{i}", field=f"t{i + 1}", gyro=owner, scale=1, offset=0)
            for i, owner in enumerate(owners)
        )
        return board.model_copy(update={"temperatures": made})

    def name(made: Board, gyro: str) -> str | None:
        found = thermometer_of(made, gyro)
        return found.name if found else None

    assert [name(with_thermometers("g2", None), gyro) for gyro in ("g1", "g2")] == ["x1", "x0"]
    assert name(with_thermometers(None, None), "g1") is None  # which of the two?
    assert name(with_thermometers("g2"), "g1") is None
    assert name(with_thermometers(), "g1") is None
