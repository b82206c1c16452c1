"""Fixtures for every test."""

import os
from pathlib import Path

import pytest

# As the workflow's jobs have it. A library's threads wait by running, and every worker would have as many as cores.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

ROOT = Path(__file__).resolve().parents[1]


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Several workers: whole pipelines first, so that no worker is left with one at the end."""
    if hasattr(config, "workerinput"):
        items.sort(key=lambda item: "workflow" not in item.keywords)


@pytest.fixture(scope="session")
def root() -> Path:
    """The top of the repository."""
    return ROOT


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Real recordings, which the repository may not contain; the test skips where they are absent."""
    folder = Path(os.environ.get("VGYRO_SHARED_DATA", "../shared/data"))
    folder = folder if folder.is_absolute() else (ROOT / folder).resolve()
    if not folder.is_dir():
        pytest.skip(f"no real recordings at {folder}; set VGYRO_SHARED_DATA")
    return folder
