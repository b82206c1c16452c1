"""A lab of its own for every test module: a copy of the project in an empty folder, with a small simulated data set.

`make test` sends whole files to its workers (`--dist loadfile`), so that each of these pipelines runs once. The small
data set's whole pipeline runs once for all workers; modules that start from its results copy them.
"""

import fcntl
import hashlib
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))
COPIED = ("Snakefile", "workflow", "profiles", "config", "vgyro")


@dataclass(frozen=True)
class Lab:
    """A folder in which `snakemake` can run as a user would run it."""

    folder: Path

    def run(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run `snakemake`; stdout and stderr together, as on a terminal."""
        return self._command(["snakemake", *arguments])

    def vgyro(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run `vgyro`."""
        return self._command(["vgyro", *arguments])

    def _command(self, command: list[str]) -> subprocess.CompletedProcess[str]:
        programs = str(Path(sys.executable).parent)
        environment = {
            **os.environ,
            "PATH": programs + os.pathsep + os.environ["PATH"],
            "PYTHONPATH": str(self.folder),
            "XDG_CACHE_HOME": str(self.folder / ".cache"),
            # Else every job compiles the whole package.
            "PYTHONDONTWRITEBYTECODE": "",
        }
        return subprocess.run(
            command, cwd=self.folder, env=environment, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False,
        )  # fmt: skip

    def products(self) -> dict[str, str]:
        """SHA-256 of every artefact and page, by path; logs and benchmark times are not products."""
        files = [path for top in ("results", "reports") for path in (self.folder / top).rglob("*") if path.is_file()]
        kept = [path for path in files if not {"logs", "benchmarks"} & set(path.relative_to(self.folder).parts)]
        return {str(path.relative_to(self.folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in kept}


def make_lab(folder: Path, root: Path, twin: str = "tiny") -> Lab:
    """Copy the project and simulate a data set."""
    folder.mkdir(exist_ok=True)
    for name in COPIED:
        source = root / name
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, folder / name)
    shutil.copy(HERE / "tiny.yaml", folder / "config" / "twins" / "tiny.yaml")
    lab = Lab(folder)
    made = lab.vgyro("simulate", twin, "--out", f"raw/{twin}")
    assert made.returncode == 0, made.stdout
    return lab


@pytest.fixture(scope="session")
def finished(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a lab in which the small data set went through the pipeline on two cores; only to be copied."""
    top = tmp_path_factory.getbasetemp()
    top = top.parent if "PYTEST_XDIST_WORKER" in os.environ else top
    folder, done = top / "finished", top / "finished.done"
    with open(top / "finished.lock", "w", encoding="utf-8") as lock:
        # Another worker waits here until the first one's run has ended.
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not done.exists():
            shutil.rmtree(folder, ignore_errors=True)
            ran = make_lab(folder, root).run("--cores", "2")
            assert ran.returncode == 0, ran.stdout
            done.touch()
    return folder


@pytest.fixture(scope="module")
def finished_lab(finished: Path, tmp_path_factory: pytest.TempPathFactory) -> Lab:
    """A lab with the small data set in raw/tiny, and all that the pipeline makes of it."""
    folder = tmp_path_factory.mktemp("finished") / "lab"
    shutil.copytree(finished, folder)
    return Lab(folder)


@pytest.fixture(scope="module")
def lab(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Lab:
    """A lab with the small data set in raw/tiny."""
    return make_lab(tmp_path_factory.mktemp("lab"), root)


@pytest.fixture(scope="module")
def demo_lab(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Lab:
    """A lab with the demo board in raw/demo."""
    return make_lab(tmp_path_factory.mktemp("demo"), root, "demo")
