rule report:
    """The page of a data set."""
    input:
        calibration="results/{dataset}/calibration.json",
        screen="results/{dataset}/screen.json",
        integrity=all_integrity,
        noise=all_noise,
        artefacts=artefacts_of,
    output:
        page="reports/{dataset}.html",
        headline="results/{dataset}/headline.json",
    log:
        "results/logs/{dataset}/report.log",
    benchmark:
        "results/benchmarks/{dataset}/report.tsv"
    resources:
        mem_mb=1500,
        runtime=20,
    params:
        options=stage("pages.report"),
        code=code("pages.report"),
    shell:
        "python -m vgyro.tasks.pages.report --input calibration {input.calibration} --input screen {input.screen}"
        " --input integrity {input.integrity:q} --input noise {input.noise:q} --input artefacts {input.artefacts:q}"
        " --output page {output.page} --output headline {output.headline}"
        " --options {params.options:q} --code {params.code} --log {log}"


rule index:
    """The overview of all data sets."""
    input:
        headlines=expand("results/{dataset}/headline.json", dataset=LOADED.datasets),
    output:
        page="reports/index.html",
    log:
        "results/logs/index.log",
    benchmark:
        "results/benchmarks/index.tsv"
    resources:
        mem_mb=1000,
        runtime=5,
    params:
        options=json.dumps({"problems": PROBLEMS}),
        code=code("pages.index"),
    shell:
        "python -m vgyro.tasks.pages.index --input headlines {input.headlines:q} --output page {output.page}"
        " --options {params.options:q} --code {params.code} --log {log}"


rule verdict:
    """Last of all: fail the run, with every reason again, if a manifest is wrong or a recording was refused."""
    input:
        page="reports/index.html",
        screens=expand("results/{dataset}/screen.json", dataset=LOADED.datasets),
    output:
        verdict="results/verdict.json",
    log:
        "results/logs/verdict.log",
    benchmark:
        "results/benchmarks/verdict.tsv"
    resources:
        mem_mb=500,
        runtime=5,
    params:
        options=json.dumps({"problems": PROBLEMS}),
        code=code("verdict"),
    shell:
        "python -m vgyro.tasks.verdict --input screens {input.screens:q} --input page {input.page} --output verdict {output.verdict}"
        " --options {params.options:q} --code {params.code} --log {log}"
