rule papers_page:
    """The tables of one paper again, from its twin: published, ours, and what the equations imply."""
    input:
        calibration="results/{dataset}/calibration.json",
        noise=all_noise,
        artefacts=artefacts_of,
    output:
        page="reports/papers/{dataset}.html",
        table1="reports/papers/{dataset}_table1.csv",
        table2="reports/papers/{dataset}_table2.csv",
        table3="reports/papers/{dataset}_table3.csv",
    log:
        "results/logs/{dataset}/papers.log",
    benchmark:
        "results/benchmarks/{dataset}/papers.tsv"
    resources:
        mem_mb=4000,
        runtime=20,
    params:
        options=stage("papers.papers"),
        code=code("papers.papers"),
    shell:
        "python -m vgyro.tasks.papers.papers --input calibration {input.calibration} --input noise {input.noise:q}"
        " --input artefacts {input.artefacts:q} --output page {output.page}"
        " --output table1 {output.table1} --output table2 {output.table2} --output table3 {output.table3}"
        " --options {params.options:q} --code {params.code} --log {log}"
