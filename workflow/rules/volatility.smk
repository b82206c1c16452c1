rule series:
    """The volatility series of one array: means of blocks of samples, for all definitions of r_t."""
    input:
        rates="results/{dataset}/{recording}/rates.parquet",
    output:
        series="results/{dataset}/{recording}/{axis}/series.parquet",
    log:
        "results/logs/{dataset}/{recording}/{axis}/series.log",
    benchmark:
        "results/benchmarks/{dataset}/{recording}/{axis}/series.tsv"
    resources:
        mem_mb=1000,
        runtime=20,
    params:
        options=stage("volatility.series"),
        code=code("volatility.series"),
    shell:
        "python -m vgyro.tasks.volatility.series --input rates {input.rates} --output series {output.series}"
        " --options {params.options:q} --code {params.code} --log {log}"


rule volatility_chunk:
    """GARCH, DCC and minimum-variance weights of some of the rolling windows, for one definition of r_t."""
    input:
        series="results/{dataset}/{recording}/{axis}/series.parquet",
    output:
        garch=temp(
            "results/{dataset}/{recording}/{axis}/{definition}/garch.{chunk}.parquet"
        ),
        dcc=temp(
            "results/{dataset}/{recording}/{axis}/{definition}/dcc.{chunk}.parquet"
        ),
        weights=temp(
            "results/{dataset}/{recording}/{axis}/{definition}/weights.{chunk}.parquet"
        ),
    log:
        "results/logs/{dataset}/{recording}/{axis}/{definition}/volatility.{chunk}.log",
    benchmark:
        "results/benchmarks/{dataset}/{recording}/{axis}/{definition}/volatility.{chunk}.tsv"
    resources:
        mem_mb=1000,
        runtime=480,
    params:
        options=stage("volatility.chunk", injected_rate=injected_rate),
        code=code("volatility.chunk"),
    shell:
        "python -m vgyro.tasks.volatility.chunk --input series {input.series}"
        " --output garch {output.garch} --output dcc {output.dcc} --output weights {output.weights}"
        " --options {params.options:q} --code {params.code} --log {log}"


rule volatility:
    """The tables of one array for one definition of r_t, with ARCH-LM; of a short recording, all the work."""
    input:
        series="results/{dataset}/{recording}/{axis}/series.parquet",
        garch=garch_parts,
        dcc=dcc_parts,
        weights=weights_parts,
    output:
        garch="results/{dataset}/{recording}/{axis}/{definition}/garch.parquet",
        dcc="results/{dataset}/{recording}/{axis}/{definition}/dcc.parquet",
        arch_lm="results/{dataset}/{recording}/{axis}/{definition}/arch_lm.parquet",
        weights="results/{dataset}/{recording}/{axis}/{definition}/weights.parquet",
        fits="results/{dataset}/{recording}/{axis}/{definition}/fits.parquet",
    log:
        "results/logs/{dataset}/{recording}/{axis}/{definition}/volatility.log",
    benchmark:
        "results/benchmarks/{dataset}/{recording}/{axis}/{definition}/volatility.tsv"
    resources:
        mem_mb=1500,
        runtime=480,
    params:
        options=stage("volatility.assemble", injected_rate=injected_rate),
        code=code("volatility.assemble"),
    shell:
        "python -m vgyro.tasks.volatility.assemble --input series {input.series}"
        " --input garch {input.garch:q} --input dcc {input.dcc:q} --input weights {input.weights:q}"
        " --output garch {output.garch} --output dcc {output.dcc} --output arch_lm {output.arch_lm}"
        " --output weights {output.weights} --output fits {output.fits}"
        " --options {params.options:q} --code {params.code} --log {log}"


rule bekk:
    """CCC, DCC and both kinds of BEKK on a random sample of the rolling windows."""
    input:
        series="results/{dataset}/{recording}/{axis}/series.parquet",
        garch=garch_of,
        dcc=dcc_of,
    output:
        bekk="results/{dataset}/{recording}/{axis}/bekk.parquet",
    log:
        "results/logs/{dataset}/{recording}/{axis}/bekk.log",
    benchmark:
        "results/benchmarks/{dataset}/{recording}/{axis}/bekk.tsv"
    resources:
        mem_mb=1000,
        runtime=60,
    params:
        options=stage("volatility.bekk"),
        code=code("volatility.bekk"),
    shell:
        "python -m vgyro.tasks.volatility.bekk --input series {input.series}"
        " --input garch {input.garch:q} --input dcc {input.dcc:q} --output bekk {output.bekk}"
        " --options {params.options:q} --code {params.code} --log {log}"


rule effects:
    """What the ARCH effect of each gyro's level is: changing variance, drift, a tone, a knock, or nothing."""
    input:
        series="results/{dataset}/{recording}/{axis}/series.parquet",
        tones="results/{dataset}/{recording}/{axis}/tones.parquet",
        garch=level_garch,
    output:
        effects="results/{dataset}/{recording}/{axis}/effects.parquet",
    log:
        "results/logs/{dataset}/{recording}/{axis}/effects.log",
    benchmark:
        "results/benchmarks/{dataset}/{recording}/{axis}/effects.tsv"
    resources:
        mem_mb=1500,
        runtime=60,
    params:
        options=stage("volatility.effects", definition="level"),
        code=code("volatility.effects"),
    shell:
        "python -m vgyro.tasks.volatility.effects --input series {input.series} --input tones {input.tones}"
        " --input garch {input.garch:q} --output effects {output.effects}"
        " --options {params.options:q} --code {params.code} --log {log}"
