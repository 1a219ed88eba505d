"""Tables: the paper's, those beside them, and the comparison with the printed figures.

Needs results/. Writes reports/tables/*.csv and, for each, the same as Markdown and LaTeX.
"""


rule summarize_initial:
    input:
        ideal="data/simulated/{robot}/ideal.parquet",
        sources=sources("summarize_initial.py"),
    output:
        initial="results/initial/{robot}.parquet",
    log:
        "results/logs/summarize_initial/{robot}.log",
    benchmark:
        "results/timings/summarize_initial/{robot}.tsv"
    params:
        seed=config["seed"],
        end_effector=lambda wildcards: STUDY.end_effectors[wildcards.robot],
    script:
        "../scripts/summarize_initial.py"


rule compare_solvers:
    input:
        experiments="data/simulated/{robot}/experiments.parquet",
        measured=f"data/simulated/{{robot}}/{TABLE_NOISE}um/measured.parquet",
        sources=sources("compare_solvers.py"),
    output:
        solvers="results/solvers/{robot}.parquet",
    log:
        "results/logs/compare_solvers/{robot}.log",
    benchmark:
        "results/timings/compare_solvers/{robot}.tsv"
    params:
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
        "../scripts/compare_solvers.py"


rule tabulate_compliances:
    input:
        sources=sources("tabulate_compliances.py"),
    output:
        table=shown(
            "reports/tables/table1.csv",
            "table1",
            "Tables and figures of the paper",
            shows="Table 1: compliances",
            kind="table",
        ),
    log:
        "results/logs/tabulate_compliances.log",
    benchmark:
        "results/timings/tabulate_compliances.tsv"
    params:
        robots={name: STUDY.robots[name] for name in REDUCED},
    script:
        "../scripts/tabulate_compliances.py"


rule tabulate_initial:
    input:
        initial=expand(rules.summarize_initial.output.initial, robot=config["robots"]),
        sources=sources("tabulate_initial.py"),
    output:
        table=shown(
            "reports/tables/table2.csv",
            "table2",
            "Tables and figures of the paper",
            shows="Table 2: deflection before calibration",
            kind="table",
        ),
    log:
        "results/logs/tabulate_initial.log",
    benchmark:
        "results/timings/tabulate_initial.tsv"
    params:
        robots=config["robots"],
        seed=config["seed"],
        replicates=config["evaluation"]["bootstrap_replicates"],
    script:
        "../scripts/tabulate_initial.py"


rule tabulate_identified:
    input:
        metrics=cells("metrics", REDUCED, TABLE_NOISE, CLASSICAL),
        sources=sources("tabulate_identified.py"),
    output:
        table=shown(
            "reports/tables/table3.csv",
            "table3",
            "Tables and figures of the paper",
            shows="Table 3: identified compliances",
            kind="table",
        ),
    log:
        "results/logs/tabulate_identified.log",
    benchmark:
        "results/timings/tabulate_identified.tsv"
    params:
        robots=REDUCED,
        strategy=NAMES[CLASSICAL],
        noise_um=config["tables"]["noise_um"],
        length=config["tables"]["length"],
    script:
        "../scripts/tabulate_identified.py"


rule tabulate_strategies:
    input:
        metrics=cells("metrics", REDUCED, TABLE_NOISE),
        replicates=cells("replicates", REDUCED, TABLE_NOISE),
        sources=sources("tabulate_strategies.py"),
    output:
        table=shown(
            "reports/tables/table4.csv", "table4", "Tables and figures of the paper", shows="Table 4: strategies", kind="table"
        ),
    log:
        "results/logs/tabulate_strategies.log",
    benchmark:
        "results/timings/tabulate_strategies.tsv"
    params:
        robots=REDUCED,
        strategies={name: key for key, name in NAMES.items()},
        cells={key: value for key, value in config["tables"].items() if key != "classical_strategy"},
    script:
        "../scripts/tabulate_strategies.py"


rule tabulate_extended:
    input:
        metrics=cells("metrics", EXTENDED, TABLE_NOISE),
        replicates=cells("replicates", EXTENDED, TABLE_NOISE),
        sources=sources("tabulate_extended.py"),
    output:
        table=shown(
            "reports/tables/extended.csv", "extended", "Questions beyond the paper", shows="Elastic links", kind="table"
        ),
    log:
        "results/logs/tabulate_extended.log",
    benchmark:
        "results/timings/tabulate_extended.tsv"
    params:
        robots=EXTENDED,
        strategies=list(NAMES.values()),
        noise_um=config["tables"]["noise_um"],
        length=config["tables"]["length"],
    script:
        "../scripts/tabulate_extended.py"


rule tabulate_accuracy:
    input:
        accuracy=cells("accuracy", config["robots"], NOISE),
        bounds=expand(rules.bound.output.bounds, robot=config["robots"]),
        sources=sources("tabulate_accuracy.py"),
    output:
        table=shown(
            "reports/tables/per_dataset.csv",
            "per_dataset",
            "Questions beyond the paper",
            shows="Accuracy of one data set",
            kind="table",
        ),
    log:
        "results/logs/tabulate_accuracy.log",
    benchmark:
        "results/timings/tabulate_accuracy.tsv"
    params:
        robots=config["robots"],
        points={NAMES[name]: list(points) for name, points in STUDY.points.items()},
        slugs={name: key for key, name in NAMES.items()},
    script:
        "../scripts/tabulate_accuracy.py"


rule tabulate_solvers:
    input:
        solvers=expand(rules.compare_solvers.output.solvers, robot=REDUCED),
        sources=sources("tabulate_solvers.py"),
    output:
        table=shown(
            "reports/tables/solvers.csv",
            "solvers",
            "Questions beyond the paper",
            shows="Strategies that are one estimator",
            kind="table",
        ),
    log:
        "results/logs/tabulate_solvers.log",
    benchmark:
        "results/timings/tabulate_solvers.tsv"
    params:
        robots=REDUCED,
        joints=[len(STUDY.robots[name]["compliance_urad_per_Nm"]) for name in REDUCED],
    script:
        "../scripts/tabulate_solvers.py"


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
        sources=sources("compare_with_paper.py"),
    output:
        table=shown(
            "reports/tables/beside_paper.csv",
            "beside_paper",
            "Tables and figures of the paper",
            shows="Every printed figure beside ours",
            kind="table",
        ),
    log:
        "results/logs/compare_with_paper.log",
    benchmark:
        "results/timings/compare_with_paper.tsv"
    params:
        noise_um=config["tables"]["noise_um"],
        length=config["tables"]["length"],
    script:
        "../scripts/compare_with_paper.py"


rule compare_with_studies:
    input:
        beside=rules.compare_with_paper.output.table,
        studies=expand(rules.repeat_studies.output.repeated, interpretation=USUAL, robot=REDUCED),
        initial=expand(rules.summarize_initial.output.initial, robot=config["robots"]),
        sources=sources("compare_with_studies.py"),
    output:
        table=shown(
            "reports/tables/comparison.csv",
            "comparison",
            "Tables and figures of the paper",
            shows="Every printed figure among further studies",
            kind="table",
        ),
    log:
        "results/logs/compare_with_studies.log",
    benchmark:
        "results/timings/compare_with_studies.tsv"
    params:
        robots=config["robots"],
        length=config["tables"]["length"],
    script:
        "../scripts/compare_with_studies.py"


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
