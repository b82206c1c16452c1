rule volatility:
    """GARCH, DCC, ARCH-LM and minimum-variance weights of one array, in rolling windows, for one definition of r_t."""
    input:
        rates="results/{dataset}/{recording}/rates.parquet",
    output:
        garch="results/{dataset}/{recording}/{axis}/{definition}/garch.parquet",
        dcc="results/{dataset}/{recording}/{axis}/{definition}/dcc.parquet",
        arch_lm="results/{dataset}/{recording}/{axis}/{definition}/arch_lm.parquet",
        weights="results/{dataset}/{recording}/{axis}/{definition}/weights.parquet",
    log:
        "results/logs/{dataset}/{recording}/{axis}/{definition}/volatility.log",
    benchmark:
        "results/benchmarks/{dataset}/{recording}/{axis}/{definition}/volatility.tsv"
    resources:
        mem_mb=2000,
        runtime=480,
    params:
        options=stage("board", "engine", "volatility"),
        code=code("volatility"),
    shell:
        "python -m vgyro.tasks.volatility --input rates {input.rates}"
        " --output garch {output.garch} --output dcc {output.dcc}"
        " --output arch_lm {output.arch_lm} --output weights {output.weights}"
        " --options {params.options:q} --code {params.code} --log {log}"
