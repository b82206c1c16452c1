"""Logs in the workflow: from a CSV to the page in one command, and files that change are seen."""

import json
import os

import numpy as np
import pytest

pytestmark = [pytest.mark.workflow, pytest.mark.timeout(1800)]

RATE_HZ, SECONDS = 50, 120
QUICK = """\
analysis:
  volatility: {definitions: [level], modes: [causal], models: [dcc], window: 60, rate_hz: 1}
  fusion: {methods: [average, inverse_variance_arw, recommended]}
  metrics: {bootstrap: 50, injected_rate: null}
  crosscheck: {windows: 1}
"""


def text_of(seconds: float, first: float = 0.0, seed: int = 1) -> str:
    """A simulated log of three gyros in deg/s, seconds with decimals."""
    rng = np.random.default_rng(seed)
    count = round(seconds * RATE_HZ)
    rates = rng.normal((0.1, -0.2, 0.3), 0.05, (count, 3))
    rows = [f"{first + k / RATE_HZ:.3f},{a:.4f},{b:.4f},{c:.4f}" for k, (a, b, c) in enumerate(rates)]
    return "".join(f"{row}\n" for row in ("t (s),g1 (deg/s),g2 (deg/s),g3 (deg/s)", *rows))


@pytest.fixture(scope="module")
def page(lab):
    """What `vgyro run` prints for a CSV of two minutes."""
    (lab.folder / "config/config.yaml").write_text(QUICK, encoding="utf-8")
    (lab.folder / "imu.csv").write_text(text_of(SECONDS), encoding="utf-8")
    done = lab.vgyro("run", "imu.csv", "--name", "stranger")
    assert done.returncode == 0, done.stdout
    return done.stdout


def test_one_command_goes_from_a_csv_to_the_page(lab, page):
    made = lab.folder / "reports/stranger.html"
    assert page.rstrip().endswith(f"the report: {made}")
    text = made.read_text(encoding="utf-8")
    assert "Rates as logged for every gyro" in text
    record = json.loads((lab.folder / "results/stranger/imu/integrity.json").read_text())
    assert (record["status"], record["rate_hz"]) == ("good", pytest.approx(RATE_HZ, rel=2e-4))
    # Another data set in raw/ is not touched by the command.
    assert not (lab.folder / "reports/tiny.html").exists()


def test_snakemake_names_the_pages_that_it_made(lab, page):
    assert f"report: {lab.folder / 'reports/stranger.html'}" in page


@pytest.mark.usefixtures("page")
def test_again_there_is_nothing_to_do(lab):
    again = lab.vgyro("run", "--name", "stranger")
    assert again.returncode == 0, again.stdout
    assert "Nothing to be done" in again.stdout
    assert again.stdout.rstrip().endswith(f"the report: {lab.folder / 'reports/stranger.html'}")


def test_a_file_rewritten_in_a_folder_or_added_to_it_is_seen(lab):
    folder = lab.folder / "archive" / "day=1"
    folder.mkdir(parents=True)
    (folder / "1.csv").write_text(text_of(20), encoding="utf-8")
    done = lab.vgyro("new-dataset", "archive", "--name", "night")
    assert done.returncode == 0, done.stdout
    target = "results/night/archive/integrity.json"

    def samples() -> int:
        ran = lab.run("--cores", "1", "--", target)
        assert ran.returncode == 0, ran.stdout
        return json.loads((lab.folder / target).read_text())["frames"]["good"]

    assert samples() == 20 * RATE_HZ
    assert "Nothing to be done" in lab.run("--cores", "1", "--", target).stdout
    seen = folder.stat()
    (folder / "1.csv").write_text(text_of(30, seed=2), encoding="utf-8")
    # The folder itself looks as it did.
    os.utime(folder, ns=(seen.st_atime_ns, seen.st_mtime_ns))
    assert samples() == 30 * RATE_HZ
    (folder / "2.csv").write_text(text_of(10, first=30.0), encoding="utf-8")
    assert samples() == 40 * RATE_HZ


def test_one_damaged_file_of_three_is_named_on_the_terminal(lab):
    folder = lab.folder / "three"
    folder.mkdir()
    for index in range(3):
        (folder / f"{index}.csv").write_text(text_of(10, first=10.0 * index), encoding="utf-8")
    done = lab.vgyro("new-dataset", "three", "--name", "three")
    assert done.returncode == 0, done.stdout
    (folder / "1.csv").write_bytes(b"")
    ran = lab.run("--cores", "1", "--", "results/three/three/integrity.json")
    assert ran.returncode == 0, ran.stdout
    assert "three: suspect: left out: " in ran.stdout
    assert "1.csv: is empty: 0 bytes" in ran.stdout
    record = json.loads((lab.folder / "results/three/three/integrity.json").read_text())
    assert record["frames"]["good"] == 20 * RATE_HZ
    # The stamps tell how long the part that is missing was.
    assert record["frames"]["lost"] == 10 * RATE_HZ
