"""Estimates and their scores: one job for each strategy, robot and noise level.

Needs data/simulated/. Writes results/weights/{robot}.parquet, results/identified/, results/metrics/ and results/replicates/, each
{robot}/{noise}um/{strategy}.parquet.
"""


rule draw_weights:
    output:
        weights="results/weights/{robot}.parquet",
    params:
        step="elastocal.study.simulation.draw_weights",
        seed=config["seed"],
        data_sets=config["data_sets"],
        tests=config["test_configurations"],
        replicates=config["evaluation"]["bootstrap_replicates"],
    script:
        "../scripts/run_step.py"


rule identify:
    input:
        experiments="data/simulated/{robot}/experiments.parquet",
        measured=rules.measure.output.measured,
        weights=rules.draw_weights.output.weights,
        test_experiments="data/simulated/{robot}/test/experiments.parquet",
        test_ideal="data/simulated/{robot}/test/ideal.parquet",
    output:
        identified="results/identified/{robot}/{noise}um/{strategy}.parquet",
        metrics="results/metrics/{robot}/{noise}um/{strategy}.parquet",
        replicates="results/replicates/{robot}/{noise}um/{strategy}.parquet",
    params:
        step="elastocal.study.evaluation.identify",
        robot=robot_document,
        strategy=strategy_document,
        seed=config["seed"],
        rows=count_components(INTERPRETATIONS["measured"]),
        tool_offset_m=INTERPRETATIONS["tool_offset_m"],
        wrench_at=INTERPRETATIONS["wrench_at"],
        average=INTERPRETATIONS["average"],
    script:
        "../scripts/run_step.py"
