"""Research questions beyond the paper's tables: how many springs (RQ1), which points (RQ2), which configurations (RQ3), which
metric (RQ4), and what the assumptions are worth.

Needs the configuration alone, as the data sets are those of the study, drawn again in memory; tabulate_uses needs results/metrics/
and results/replicates/. Writes results/budget/{robot}.parquet, and results/places/, ladder/, designs/, observability/, uses/,
geometry/, weighting/, tubes/ and so on alike, and from each tables of their names in reports/tables/.
"""

QUESTIONS = config["questions"]
AT_LENGTH = study_in_memory(configurations=config["tables"]["length"])
# Each question asked of one robot: its step in the package, folders of what it writes, and parameters.
ASKED = {
    "compare_point_sets": ("points", ["budget"], {"study": study_in_memory(), "point_sets": QUESTIONS["point_sets"]}),
    "climb_ladder": (
        "ladder",
        ["ladder"],
        {
            "study": study_in_memory(),
            "lengths": QUESTIONS["ladder_lengths"],
            "noises": [1e-6 * noise for noise in QUESTIONS["ladder_noise_um"]],
        },
    ),
    "choose_designs": (
        "designs",
        ["designs"],
        {"study": study_in_memory(), "candidates": QUESTIONS["candidates"], "sizes": QUESTIONS["design_sizes"]},
    ),
    "index_observability": ("designs", ["observability"], {"study": AT_LENGTH}),
    "vary_assumptions": (
        "assumptions",
        ["geometry", "weighting"],
        {
            "study": AT_LENGTH,
            "geometry": QUESTIONS["geometry_errors"],
            "weighting": QUESTIONS["unequal_noise"] | {"tracker_m": QUESTIONS["tracker_m"]},
        },
    ),
    "map_arm": (
        "arm_points",
        ["places"],
        {"study": AT_LENGTH, "tracker_m": QUESTIONS["tracker_m"], "arm": QUESTIONS["arm_points"]},
    ),
    "judge_in_use": (
        "uses",
        ["uses"],
        {"study": AT_LENGTH, "strategies": list(STUDY.strategies.values()), "uses": QUESTIONS["uses"]},
    ),
    "vary_tubes": (
        "assumptions",
        ["tubes"],
        {"study": study_in_memory(), "factors": QUESTIONS["tube_factors"], "length": config["tables"]["length"]},
    ),
    "compare_few": (
        "measurement_kinds",
        ["few"],
        {
            "study": study_in_memory(configurations=QUESTIONS["few"]["configurations"]),
            "strategies": STUDY.few,
            "nominal_errors": QUESTIONS["few"]["nominal_errors"],
        },
    ),
    "compare_kinds": (
        "measurement_kinds",
        ["kinds"],
        {
            "study": study_in_memory(configurations=2 * config["tables"]["length"]),
            "reflectors": QUESTIONS["kinds"]["reflectors_m"],
            "encoders_rad": [1e-6 * noise for noise in QUESTIONS["kinds"]["encoders_urad"]],
        },
    ),
    "load_arm": ("stiffness", ["stiffness"], {"study": AT_LENGTH, "forces_N": QUESTIONS["forces_N"]}),
    "vary_starts": (
        "solvers",
        ["starts"],
        {
            "study": AT_LENGTH,
            "strategies": [STUDY.strategies[CLASSICAL]],
            "starts": [1e-6 * start for start in QUESTIONS["starts_urad_per_Nm"]],
        },
    ),
}
LENGTH = {"length": config["tables"]["length"]}
SETS_OF_POINTS = {"point_sets": QUESTIONS["point_sets"], "accuracies_um": QUESTIONS["accuracies_um"]}
# Tables of all robots: the step, inputs, outputs with caption and what they show (none of those that no report shows), parameters.
TABULATED = {
    "tabulate_budget": (
        "points",
        {"budgets": "budget"},
        {
            "budget": ("budget", "budget", "Sets of points (RQ2)"),
            "pairs": ("budget_pairs",),
            "lengths": ("configurations_needed", "configurations_needed", "Configurations needed (RQ3)"),
        },
        SETS_OF_POINTS | LENGTH,
    ),
    "tabulate_costs": (
        "points",
        {"budgets": "budget"},
        {"costs": ("costs", "costs", "Cost of an accuracy (RQ2)"), "break_even": ("break_even",)},
        SETS_OF_POINTS | {"weights": {"seed": config["seed"], "replicates": config["evaluation"]["bootstrap_replicates"]}},
    ),
    "tabulate_ladder": ("ladder", {"ladders": "ladder"}, {"table": ("ladder", "ladder", "Link springs (RQ1)")}, {}),
    "tabulate_designs": ("designs", {"designs": "designs"}, {"table": ("designs", "designs", "Optimal designs (RQ3)")}, {}),
    "tabulate_observability": (
        "designs",
        {"observabilities": "observability"},
        {"table": ("observability", "observability", "Observability indices (RQ3)")},
        {},
    ),
    "tabulate_assumptions": (
        "assumptions",
        {"geometries": "geometry", "weightings": "weighting"},
        {"geometry": ("geometry", "geometry", "Known geometry"), "weighting": ("weighting", "weighting", "Equal weights")},
        {},
    ),
    "tabulate_places": (
        "arm_points",
        {"places": "places"},
        {"table": ("places", "places", "Places of a second target (RQ2)")},
        {},
    ),
    "tabulate_tubes": ("assumptions", {"tubes": "tubes"}, {"table": ("tubes", "tubes", "Tubes of other diameters")}, {}),
    "tabulate_few": (
        "measurement_kinds",
        {"few": "few"},
        {"table": ("few_configurations", "few_configurations", "Fewer than ten configurations")},
        {},
    ),
    "tabulate_kinds": (
        "measurement_kinds",
        {"kinds": "kinds"},
        {"table": ("measurement_kinds", "measurement_kinds", "What to measure (RQ2)")},
        LENGTH,
    ),
    "tabulate_stiffness": ("stiffness", {"stiffness": "stiffness"}, {"table": ("stiffness",)}, {}),
    "tabulate_starts": ("solvers", {"starts": "starts"}, {"table": ("starts",)}, {}),
    "tabulate_uses": (
        "uses",
        {"uses": "uses"},
        {"scores": ("strategy_scores", "strategy_scores", "Strategies by metric (RQ4)"), "pairs": ("strategy_pairs",)},
        {"classical": NAMES[CLASSICAL]} | LENGTH,
    ),
}


