"""The rules of a robot, its noise levels and strategies, and nothing else: `benchmarks/plan.py` compares ours with it."""


wildcard_constraints:
    robot=r"\w+",


rule all:
    input:
        expand(
            "results/metrics/{robot}/{noise}um/{strategy}.parquet",
            robot=config["robots"],
            noise=config["noise_um"],
            strategy=config["strategies"],
        ),


rule draw_experiments:
    output:
        experiments="data/simulated/{robot}/{purpose}/experiments.parquet",
    script:
        "touch.py"


rule simulate:
    input:
        experiments=rules.draw_experiments.output.experiments,
    output:
        ideal="data/simulated/{robot}/{purpose}/ideal.parquet",
    script:
        "touch.py"


rule measure:
    input:
        ideal="data/simulated/{robot}/identification/ideal.parquet",
    output:
        measured="data/simulated/{robot}/{noise}um/measured.parquet",
    script:
        "touch.py"


rule draw_weights:
    output:
        weights="results/weights/{robot}.parquet",
    script:
        "touch.py"


rule identify:
    input:
        experiments="data/simulated/{robot}/identification/experiments.parquet",
        measured=rules.measure.output.measured,
        weights=rules.draw_weights.output.weights,
        test_experiments="data/simulated/{robot}/test/experiments.parquet",
        test_ideal="data/simulated/{robot}/test/ideal.parquet",
    output:
        identified="results/identified/{robot}/{noise}um/{strategy}.parquet",
        metrics="results/metrics/{robot}/{noise}um/{strategy}.parquet",
        replicates="results/replicates/{robot}/{noise}um/{strategy}.parquet",
    log:
        "results/logs/identify/{robot}/{noise}um/{strategy}.log",
    benchmark:
        "results/timings/identify/{robot}/{noise}um/{strategy}.tsv"
    script:
        "touch.py"
