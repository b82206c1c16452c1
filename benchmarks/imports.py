"""Import of the native engine beside `import numpy`, each in a fresh interpreter."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable

from benchmarks.contest import Accuracy, Contest, Rival, Side
from vgyro.engine import native

MOST_SECONDS = 0.1
ENGINE = "import vgyro.engine; native = vgyro.engine.get('native'); [getattr(native, name) for name in native.MODULES]"


def contests(quick: bool) -> list[Contest]:
    """Seconds of a whole interpreter; the figure is the difference, not the ratio."""
    count = 1 if quick else 3
    numpy = Side("import numpy", _interpreter("import numpy", count), count)
    ours = Side("vgyro", _interpreter(ENGINE, count), count)
    return [
        Contest(
            "import", f"Import of the engine, {len(native.MODULES)} modules", "interpreter", ours,
            (Rival(numpy, MOST_SECONDS),), 0.0, _nothing_heavy, difference=True,
        )
    ]  # fmt: skip


def _interpreter(code: str, count: int) -> Callable[[], object]:
    def run() -> None:
        for _ in range(count):
            subprocess.run([sys.executable, "-c", code], check=True)

    return run


def _nothing_heavy() -> list[Accuracy]:
    """Packages that the engine must not load by itself."""
    code = f"{ENGINE}; import sys; print(sum(name in sys.modules for name in ('scipy', 'pandas', 'arch', 'pyarrow')))"
    loaded = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout
    return [Accuracy("of SciPy, pandas, arch, pyarrow are loaded with it", float(loaded), 0.0)]
