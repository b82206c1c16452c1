rule garch:
    """GARCH(1,1) of each gyro in each rolling window."""
    input:
        rates="results/{dataset}/{recording}/rates.parquet",
    output:
        garch="results/{dataset}/{recording}/{axis}/{definition}/garch.parquet",
    log:
        "results/logs/{dataset}/{recording}/{axis}/{definition}/garch.log",
    benchmark:
        "results/benchmarks/{dataset}/{recording}/{axis}/{definition}/garch.tsv"
    resources:
        mem_mb=2000,
        runtime=120,
    params:
        options=stage("board", "engine", "volatility"),
        code=code("garch"),
    shell:
        "python -m vgyro.tasks.garch --input rates {input.rates}"
        " --output garch {output.garch}"
        " --options {params.options:q} --code {params.code} --log {log}"


rule dcc:
    """DCC(1,1) and the constant-correlation test, in each window and on the whole record."""
    input:
        rates="results/{dataset}/{recording}/rates.parquet",
        garch="results/{dataset}/{recording}/{axis}/{definition}/garch.parquet",
    output:
        dcc="results/{dataset}/{recording}/{axis}/{definition}/dcc.parquet",
    log:
        "results/logs/{dataset}/{recording}/{axis}/{definition}/dcc.log",
    benchmark:
        "results/benchmarks/{dataset}/{recording}/{axis}/{definition}/dcc.tsv"
    resources:
        mem_mb=2000,
        runtime=240,
    params:
        options=stage("board", "engine", "volatility"),
        code=code("dcc"),
    shell:
        "python -m vgyro.tasks.dcc --input rates {input.rates} --input garch {input.garch}"
        " --output dcc {output.dcc}"
        " --options {params.options:q} --code {params.code} --log {log}"


rule arch_lm:
    """Engle's test on the level, the detrended series and the standardised residuals."""
    input:
        rates="results/{dataset}/{recording}/rates.parquet",
        garch="results/{dataset}/{recording}/{axis}/{definition}/garch.parquet",
    output:
        arch_lm="results/{dataset}/{recording}/{axis}/{definition}/arch_lm.parquet",
    log:
        "results/logs/{dataset}/{recording}/{axis}/{definition}/arch_lm.log",
    benchmark:
        "results/benchmarks/{dataset}/{recording}/{axis}/{definition}/arch_lm.tsv"
    resources:
        mem_mb=2000,
        runtime=20,
    params:
        options=stage("board", "engine", "volatility"),
        code=code("arch_lm"),
    shell:
        "python -m vgyro.tasks.arch_lm --input rates {input.rates} --input garch {input.garch}"
        " --output arch_lm {output.arch_lm}"
        " --options {params.options:q} --code {params.code} --log {log}"


rule weights:
    """Minimum-variance weights from every window's conditional covariance."""
    input:
        rates="results/{dataset}/{recording}/rates.parquet",
        garch="results/{dataset}/{recording}/{axis}/{definition}/garch.parquet",
        dcc="results/{dataset}/{recording}/{axis}/{definition}/dcc.parquet",
    output:
        weights="results/{dataset}/{recording}/{axis}/{definition}/weights.parquet",
    log:
        "results/logs/{dataset}/{recording}/{axis}/{definition}/weights.log",
    benchmark:
        "results/benchmarks/{dataset}/{recording}/{axis}/{definition}/weights.tsv"
    resources:
        mem_mb=2000,
        runtime=120,
    params:
        options=stage("board", "engine", "volatility"),
        code=code("weights"),
    shell:
        "python -m vgyro.tasks.weights --input rates {input.rates} --input garch {input.garch} --input dcc {input.dcc}"
        " --output weights {output.weights}"
        " --options {params.options:q} --code {params.code} --log {log}"
