"""What is asked for: every artefact and page of a data set, and the overview of a run that failed."""

import shlex
import time
from types import SimpleNamespace

STARTED = time.time()


def artefacts_of(wildcards):
    """Every artefact that the page of a data set shows."""
    dataset = wildcards.dataset
    paths = []
    for recording in usable(dataset):
        paths.append(f"results/{dataset}/{recording}/rates.parquet")
        for axis in DATASETS[dataset].board.axes:
            folder = f"results/{dataset}/{recording}/{axis}"
            tables = (
                "allan",
                "spectrum",
                "metrics",
                "correlation",
                "cross_allan",
                "tones",
                "faults",
                "fused",
                "methods",
                "crosscheck",
            )
            paths += [f"{folder}/{table}.parquet" for table in tables]
            if has_volatility(dataset, recording):
                paths.append(f"{folder}/effects.parquet")
                if analysis_of(dataset).bekk:
                    paths.append(f"{folder}/bekk.parquet")
                parts = ("arch_lm", "garch", "dcc", "weights", "fits")
                paths += [
                    f"{folder}/{name}/{part}.parquet"
                    for name in definitions(dataset)
                    for part in parts
                ]
    for source in noise_source(wildcards):
        folder = source.rsplit("/", 1)[0]
        paths += [
            f"{folder}/{axis}/more_gyros.parquet"
            for axis in DATASETS[dataset].board.axes
        ]
    return paths


def artefacts_before(dataset):
    """Every artefact of a data set that others are made from, and that no page shows."""
    paths = [f"results/{dataset}/{name}.json" for name in ("calibration", "screen")]
    paths += all_integrity(SimpleNamespace(dataset=dataset))
    paths += all_noise(SimpleNamespace(dataset=dataset))
    for recording in usable(dataset):
        for axis in DATASETS[dataset].board.axes:
            job = SimpleNamespace(dataset=dataset, recording=recording, axis=axis)
            paths += series_of(job) + moved_weights_of(job)
    return paths


def everything_of(datasets):
    """Every artefact of some data sets, so that each is asked for by itself.

    What is missing half-way to a page that exists is not made again by Snakemake: the page of yesterday would hide the
    job that failed today.
    """
    found = []
    for name in datasets:
        found += artefacts_before(name)
        found += artefacts_of(SimpleNamespace(dataset=name))
    return found


def everything(wildcards):
    """Every artefact and page of all data sets in raw/."""
    made = [f"reports/{name}.html" for name in LOADED.datasets]
    made += [f"results/{name}/headline.json" for name in LOADED.datasets]
    return made + everything_of(LOADED.datasets)


def everything_of_one(wildcards):
    """Every artefact and page of the data set that the command line names."""
    name = config["only"]
    return [
        f"reports/{name}.html",
        f"results/{name}/headline.json",
        *everything_of([name]),
    ]


def pages_made():
    """The pages that this run wrote."""
    pages = sorted(Path("reports").rglob("*.html"))
    return [page for page in pages if page.stat().st_mtime > STARTED]


def everything_of_papers(wildcards):
    """Every artefact of the papers' twins."""
    return everything_of(PAPERS)


def unfinished():
    """What the overview says of data sets whose page was not made in a run that failed."""
    texts = []
    for name in LOADED.datasets:
        page = Path(f"reports/{name}.html")
        logs = Path("results/logs", name).rglob("*.log")
        worked_on = any(log.stat().st_mtime > STARTED for log in logs)
        if page.exists() and (page.stat().st_mtime > STARTED or not worked_on):
            continue
        state = "its page is that of an earlier run" if page.exists() else "no page"
        remedy = f"read results/logs/{name}/, then run snakemake again"
        texts.append(f"{name}: a job failed or did not run, so {state}; {remedy}")
    return texts


def index_command():
    """Command that writes the overview of a run that failed, from the headlines that exist."""
    headlines = [f"results/{name}/headline.json" for name in LOADED.datasets]
    there = [path for path in headlines if Path(path).exists()]
    return " ".join(
        [
            "python -m vgyro.tasks.pages.index --input headlines",
            *map(shlex.quote, there),
            "--output page reports/index.html",
        ]
        + [
            "--options",
            shlex.quote(json.dumps({"problems": PROBLEMS + unfinished()})),
            "--log results/logs/index.log",
        ]
    )
