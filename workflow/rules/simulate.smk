"""Data: random experiments of each robot, and their deflections without and with noise.

Needs only the configuration. Writes to data/simulated/{robot}/: experiments.parquet and ideal.parquet, the same two in test/ for
the test configurations, and {noise}um/measured.parquet.
"""


rule draw_experiments:
    output:
        experiments="data/simulated/{robot}{test}/experiments.parquet",
    log:
        "results/logs/draw_experiments/{robot}{test}.log",
    benchmark:
        "results/timings/draw_experiments/{robot}{test}.tsv"
    params:
        step="elastocal.study.simulation.draw_experiments",
        chain=lambda wildcards: robot_document(wildcards)["chain"],
        lengths_m=lambda wildcards: robot_document(wildcards).get("lengths_m", {}),
        joint_limits_deg=lambda wildcards: robot_document(wildcards)["joint_limits_deg"],
        seed=config["seed"],
        loading=LOADING,
        purpose=lambda wildcards: "test" if wildcards.test else "identification",
        data_sets=lambda wildcards: 1 if wildcards.test else config["data_sets"],
        configurations=lambda wildcards: config[
            "test_configurations" if wildcards.test else "configurations"
        ],
    script:
        "../scripts/run_step.py"


rule simulate:
    input:
        experiments=rules.draw_experiments.output.experiments,
    output:
        ideal="data/simulated/{robot}{test}/ideal.parquet",
    log:
        "results/logs/simulate/{robot}{test}.log",
    benchmark:
        "results/timings/simulate/{robot}{test}.tsv"
    params:
        step="elastocal.study.simulation.simulate",
        robot=robot_document,
        seed=config["seed"],
        tool_offset_m=INTERPRETATIONS["tool_offset_m"],
        wrench_at=INTERPRETATIONS["wrench_at"],
    script:
        "../scripts/run_step.py"


rule measure:
    input:
        ideal="data/simulated/{robot}/ideal.parquet",
    output:
        measured="data/simulated/{robot}/{noise}um/measured.parquet",
    params:
        step="elastocal.study.simulation.measure",
        seed=config["seed"],
    script:
        "../scripts/run_step.py"
