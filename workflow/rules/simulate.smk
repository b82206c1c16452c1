rule simulate:
    """Make one recording of a paper's twin, down to the bytes of its dump."""
    input:
        twin="config/twins/{dataset}.yaml",
    output:
        dump="results/twins/{dataset}/{recording}.bin",
        truth="results/twins/{dataset}/truth/{recording}.parquet",
        reference="results/twins/{dataset}/{recording}_reference.parquet",
    log:
        "results/logs/{dataset}/{recording}/simulate.log",
    benchmark:
        "results/benchmarks/{dataset}/{recording}/simulate.tsv"
    resources:
        mem_mb=3000,
        runtime=20,
    params:
        options=stage("simulate"),
        code=code("simulate"),
    shell:
        "python -m vgyro.tasks.simulate --input twin {input.twin} --output dump {output.dump} --output truth {output.truth}"
        " --output reference {output.reference} --options {params.options:q} --code {params.code} --log {log}"
