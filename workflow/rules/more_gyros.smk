rule more_gyros:
    """What a larger array of the same kind of gyro would bring."""
    input:
        rates="results/{dataset}/{recording}/rates.parquet",
        noise="results/{dataset}/noise/{axis}.json",
        correlation="results/{dataset}/{recording}/{axis}/correlation.parquet",
    output:
        more_gyros="results/{dataset}/{recording}/{axis}/more_gyros.parquet",
    log:
        "results/logs/{dataset}/{recording}/{axis}/more_gyros.log",
    benchmark:
        "results/benchmarks/{dataset}/{recording}/{axis}/more_gyros.tsv"
    resources:
        mem_mb=500,
        runtime=5,
    params:
        options=stage("fusion.more_gyros"),
        code=code("fusion.more_gyros"),
    shell:
        "python -m vgyro.tasks.fusion.more_gyros --input rates {input.rates} --input noise {input.noise} --input correlation {input.correlation}"
        " --output more_gyros {output.more_gyros}"
        " --options {params.options:q} --code {params.code} --log {log}"
