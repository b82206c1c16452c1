rule decode:
    """Frames of one recording, and the record of what is damaged or missing. A refused recording gets no frames."""
    input:
        files=existing_files,
    output:
        frames="results/{dataset}/{recording}/frames.parquet",
        integrity="results/{dataset}/{recording}/integrity.json",
    log:
        "results/logs/{dataset}/{recording}/decode.log",
    benchmark:
        "results/benchmarks/{dataset}/{recording}/decode.tsv"
    resources:
        mem_mb=2000,
        runtime=60,
    params:
        files=named_files,
        options=stage("rates.decode"),
        code=code("rates.decode"),
    shell:
        "python -m vgyro.tasks.rates.decode --input files {params.files:q} --output frames {output.frames}"
        " --output integrity {output.integrity} --options {params.options:q} --code {params.code} --log {log}"


checkpoint screen:
    """Which recordings of a data set can be used: what follows is planned from this."""
    input:
        integrity=all_integrity,
    output:
        screen="results/{dataset}/screen.json",
    log:
        "results/logs/{dataset}/screen.log",
    benchmark:
        "results/benchmarks/{dataset}/screen.tsv"
    resources:
        mem_mb=500,
        runtime=5,
    params:
        options=stage("rates.screen"),
        code=code("rates.screen"),
    shell:
        "python -m vgyro.tasks.rates.screen --input integrity {input.integrity:q} --output screen {output.screen}"
        " --options {params.options:q} --code {params.code} --log {log}"
