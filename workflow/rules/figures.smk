"""Figures: the paper's, and those that show what its metric hides.

Needs results/ and reports/tables/. Writes reports/figures/*.pdf and *.png.
"""

TITLES = {name: STUDY.robots[name]["name"] for name in config["robots"]}
REDUCED_TITLES = {name: TITLES[name] for name in REDUCED}
# Figure 2 shows the first robot and has one more for each further one; Figure 3 shows the extended robot where there is one.
SCHEME_ROBOTS = {"fig2": REDUCED[0], **{f"fig2_{name}": name for name in REDUCED[1:]}, "fig3": (EXTENDED or REDUCED)[-1]}
# Figures 5a and 5c show the first robot, 5b and 5d the second, as in the paper.
STIFFNESS_PANELS = dict(zip("ab", REDUCED, strict=False))
DEVIATION_PANELS = dict(zip("cd", REDUCED, strict=False))
BEST_TWO = [name for name in (CLASSICAL, "3+6DoF-comb") if name in config["strategies"]]
PAPER_FIGURES = [*SCHEME_ROBOTS, "fig4", *(f"fig5{panel}" for panel in (STIFFNESS_PANELS | DEVIATION_PANELS))]
FIGURES = [
    *PAPER_FIGURES,
    "studies",
    "costs",
    "bias_and_accuracy",
    "scores_against_paper",
    "ladder",
    "designs",
    "arm_map",
    "metrics",
]


rule draw_scheme:
    input:
        sources=sources("draw_scheme.py"),
    output:
        pdf="reports/figures/{scheme}.pdf",
        png=shown(
            "reports/figures/{scheme}.png",
            "scheme",
            "Tables and figures of the paper",
            shows="Figures 2 and 3: {scheme}",
            kind="figure",
        ),
    log:
        "results/logs/draw_scheme/{scheme}.log",
    benchmark:
        "results/timings/draw_scheme/{scheme}.tsv"
    wildcard_constraints:
        scheme="|".join(SCHEME_ROBOTS),
    params:
        robot=lambda wildcards: STUDY.robots[SCHEME_ROBOTS[wildcards.scheme]],
        scheme=lambda wildcards: "spring_scheme" if wildcards.scheme == "fig3" else "kinematic_scheme",
    script:
        "../scripts/draw_scheme.py"


rule draw_noise_impact:
    input:
        metrics=cells("metrics", REDUCED, NOISE, CLASSICAL),
        sources=sources("draw_noise_impact.py"),
    output:
        pdf="reports/figures/fig4.pdf",
        png=shown(
            "reports/figures/fig4.png",
            "fig4",
            "Tables and figures of the paper",
            shows="Figure 4: impact of noise",
            kind="figure",
        ),
    log:
        "results/logs/draw_noise_impact.log",
    benchmark:
        "results/timings/draw_noise_impact.tsv"
    params:
        strategy=NAMES[CLASSICAL],
        titles=REDUCED_TITLES,
    script:
        "../scripts/draw_noise_impact.py"


rule draw_stiffness_errors:
    input:
        metrics=lambda wildcards: cells("metrics", STIFFNESS_PANELS[wildcards.panel], TABLE_NOISE),
        reference=f"{CONFIG}/paper/reference.csv",
        sources=sources("draw_stiffness_errors.py"),
    output:
        pdf="reports/figures/fig5{panel}.pdf",
        png=shown(
            "reports/figures/fig5{panel}.png",
            "fig5_stiffness",
            "Tables and figures of the paper",
            shows="Figure 5{panel}: stiffness errors of all strategies",
            kind="figure",
        ),
    log:
        "results/logs/draw_stiffness_errors/fig5{panel}.log",
    benchmark:
        "results/timings/draw_stiffness_errors/fig5{panel}.tsv"
    wildcard_constraints:
        panel="|".join(STIFFNESS_PANELS) or "none",
    params:
        robot=lambda wildcards: STIFFNESS_PANELS[wildcards.panel],
        title=lambda wildcards: TITLES[STIFFNESS_PANELS[wildcards.panel]],
        order=list(NAMES.values()),
        limit=config["tables"]["k_sigma_limit_percent"],
    script:
        "../scripts/draw_stiffness_errors.py"


rule draw_deviations:
    input:
        metrics=lambda wildcards: cells("metrics", DEVIATION_PANELS[wildcards.panel], TABLE_NOISE),
        reference=f"{CONFIG}/paper/reference.csv",
        sources=sources("draw_deviations.py"),
    output:
        pdf="reports/figures/fig5{panel}.pdf",
        png=shown(
            "reports/figures/fig5{panel}.png",
            "fig5_deviation",
            "Tables and figures of the paper",
            shows="Figure 5{panel}: deviation by all strategies",
            kind="figure",
        ),
    log:
        "results/logs/draw_deviations/fig5{panel}.log",
    benchmark:
        "results/timings/draw_deviations/fig5{panel}.tsv"
    wildcard_constraints:
        panel="|".join(DEVIATION_PANELS) or "none",
    params:
        robot=lambda wildcards: DEVIATION_PANELS[wildcards.panel],
        title=lambda wildcards: TITLES[DEVIATION_PANELS[wildcards.panel]],
        order=list(NAMES.values()),
        limit=config["tables"]["deviation_limit_um"],
    script:
        "../scripts/draw_deviations.py"


