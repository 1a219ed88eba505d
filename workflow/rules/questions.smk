"""Research questions beyond the paper's tables: how many springs (RQ1), which points (RQ2), which configurations (RQ3), which
metric (RQ4), and what the assumptions are worth.

Needs the configuration alone, as the data sets are those of the study, drawn again in memory; tabulate_uses needs results/metrics/
and results/replicates/. Writes results/budget/{robot}.parquet, and results/places/, ladder/, designs/, observability/, uses/,
geometry/, weighting/ and tubes/ alike, and from each tables of their names in reports/tables/.
"""

QUESTIONS = config["questions"]


rule compare_point_sets:
    input:
        sources=sources("compare_point_sets.py"),
    output:
        budget="results/budget/{robot}.parquet",
    log:
        "results/logs/compare_point_sets/{robot}.log",
    benchmark:
        "results/timings/compare_point_sets/{robot}.tsv"
    params:
        study=study_in_memory(),
        point_sets=QUESTIONS["point_sets"],
    script:
        "../scripts/compare_point_sets.py"


rule climb_ladder:
    input:
        sources=sources("climb_ladder.py"),
    output:
        ladder="results/ladder/{robot}.parquet",
    log:
        "results/logs/climb_ladder/{robot}.log",
    benchmark:
        "results/timings/climb_ladder/{robot}.tsv"
    params:
        study=study_in_memory(),
        lengths=QUESTIONS["ladder_lengths"],
        noises=[1e-6 * noise for noise in QUESTIONS["ladder_noise_um"]],
    script:
        "../scripts/climb_ladder.py"


rule choose_designs:
    input:
        sources=sources("choose_designs.py"),
    output:
        designs="results/designs/{robot}.parquet",
    log:
        "results/logs/choose_designs/{robot}.log",
    benchmark:
        "results/timings/choose_designs/{robot}.tsv"
    params:
        study=study_in_memory(),
        candidates=QUESTIONS["candidates"],
        sizes=QUESTIONS["design_sizes"],
    script:
        "../scripts/choose_designs.py"


rule index_observability:
    input:
        sources=sources("index_observability.py"),
    output:
        observability="results/observability/{robot}.parquet",
    log:
        "results/logs/index_observability/{robot}.log",
    benchmark:
        "results/timings/index_observability/{robot}.tsv"
    params:
        study=study_in_memory(configurations=config["tables"]["length"]),
    script:
        "../scripts/index_observability.py"


rule tabulate_budget:
    input:
        budgets=expand(rules.compare_point_sets.output.budget, robot=REDUCED),
        sources=sources("tabulate_budget.py"),
    output:
        budget=shown(
            "reports/tables/budget.csv", "budget", "Questions beyond the paper", shows="Sets of points (RQ2)", kind="table"
        ),
        pairs="reports/tables/budget_pairs.csv",
        lengths=shown(
            "reports/tables/configurations_needed.csv",
            "configurations_needed",
            "Questions beyond the paper",
            shows="Configurations needed (RQ3)",
            kind="table",
        ),
    log:
        "results/logs/tabulate_budget.log",
    benchmark:
        "results/timings/tabulate_budget.tsv"
    params:
        robots=REDUCED,
        point_sets=QUESTIONS["point_sets"],
        accuracies_um=QUESTIONS["accuracies_um"],
        length=config["tables"]["length"],
    script:
        "../scripts/tabulate_budget.py"


rule tabulate_ladder:
    input:
        ladders=expand(rules.climb_ladder.output.ladder, robot=EXTENDED),
        sources=sources("tabulate_ladder.py"),
    output:
        table=shown(
            "reports/tables/ladder.csv", "ladder", "Questions beyond the paper", shows="Link springs (RQ1)", kind="table"
        ),
    log:
        "results/logs/tabulate_ladder.log",
    benchmark:
        "results/timings/tabulate_ladder.tsv"
    params:
        robots=EXTENDED,
    script:
        "../scripts/tabulate_ladder.py"


rule tabulate_designs:
    input:
        designs=expand(rules.choose_designs.output.designs, robot=REDUCED),
        sources=sources("tabulate_designs.py"),
    output:
        table=shown(
            "reports/tables/designs.csv", "designs", "Questions beyond the paper", shows="Optimal designs (RQ3)", kind="table"
        ),
    log:
        "results/logs/tabulate_designs.log",
    benchmark:
        "results/timings/tabulate_designs.tsv"
    params:
        robots=REDUCED,
    script:
        "../scripts/tabulate_designs.py"


rule tabulate_observability:
    input:
        observabilities=expand(rules.index_observability.output.observability, robot=REDUCED),
        sources=sources("tabulate_observability.py"),
    output:
        table=shown(
            "reports/tables/observability.csv",
            "observability",
            "Questions beyond the paper",
            shows="Observability indices (RQ3)",
            kind="table",
        ),
    log:
        "results/logs/tabulate_observability.log",
    benchmark:
        "results/timings/tabulate_observability.tsv"
    params:
        robots=REDUCED,
    script:
        "../scripts/tabulate_observability.py"


