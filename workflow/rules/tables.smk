"""Tables: those of the paper, further ones, and the comparison with the printed figures.

Needs results/. Writes reports/tables/*.csv; the tables of the paper also as Markdown and LaTeX.
"""

PRINTED_FIGURES = f"{CONFIG}/paper/reference.csv"


rule summarize_initial:
    input:
        ideal="data/simulated/{robot}/ideal.parquet",
    output:
        initial="results/initial/{robot}.parquet",
    params:
        step="elastocal.study.simulation.summarize_initial",
        seed=config["seed"],
        end_effector=lambda wildcards: STUDY.end_effectors[wildcards.robot],
    script:
        "../scripts/run_step.py"


rule tabulate_compliances:
    output:
        table=shown_table("reports/tables/table1.csv", "table1", PAPER, "Table 1: compliances"),
    params:
        step="elastocal.study.tables.tabulate_compliances",
        robots={name: STUDY.robots[name] for name in REDUCED},
    script:
        "../scripts/run_step.py"


rule tabulate_initial:
    input:
        initial=expand(rules.summarize_initial.output.initial, robot=config["robots"]),
    output:
        table=shown_table(
            "reports/tables/table2.csv", "table2", PAPER, "Table 2: deflection before calibration"
        ),
    params:
        step="elastocal.study.tables.tabulate_initial",
        robots=config["robots"],
        seed=config["seed"],
        replicates=config["evaluation"]["bootstrap_replicates"],
    script:
        "../scripts/run_step.py"


rule tabulate_identified:
    input:
        metrics=cells("metrics", REDUCED, TABLE_NOISE, CLASSICAL),
    output:
        table=shown_table(
            "reports/tables/table3.csv", "table3", PAPER, "Table 3: identified compliances"
        ),
    params:
        step="elastocal.study.tables.tabulate_identified",
        robots=REDUCED,
        strategy=NAMES[CLASSICAL],
        noise_um=config["tables"]["noise_um"],
        length=config["tables"]["length"],
    script:
        "../scripts/run_step.py"


rule tabulate_strategies:
    input:
        metrics=cells("metrics", REDUCED, TABLE_NOISE),
        replicates=cells("replicates", REDUCED, TABLE_NOISE),
    output:
        table=shown_table("reports/tables/table4.csv", "table4", PAPER, "Table 4: strategies"),
    params:
        step="elastocal.study.tables.tabulate_strategies",
        robots=REDUCED,
        strategies={name: key for key, name in NAMES.items()},
        cells={key: value for key, value in config["tables"].items() if key != "classical_strategy"},
    script:
        "../scripts/run_step.py"


rule tabulate_extended:
    input:
        metrics=cells("metrics", EXTENDED, TABLE_NOISE),
        replicates=cells("replicates", EXTENDED, TABLE_NOISE),
    output:
        table=shown_table(
            "reports/tables/extended.csv", "extended", QUESTIONS_BEYOND, "Elastic links"
        ),
    params:
        step="elastocal.study.tables.tabulate_extended",
        robots=EXTENDED,
        strategies=list(NAMES.values()),
        noise_um=config["tables"]["noise_um"],
        length=config["tables"]["length"],
    script:
        "../scripts/run_step.py"


rule compare_with_paper:
    input:
        reference=PRINTED_FIGURES,
        table1=rules.tabulate_compliances.output.table,
        table2=rules.tabulate_initial.output.table,
        table3=rules.tabulate_identified.output.table,
        table4=rules.tabulate_strategies.output.table,
        extended=rules.tabulate_extended.output.table,
        metrics=cells("metrics", config["robots"], TABLE_NOISE),
        replicates=cells("replicates", config["robots"], TABLE_NOISE),
    output:
        table=shown_table(
            "reports/tables/beside_paper.csv",
            "beside_paper",
            PAPER,
            "Every printed figure beside ours",
        ),
    params:
        step="elastocal.study.printed.compare_with_paper",
        noise_um=config["tables"]["noise_um"],
        length=config["tables"]["length"],
    script:
        "../scripts/run_step.py"


rule compare_with_studies:
    input:
        beside=rules.compare_with_paper.output.table,
        studies=expand(rules.repeat_studies.output.repeated, robot=REDUCED),
        initial=expand(rules.summarize_initial.output.initial, robot=config["robots"]),
        reference=PRINTED_FIGURES,
    output:
        table=shown_table(
            "reports/tables/comparison.csv",
            "comparison",
            PAPER,
            "Every printed figure among further studies",
        ),
        joint="reports/tables/joint_test.csv",
    params:
        step="elastocal.study.joint_test.compare_with_studies",
        robots=config["robots"],
        length=config["tables"]["length"],
    script:
        "../scripts/run_step.py"


rule tabulate_multiverse:
    input:
        alternatives=alternative_files("studies"),
        alternatives_initial=alternative_files("initial"),
        studies=expand(rules.repeat_studies.output.repeated, robot=REDUCED),
        initial=expand(rules.summarize_initial.output.initial, robot=config["robots"]),
        reference=PRINTED_FIGURES,
        interpretations=f"{CONFIG}/paper/interpretations.csv",
    output:
        table=shown_table(
            "reports/tables/multiverse.csv",
            "multiverse",
            PAPER,
            "Every printed figure with the alternative to each interpretation",
        ),
        summary="reports/tables/multiverse_summary.csv",
    params:
        step="elastocal.study.multiverse.tabulate_multiverse",
        robots=config["robots"],
        alternatives=ALTERNATIVE_ROBOTS,
        length=config["tables"]["length"],
    script:
        "../scripts/run_step.py"


rule judge_claims:
    input:
        claims=f"{CONFIG}/paper/claims.csv",
        studies=expand(rules.repeat_studies.output.repeated, robot=REDUCED),
        table2=rules.tabulate_initial.output.table,
        extended=rules.tabulate_extended.output.table,
        scores=rules.tabulate_uses.output.scores,
        score_pairs=rules.tabulate_uses.output.pairs,
        budget=rules.tabulate_budget.output.budget,
        pairs=rules.tabulate_budget.output.pairs,
        simulated=rules.tabulate_simulated_designs.output.table,
    output:
        table=shown_table(
            "reports/tables/claims.csv", "claims", PAPER, "The paper's sentences, one by one"
        ),
    params:
        step="elastocal.study.claims.judge_claims",
        length=config["tables"]["length"],
    script:
        "../scripts/run_step.py"


rule typeset_table:
    input:
        table="reports/tables/{table}.csv",
    output:
        markdown="reports/tables/{table}.md",
        latex="reports/tables/{table}.tex",
    wildcard_constraints:
        table=r"table\d",
    script:
        "../scripts/typeset_table.py"
