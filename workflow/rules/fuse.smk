rule fuse:
    """One virtual gyroscope a method."""
    input:
        rates="results/{dataset}/{recording}/rates.parquet",
        noise="results/{dataset}/noise/{axis}.json",
        weights=weights_of,
    output:
        fused="results/{dataset}/{recording}/{axis}/fused.parquet",
        methods="results/{dataset}/{recording}/{axis}/methods.parquet",
    log:
        "results/logs/{dataset}/{recording}/{axis}/fuse.log",
    benchmark:
        "results/benchmarks/{dataset}/{recording}/{axis}/fuse.tsv"
    resources:
        mem_mb=1500,
        runtime=60,
    params:
        options=stage("board", "engine", "volatility", "fusion"),
        code=code("fuse"),
    shell:
        "python -m vgyro.tasks.fuse --input rates {input.rates} --input noise {input.noise} --input weights {input.weights:q}"
        " --output fused {output.fused} --output methods {output.methods}"
        " --options {params.options:q} --code {params.code} --log {log}"