for question, (module, folders, settings) in ASKED.items():
    step = f"elastocal.study.{module}.{question}"

    rule:
        name:
            question
        input:
            sources=sources(step),
        output:
            **{folder: f"results/{folder}/{{robot}}.parquet" for folder in folders},
        log:
            f"results/logs/{question}/{{robot}}.log",
        benchmark:
            f"results/timings/{question}/{{robot}}.tsv"
        params:
            **settings,
            step=step,
        script:
            "../scripts/run_step.py"


for question, (module, given, made, settings) in TABULATED.items():
    # What links alone have is asked of robots with links.
    of = EXTENDED if question in ("tabulate_ladder", "tabulate_tubes") else REDUCED
    given = {name: expand(f"results/{folder}/{{robot}}.parquet", robot=of) for name, folder in given.items()}
    given |= all_cells(of) if question == "tabulate_uses" else {}
    made = {name: table_of(file, ABOUT, *shows) for name, (file, *shows) in made.items()}
    STUDY_TABLES[question] = module, given, made, {"robots": of} | settings


rule simulate_designs:
    input:
        sources=sources("elastocal.study.designs.simulate_designs"),
    output:
        designs="results/simulated_designs/{sizes}/{robot}.parquet",
    log:
        "results/logs/simulate_designs/{sizes}/{robot}.log",
    benchmark:
        "results/timings/simulate_designs/{sizes}/{robot}.tsv"
    wildcard_constraints:
        sizes="few|every",
    params:
        step="elastocal.study.designs.simulate_designs",
        study=study_in_memory(),
        candidates=QUESTIONS["candidates"],
        sizes=lambda wildcards: QUESTIONS["simulated_designs"]["sizes"][wildcards.sizes],
        loads=QUESTIONS["simulated_designs"]["loads"],
        uses=QUESTIONS["uses"],
    script:
        "../scripts/run_step.py"


rule tabulate_simulated_designs:
    input:
        designs=expand(rules.simulate_designs.output.designs, robot=REDUCED, allow_missing=True),
        sources=sources("elastocal.study.designs.tabulate_simulated_designs"),
    output:
        table=table_of("simulated_designs_{sizes}", ABOUT, "simulated_designs", "Designs simulated, {sizes} sizes (RQ3)"),
    log:
        "results/logs/tabulate_simulated_designs/{sizes}.log",
    benchmark:
        "results/timings/tabulate_simulated_designs/{sizes}.tsv"
    params:
        step="elastocal.study.designs.tabulate_simulated_designs",
        robots=REDUCED,
    script:
        "../scripts/run_step.py"
