"""Same inputs, same bytes; nothing to do the second time; an edit re-runs what it must, and no more."""

import re
import shutil
from pathlib import Path

import pytest

pytestmark = [pytest.mark.workflow, pytest.mark.timeout(1200)]


def jobs_planned(output: str) -> set[str]:
    """Rules in the job table of a dry run."""
    table = output[output.index("Job stats:") :]
    return {match.group(1) for match in re.finditer(r"^(\w+) +\d+$", table, flags=re.MULTILINE)} - {"total", "all"}


@pytest.fixture(scope="module")
def lab(finished_lab):
    return finished_lab


def test_second_run_one_core_and_edits(lab) -> None:
    assert (lab.folder / "reports/tiny.html").is_file()
    assert (lab.folder / "reports/index.html").is_file()
    products = lab.products()
    assert any(name.endswith("fused.parquet") for name in products)

    assert not any("bekk" in name for name in products)
    assert "BEKK" not in (lab.folder / "reports/tiny.html").read_text(encoding="utf-8")

    second = lab.run("--cores", "2")
    assert second.returncode == 0, second.stdout
    assert "Nothing to be done" in second.stdout

    config = lab.folder / "config/config.yaml"
    config.write_text("# a remark\n" + config.read_text(encoding="utf-8"), encoding="utf-8")
    assert "Nothing to be done" in lab.run("--cores", "2", "--dry-run").stdout

    source = lab.folder / "vgyro/metrics/allan/deviation.py"
    source.write_text(source.read_text(encoding="utf-8") + "\n# edited\n", encoding="utf-8")
    planned = jobs_planned(lab.run("--cores", "2", "--dry-run").stdout)
    assert {"measure", "report"} <= planned
    assert not planned & {"decode", "calibrate", "convert", "volatility"}
    source.write_text(source.read_text(encoding="utf-8").removesuffix("\n# edited\n"), encoding="utf-8")

    # From nothing, on one core, and with a job for every rolling window: the same bytes, and no parts left behind.
    for folder in ("results", "reports", ".snakemake"):
        shutil.rmtree(lab.folder / folder)
    text = config.read_text(encoding="utf-8")
    config.write_text(text.replace("chunk_windows: 20000", "chunk_windows: 1"), encoding="utf-8")
    again = lab.run("--cores", "1")
    assert again.returncode == 0, again.stdout
    assert "volatility_chunk" in again.stdout
    assert lab.products() == products
    assert "Nothing to be done" in lab.run("--cores", "2").stdout


def test_bekk_runs_where_it_is_asked_for(lab) -> None:
    config = lab.folder / "config/config.yaml"
    without, text = lab.products(), config.read_text(encoding="utf-8")
    config.write_text(text.replace("bekk: false", "bekk: true"), encoding="utf-8")
    done = lab.run("--cores", "2")
    assert done.returncode == 0, done.stdout
    assert jobs_planned(done.stdout) == {"bekk", "report", "index", "verdict"}
    found = lab.products()
    assert set(found) - set(without) == {"results/tiny/static/z/bekk.parquet"}
    changed = {name for name in without if found[name] != without[name]}
    assert changed == {"reports/tiny.html"}
    assert "BEKK, diagonal" in (lab.folder / "reports/tiny.html").read_text(encoding="utf-8")

    config.write_text(text, encoding="utf-8")
    done = lab.run("--cores", "2")
    assert jobs_planned(done.stdout) == {"report", "index", "verdict"}
    assert {name: digest for name, digest in lab.products().items() if "bekk" not in name} == without


def test_progress_is_shown_and_units_are_inside(lab) -> None:
    import json

    import pyarrow.parquet as pq

    rates: list[Path] = sorted((lab.folder / "results/tiny").rglob("rates.parquet"))
    assert rates
    for path in rates:
        record = json.loads(pq.read_schema(path).metadata[b"vgyro"])
        assert record["units"]["g1"] == "deg/s"
        assert set(record["provenance"]) == {"inputs", "options", "code"}
        assert re.fullmatch(r"[0-9a-f]{64}", record["provenance"]["code"])
