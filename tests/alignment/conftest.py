"""Tests of alignment; moving_arrays.py, beside this file, is no package."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
