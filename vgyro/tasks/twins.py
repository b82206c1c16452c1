"""The twins of the papers as data sets: known before they are simulated, because the workflow plans with them."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from vgyro.dataset import used_board
from vgyro.simulate import manifest_of, parse_twin
from vgyro.storage.inputs import read_board
from vgyro.tasks.inputs_check import Dataset


def load_twins(names: Iterable[str], twins: str | Path, folder: str | Path, boards: str | Path) -> dict[str, Dataset]:
    """Manifest, board and (future) folder of each twin.  raises : ConfigError for a wrong twin file"""
    datasets = {}
    for name in names:
        path = Path(twins) / f"{name}.yaml"
        manifest = manifest_of(parse_twin(path.read_text(encoding="utf-8"), str(path)))
        board = read_board(str(manifest.board), boards=Path(boards))
        datasets[name] = Dataset(manifest, used_board(manifest, board), Path(folder) / name)
    return datasets
