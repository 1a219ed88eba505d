"""The reports: the paper's tables and figures, and the study's: numbers for its text, then its pages.

Needs reports/tables/ and reports/figures/. Writes reports/paper.pdf, reports/answers.json and reports/study.pdf; of the
documentation, docs/study_tables.md.
"""

# What the text of the report says of loads and places.
STATED = {
    "force_N": config["loading"]["force_N"],
    "offset_m": max(map(abs, config["loading"]["offset_m"])),
    "tracker_m": QUESTIONS["tracker_m"],
    **{key: QUESTIONS["uses"][key] for key in ("edge_m", "weight_N", "path_m", "cutting_N")},
    **{key: QUESTIONS["arm_points"][key] for key in ("bar_m", "acceptance_deg")},
}


rule compile_paper:
    input:
        beside=rules.compare_with_paper.output.table,
        figures=expand("reports/figures/{figure}.pdf", figure=PAPER_FIGURES),
        citation=placed(ROOT / "CITATION.cff"),
        pages=placed(PACKAGES / "elastocal" / "report" / "paper.typ"),
        sources=sources("compile_paper.py"),
    output:
        report=shown(
            "reports/paper.pdf", "paper", "Tables and figures of the paper", shows="The paper, regenerated", kind="report"
        ),
    log:
        "results/logs/compile_paper.log",
    benchmark:
        "results/timings/compile_paper.tsv"
    params:
        names=TITLES,
        stated={
            "figures": PAPER_FIGURES,
            "classical": NAMES[CLASSICAL],
            **{key: str(config["tables"][key]) for key in ("noise_um", "length")},
            **{key: str(config[key]) for key in ("data_sets", "configurations", "test_configurations")},
        },
    script:
        "../scripts/compile_paper.py"


rule judge_claims:
    input:
        studies=expand(rules.repeat_studies.output.repeated, interpretation=USUAL, robot=REDUCED),
        expected=cells("expected", REDUCED, NOISE, CLASSICAL),
        comparison=rules.compare_with_studies.output.table,
        solvers=rules.tabulate_solvers.output.table,
        starts=rules.tabulate_decisions.output.starts,
        stiffness=rules.tabulate_decisions.output.stiffness,
        designs=rules.tabulate_designs.output.table,
        pairs=rules.tabulate_budget.output.pairs,
        score_pairs=rules.tabulate_uses.output.pairs,
        sources=sources("judge_claims.py"),
    output:
        table=shown(
            "reports/tables/claims.csv", "claims", "Tables and figures of the paper", shows="Claims of the paper", kind="table"
        ),
    log:
        "results/logs/judge_claims.log",
    benchmark:
        "results/timings/judge_claims.tsv"
    params:
        length=config["tables"]["length"],
        robots=REDUCED,
    script:
        "../scripts/judge_claims.py"


rule state_answers:
    input:
        comparison=rules.compare_with_studies.output.table,
        expectations=rules.tabulate_expectations.output.table,
        ladder=rules.tabulate_ladder.output.table,
        budget=rules.tabulate_budget.output.budget,
        pairs=rules.tabulate_budget.output.pairs,
        needed=rules.tabulate_budget.output.lengths,
        observability=rules.tabulate_observability.output.table,
        places=rules.tabulate_places.output.table,
        scores=rules.tabulate_uses.output.scores,
        score_pairs=rules.tabulate_uses.output.pairs,
        tubes=rules.tabulate_tubes.output.table,
        geometry=rules.tabulate_assumptions.output.geometry,
        weighting=rules.tabulate_assumptions.output.weighting,
        table2=rules.tabulate_initial.output.table,
        extended=rules.tabulate_extended.output.table,
        solvers=rules.tabulate_solvers.output.table,
        claims=rules.judge_claims.output.table,
        studies=rules.tabulate_studies.output.table,
        joint=rules.tabulate_studies.output.joint,
        costs=rules.tabulate_costs.output.costs,
        break_even=rules.tabulate_costs.output.break_even,
        simulated="reports/tables/simulated_designs_few.csv",
        few=rules.tabulate_decisions.output.few,
        kinds=rules.tabulate_decisions.output.kinds,
        stiffness=rules.tabulate_decisions.output.stiffness,
        citation=placed(ROOT / "CITATION.cff"),
        template=placed(PACKAGES / "elastocal" / "report" / "study.txt"),
        sources=sources("state_answers.py"),
    output:
        answers="reports/answers.json",
    log:
        "results/logs/state_answers.log",
    benchmark:
        "results/timings/state_answers.tsv"
    params:
        robots=REDUCED,
        names=TITLES,
        cells={key: config["tables"][key] for key in ("noise_um", "length")} | {"configurations": config["configurations"]},
        classical=NAMES[CLASSICAL],
        strategies=list(STUDY.strategies.values()),
        best=NAMES.get("3+6DoF-comb", NAMES[CLASSICAL]),
        accuracy_um=QUESTIONS["accuracies_um"][0],
        size={key: config[key] for key in ("data_sets", "configurations", "test_configurations", "seed")},
        stated=STATED,
    script:
        "../scripts/state_answers.py"


rule write_study_page:
    input:
        answers=rules.state_answers.output.answers,
        template=placed(PACKAGES / "elastocal" / "report" / "study_tables.md"),
        sources=sources("write_study_page.py"),
    output:
        page="docs/study_tables.md",
    log:
        "results/logs/write_study_page.log",
    benchmark:
        "results/timings/write_study_page.tsv"
    script:
        "../scripts/write_study_page.py"


rule compile_report:
    input:
        answers=rules.state_answers.output.answers,
        table1=rules.tabulate_compliances.output.table,
        table2=rules.tabulate_initial.output.table,
        table3=rules.tabulate_identified.output.table,
        table4=rules.tabulate_strategies.output.table,
        interpretations=f"{CONFIG}/paper/interpretations.csv",
        figures=expand("reports/figures/{figure}.pdf", figure=FIGURES),
        bibliography=placed(ROOT / "paper" / "paper.bib"),
        pages=placed(PACKAGES / "elastocal" / "report" / "study.typ"),
        sources=sources("compile_report.py"),
    output:
        report=shown(
            "reports/study.pdf", "study", "Tables and figures of the paper", shows="The report of the study", kind="report"
        ),
    log:
        "results/logs/compile_report.log",
    benchmark:
        "results/timings/compile_report.tsv"
    params:
        figures=FIGURES,
    script:
        "../scripts/compile_report.py"
