"""task_chain.py and fuse_bench.py, beside this file, are no package."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="module")
def analysed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A static recording with everything that the volatility tasks write."""
    from fuse_bench import run_volatility, write_inputs

    folder = tmp_path_factory.mktemp("analysed")
    write_inputs(folder)
    run_volatility(folder)
    return folder