rule vary_assumptions:
    input:
        sources=sources("vary_assumptions.py"),
    output:
        geometry="results/geometry/{robot}.parquet",
        weighting="results/weighting/{robot}.parquet",
    log:
        "results/logs/vary_assumptions/{robot}.log",
    benchmark:
        "results/timings/vary_assumptions/{robot}.tsv"
    params:
        study=study_in_memory(configurations=config["tables"]["length"]),
        geometry=QUESTIONS["geometry_errors"],
        weighting=QUESTIONS["unequal_noise"] | {"tracker_m": QUESTIONS["tracker_m"]},
    script:
        "../scripts/vary_assumptions.py"


rule tabulate_assumptions:
    input:
        geometries=expand(rules.vary_assumptions.output.geometry, robot=REDUCED),
        weightings=expand(rules.vary_assumptions.output.weighting, robot=REDUCED),
        sources=sources("tabulate_assumptions.py"),
    output:
        geometry=shown(
            "reports/tables/geometry.csv", "geometry", "Questions beyond the paper", shows="Known geometry", kind="table"
        ),
        weighting=shown(
            "reports/tables/weighting.csv", "weighting", "Questions beyond the paper", shows="Equal weights", kind="table"
        ),
    log:
        "results/logs/tabulate_assumptions.log",
    benchmark:
        "results/timings/tabulate_assumptions.tsv"
    params:
        robots=REDUCED,
    script:
        "../scripts/tabulate_assumptions.py"


rule map_arm:
    input:
        sources=sources("map_arm.py"),
    output:
        places="results/places/{robot}.parquet",
    log:
        "results/logs/map_arm/{robot}.log",
    benchmark:
        "results/timings/map_arm/{robot}.tsv"
    params:
        study=study_in_memory(configurations=config["tables"]["length"]),
        tracker_m=QUESTIONS["tracker_m"],
        arm_points=QUESTIONS["arm_points"],
    script:
        "../scripts/map_arm.py"


rule judge_in_use:
    input:
        sources=sources("judge_in_use.py"),
    output:
        uses="results/uses/{robot}.parquet",
    log:
        "results/logs/judge_in_use/{robot}.log",
    benchmark:
        "results/timings/judge_in_use/{robot}.tsv"
    params:
        study=study_in_memory(configurations=config["tables"]["length"]),
        strategies=list(STUDY.strategies.values()),
        uses=QUESTIONS["uses"],
    script:
        "../scripts/judge_in_use.py"


rule vary_tubes:
    input:
        sources=sources("vary_tubes.py"),
    output:
        tubes="results/tubes/{robot}.parquet",
    log:
        "results/logs/vary_tubes/{robot}.log",
    benchmark:
        "results/timings/vary_tubes/{robot}.tsv"
    params:
        study=study_in_memory(),
        factors=QUESTIONS["tube_factors"],
        length=config["tables"]["length"],
    script:
        "../scripts/vary_tubes.py"


rule tabulate_places:
    input:
        places=expand(rules.map_arm.output.places, robot=REDUCED),
        sources=sources("tabulate_places.py"),
    output:
        table=shown(
            "reports/tables/places.csv",
            "places",
            "Questions beyond the paper",
            shows="Places of a second target (RQ2)",
            kind="table",
        ),
    log:
        "results/logs/tabulate_places.log",
    benchmark:
        "results/timings/tabulate_places.tsv"
    params:
        robots=REDUCED,
    script:
        "../scripts/tabulate_places.py"


rule tabulate_uses:
    input:
        uses=expand(rules.judge_in_use.output.uses, robot=REDUCED),
        metrics=cells("metrics", REDUCED, TABLE_NOISE),
        replicates=cells("replicates", REDUCED, TABLE_NOISE),
        sources=sources("tabulate_uses.py"),
    output:
        scores=shown(
            "reports/tables/strategy_scores.csv",
            "strategy_scores",
            "Questions beyond the paper",
            shows="Strategies by metric (RQ4)",
            kind="table",
        ),
        pairs="reports/tables/strategy_pairs.csv",
    log:
        "results/logs/tabulate_uses.log",
    benchmark:
        "results/timings/tabulate_uses.tsv"
    params:
        robots=REDUCED,
        classical=NAMES[CLASSICAL],
        length=config["tables"]["length"],
    script:
        "../scripts/tabulate_uses.py"


rule tabulate_tubes:
    input:
        tubes=expand(rules.vary_tubes.output.tubes, robot=EXTENDED),
        sources=sources("tabulate_tubes.py"),
    output:
        table=shown(
            "reports/tables/tubes.csv", "tubes", "Questions beyond the paper", shows="Tubes of other diameters", kind="table"
        ),
    log:
        "results/logs/tabulate_tubes.log",
    benchmark:
        "results/timings/tabulate_tubes.tsv"
    params:
        robots=EXTENDED,
    script:
        "../scripts/tabulate_tubes.py"


