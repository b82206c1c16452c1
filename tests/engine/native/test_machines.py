"""The kernels give the same bits on every machine and for any number of threads, and run clean under sanitizers."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

EXERCISE = Path(__file__).parent / "exercise.py"


def exercise(**environment: str) -> dict[str, str]:
    """Kernel → hash of its results, in a process of its own."""
    done = subprocess.run(
        [sys.executable, str(EXERCISE)], env={**os.environ, **environment}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return dict(line.rsplit(" ", 1) for line in done.stdout.splitlines())


@pytest.fixture(scope="module")
def usual() -> dict[str, str]:
    return exercise(VGYRO_THREADS="1")


def test_without_avx2_the_bits_are_the_same(usual):
    assert exercise(VGYRO_THREADS="1", VGYRO_ISA="baseline") == usual


@pytest.mark.parametrize("threads", ["2", "5"])
def test_with_more_threads_the_bits_are_the_same(usual, threads):
    assert exercise(VGYRO_THREADS=threads) == usual


def test_the_plain_variant_is_really_used():
    code = "from vgyro.engine.native import _cpu; print(_cpu.instruction_set())"
    done = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, "VGYRO_ISA": "baseline"}, capture_output=True, text=True,
        check=True,
    )  # fmt: skip
    assert done.stdout.strip() in {"x86-64", "portable"}


@pytest.mark.parametrize("isa", ["baseline", ""])
def test_clean_under_address_and_undefined_behaviour_sanitizers(instrumented, isa):
    """Any finding ends the process with an error; the results are compared as well: -O0 must not change a bit."""
    folder, preload = instrumented
    found = exercise(
        PYTHONPATH=str(folder), LD_PRELOAD=preload, ASAN_OPTIONS="detect_leaks=0", VGYRO_ISA=isa, VGYRO_THREADS="2",
        PYTHONMALLOC="malloc",
    )  # fmt: skip
    assert found == exercise(VGYRO_THREADS="1")


@pytest.fixture(scope="module")
def instrumented(root: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The package with kernels built for AddressSanitizer and UBSan, and the library to load first."""
    folder = tmp_path_factory.mktemp("sanitized")
    skip = shutil.ignore_patterns("__pycache__", "*.so")
    shutil.copytree(root / "vgyro", folder / "vgyro", ignore=skip)
    if (root / "build" / "vgyro").is_dir():
        # The binding's C, as `make env` made it: what is not older than its source is not made again.
        shutil.copytree(root / "build" / "vgyro", folder / "build" / "vgyro")
    for name in ("setup.py", "pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(root / name, folder)
    built = subprocess.run(
        [sys.executable, "setup.py", "-q", "build_ext", "--inplace", "--parallel", "2"],
        cwd=folder, env={**os.environ, "VGYRO_SANITIZE": "1"}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert built.returncode == 0, built.stderr
    library = subprocess.run(["gcc", "-print-file-name=libasan.so"], capture_output=True, text=True, check=True)
    return folder, library.stdout.strip()
