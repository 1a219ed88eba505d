"""Tables: the paper's, those beside them, and the comparison with the printed figures.

Needs results/. Writes reports/tables/*.csv and, for each, the same as Markdown and LaTeX.
"""


rule summarize_initial:
    input:
        ideal="data/simulated/{robot}/ideal.parquet",
        sources=sources("elastocal.study.simulation.summarize_initial"),
    output:
        initial="results/initial/{robot}.parquet",
    log:
        "results/logs/summarize_initial/{robot}.log",
    benchmark:
        "results/timings/summarize_initial/{robot}.tsv"
    params:
        step="elastocal.study.simulation.summarize_initial",
        seed=config["seed"],
        end_effector=lambda wildcards: STUDY.end_effectors[wildcards.robot],
    script:
        "../scripts/run_step.py"


rule compare_solvers:
    input:
        experiments="data/simulated/{robot}/experiments.parquet",
        measured=f"data/simulated/{{robot}}/{TABLE_NOISE}um/measured.parquet",
        sources=sources("elastocal.study.solvers.compare_solvers"),
    output:
        solvers="results/solvers/{robot}.parquet",
    log:
        "results/logs/compare_solvers/{robot}.log",
    benchmark:
        "results/timings/compare_solvers/{robot}.tsv"
    params:
        step="elastocal.study.solvers.compare_solvers",
        chain=lambda wildcards: robot_document(wildcards)["chain"],
        lengths_m=lambda wildcards: robot_document(wildcards).get("lengths_m", {}),
        strategies=list(STUDY.strategies.values()),
        seed=config["seed"],
        rows=rows_read(INTERPRETATIONS["measured"]),
        tool_offset_m=INTERPRETATIONS["tool_offset_m"],
        wrench_at=INTERPRETATIONS["wrench_at"],
        length=config["tables"]["length"],
        start=1e-6 * config["identification"]["start_urad_per_Nm"],
    script:
        "../scripts/run_step.py"


rule tabulate_compliances:
    input:
        sources=sources("elastocal.study.tables.tabulate_compliances"),
    output:
        table=table_of("table1", PAPER, "table1", "Table 1: compliances"),
    log:
        "results/logs/tabulate_compliances.log",
    benchmark:
        "results/timings/tabulate_compliances.tsv"
    params:
        step="elastocal.study.tables.tabulate_compliances",
        robots={name: STUDY.robots[name] for name in REDUCED},
    script:
        "../scripts/run_step.py"


rule tabulate_initial:
    input:
        initial=expand(rules.summarize_initial.output.initial, robot=config["robots"]),
        sources=sources("elastocal.study.tables.tabulate_initial"),
    output:
        table=table_of("table2", PAPER, "table2", "Table 2: deflection before calibration"),
    log:
        "results/logs/tabulate_initial.log",
    benchmark:
        "results/timings/tabulate_initial.tsv"
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
        sources=sources("elastocal.study.tables.tabulate_identified"),
    output:
        table=table_of("table3", PAPER, "table3", "Table 3: identified compliances"),
    log:
        "results/logs/tabulate_identified.log",
    benchmark:
        "results/timings/tabulate_identified.tsv"
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
        sources=sources("elastocal.study.tables.tabulate_strategies"),
    output:
        table=table_of("table4", PAPER, "table4", "Table 4: strategies"),
    log:
        "results/logs/tabulate_strategies.log",
    benchmark:
        "results/timings/tabulate_strategies.tsv"
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
        sources=sources("elastocal.study.tables.tabulate_extended"),
    output:
        table=table_of("extended", ABOUT, "extended", "Elastic links"),
    log:
        "results/logs/tabulate_extended.log",
    benchmark:
        "results/timings/tabulate_extended.tsv"
    params:
        step="elastocal.study.tables.tabulate_extended",
        robots=EXTENDED,
        strategies=list(NAMES.values()),
        noise_um=config["tables"]["noise_um"],
        length=config["tables"]["length"],
    script:
        "../scripts/run_step.py"


rule tabulate_accuracy:
    input:
        accuracy=cells("accuracy", config["robots"], NOISE),
        bounds=expand(rules.bound.output.bounds, robot=config["robots"]),
        sources=sources("elastocal.study.tables.tabulate_accuracy"),
    output:
        table=table_of("per_dataset", ABOUT, "per_dataset", "Accuracy of one data set"),
    log:
        "results/logs/tabulate_accuracy.log",
    benchmark:
        "results/timings/tabulate_accuracy.tsv"
    params:
        step="elastocal.study.tables.tabulate_accuracy",
        robots=config["robots"],
        points={NAMES[name]: list(points) for name, points in STUDY.points.items()},
        slugs={name: key for key, name in NAMES.items()},
    script:
        "../scripts/run_step.py"


rule tabulate_solvers:
    input:
        solvers=expand(rules.compare_solvers.output.solvers, robot=REDUCED),
        sources=sources("elastocal.study.solvers.tabulate_solvers"),
    output:
        table=table_of("solvers", ABOUT, "solvers", "Strategies that are one estimator"),
    log:
        "results/logs/tabulate_solvers.log",
    benchmark:
        "results/timings/tabulate_solvers.tsv"
    params:
        step="elastocal.study.solvers.tabulate_solvers",
        robots=REDUCED,
        joints=[len(STUDY.robots[name]["compliance_urad_per_Nm"]) for name in REDUCED],
    script:
        "../scripts/run_step.py"


rule compare_with_paper:
    input:
        reference=f"{CONFIG}/paper/reference.csv",
        table1=rules.tabulate_compliances.output.table,
        table2=rules.tabulate_initial.output.table,
        table3=rules.tabulate_identified.output.table,
        table4=rules.tabulate_strategies.output.table,
        extended=rules.tabulate_extended.output.table,
        metrics=cells("metrics", config["robots"], TABLE_NOISE),
        replicates=cells("replicates", config["robots"], TABLE_NOISE),
        sources=sources("elastocal.study.printed.compare_with_paper"),
    output:
        table=table_of("beside_paper", PAPER, "beside_paper", "Every printed figure beside ours"),
    log:
        "results/logs/compare_with_paper.log",
    benchmark:
        "results/timings/compare_with_paper.tsv"
    params:
        step="elastocal.study.printed.compare_with_paper",
        noise_um=config["tables"]["noise_um"],
        length=config["tables"]["length"],
    script:
        "../scripts/run_step.py"


rule compare_with_studies:
    input:
        beside=rules.compare_with_paper.output.table,
        studies=expand(rules.repeat_studies.output.repeated, interpretation=USUAL, robot=REDUCED),
        initial=expand(rules.summarize_initial.output.initial, robot=config["robots"]),
        sources=sources("elastocal.study.printed.compare_with_studies"),
    output:
        table=table_of("comparison", PAPER, "comparison", "Every printed figure among further studies"),
    log:
        "results/logs/compare_with_studies.log",
    benchmark:
        "results/timings/compare_with_studies.tsv"
    params:
        step="elastocal.study.printed.compare_with_studies",
        robots=config["robots"],
        length=config["tables"]["length"],
    script:
        "../scripts/run_step.py"


rule typeset_table:
    input:
        table="reports/tables/{table}.csv",
        sources=sources("typeset_table.py"),
    output:
        markdown="reports/tables/{table}.md",
        latex="reports/tables/{table}.tex",
    log:
        "results/logs/typeset_table/{table}.log",
    benchmark:
        "results/timings/typeset_table/{table}.tsv"
    wildcard_constraints:
        table=r"table\d",
    script:
        "../scripts/typeset_table.py"
