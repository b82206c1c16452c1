"""Logs with known truth."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from stamps import LOGS


@pytest.fixture
def rng():
    return np.random.default_rng(7)


@pytest.fixture
def column():
    """The first column of one of the logs of tests/cases."""

    def load(name, separator=","):
        values = []
        for line in (LOGS / name).read_text().splitlines():
            cell = line.split(separator)[0].strip()
            if cell and cell.replace(".", "", 1).replace("-", "", 1).isdigit():
                values.append(float(cell))
        return np.array(values)

    return load
