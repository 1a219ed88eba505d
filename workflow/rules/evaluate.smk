"""Metrics: what each strategy is worth, averaged over data sets as in the paper and for one data set, and what is possible.

Needs results/identified/ and data/simulated/. Writes results/weights/{robot}.parquet, results/metrics/, results/replicates/ and
results/accuracy/, each {robot}/{noise}um/{strategy}.parquet, and results/bounds/{robot}.parquet.
"""


rule draw_weights:
    input:
        sources=sources("draw_weights.py"),
    output:
        weights="results/weights/{robot}.parquet",
    log:
        "results/logs/draw_weights/{robot}.log",
    benchmark:
        "results/timings/draw_weights/{robot}.tsv"
    params:
        seed=config["seed"],
        data_sets=config["data_sets"],
        tests=config["test_configurations"],
        replicates=config["evaluation"]["bootstrap_replicates"],
    script:
        "../scripts/draw_weights.py"


rule evaluate:
    input:
        identified=rules.identify.output.identified,
        weights=rules.draw_weights.output.weights,
        test_experiments="data/simulated/{robot}/test/experiments.parquet",
        test_ideal="data/simulated/{robot}/test/ideal.parquet",
        sources=sources("evaluate.py"),
    output:
        metrics="results/metrics/{robot}/{noise}um/{strategy}.parquet",
        replicates="results/replicates/{robot}/{noise}um/{strategy}.parquet",
        accuracy="results/accuracy/{robot}/{noise}um/{strategy}.parquet",
    log:
        "results/logs/evaluate/{robot}/{noise}um/{strategy}.log",
    benchmark:
        "results/timings/evaluate/{robot}/{noise}um/{strategy}.tsv"
    params:
        robot=robot_document,
        strategy=strategy_document,
        seed=config["seed"],
        tool_offset_m=INTERPRETATIONS["tool_offset_m"],
        wrench_at=INTERPRETATIONS["wrench_at"],
        average=INTERPRETATIONS["average"],
        deviation_of=INTERPRETATIONS["deviation_of"],
        lengths=config["evaluation"]["lengths"],
    script:
        "../scripts/evaluate.py"


rule bound:
    input:
        experiments="data/simulated/{robot}/experiments.parquet",
        test_experiments="data/simulated/{robot}/test/experiments.parquet",
        test_ideal="data/simulated/{robot}/test/ideal.parquet",
        sources=sources("bound.py"),
    output:
        bounds="results/bounds/{robot}.parquet",
    log:
        "results/logs/bound/{robot}.log",
    benchmark:
        "results/timings/bound/{robot}.tsv"
    params:
        robot=robot_document,
        point_sets=list(STUDY.points.values()),
        seed=config["seed"],
        rows=rows_read(INTERPRETATIONS["measured"]),
        tool_offset_m=INTERPRETATIONS["tool_offset_m"],
        wrench_at=INTERPRETATIONS["wrench_at"],
    script:
        "../scripts/bound.py"
