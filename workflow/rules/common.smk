"""What the rules share: the data sets, the options each stage uses, and where files are."""

import json
import math
import sys
from functools import cache
from pathlib import Path

from vgyro.config import override_analysis
from vgyro.dataset import AT_REST
from vgyro.storage.inputs import data_files
from vgyro.tasks.closure import code_hash, sections_of
from vgyro.tasks.inputs_check import load_datasets
from vgyro.tasks.inputs_check import reference_file as logged_reference
from vgyro.tasks.twins import load_twins

PAPERS = ("jiang2012", "liu2015")

# One thread a job: Snakemake places the jobs on the cores, and one thread gives the same bytes everywhere.
shell.prefix(
    "export VGYRO_THREADS=1 OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MKL_NUM_THREADS=1; "
)

LOADED = load_datasets("config/config.yaml", "raw", "config/boards")
TWINS = load_twins(PAPERS, "config/twins", "results/twins", "config/boards")
DATASETS = {**LOADED.datasets, **TWINS}
PROBLEMS = [str(problem) for problem in LOADED.problems]
if not LOADED.config_ok:
    sys.exit("\n".join(f"vgyro: {problem}" for problem in PROBLEMS))
for _problem in PROBLEMS:
    print(f"vgyro: {_problem}", file=sys.stderr)


def code(task):
    """Hash of all code that a task can reach: a change there re-runs its jobs, and no others."""
    return code_hash(f"vgyro.tasks.{task}")


@cache
def analysis_of(dataset):
    """The analysis options of a data set: config.yaml with the manifest's overrides."""
    return override_analysis(
        LOADED.config.analysis, DATASETS[dataset].manifest.analysis
    )


def stage(task, **values):
    """Options of a task's jobs, as JSON: the SECTIONS that its module names, the wildcards, and what else is given.

    A function among what else is given is called with the wildcards.
    """

    def options(wildcards):
        known = DATASETS[wildcards.dataset]
        given = {
            name: value(wildcards) if callable(value) else value
            for name, value in values.items()
        }
        record = {**given, **dict(wildcards.items()), "analysis": {}}
        if "recording" in record:
            record["kind"] = kind_of(wildcards.dataset, wildcards.recording)
        for section in sections_of(f"vgyro.tasks.{task}"):
            if section in ("manifest", "board"):
                record[section] = getattr(known, section).model_dump(mode="json")
            else:
                record["analysis"][section] = analysis_of(wildcards.dataset).model_dump(
                    mode="json"
                )[section]
        return json.dumps(record, sort_keys=True)

    return options


def files_of(dataset, recording):
    """All files that the manifest names for a recording, there or not."""
    return [
        str(path)
        for path in data_files(
            DATASETS[dataset].manifest, recording, DATASETS[dataset].folder
        )
    ]


def made_here(dataset, path):
    """True for a file that the rule `simulate` makes."""
    return dataset in TWINS and path.startswith("results/twins/")


def named_files(wildcards):
    """All files of a recording, for the command line of decode."""
    return files_of(wildcards.dataset, wildcards.recording)


def existing_files(wildcards):
    """The files of a recording that can be an input; decode refuses a recording whose files are missing."""
    paths = files_of(wildcards.dataset, wildcards.recording)
    return [
        path
        for path in paths
        if made_here(wildcards.dataset, path) or Path(path).exists()
    ]


def recordings(dataset, *kinds):
    """Names of the recordings of some kinds; of all kinds if none is given."""
    found = DATASETS[dataset].manifest.recordings
    return [
        recording.name for recording in found if not kinds or recording.kind in kinds
    ]


def kind_of(dataset, recording):
    """Kind of a recording."""
    return DATASETS[dataset].manifest.recording(recording).kind


def screened(dataset):
    """What `screen` wrote of a data set: which recordings can be used, and how long they are."""
    return json.loads(
        Path(checkpoints.screen.get(dataset=dataset).output.screen).read_text(
            encoding="utf-8"
        )
    )


def usable(dataset):
    """Recordings, calibration runs left out, that decode did not refuse."""
    known = screened(dataset)["recordings"]
    return [
        name
        for name in known
        if known[name]["usable"] and kind_of(dataset, name) != "calibration"
    ]


def has_volatility(dataset, recording):
    """True if the recording can hold a rolling window; a free one may, and finds out."""
    if kind_of(dataset, recording) in (*AT_REST, "free"):
        return True
    return series_length(dataset, recording) >= analysis_of(dataset).volatility.window


def series_length(dataset, recording):
    """Samples that the volatility series of a recording has, if nothing is lost and all of it is used."""
    chosen = analysis_of(dataset).volatility
    about = screened(dataset)["recordings"][recording]
    rate = about["rate_hz"] if chosen.rate_hz == "full" else chosen.rate_hz
    return about["duration_s"] * rate


def volatility_parts(table):
    """Parts of a volatility table; none for a recording whose windows are few enough for one job."""

    def parts(wildcards):
        samples = series_length(wildcards.dataset, wildcards.recording)
        windows = samples / analysis_of(wildcards.dataset).volatility.step
        chunks = math.ceil(windows / LOADED.config.workflow.chunk_windows)
        folder = "results/{dataset}/{recording}/{axis}/{definition}"
        return [
            f"{folder}/{table}.{chunk}-of-{chunks}.parquet"
            for chunk in range(1, chunks + 1)
            if chunks > 1
        ]

    return parts


