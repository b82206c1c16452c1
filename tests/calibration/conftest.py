"""Tests of calibration: rate_table.py, beside this file, is not a package."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
