"""Research questions beyond the paper's tables: how many springs (RQ1), which points (RQ2), which configurations (RQ3), which
metric (RQ4).

Needs the configuration alone, as the data sets are those of the study, drawn again in memory; tabulate_uses needs results/metrics/
and results/replicates/. Writes results/budget/{robot}.parquet, results/ladder/, simulated_designs/ and uses/ alike, and
from each tables of their names in reports/tables/.
"""

QUESTIONS = config["questions"]
AT_LENGTH = study_in_memory(configurations=config["tables"]["length"])
# Each question asked of one robot: its step in the package, folders of what it writes, and parameters.
ASKED = {
    "compare_point_sets": (
        "points",
        ["budget"],
        {"study": study_in_memory(), "point_sets": QUESTIONS["point_sets"]},
    ),
    "climb_ladder": (
        "ladder",
        ["ladder"],
        {
            "study": study_in_memory(),
            "lengths": QUESTIONS["ladder_lengths"],
            "noises": [1e-6 * noise for noise in QUESTIONS["ladder_noise_um"]],
        },
    ),
    "judge_in_use": (
        "uses",
        ["uses"],
        {
            "study": AT_LENGTH,
            "strategies": list(STUDY.strategies.values()),
            "uses": QUESTIONS["uses"],
        },
    ),
    "simulate_designs": (
        "designs",
        ["simulated_designs"],
        {
            "study": study_in_memory(),
            "candidates": QUESTIONS["candidates"],
            "sizes": QUESTIONS["simulated_designs"]["sizes"],
            "loads": QUESTIONS["simulated_designs"]["loads"],
        },
    ),
}
LENGTH = {"length": config["tables"]["length"]}
SETS_OF_POINTS = {
    "point_sets": QUESTIONS["point_sets"],
    "accuracies_um": QUESTIONS["accuracies_um"],
}
# Tables of all robots: the step, inputs, outputs with caption and what they show (none of those that no report shows), parameters.
TABULATED = {
    "tabulate_budget": (
        "points",
        {"budgets": "budget"},
        {
            "budget": ("budget", "budget", "Sets of points (RQ2)"),
            "pairs": ("budget_pairs",),
            "lengths": (
                "configurations_needed",
                "configurations_needed",
                "Configurations needed (RQ3)",
            ),
        },
        SETS_OF_POINTS | LENGTH,
    ),
    "tabulate_costs": (
        "points",
        {"budgets": "budget"},
        {"table": ("break_even",)},
        SETS_OF_POINTS
        | {
            "weights": {
                "seed": config["seed"],
                "replicates": config["evaluation"]["bootstrap_replicates"],
            }
        },
    ),
    "tabulate_ladder": (
        "ladder",
        {"ladders": "ladder"},
        {"table": ("ladder", "ladder", "Link springs (RQ1)")},
        {},
    ),
    "tabulate_simulated_designs": (
        "designs",
        {"designs": "simulated_designs"},
        {"table": ("simulated_designs", "simulated_designs", "Designs simulated (RQ3)")},
        {},
    ),
    "tabulate_uses": (
        "uses",
        {"uses": "uses"},
        {
            "scores": ("strategy_scores", "strategy_scores", "Strategies by metric (RQ4)"),
            "pairs": ("strategy_pairs",),
        },
        {"classical": NAMES[CLASSICAL]} | LENGTH,
    ),
}


for question, (module, folders, settings) in ASKED.items():
    step = f"elastocal.study.{module}.{question}"

    rule:
        name:
            question
        output:
            **{folder: f"results/{folder}/{{robot}}.parquet" for folder in folders},
        params:
            **settings,
            step=step,
        script:
            "../scripts/run_step.py"


for question, (module, given, made, settings) in TABULATED.items():
    # What links alone have is asked of robots with links.
    of = EXTENDED if question == "tabulate_ladder" else REDUCED
    given = {
        name: expand(f"results/{folder}/{{robot}}.parquet", robot=of)
        for name, folder in given.items()
    }
    given |= all_cells(of) if question == "tabulate_uses" else {}
    made = {name: table_of(file, ABOUT, *shows) for name, (file, *shows) in made.items()}
    STUDY_TABLES[question] = module, given, made, {"robots": of} | settings
