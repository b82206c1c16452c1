"""The native engine: one extension a domain, from vgyro/engine/native/_<domain>.pyx and c/<domain>.c.

All else about the package is in pyproject.toml. VGYRO_SANITIZE=1 builds the kernels with AddressSanitizer and UBSan.
"""

import os
from pathlib import Path

import numpy as np
from Cython.Build import cythonize
from setuptools import Extension, setup

NATIVE = Path("vgyro/engine/native")
# The same bits on every instruction set: no fused multiply-add, no reordering.
FLAGS = ["-O3", "-std=gnu11", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math", "-Wno-psabi"]
# As written: the compiler can take nothing away before it is checked, and is done in a third of the time.
SANITIZE = ["-O0", "-g1", "-fno-omit-frame-pointer", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]


def extensions() -> list[Extension]:
    sanitize = os.environ.get("VGYRO_SANITIZE") == "1"
    shared = sorted(str(path) for path in (NATIVE / "c").glob("*.h"))
    return [
        Extension(
            f"vgyro.engine.native.{path.stem}",
            [str(path), str(NATIVE / "c" / f"{path.stem[1:]}.c")],
            depends=shared,
            include_dirs=[np.get_include(), str(NATIVE / "c")],
            define_macros=[("NPY_NO_DEPRECATED_API", "NPY_2_0_API_VERSION")],
            extra_compile_args=FLAGS + (SANITIZE if sanitize else []),
            extra_link_args=SANITIZE[3:] if sanitize else [],
        )
        for path in sorted(NATIVE.glob("_*.pyx"))
    ]


setup(ext_modules=cythonize(extensions(), build_dir="build", language_level=3))
