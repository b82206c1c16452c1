rule faults:
    """Stretches in which one gyro of an array is at fault."""
    input:
        rates="results/{dataset}/{recording}/rates.parquet",
        calibration="results/{dataset}/calibration.json",
    output:
        faults="results/{dataset}/{recording}/{axis}/faults.parquet",
    log:
        "results/logs/{dataset}/{recording}/{axis}/faults.log",
    benchmark:
        "results/benchmarks/{dataset}/{recording}/{axis}/faults.tsv"
    resources:
        mem_mb=1500,
        runtime=30,
    params:
        options=stage("fusion.faults"),
        code=code("fusion.faults"),
    shell:
        "python -m vgyro.tasks.fusion.faults --input rates {input.rates} --input calibration {input.calibration}"
        " --output faults {output.faults} --options {params.options:q} --code {params.code} --log {log}"


rule fuse:
    """One virtual gyroscope a method; at rest again with a constant rate added."""
    input:
        rates="results/{dataset}/{recording}/rates.parquet",
        noise="results/{dataset}/noise/{axis}.json",
        weights=weights_of,
        moved=moved_weights_of,
        faults="results/{dataset}/{recording}/{axis}/faults.parquet",
    output:
        fused="results/{dataset}/{recording}/{axis}/fused.parquet",
        methods="results/{dataset}/{recording}/{axis}/methods.parquet",
        moved="results/{dataset}/{recording}/{axis}/moved.parquet",
    log:
        "results/logs/{dataset}/{recording}/{axis}/fuse.log",
    benchmark:
        "results/benchmarks/{dataset}/{recording}/{axis}/fuse.tsv"
    resources:
        mem_mb=2500,
        runtime=60,
    params:
        options=stage("fusion.fuse", injected_rate=injected_rate),
        code=code("fusion.fuse"),
    shell:
        "python -m vgyro.tasks.fusion.fuse --input rates {input.rates} --input noise {input.noise} --input weights {input.weights:q} --input moved {input.moved:q} --input faults {input.faults}"
        " --output fused {output.fused} --output methods {output.methods} --output moved {output.moved}"
        " --options {params.options:q} --code {params.code} --log {log}"
