"""Figures: the paper's, and those that show what its metric hides.

Needs results/ and reports/tables/. Writes reports/figures/*.pdf and *.png.
"""

TITLES = {name: STUDY.robots[name]["name"] for name in config["robots"]}
REDUCED_TITLES = {name: TITLES[name] for name in REDUCED}
# Figure 2 shows the first robot and has one more for each further one; Figure 3 shows the extended robot where there is one.
SCHEME_ROBOTS = dict(
    zip(["figure2", *(f"figure2_{name}" for name in REDUCED[1:])], REDUCED, strict=True)
)
SCHEME_ROBOTS |= {"figure3": (EXTENDED or REDUCED)[-1]}
# Figures 5a and 5c show the first robot, 5b and 5d the second, as in the paper.
STIFFNESS_PANELS = dict(zip("ab", REDUCED, strict=False))
DEVIATION_PANELS = dict(zip("cd", REDUCED, strict=False))
PAPER_FIGURES = [
    *SCHEME_ROBOTS,
    "figure4",
    *(f"figure5{panel}" for panel in (STIFFNESS_PANELS | DEVIATION_PANELS)),
]
FIGURES = [*PAPER_FIGURES, "scores_against_paper", "ladder", "designs"]

# Each other figure: its function, file, caption, category, what it shows, tables, settings.
DRAWN = {
    "draw_noise_impact": (
        ("draw_noise_impact", "figure4", "figure4", PAPER, "Figure 4: impact of noise"),
        {"metrics": cells("metrics", REDUCED, NOISE, CLASSICAL)},
        {"strategy": NAMES[CLASSICAL], "titles": REDUCED_TITLES},
    ),
    "draw_scores": (
        (
            "draw_scores",
            "scores_against_paper",
            "scores_against_paper",
            PAPER,
            "Table 4 against further studies",
        ),
        {"comparison": rules.compare_with_studies.output.table},
        {"titles": REDUCED_TITLES},
    ),
    "draw_ladder": (
        ("draw_ladder", "ladder", "ladder", ABOUT, "How many springs (RQ1)"),
        {"table": rules.tabulate_ladder.output.table},
        {},
    ),
    "draw_designs": (
        ("draw_designs", "designs", "designs", ABOUT, "Which configurations (RQ3)"),
        {"table": rules.tabulate_simulated_designs.output.table},
        {"titles": REDUCED_TITLES, "accuracy_um": QUESTIONS["accuracies_um"][0]},
    ),
}
# Figures 5a and 5b, and 5c and 5d: their panels, function, caption, words, and the limit that they show.
PANELS = {
    "draw_stiffness_errors": (
        *(
            STIFFNESS_PANELS,
            "draw_stiffness_errors",
            "figure5_stiffness",
            "stiffness errors of all strategies",
        ),
        {"limit_percent": config["tables"]["k_sigma_limit_percent"]},
    ),
    "draw_deviations": (
        *(DEVIATION_PANELS, "draw_deviations", "figure5_deviation", "deviation by all strategies"),
        {"limit_um": config["tables"]["deviation_limit_um"]},
    ),
}


DRAWN |= {name: draw_panel(*panel) for name, panel in PANELS.items()}


for drawn, ((function, file, caption, category, words), tables, settings) in DRAWN.items():

    rule:
        name:
            drawn
        input:
            **tables,
        output:
            pdf=f"reports/figures/{file}.pdf",
            png=shown(f"reports/figures/{file}.png", caption, category, shows=words, kind="figure"),
        wildcard_constraints:
            panel="|".join(PANELS[drawn][0] if drawn in PANELS else ()) or "none",
        params:
            figure=function,
            tables=[*tables],
            settings=settings,
        script:
            "../scripts/draw_study.py"


rule draw_scheme:
    output:
        pdf="reports/figures/{scheme}.pdf",
        png=shown(
            "reports/figures/{scheme}.png",
            "scheme",
            "Tables and figures of the paper",
            shows="Figures 2 and 3: {scheme}",
            kind="figure",
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
