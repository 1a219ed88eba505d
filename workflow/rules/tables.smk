"""Tables: the paper's, those beside them, and the comparison with the printed figures.

Needs results/. Writes reports/tables/*.csv and, for each, the same as Markdown and LaTeX.
"""


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


INITIAL = {"initial": expand(rules.summarize_initial.output.initial, robot=config["robots"])}
AT = {"noise_um": config["tables"]["noise_um"], "length": config["tables"]["length"]}
STUDY_TABLES |= {
    "tabulate_compliances": (
        "tables",
        {},
        {"table": table_of("table1", PAPER, "table1", "Table 1: compliances")},
        {"robots": {name: STUDY.robots[name] for name in REDUCED}},
    ),
    "tabulate_initial": (
        "tables",
        INITIAL,
        {"table": table_of("table2", PAPER, "table2", "Table 2: deflection before calibration")},
        {
            "robots": config["robots"],
            "seed": config["seed"],
            "replicates": config["evaluation"]["bootstrap_replicates"],
        },
    ),
    "tabulate_identified": (
        "tables",
        {"metrics": cells("metrics", REDUCED, TABLE_NOISE, CLASSICAL)},
        {"table": table_of("table3", PAPER, "table3", "Table 3: identified compliances")},
        {"robots": REDUCED, "strategy": NAMES[CLASSICAL]} | AT,
    ),
    "tabulate_strategies": (
        "tables",
        all_cells(REDUCED),
        {"table": table_of("table4", PAPER, "table4", "Table 4: strategies")},
        {
            "robots": REDUCED,
            "strategies": {name: key for key, name in NAMES.items()},
            "cells": {
                key: value for key, value in config["tables"].items() if key != "classical_strategy"
            },
        },
    ),
    "tabulate_extended": (
        "tables",
        all_cells(EXTENDED),
        {"table": table_of("extended", ABOUT, "extended", "Elastic links")},
        {"robots": EXTENDED, "strategies": list(NAMES.values())} | AT,
    ),
    "compare_with_paper": (
        "printed",
        REFERENCE
        | {
            name: f"reports/tables/{name}.csv"
            for name in ("table1", "table2", "table3", "table4", "extended")
        }
        | all_cells(config["robots"]),
        {
            "table": table_of(
                "beside_paper", PAPER, "beside_paper", "Every printed figure beside ours"
            )
        },
        AT,
    ),
    "compare_with_studies": (
        "printed",
        {"beside": "reports/tables/beside_paper.csv"} | ONE_STUDY | INITIAL | REFERENCE,
        {
            "table": table_of(
                "comparison", PAPER, "comparison", "Every printed figure among further studies"
            ),
            "joint": table_of("joint_test", PAPER),
        },
        {"robots": config["robots"], "length": config["tables"]["length"]},
    ),
}


for tabulated, (module, given, made, settings) in STUDY_TABLES.items():
    step = f"elastocal.study.{module}.{tabulated}"

    rule:
        name:
            tabulated
        input:
            **given,
        output:
            **made,
        params:
            **settings,
            step=step,
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
