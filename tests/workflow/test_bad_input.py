"""One clear message for each bad input, exit code not 0, and every other data set reported all the same."""

import gzip
import shutil
from pathlib import Path

import pytest

pytestmark = [pytest.mark.workflow, pytest.mark.timeout(1200)]

MANIFEST = "board: {board}\nrecordings:\n  - name: static\n    kind: static\n    files: [{file}]\n"


def dataset(lab, name: str, file: str, content: bytes, board: str = "dsp6") -> Path:
    folder = lab.folder / "raw" / name
    folder.mkdir(parents=True)
    (folder / file).write_bytes(content)
    (folder / "dataset.yaml").write_text(MANIFEST.format(board=board, file=file), encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def lab(finished_lab):
    return finished_lab


@pytest.fixture(scope="module")
def output(lab) -> str:
    """What a run says that has the bad data sets, one recording of the good one, and all pages to make."""
    shutil.rmtree(lab.folder / "reports")
    shutil.rmtree(lab.folder / "results/tiny/constant")
    dump = next((lab.folder / "raw/tiny").glob("static*.bin")).read_bytes()
    dataset(lab, "empty", "empty.bin", b"")
    dataset(lab, "other", "other.bin", dump, board="mimu4444")
    dataset(lab, "cut", "cut.bin.gz", gzip.compress(dump)[: len(dump) // 4])
    (lab.folder / "raw/missing").mkdir()
    (lab.folder / "raw/missing/dataset.yaml").write_text(MANIFEST.format(board="dsp6", file="gone.bin"))
    wrong = lab.folder / "raw/wrong"
    wrong.mkdir()
    (wrong / "dataset.yaml").write_text(
        "board: dsp7\ntitel: three mistakes\nrecordings:\n  - name: a\n    kind: statik\n    files: [a.bin]\n"
    )
    done = lab.run("--cores", "2")
    assert done.returncode != 0
    return done.stdout


def test_the_good_data_set_is_reported(lab, output: str) -> None:
    assert (lab.folder / "results/tiny/constant/z/metrics.parquet").is_file(), output
    assert (lab.folder / "reports/tiny.html").is_file(), output
    assert (lab.folder / "reports/index.html").is_file(), output


@pytest.mark.parametrize("name", ["empty", "other", "missing"])
def test_a_refused_recording_still_has_its_page(lab, output: str, name: str) -> None:
    assert (lab.folder / f"reports/{name}.html").is_file(), output


def test_messages_say_what_where_and_what_to_do(output: str) -> None:
    lines = output.splitlines()
    assert any("empty.bin" in line and "empty" in line for line in lines)
    assert any("other.bin" in line and "dsp6" in line for line in lines), "the board that does fit is named"
    assert any("gone.bin" in line for line in lines)
    assert any("cut.bin.gz" in line for line in lines)


def test_a_manifest_with_three_mistakes_names_all_three(output: str) -> None:
    assert "raw/wrong/dataset.yaml:2: titel:" in output
    assert "did you mean 'title'?" in output
    assert "raw/wrong/dataset.yaml:5: recordings.0.kind:" in output
    assert "dsp7" in output


def test_no_traceback_on_the_terminal(output: str) -> None:
    assert "Traceback" not in output


@pytest.mark.usefixtures("output")
def test_a_wrong_config_stops_everything(lab) -> None:
    path = lab.folder / "config/config.yaml"
    kept = path.read_text(encoding="utf-8")
    path.write_text("analysis: {volatility: {widow: 3}}\n", encoding="utf-8")
    done = lab.run("--cores", "2")
    path.write_text(kept, encoding="utf-8")
    assert done.returncode != 0
    assert "config/config.yaml:1: analysis.volatility.widow: unknown key; did you mean 'window'?" in done.stdout
    shutil.rmtree(lab.folder / "raw/wrong")


@pytest.mark.usefixtures("output")
def test_what_is_missing_half_way_to_a_page_is_made_again(lab) -> None:
    # Truth: what a failed job has left is a page, and no file that its figures are from.
    without_bad_data_sets(lab)
    assert lab.run("--cores", "2").returncode == 0
    fused = lab.folder / "results/tiny/static/z/fused.parquet"
    fused.unlink()
    assert lab.run("--cores", "2").returncode == 0
    assert fused.exists()


@pytest.mark.usefixtures("output")
def test_the_run_after_one_that_failed_makes_what_is_missing(lab) -> None:
    # A stage that fails half-way leaves an overview, and no page or that of the run before. Truth: the next run must
    # not take these for its own.
    without_bad_data_sets(lab)
    shutil.rmtree(lab.folder / "reports")
    for fused in (lab.folder / "results/tiny").glob("*/z/fused.parquet"):
        fused.unlink()
    page, overview = lab.folder / "reports/tiny.html", lab.folder / "reports/index.html"
    assert broken_run(lab).returncode != 0
    assert not page.exists()
    assert "tiny: a job failed or did not run, so no page" in overview.read_text(encoding="utf-8")
    again = lab.run("--cores", "2")
    assert again.returncode == 0, again.stdout
    before = page.read_bytes()
    config = lab.folder / "config/config.yaml"
    options = config.read_text(encoding="utf-8")
    config.write_text("analysis: {fusion: {bandwidth_hz: 3.3}}\n", encoding="utf-8")
    assert broken_run(lab).returncode != 0
    assert page.read_bytes() == before
    assert "tiny: a job failed or did not run, so its page is that of an earlier run" in overview.read_text("utf-8")
    again = lab.run("--cores", "2")
    config.write_text(options, encoding="utf-8")
    assert again.returncode == 0, again.stdout
    assert page.read_bytes() != before
    assert "an earlier run" not in overview.read_text(encoding="utf-8")


def without_bad_data_sets(lab) -> None:
    for bad in ("empty", "other", "cut", "missing", "wrong"):
        shutil.rmtree(lab.folder / "raw" / bad, ignore_errors=True)


def broken_run(lab):
    """A run in which the fuse stage fails."""
    stage = lab.folder / "vgyro/tasks/fusion/fuse.py"
    kept = stage.read_text(encoding="utf-8")
    stage.write_text(kept.replace("def main(", "raise SystemExit('no power')\n\n\ndef main("), encoding="utf-8")
    done = lab.run("--cores", "2")
    stage.write_text(kept, encoding="utf-8")
    return done
