"""Estimates: each strategy on each robot at each noise level, its own job.

Needs data/simulated/. Writes results/design/{robot}/{strategy}.parquet, which holds for all noise levels, and
results/identified/{robot}/{noise}um/{strategy}.parquet.
"""


rule judge_design:
    input:
        experiments="data/simulated/{robot}/experiments.parquet",
        sources=sources("judge_design.py"),
    output:
        design="results/design/{robot}/{strategy}.parquet",
    log:
        "results/logs/judge_design/{robot}/{strategy}.log",
    benchmark:
        "results/timings/judge_design/{robot}/{strategy}.tsv"
    params:
        chain=lambda wildcards: robot_document(wildcards)["chain"],
        lengths_m=lambda wildcards: robot_document(wildcards).get("lengths_m", {}),
        strategy=strategy_document,
        seed=config["seed"],
        rows=rows_read(INTERPRETATIONS["measured"]),
        tool_offset_m=INTERPRETATIONS["tool_offset_m"],
        wrench_at=INTERPRETATIONS["wrench_at"],
    script:
        "../scripts/judge_design.py"


rule identify:
    input:
        experiments="data/simulated/{robot}/experiments.parquet",
        measured=rules.measure.output.measured,
        design=rules.judge_design.output.design,
        sources=sources("identify.py"),
    output:
        identified="results/identified/{robot}/{noise}um/{strategy}.parquet",
    log:
        "results/logs/identify/{robot}/{noise}um/{strategy}.log",
    benchmark:
        "results/timings/identify/{robot}/{noise}um/{strategy}.tsv"
    params:
        chain=lambda wildcards: robot_document(wildcards)["chain"],
        lengths_m=lambda wildcards: robot_document(wildcards).get("lengths_m", {}),
        strategy=strategy_document,
        seed=config["seed"],
        rows=rows_read(INTERPRETATIONS["measured"]),
        tool_offset_m=INTERPRETATIONS["tool_offset_m"],
        wrench_at=INTERPRETATIONS["wrench_at"],
        start=(
            1e-6 * config["identification"]["start_urad_per_Nm"]
            if config["identification"]["solver"] == "gauss_newton"
            else None
        ),
    script:
        "../scripts/identify.py"
