rule measure:
    """Allan deviations, densities, correlation, tones and every figure, with intervals."""
    input:
        rates="results/{dataset}/{recording}/rates.parquet",
        fused="results/{dataset}/{recording}/{axis}/fused.parquet",
        methods="results/{dataset}/{recording}/{axis}/methods.parquet",
        moved="results/{dataset}/{recording}/{axis}/moved.parquet",
    output:
        allan="results/{dataset}/{recording}/{axis}/allan.parquet",
        spectrum="results/{dataset}/{recording}/{axis}/spectrum.parquet",
        metrics="results/{dataset}/{recording}/{axis}/metrics.parquet",
        correlation="results/{dataset}/{recording}/{axis}/correlation.parquet",
        cross_allan="results/{dataset}/{recording}/{axis}/cross_allan.parquet",
        tones="results/{dataset}/{recording}/{axis}/tones.parquet",
    log:
        "results/logs/{dataset}/{recording}/{axis}/measure.log",
    benchmark:
        "results/benchmarks/{dataset}/{recording}/{axis}/measure.tsv"
    resources:
        mem_mb=2000,
        runtime=60,
    params:
        options=stage("figures.measure"),
        code=code("figures.measure"),
    shell:
        "python -m vgyro.tasks.figures.measure --input rates {input.rates} --input fused {input.fused} --input methods {input.methods} --input moved {input.moved}"
        " --output allan {output.allan} --output spectrum {output.spectrum} --output metrics {output.metrics} --output correlation {output.correlation} --output cross_allan {output.cross_allan} --output tones {output.tones}"
        " --options {params.options:q} --code {params.code} --log {log}"


rule crosscheck:
    """A random sample of the results, computed again by an independent route."""
    input:
        rates="results/{dataset}/{recording}/rates.parquet",
        noise="results/{dataset}/noise/{axis}.json",
        fused="results/{dataset}/{recording}/{axis}/fused.parquet",
        methods="results/{dataset}/{recording}/{axis}/methods.parquet",
        allan="results/{dataset}/{recording}/{axis}/allan.parquet",
        series=series_of,
        garch=garch_of,
        dcc=dcc_of,
        weights=weights_of,
    output:
        crosscheck="results/{dataset}/{recording}/{axis}/crosscheck.parquet",
    log:
        "results/logs/{dataset}/{recording}/{axis}/crosscheck.log",
    benchmark:
        "results/benchmarks/{dataset}/{recording}/{axis}/crosscheck.tsv"
    resources:
        mem_mb=2500,
        runtime=60,
    params:
        options=stage("figures.crosscheck"),
        code=code("figures.crosscheck"),
    shell:
        "python -m vgyro.tasks.figures.crosscheck --input rates {input.rates} --input noise {input.noise} --input fused {input.fused} --input methods {input.methods} --input allan {input.allan} --input series {input.series:q} --input garch {input.garch:q} --input dcc {input.dcc:q} --input weights {input.weights:q}"
        " --output crosscheck {output.crosscheck}"
        " --options {params.options:q} --code {params.code} --log {log}"
