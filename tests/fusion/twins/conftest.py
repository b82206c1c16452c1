"""Evidence on twins: harness.py and yardsticks.py, beside this file, are no package."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