rule compare_few:
    input:
        sources=sources("compare_few.py"),
    output:
        few="results/few/{robot}.parquet",
    log:
        "results/logs/compare_few/{robot}.log",
    benchmark:
        "results/timings/compare_few/{robot}.tsv"
    params:
        study=study_in_memory(configurations=QUESTIONS["few"]["configurations"]),
        strategies=STUDY.few,
        nominal_errors=QUESTIONS["few"]["nominal_errors"],
    script:
        "../scripts/compare_few.py"


rule compare_kinds:
    input:
        sources=sources("compare_kinds.py"),
    output:
        kinds="results/kinds/{robot}.parquet",
    log:
        "results/logs/compare_kinds/{robot}.log",
    benchmark:
        "results/timings/compare_kinds/{robot}.tsv"
    params:
        study=study_in_memory(configurations=2 * config["tables"]["length"]),
        reflectors=QUESTIONS["kinds"]["reflectors_m"],
        encoders_rad=[1e-6 * noise for noise in QUESTIONS["kinds"]["encoders_urad"]],
    script:
        "../scripts/compare_kinds.py"


rule simulate_designs:
    input:
        sources=sources("simulate_designs.py"),
    output:
        designs="results/simulated_designs/{sizes}/{robot}.parquet",
    log:
        "results/logs/simulate_designs/{sizes}/{robot}.log",
    benchmark:
        "results/timings/simulate_designs/{sizes}/{robot}.tsv"
    wildcard_constraints:
        sizes="few|every",
    params:
        study=study_in_memory(),
        candidates=QUESTIONS["candidates"],
        sizes=lambda wildcards: QUESTIONS["simulated_designs"]["sizes"][wildcards.sizes],
        loads=QUESTIONS["simulated_designs"]["loads"],
        uses=QUESTIONS["uses"],
    script:
        "../scripts/simulate_designs.py"


rule check_claims:
    input:
        sources=sources("check_claims.py"),
    output:
        stiffness="results/stiffness/{robot}.parquet",
        starts="results/starts/{robot}.parquet",
    log:
        "results/logs/check_claims/{robot}.log",
    benchmark:
        "results/timings/check_claims/{robot}.tsv"
    params:
        study=study_in_memory(configurations=config["tables"]["length"]),
        strategy=STUDY.strategies[CLASSICAL],
        forces_N=QUESTIONS["forces_N"],
        starts=[1e-6 * start for start in QUESTIONS["starts_urad_per_Nm"]],
    script:
        "../scripts/check_claims.py"


rule tabulate_decisions:
    input:
        few=expand(rules.compare_few.output.few, robot=REDUCED),
        kinds=expand(rules.compare_kinds.output.kinds, robot=REDUCED),
        stiffness=expand(rules.check_claims.output.stiffness, robot=REDUCED),
        starts=expand(rules.check_claims.output.starts, robot=REDUCED),
        sources=sources("tabulate_decisions.py"),
    output:
        few=shown(
            "reports/tables/few_configurations.csv",
            "few_configurations",
            "Questions beyond the paper",
            shows="Fewer than ten configurations",
            kind="table",
        ),
        kinds=shown(
            "reports/tables/measurement_kinds.csv",
            "measurement_kinds",
            "Questions beyond the paper",
            shows="What to measure (RQ2)",
            kind="table",
        ),
        stiffness="reports/tables/stiffness.csv",
        starts="reports/tables/starts.csv",
    log:
        "results/logs/tabulate_decisions.log",
    benchmark:
        "results/timings/tabulate_decisions.tsv"
    params:
        robots=REDUCED,
        length=config["tables"]["length"],
    script:
        "../scripts/tabulate_decisions.py"


rule tabulate_simulated_designs:
    input:
        designs=expand(rules.simulate_designs.output.designs, robot=REDUCED, allow_missing=True),
        sources=sources("tabulate_simulated_designs.py"),
    output:
        table=shown(
            "reports/tables/simulated_designs_{sizes}.csv",
            "simulated_designs",
            "Questions beyond the paper",
            shows="Designs simulated, {sizes} sizes (RQ3)",
            kind="table",
        ),
    log:
        "results/logs/tabulate_simulated_designs/{sizes}.log",
    benchmark:
        "results/timings/tabulate_simulated_designs/{sizes}.tsv"
    params:
        robots=REDUCED,
    script:
        "../scripts/tabulate_simulated_designs.py"


rule tabulate_costs:
    input:
        budgets=expand(rules.compare_point_sets.output.budget, robot=REDUCED),
        sources=sources("tabulate_costs.py"),
    output:
        costs=shown(
            "reports/tables/costs.csv", "costs", "Questions beyond the paper", shows="Cost of an accuracy (RQ2)", kind="table"
        ),
        break_even="reports/tables/break_even.csv",
    log:
        "results/logs/tabulate_costs.log",
    benchmark:
        "results/timings/tabulate_costs.tsv"
    params:
        robots=REDUCED,
        point_sets=QUESTIONS["point_sets"],
        accuracies_um=QUESTIONS["accuracies_um"],
        weights={"seed": config["seed"], "replicates": config["evaluation"]["bootstrap_replicates"]},
    script:
        "../scripts/tabulate_costs.py"