garch_parts = volatility_parts("garch")
dcc_parts = volatility_parts("dcc")
weights_parts = volatility_parts("weights")


def series_of(wildcards):
    """Volatility series, for a recording that can hold a window."""
    path = f"results/{wildcards.dataset}/{wildcards.recording}/{wildcards.axis}/series.parquet"
    return [path] if has_volatility(wildcards.dataset, wildcards.recording) else []


def definitions(dataset):
    """Definitions of r_t that the analysis uses."""
    return analysis_of(dataset).volatility.definitions


def weights_of(wildcards):
    """Weights of every definition, for a recording that can hold a window."""
    if not has_volatility(wildcards.dataset, wildcards.recording):
        return []
    folder = f"results/{wildcards.dataset}/{wildcards.recording}/{wildcards.axis}"
    return [
        f"{folder}/{definition}/weights.parquet"
        for definition in definitions(wildcards.dataset)
    ]


def injected_rate(wildcards):
    """Constant rate that the job adds to every gyro, deg/s; None: none is added."""
    added = analysis_of(wildcards.dataset).metrics.injected_rate
    moved = getattr(wildcards, "definition", "moved") == "moved"
    at_rest = kind_of(wildcards.dataset, wildcards.recording) in AT_REST
    return added if moved and at_rest else None


def moved_weights_of(wildcards):
    """Weights of the level with a constant rate added, for a recording at rest: those of `level` shrink toward zero.

    Not at the full rate, where every window fitted again would be most of the work.
    """
    wanted = (
        injected_rate(wildcards) is not None
        and "level" in definitions(wildcards.dataset)
        and analysis_of(wildcards.dataset).volatility.rate_hz != "full"
        and has_volatility(wildcards.dataset, wildcards.recording)
    )
    folder = f"results/{wildcards.dataset}/{wildcards.recording}/{wildcards.axis}"
    return [f"{folder}/moved/weights.parquet"] if wanted else []


def tables_of(wildcards, table):
    """One table of the volatility stage for every definition."""
    return [
        path.replace("weights.parquet", f"{table}.parquet")
        for path in weights_of(wildcards)
    ]


def garch_of(wildcards):
    """GARCH fits of every definition."""
    return tables_of(wildcards, "garch")


def dcc_of(wildcards):
    """DCC fits of every definition."""
    return tables_of(wildcards, "dcc")


def level_garch(wildcards):
    """GARCH fits of the level, where it is analysed."""
    folder = f"results/{wildcards.dataset}/{wildcards.recording}/{wildcards.axis}"
    there = "level" in definitions(wildcards.dataset)
    return [f"{folder}/level/garch.parquet"] if there else []


def all_integrity(wildcards):
    """Integrity record of every recording of a data set."""
    return [
        f"results/{wildcards.dataset}/{name}/integrity.json"
        for name in recordings(wildcards.dataset)
    ]


def all_noise(wildcards):
    """Noise of every axis; none if no recording can be used."""
    axes = DATASETS[wildcards.dataset].board.axes if usable(wildcards.dataset) else []
    return [f"results/{wildcards.dataset}/noise/{axis}.json" for axis in axes]


def calibration_frames(wildcards):
    """Frames of the recordings that calibrate uses: on a rate table, and at rest."""
    return [
        f"results/{wildcards.dataset}/{name}/frames.parquet"
        for name in recordings(wildcards.dataset, "calibration", *AT_REST)
    ]


def calibration_integrity(wildcards):
    """Integrity records of the recordings that calibrate uses."""
    return [
        path.replace("frames.parquet", "integrity.json")
        for path in calibration_frames(wildcards)
    ]


def calibration_references(wildcards):
    """Logged table rates of the calibration recordings that have one."""
    names = recordings(wildcards.dataset, "calibration")
    return [path for name in names for path in reference_path(wildcards.dataset, name)]


def noise_choices(wildcards):
    """Rates of the recordings that may tell each gyro's noise, the first choice first: those at rest, else the longest.

    Whether the board stood still in them shows only when they are converted; the stage `noise` chooses.
    """
    names = usable(wildcards.dataset)
    order = {kind: rank for rank, kind in enumerate(("static", "thermal", "free"))}
    about = screened(wildcards.dataset)["recordings"]
    names.sort(
        key=lambda name: (
            order.get(kind_of(wildcards.dataset, name), len(order)),
            -about[name]["duration_s"],
        )
    )
    resting = [name for name in names if kind_of(wildcards.dataset, name) in order]
    return [
        f"results/{wildcards.dataset}/{name}/rates.parquet"
        for name in resting or names[:1]
    ]


def noise_source(wildcards):
    """Rates of the recording that is the first choice, or none."""
    return noise_choices(wildcards)[:1]


def reference_path(dataset, recording):
    """The logged true rate of a recording, where there is one."""
    known = DATASETS[dataset]
    path = logged_reference(known.manifest, recording, known.folder)
    return [str(path)] if path is not None else []


def reference_file(wildcards):
    """The logged true rate of the job's recording, where there is one."""
    return reference_path(wildcards.dataset, wildcards.recording)
