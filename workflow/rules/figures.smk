"""Figures: those of the paper, and those that show what its metric hides.

Needs results/ and reports/tables/. Writes reports/figures/*.pdf and *.png.
"""

TITLES = {name: STUDY.robots[name]["name"] for name in config["robots"]}
REDUCED_TITLES = {name: TITLES[name] for name in REDUCED}
# Figure 2 shows the first robot; each further robot has a Figure 2 of its own. Figure 3 shows the robot with elastic links, if any.
SCHEME_ROBOTS = {"figure2": REDUCED[0]}
SCHEME_ROBOTS |= {f"figure2_{name}": name for name in REDUCED[1:]}
SCHEME_ROBOTS |= {"figure3": (EXTENDED or REDUCED)[-1]}
# Figures 5a and 5c show the first robot, 5b and 5d the second, as in the paper.
STIFFNESS_PANELS = dict(zip("ab", REDUCED, strict=False))
DEVIATION_PANELS = dict(zip("cd", REDUCED, strict=False))
PAPER_FIGURES = [
    *SCHEME_ROBOTS,
    "figure4",
    *(f"figure5{panel}" for panel in STIFFNESS_PANELS),
    *(f"figure5{panel}" for panel in DEVIATION_PANELS),
]
FIGURES = [*PAPER_FIGURES, "scores_against_paper", "multiverse", "ladder", "designs"]


rule draw_scheme:
    output:
        pdf="reports/figures/{scheme}.pdf",
        png=shown_figure(
            "reports/figures/{scheme}.png", "scheme", PAPER, "Figures 2 and 3: {scheme}"
        ),
    wildcard_constraints:
        scheme="|".join(SCHEME_ROBOTS),
    params:
        robot=lambda wildcards: STUDY.robots[SCHEME_ROBOTS[wildcards.scheme]],
        scheme=lambda wildcards: (
            "draw_spring_scheme" if wildcards.scheme == "figure3" else "draw_kinematic_scheme"
        ),
    script:
        "../scripts/draw_scheme.py"


rule draw_noise_impact:
    input:
        metrics=cells("metrics", REDUCED, NOISE, CLASSICAL),
    output:
        pdf="reports/figures/figure4.pdf",
        png=shown_figure(
            "reports/figures/figure4.png", "figure4", PAPER, "Figure 4: impact of noise"
        ),
    params:
        figure="draw_noise_impact",
        tables=["metrics"],
        settings={"strategy": NAMES[CLASSICAL], "titles": REDUCED_TITLES},
    script:
        "../scripts/draw_study.py"


rule draw_stiffness_errors:
    input:
        metrics=lambda wildcards: cells("metrics", STIFFNESS_PANELS[wildcards.panel], TABLE_NOISE),
        printed=PRINTED_FIGURES,
    output:
        pdf="reports/figures/figure5{panel}.pdf",
        png=shown_figure(
            "reports/figures/figure5{panel}.png",
            "figure5_stiffness",
            PAPER,
            "Figure 5{panel}: stiffness errors of all strategies",
        ),
    wildcard_constraints:
        panel="|".join(STIFFNESS_PANELS),
    params:
        figure="draw_stiffness_errors",
        tables=["metrics", "printed"],
        settings=lambda wildcards: panel_settings(
            STIFFNESS_PANELS[wildcards.panel],
            limit_percent=config["tables"]["k_sigma_limit_percent"],
        ),
    script:
        "../scripts/draw_study.py"


rule draw_deviations:
    input:
        metrics=lambda wildcards: cells("metrics", DEVIATION_PANELS[wildcards.panel], TABLE_NOISE),
        printed=PRINTED_FIGURES,
    output:
        pdf="reports/figures/figure5{panel}.pdf",
        png=shown_figure(
            "reports/figures/figure5{panel}.png",
            "figure5_deviation",
            PAPER,
            "Figure 5{panel}: deviation by all strategies",
        ),
    wildcard_constraints:
        panel="|".join(DEVIATION_PANELS),
    params:
        figure="draw_deviations",
        tables=["metrics", "printed"],
        settings=lambda wildcards: panel_settings(
            DEVIATION_PANELS[wildcards.panel], limit_um=config["tables"]["deviation_limit_um"]
        ),
    script:
        "../scripts/draw_study.py"


rule draw_scores:
    input:
        comparison=rules.compare_with_studies.output.table,
    output:
        pdf="reports/figures/scores_against_paper.pdf",
        png=shown_figure(
            "reports/figures/scores_against_paper.png",
            "scores_against_paper",
            PAPER,
            "Table 4 against further studies",
        ),
    params:
        figure="draw_scores",
        tables=["comparison"],
        settings={"titles": REDUCED_TITLES},
    script:
        "../scripts/draw_study.py"


rule draw_multiverse:
    input:
        table=rules.tabulate_multiverse.output.table,
    output:
        pdf="reports/figures/multiverse.pdf",
        png=shown_figure(
            "reports/figures/multiverse.png",
            "multiverse_figure",
            PAPER,
            "Interpretations and their alternatives",
        ),
    params:
        figure="draw_multiverse",
        tables=["table"],
        settings={},
    script:
        "../scripts/draw_study.py"


rule draw_ladder:
    input:
        table=rules.tabulate_ladder.output.table,
    output:
        pdf="reports/figures/ladder.pdf",
        png=shown_figure(
            "reports/figures/ladder.png", "ladder", QUESTIONS_BEYOND, "How many springs (RQ1)"
        ),
    params:
        figure="draw_ladder",
        tables=["table"],
        settings={},
    script:
        "../scripts/draw_study.py"


rule draw_designs:
    input:
        table=rules.tabulate_simulated_designs.output.table,
    output:
        pdf="reports/figures/designs.pdf",
        png=shown_figure(
            "reports/figures/designs.png",
            "designs",
            QUESTIONS_BEYOND,
            "Which configurations (RQ3)",
        ),
    params:
        figure="draw_designs",
        tables=["table"],
        settings={"titles": REDUCED_TITLES, "accuracy_um": QUESTIONS["accuracies_um"][0]},
    script:
        "../scripts/draw_study.py"
