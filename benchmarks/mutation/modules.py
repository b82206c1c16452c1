"""The modules that decide something, and a copy of the repository in which they may be changed."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

DECIDING = (
    "vgyro/fusion/**/*.py",
    "vgyro/metrics/improvement.py",
    "vgyro/metrics/intervals/*.py",
    "vgyro/metrics/static/figures.py",
    "vgyro/metrics/dynamic/figures.py",
    "vgyro/metrics/allan/coefficient*.py",
    "vgyro/volatility/dcc.py",
    "vgyro/volatility/effects/*.py",
    "vgyro/storage/verdict.py",
    "vgyro/calibration/suspicions.py",
    "vgyro/report/conclusions/*.py",
)
"""Priors, prices, choices, faults, intervals, verdicts."""


def deciding(root: Path) -> list[str]:
    """Their paths from the root, in order."""
    return sorted({path.relative_to(root).as_posix() for one in DECIDING for path in root.glob(one)})


def copy_tree(root: Path, folder: Path) -> None:
    """What git knows of, as it stands in the work tree, and the compiled kernels."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=root,
        capture_output=True,
        text=True,
        check=True,
    )
    kernels = [path.relative_to(root).as_posix() for path in (root / "vgyro").rglob("*.so")]
    for name in [*listed.stdout.split("\0"), *kernels]:
        source, target = root / name, folder / name
        if name and source.is_file():
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(source, target)
