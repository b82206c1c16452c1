rule fuse:
    """One virtual gyroscope a method; at rest again with a constant rate added."""
    input:
        rates="results/{dataset}/{recording}/rates.parquet",
        noise="results/{dataset}/noise/{axis}.json",
        weights=weights_of,
        moved=moved_weights_of,
    output:
        fused="results/{dataset}/{recording}/{axis}/fused.parquet",
        methods="results/{dataset}/{recording}/{axis}/methods.parquet",
        moved="results/{dataset}/{recording}/{axis}/moved.parquet",
    log:
        "results/logs/{dataset}/{recording}/{axis}/fuse.log",
    benchmark:
        "results/benchmarks/{dataset}/{recording}/{axis}/fuse.tsv"
    resources:
        mem_mb=1500,
        runtime=60,
    params:
        options=stage(
            "board", "engine", "volatility", "fusion", injected_rate=injected_rate
        ),
        code=code("fuse"),
    shell:
        "python -m vgyro.tasks.fuse --input rates {input.rates} --input noise {input.noise} --input weights {input.weights:q} --input moved {input.moved:q}"
        " --output fused {output.fused} --output methods {output.methods} --output moved {output.moved}"
        " --options {params.options:q} --code {params.code} --log {log}"
