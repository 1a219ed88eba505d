"""Research questions beyond the paper's tables: how many springs (RQ1), which points (RQ2), which configurations (RQ3), which
metric (RQ4).

Needs only the configuration, because the data sets of the study are drawn again in memory; tabulate_uses also needs
results/metrics/ and results/replicates/. Writes results/budget/, results/ladder/, results/simulated_designs/ and results/uses/, each
with {robot}.parquet, and the tables of the same names in reports/tables/.
"""

QUESTIONS = config["questions"]


rule compare_point_sets:
    output:
        budget="results/budget/{robot}.parquet",
    params:
        step="elastocal.study.points.compare_point_sets",
        study=study_in_memory(),
        point_sets=QUESTIONS["point_sets"],
    script:
        "../scripts/run_step.py"


rule climb_ladder:
    output:
        ladder="results/ladder/{robot}.parquet",
    params:
        step="elastocal.study.ladder.climb_ladder",
        study=study_in_memory(),
        lengths=QUESTIONS["ladder_lengths"],
        noises=[1e-6 * noise for noise in QUESTIONS["ladder_noise_um"]],
    script:
        "../scripts/run_step.py"


rule judge_in_use:
    output:
        uses="results/uses/{robot}.parquet",
    params:
        step="elastocal.study.uses.judge_in_use",
        study=study_in_memory(configurations=config["tables"]["length"]),
        strategies=list(STUDY.strategies.values()),
        uses=QUESTIONS["uses"],
    script:
        "../scripts/run_step.py"


rule simulate_designs:
    output:
        simulated_designs="results/simulated_designs/{robot}.parquet",
    params:
        step="elastocal.study.designs.simulate_designs",
        study=study_in_memory(),
        candidates=QUESTIONS["candidates"],
        sizes=QUESTIONS["simulated_designs"]["sizes"],
        loads=QUESTIONS["simulated_designs"]["loads"],
    script:
        "../scripts/run_step.py"


rule tabulate_budget:
    input:
        budgets=expand(rules.compare_point_sets.output.budget, robot=REDUCED),
    output:
        budget=shown_table(
            "reports/tables/budget.csv", "budget", QUESTIONS_BEYOND, "Sets of points (RQ2)"
        ),
        pairs="reports/tables/budget_pairs.csv",
        lengths=shown_table(
            "reports/tables/configurations_needed.csv",
            "configurations_needed",
            QUESTIONS_BEYOND,
            "Configurations needed (RQ3)",
        ),
    params:
        step="elastocal.study.points.tabulate_budget",
        robots=REDUCED,
        point_sets=QUESTIONS["point_sets"],
        accuracies_um=QUESTIONS["accuracies_um"],
        length=config["tables"]["length"],
    script:
        "../scripts/run_step.py"


rule tabulate_costs:
    input:
        budgets=expand(rules.compare_point_sets.output.budget, robot=REDUCED),
    output:
        table="reports/tables/break_even.csv",
    params:
        step="elastocal.study.points.tabulate_costs",
        robots=REDUCED,
        point_sets=QUESTIONS["point_sets"],
        accuracies_um=QUESTIONS["accuracies_um"],
        weights={
            "seed": config["seed"],
            "replicates": config["evaluation"]["bootstrap_replicates"],
        },
    script:
        "../scripts/run_step.py"


rule tabulate_ladder:
    input:
        # Only a robot with elastic links has link springs to add.
        ladders=expand(rules.climb_ladder.output.ladder, robot=EXTENDED),
    output:
        table=shown_table(
            "reports/tables/ladder.csv", "ladder", QUESTIONS_BEYOND, "Link springs (RQ1)"
        ),
    params:
        step="elastocal.study.ladder.tabulate_ladder",
        robots=EXTENDED,
    script:
        "../scripts/run_step.py"


rule tabulate_simulated_designs:
    input:
        designs=expand(rules.simulate_designs.output.simulated_designs, robot=REDUCED),
    output:
        table=shown_table(
            "reports/tables/simulated_designs.csv",
            "simulated_designs",
            QUESTIONS_BEYOND,
            "Designs simulated (RQ3)",
        ),
    params:
        step="elastocal.study.designs.tabulate_simulated_designs",
        robots=REDUCED,
    script:
        "../scripts/run_step.py"


rule tabulate_uses:
    input:
        uses=expand(rules.judge_in_use.output.uses, robot=REDUCED),
        metrics=cells("metrics", REDUCED, TABLE_NOISE),
        replicates=cells("replicates", REDUCED, TABLE_NOISE),
    output:
        scores=shown_table(
            "reports/tables/strategy_scores.csv",
            "strategy_scores",
            QUESTIONS_BEYOND,
            "Strategies by metric (RQ4)",
        ),
        pairs="reports/tables/strategy_pairs.csv",
    params:
        step="elastocal.study.uses.tabulate_uses",
        robots=REDUCED,
        classical=NAMES[CLASSICAL],
        length=config["tables"]["length"],
    script:
        "../scripts/run_step.py"
