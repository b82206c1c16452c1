# vgyro: from the dumps in raw/ to the pages in reports/.   snakemake --cores 2   |   snakemake --cores 2 papers
#
# Each data set is raw/<dataset>/dataset.yaml. The stages, one file each in workflow/rules/:
#   decode → screen → calibrate → convert → noise → series → volatility (in chunks) → fuse → measure
#   → crosscheck → report → verdict;   simulate → papers regenerates the tables of the two papers.

from snakemake.utils import min_version

from vgyro.config import DEFINITIONS

min_version("9.0")


# The base that the environment of `make` is built on; it is only used when Snakemake is told to run containers.
container: "docker://python:3.11-bookworm"


include: "workflow/rules/common.smk"
include: "workflow/rules/targets.smk"


wildcard_constraints:
    dataset="|".join(DATASETS) or "none",
    recording="[A-Za-z0-9][A-Za-z0-9_-]*",
    axis="[A-Za-z0-9_]+",
    definition="|".join((*DEFINITIONS, "moved")),
    chunk=r"\d+-of-\d+",
    paper="|".join(PAPERS),


localrules:
    all,
    one,
    papers,


rule all:
    input:
        everything,
        "reports/index.html",
        "results/verdict.json",


rule one:
    """Everything of the data set that `--config only=NAME` names; see `vgyro run`."""
    input:
        everything_of_one,


rule papers:
    input:
        everything_of_papers,
        expand("reports/papers/{paper}.html", paper=PAPERS),


include: "workflow/rules/simulate.smk"
include: "workflow/rules/decode.smk"
include: "workflow/rules/calibrate.smk"
include: "workflow/rules/volatility.smk"
include: "workflow/rules/fuse.smk"
include: "workflow/rules/measure.smk"
include: "workflow/rules/more_gyros.smk"
include: "workflow/rules/report.smk"
include: "workflow/rules/papers.smk"


onsuccess:
    for page in pages_made():
        print(f"report: {page.resolve()}")


onerror:
    # One bad data set must not take the overview of the others away.
    shell("{command}", command=index_command())
