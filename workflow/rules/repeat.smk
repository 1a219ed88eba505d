"""Studies over again: how far apart two studies of one size lie, what is expected of them, and other interpretations.

Needs results/design/, results/metrics/ and the test configurations. Writes results/studies/{interpretation}/{robot}.parquet,
results/expected/{robot}/{noise}um/{strategy}.parquet, reports/tables/expectations.csv and, for the target extended_study,
reports/tables/interpretations.csv.
"""

# Interpretations by what is measured, as Table 4 is shown.
MEASURED = {"pose": USUAL} | {
    spell_count(len(some["reflectors_m"]), "reflector"): name
    for name, some in config["switched"].items()
    if "reflectors_m" in some
}


rule repeat_studies:
    input:
        sources=sources("elastocal.study.repeated.repeat_studies"),
    output:
        repeated="results/studies/{interpretation}/{robot}.parquet",
    log:
        "results/logs/repeat_studies/{interpretation}/{robot}.log",
    benchmark:
        "results/timings/repeat_studies/{interpretation}/{robot}.tsv"
    wildcard_constraints:
        interpretation="|".join([USUAL, *config["switched"]]),
    params:
        step="elastocal.study.repeated.repeat_studies",
        study=study_in_memory(),
        strategies=list(STUDY.strategies.values()),
        studies=config["evaluation"]["studies"],
    script:
        "../scripts/run_step.py"


rule expect:
    input:
        unpack(
            lambda wildcards: (
                {"noise_free": f"results/metrics/{wildcards.robot}/0um/{wildcards.strategy}.parquet"} if "0" in NOISE else {}
            )
        ),
        design="results/design/{robot}/{strategy}.parquet",
        test_experiments="data/simulated/{robot}/test/experiments.parquet",
        test_ideal="data/simulated/{robot}/test/ideal.parquet",
        sources=sources("elastocal.study.repeated.expect"),
    output:
        expected="results/expected/{robot}/{noise}um/{strategy}.parquet",
    log:
        "results/logs/expect/{robot}/{noise}um/{strategy}.log",
    benchmark:
        "results/timings/expect/{robot}/{noise}um/{strategy}.tsv"
    params:
        step="elastocal.study.repeated.expect",
        robot=robot_document,
        strategy=strategy_document,
        seed=config["seed"],
        tool_offset_m=INTERPRETATIONS["tool_offset_m"],
        wrench_at=INTERPRETATIONS["wrench_at"],
        average=INTERPRETATIONS["average"],
        deviation_of=INTERPRETATIONS["deviation_of"],
    script:
        "../scripts/run_step.py"


ONE_STUDY = {"studies": expand(rules.repeat_studies.output.repeated, interpretation=USUAL, robot=REDUCED)}
STUDY_TABLES |= {
    "tabulate_expectations": (
        "study_tables",
        ONE_STUDY | {"expected": cells("expected", REDUCED, TABLE_NOISE)} | REFERENCE,
        {"table": table_of("expectations", PAPER, "expectations", "Expectations in closed form")},
        {"length": config["tables"]["length"], "strategies": list(NAMES.values())},
    ),
    "tabulate_studies": (
        "study_tables",
        {"studies": expand(rules.repeat_studies.output.repeated, interpretation=MEASURED.values(), robot=REDUCED)} | REFERENCE,
        {
            "table": table_of("strategies_over_studies", PAPER, "strategies_over_studies", "Table 4 over studies"),
            "joint": table_of("joint_test", PAPER),
        },
        {
            "measured": {name: kind for kind, name in MEASURED.items()},
            "usual": USUAL,
            "slugs": {name: key for key, name in NAMES.items()},
            "length": config["tables"]["length"],
            "limits": {
                "k_sigma": config["tables"]["k_sigma_limit_percent"],
                "deviation": config["tables"]["deviation_limit_um"],
            },
        },
    ),
    "tabulate_interpretations": (
        "study_tables",
        {"studies": expand(rules.repeat_studies.output.repeated, interpretation=[USUAL, *config["switched"]], robot=REDUCED)}
        | REFERENCE,
        {"table": table_of("interpretations", PAPER, "interpretations", "Other interpretations of the paper")},
        {"length": config["tables"]["length"], "usual": USUAL, "classical": NAMES[CLASSICAL]},
    ),
}
