"""The reports: the paper's tables and figures, and the study with the numbers of its text.

Needs reports/tables/ and reports/figures/. Writes reports/paper.pdf, reports/answers.json, reports/study.pdf and
docs/study_tables.md.
"""

# Loads and sizes that the text of the report states.
STATED = {
    "force_N": config["loading"]["force_N"],
    "offset_m": max(map(abs, config["loading"]["offset_m"])),
    **{key: QUESTIONS["uses"][key] for key in ("edge_m", "weight_N", "path_m", "cutting_N")},
}


rule compile_paper:
    input:
        beside=rules.compare_with_paper.output.table,
        table2=rules.tabulate_initial.output.table,
        figures=expand("reports/figures/{figure}.pdf", figure=PAPER_FIGURES),
        citation=placed(ROOT / "CITATION.cff"),
        pages=placed(PACKAGES / "elastocal" / "report" / "paper.typ"),
    output:
        report=shown(
            "reports/paper.pdf",
            "paper",
            "Tables and figures of the paper",
            shows="The paper, regenerated",
            kind="report",
        ),
    params:
        names=TITLES,
        robots=REDUCED,
        stated={
            "classical": NAMES[CLASSICAL],
            **{key: str(config["tables"][key]) for key in ("noise_um", "length")},
            **{
                key: str(config[key])
                for key in ("data_sets", "configurations", "test_configurations")
            },
        },
    script:
        "../scripts/compile_paper.py"


rule state_answers:
    input:
        comparison=rules.compare_with_studies.output.table,
        ladder=rules.tabulate_ladder.output.table,
        budget=rules.tabulate_budget.output.budget,
        pairs=rules.tabulate_budget.output.pairs,
        needed=rules.tabulate_budget.output.lengths,
        scores=rules.tabulate_uses.output.scores,
        score_pairs=rules.tabulate_uses.output.pairs,
        table2=rules.tabulate_initial.output.table,
        extended=rules.tabulate_extended.output.table,
        studies=rules.tabulate_studies.output.table,
        joint=rules.compare_with_studies.output.joint,
        multiverse_summary=rules.tabulate_multiverse.output.summary,
        claims=rules.judge_claims.output.table,
        break_even=rules.tabulate_costs.output.table,
        simulated=rules.tabulate_simulated_designs.output.table,
        citation=placed(ROOT / "CITATION.cff"),
        template=placed(PACKAGES / "elastocal" / "report" / "study.txt"),
    output:
        answers="reports/answers.json",
    params:
        robots=REDUCED,
        names=TITLES,
        cells={key: config["tables"][key] for key in ("noise_um", "length")}
        | {"configurations": config["configurations"]},
        classical=NAMES[CLASSICAL],
        strategies=list(STUDY.strategies.values()),
        best=NAMES.get("3+6DoF-comb", NAMES[CLASSICAL]),
        accuracy_um=QUESTIONS["accuracies_um"][0],
        size={
            key: config[key]
            for key in ("data_sets", "configurations", "test_configurations", "seed")
        },
        stated=STATED,
    script:
        "../scripts/state_answers.py"


rule write_study_page:
    input:
        answers=rules.state_answers.output.answers,
        template=placed(PACKAGES / "elastocal" / "report" / "study_tables.md"),
    output:
        page="docs/study_tables.md",
    script:
        "../scripts/write_study_page.py"


rule compile_report:
    input:
        answers=rules.state_answers.output.answers,
        table1=rules.tabulate_compliances.output.table,
        table2=rules.tabulate_initial.output.table,
        table3=rules.tabulate_identified.output.table,
        table4=rules.tabulate_strategies.output.table,
        figures=expand("reports/figures/{figure}.pdf", figure=FIGURES),
        bibliography=placed(ROOT / "paper" / "paper.bib"),
        pages=placed(PACKAGES / "elastocal" / "report" / "study.typ"),
    output:
        report=shown(
            "reports/study.pdf",
            "study",
            "Tables and figures of the paper",
            shows="The report of the study",
            kind="report",
        ),
    script:
        "../scripts/compile_report.py"
