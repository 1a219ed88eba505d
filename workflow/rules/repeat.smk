"""Repeated studies: how much studies of the same size differ, Table 4 over all of them, and studies under other interpretations.

Needs only the configuration. Writes results/studies/{robot}.parquet, of the alternative to each interpretation
results/alternatives/{number}/studies/{robot}.parquet and initial/{robot}.parquet, and reports/tables/strategies_over_studies.csv.
"""


rule repeat_studies:
    output:
        repeated="results/studies/{robot}.parquet",
    params:
        step="elastocal.study.repeated.repeat_studies",
        study=study_in_memory(),
        strategies=list(STUDY.strategies.values()),
        studies=config["evaluation"]["studies"],
    script:
        "../scripts/run_step.py"


rule tabulate_studies:
    input:
        studies=expand(rules.repeat_studies.output.repeated, robot=REDUCED),
    output:
        table=shown_table(
            "reports/tables/strategies_over_studies.csv",
            "strategies_over_studies",
            PAPER,
            "Table 4 over studies",
        ),
    params:
        step="elastocal.study.evaluation.tabulate_studies",
        slugs={name: key for key, name in NAMES.items()},
        length=config["tables"]["length"],
        limits={
            "k_sigma": config["tables"]["k_sigma_limit_percent"],
            "deviation": config["tables"]["deviation_limit_um"],
        },
    script:
        "../scripts/run_step.py"


rule evaluate_alternative:
    output:
        repeated="results/alternatives/{number}/studies/{robot}.parquet",
        initial="results/alternatives/{number}/initial/{robot}.parquet",
    wildcard_constraints:
        number=r"R\d+",
        robot="|".join(map(re.escape, REDUCED)),
    params:
        step="elastocal.study.multiverse.evaluate_alternative",
        study=alternative_study,
        strategies=list(STUDY.strategies.values()),
        studies=ALTERNATIVES["studies"],
    script:
        "../scripts/run_step.py"