rule draw_bias_and_accuracy:
    input:
        metrics=cells("metrics", REDUCED, TABLE_NOISE, BEST_TWO),
        per_dataset=rules.tabulate_accuracy.output.table,
        sources=sources("draw_bias_and_accuracy.py"),
    output:
        pdf="reports/figures/bias_and_accuracy.pdf",
        png=shown(
            "reports/figures/bias_and_accuracy.png",
            "bias_and_accuracy",
            "Questions beyond the paper",
            shows="What the paper's scores measure",
            kind="figure",
        ),
    log:
        "results/logs/draw_bias_and_accuracy.log",
    benchmark:
        "results/timings/draw_bias_and_accuracy.tsv"
    params:
        titles=REDUCED_TITLES,
        order=[NAMES[name] for name in BEST_TWO],
        noise_um=config["tables"]["noise_um"],
        accuracy_um=QUESTIONS["accuracies_um"][0],
    script:
        "../scripts/draw_bias_and_accuracy.py"


rule draw_scores:
    input:
        comparison=rules.compare_with_studies.output.table,
        expectations=rules.tabulate_expectations.output.table,
        sources=sources("draw_scores.py"),
    output:
        pdf="reports/figures/scores_against_paper.pdf",
        png=shown(
            "reports/figures/scores_against_paper.png",
            "scores_against_paper",
            "Tables and figures of the paper",
            shows="Table 4 against further studies",
            kind="figure",
        ),
    log:
        "results/logs/draw_scores.log",
    benchmark:
        "results/timings/draw_scores.tsv"
    params:
        titles=REDUCED_TITLES,
    script:
        "../scripts/draw_scores.py"


rule draw_ladder:
    input:
        table=rules.tabulate_ladder.output.table,
        sources=sources("draw_ladder.py"),
    output:
        pdf="reports/figures/ladder.pdf",
        png=shown(
            "reports/figures/ladder.png", "ladder", "Questions beyond the paper", shows="How many springs (RQ1)", kind="figure"
        ),
    log:
        "results/logs/draw_ladder.log",
    benchmark:
        "results/timings/draw_ladder.tsv"
    script:
        "../scripts/draw_ladder.py"


rule draw_designs:
    input:
        table=rules.tabulate_designs.output.table,
        sources=sources("draw_designs.py"),
    output:
        pdf="reports/figures/designs.pdf",
        png=shown(
            "reports/figures/designs.png",
            "designs",
            "Questions beyond the paper",
            shows="Which configurations (RQ3)",
            kind="figure",
        ),
    log:
        "results/logs/draw_designs.log",
    benchmark:
        "results/timings/draw_designs.tsv"
    params:
        titles=REDUCED_TITLES,
        accuracy_um=QUESTIONS["accuracies_um"][0],
        joint_range=INTERPRETATIONS["joint_range"],
    script:
        "../scripts/draw_designs.py"


rule draw_arm_map:
    input:
        table=rules.tabulate_places.output.table,
        sources=sources("draw_arm_map.py"),
    output:
        pdf="reports/figures/arm_map.pdf",
        png=shown(
            "reports/figures/arm_map.png",
            "arm_map",
            "Questions beyond the paper",
            shows="A second target anywhere on the arm (RQ2)",
            kind="figure",
        ),
    log:
        "results/logs/draw_arm_map.log",
    benchmark:
        "results/timings/draw_arm_map.tsv"
    params:
        robots={name: STUDY.robots[name] for name in REDUCED},
        titles=REDUCED_TITLES,
    script:
        "../scripts/draw_arm_map.py"


rule draw_metrics:
    input:
        table=rules.tabulate_uses.output.scores,
        sources=sources("draw_metrics.py"),
    output:
        pdf="reports/figures/metrics.pdf",
        png=shown(
            "reports/figures/metrics.png",
            "metrics",
            "Questions beyond the paper",
            shows="Metrics against one another (RQ4)",
            kind="figure",
        ),
    log:
        "results/logs/draw_metrics.log",
    benchmark:
        "results/timings/draw_metrics.tsv"
    params:
        titles=REDUCED_TITLES,
    script:
        "../scripts/draw_metrics.py"


rule draw_costs:
    input:
        table=rules.tabulate_costs.output.costs,
        break_even=rules.tabulate_costs.output.break_even,
        sources=sources("draw_costs.py"),
    output:
        pdf="reports/figures/costs.pdf",
        png=shown(
            "reports/figures/costs.png",
            "costs",
            "Questions beyond the paper",
            shows="Cost of an accuracy (RQ2)",
            kind="figure",
        ),
    log:
        "results/logs/draw_costs.log",
    benchmark:
        "results/timings/draw_costs.tsv"
    params:
        titles=REDUCED_TITLES,
        accuracy_um=QUESTIONS["accuracies_um"][0],
    script:
        "../scripts/draw_costs.py"


rule draw_studies:
    input:
        studies=expand(rules.repeat_studies.output.repeated, interpretation=USUAL, robot=REDUCED),
        reference=f"{CONFIG}/paper/reference.csv",
        sources=sources("draw_studies.py"),
    output:
        pdf="reports/figures/studies.pdf",
        png=shown(
            "reports/figures/studies.png",
            "studies",
            "Tables and figures of the paper",
            shows="Strategies over studies",
            kind="figure",
        ),
    log:
        "results/logs/draw_studies.log",
    benchmark:
        "results/timings/draw_studies.tsv"
    params:
        titles=REDUCED_TITLES,
        order=list(NAMES.values()),
    script:
        "../scripts/draw_studies.py"
