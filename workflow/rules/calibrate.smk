rule calibrate:
    """Every figure of a calibration, from the recordings on a rate table and at rest; nominal where there are none."""
    input:
        frames=calibration_frames,
        integrity=calibration_integrity,
        references=calibration_references,
    output:
        calibration="results/{dataset}/calibration.json",
    log:
        "results/logs/{dataset}/calibrate.log",
    benchmark:
        "results/benchmarks/{dataset}/calibrate.tsv"
    resources:
        mem_mb=2000,
        runtime=20,
    params:
        options=stage("calibration.calibrate"),
        code=code("calibration.calibrate"),
    shell:
        "python -m vgyro.tasks.calibration.calibrate --input frames {input.frames:q} --input integrity {input.integrity:q}"
        " --input references {input.references:q} --output calibration {output.calibration}"
        " --options {params.options:q} --code {params.code} --log {log}"


rule convert:
    """Counts to deg/s, with the stretches at rest and the true rate where it is known."""
    input:
        frames="results/{dataset}/{recording}/frames.parquet",
        integrity="results/{dataset}/{recording}/integrity.json",
        calibration="results/{dataset}/calibration.json",
        reference=reference_file,
    output:
        rates="results/{dataset}/{recording}/rates.parquet",
    log:
        "results/logs/{dataset}/{recording}/convert.log",
    benchmark:
        "results/benchmarks/{dataset}/{recording}/convert.tsv"
    resources:
        mem_mb=3000,
        runtime=20,
    params:
        options=stage("rates.convert"),
        code=code("rates.convert"),
    shell:
        "python -m vgyro.tasks.rates.convert --input frames {input.frames} --input integrity {input.integrity}"
        " --input calibration {input.calibration}"
        " --input reference {input.reference:q} --output rates {output.rates}"
        " --options {params.options:q} --code {params.code} --log {log}"


rule noise:
    """White noise, random walk and correlation of an axis' gyros: what the filters are designed from."""
    input:
        rates=noise_choices,
    output:
        noise="results/{dataset}/noise/{axis}.json",
    log:
        "results/logs/{dataset}/noise/{axis}.log",
    benchmark:
        "results/benchmarks/{dataset}/noise/{axis}.tsv"
    resources:
        mem_mb=1500,
        runtime=30,
    params:
        options=stage("fusion.noise"),
        code=code("fusion.noise"),
    shell:
        "python -m vgyro.tasks.fusion.noise --input rates {input.rates:q} --output noise {output.noise}"
        " --options {params.options:q} --code {params.code} --log {log}"
