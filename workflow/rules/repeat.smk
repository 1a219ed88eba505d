"""Studies over again: how far apart two studies of one size lie, and Table 4 over them.

Needs the configuration alone. Writes results/studies/{robot}.parquet and reports/tables/strategies_over_studies.csv.
"""


rule repeat_studies:
    output:
        repeated="results/studies/{robot}.parquet",
    params:
        step="elastocal.study.evaluation.repeat_studies",
        study=study_in_memory(),
        strategies=list(STUDY.strategies.values()),
        studies=config["evaluation"]["studies"],
    script:
        "../scripts/run_step.py"


ONE_STUDY = {"studies": expand(rules.repeat_studies.output.repeated, robot=REDUCED)}
STUDY_TABLES |= {
    "tabulate_studies": (
        "evaluation",
        ONE_STUDY,
        {
            "table": table_of(
                "strategies_over_studies", PAPER, "strategies_over_studies", "Table 4 over studies"
            )
        },
        {
            "slugs": {name: key for key, name in NAMES.items()},
            "length": config["tables"]["length"],
            "limits": {
                "k_sigma": config["tables"]["k_sigma_limit_percent"],
                "deviation": config["tables"]["deviation_limit_um"],
            },
        },
    ),
}
