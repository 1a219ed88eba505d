"""What comes after the verdicts of the blind proof: the oracle, the scores, figures and the report.

Needs data/blind/, data/sealed/, the verdicts of results/blind/ and what blind_follow_up.smk makes. Writes results/blind/oracle/
and reports/blind/.
"""

BLIND_FIGURES = ["targets", "reliability", "power", "confusion", "errors", "coverage"]


rule oracle_cases:
    input:
        blind=rules.make_cases.output.blind,
        sealed=rules.make_cases.output.sealed,
        manifest=rules.seal_cases.output.manifest,
        verdicts=rules.diagnose_cases.output.verdicts,
        sources=sources("oracle_cases.py"),
    output:
        oracle="results/blind/oracle/{block}.json",
    log:
        "results/logs/oracle_cases/{block}.log",
    benchmark:
        "results/timings/oracle_cases/{block}.tsv"
    params:
        seed=config["seed"],
        robots=f"{CONFIG}/robots",
    script:
        "../scripts/oracle_cases.py"


rule score_cases:
    input:
        sealed=expand(rules.make_cases.output.sealed, block=BLIND),
        manifest=rules.seal_cases.output.manifest,
        verdicts=expand(rules.diagnose_cases.output.verdicts, block=BLIND),
        oracles=expand(rules.oracle_cases.output.oracle, block=BLIND),
        sources=sources("score_cases.py"),
    output:
        cases="reports/blind/cases.csv",
        summary=shown(
            "reports/blind/summary.csv", "blind_targets", "Blind proof", shows="Every figure beside its target", kind="table"
        ),
        settings="reports/blind/settings.csv",
        confusion="reports/blind/confusion.csv",
        power=shown("reports/blind/power.csv", "blind_power", "Blind proof", shows="Power by effect and size", kind="table"),
        coverage="reports/blind/coverage.csv",
        undetectable=shown(
            "reports/blind/undetectable.csv", "blind_undetectable", "Blind proof", shows="What cannot be found", kind="table"
        ),
        probabilities="reports/blind/probabilities.csv",
        reliability="reports/blind/reliability.csv",
    log:
        "results/logs/score_cases.log",
    benchmark:
        "results/timings/score_cases.tsv"
    params:
        seed=config["seed"],
    script:
        "../scripts/score_cases.py"


rule draw_blind_targets:
    input:
        summary=rules.score_cases.output.summary,
        cases=rules.score_cases.output.cases,
        probabilities=rules.score_cases.output.probabilities,
        robots=rules.make_cases.input.robots,
        sources=sources("draw_blind_targets.py"),
    output:
        page="reports/blind/targets.md",
        pdf="reports/blind/figures/targets.pdf",
        png=shown(
            "reports/blind/figures/targets.png", "blind_targets", "Blind proof", shows="Figures against targets", kind="figure"
        ),
    log:
        "results/logs/draw_blind_targets.log",
    benchmark:
        "results/timings/draw_blind_targets.tsv"
    params:
        size=config["blind"],
        seed=config["seed"],
    script:
        "../scripts/draw_blind_targets.py"


rule draw_blind_reliability:
    input:
        reliability=rules.score_cases.output.reliability,
        sources=sources("draw_blind_reliability.py"),
    output:
        pdf="reports/blind/figures/reliability.pdf",
        png=shown(
            "reports/blind/figures/reliability.png",
            "blind_reliability",
            "Blind proof",
            shows="Probabilities against frequencies",
            kind="figure",
        ),
    log:
        "results/logs/draw_blind_reliability.log",
    benchmark:
        "results/timings/draw_blind_reliability.tsv"
    script:
        "../scripts/draw_blind_reliability.py"


rule draw_blind_power:
    input:
        power=rules.score_cases.output.power,
        sources=sources("draw_blind_power.py"),
    output:
        pdf="reports/blind/figures/power.pdf",
        png=shown(
            "reports/blind/figures/power.png", "blind_power", "Blind proof", shows="What is detected by size", kind="figure"
        ),
    log:
        "results/logs/draw_blind_power.log",
    benchmark:
        "results/timings/draw_blind_power.tsv"
    script:
        "../scripts/draw_blind_power.py"


rule draw_blind_confusion:
    input:
        confusion=rules.score_cases.output.confusion,
        sources=sources("draw_blind_confusion.py"),
    output:
        pdf="reports/blind/figures/confusion.pdf",
        png=shown(
            "reports/blind/figures/confusion.png",
            "blind_confusion",
            "Blind proof",
            shows="Ground truth against verdict",
            kind="figure",
        ),
    log:
        "results/logs/draw_blind_confusion.log",
    benchmark:
        "results/timings/draw_blind_confusion.tsv"
    script:
        "../scripts/draw_blind_confusion.py"


rule draw_blind_coverage:
    input:
        coverage=rules.score_cases.output.coverage,
        sources=sources("draw_blind_coverage.py"),
    output:
        pdf="reports/blind/figures/coverage.pdf",
        png=shown(
            "reports/blind/figures/coverage.png", "blind_coverage", "Blind proof", shows="Coverage of intervals", kind="figure"
        ),
    log:
        "results/logs/draw_blind_coverage.log",
    benchmark:
        "results/timings/draw_blind_coverage.tsv"
    script:
        "../scripts/draw_blind_coverage.py"


rule draw_blind_errors:
    input:
        cases=rules.score_cases.output.cases,
        sources=sources("draw_blind_errors.py"),
    output:
        pdf="reports/blind/figures/errors.pdf",
        png=shown("reports/blind/figures/errors.png", "blind_errors", "Blind proof", shows="Held-out errors", kind="figure"),
    log:
        "results/logs/draw_blind_errors.log",
    benchmark:
        "results/timings/draw_blind_errors.tsv"
    script:
        "../scripts/draw_blind_errors.py"


rule compile_blind_report:
    input:
        summary=rules.score_cases.output.summary,
        settings=rules.score_cases.output.settings,
        power=rules.score_cases.output.power,
        undetectable=rules.score_cases.output.undetectable,
        confusion=rules.score_cases.output.confusion,
        cases=rules.score_cases.output.cases,
        follow_up=rules.score_follow_ups.output.rates,
        sweep=rules.score_sweep.output.table,
        manifest=rules.seal_cases.output.manifest,
        figures=[*expand("reports/blind/figures/{figure}.pdf", figure=BLIND_FIGURES), rules.score_sweep.output.pdf],
        pages=[placed(PACKAGES / file) for file in ("elastocal_proof/report/blind.typ", "elastocal/report/sheet.typ")],
        sources=sources("compile_blind_report.py"),
    output:
        report=shown("reports/blind/blind.pdf", "blind", "Blind proof", shows="The report of the blind proof", kind="report"),
    log:
        "results/logs/compile_blind_report.log",
    benchmark:
        "results/timings/compile_blind_report.tsv"
    params:
        size=config["blind"],
        seed=config["seed"],
    script:
        "../scripts/compile_blind_report.py"


rule blind_pictures:
    """Pictures and the table of docs/, from a finished proof."""
    input:
        page=rules.draw_blind_targets.output.page,
        figures=expand("reports/blind/figures/{figure}.png", figure=["targets", "reliability", "power"]),
    output:
        page="docs/blind_tables.md",
        figures=expand("docs/blind_{figure}.png", figure=["targets", "reliability", "power"]),
    log:
        "results/logs/blind_pictures.log",
    benchmark:
        "results/timings/blind_pictures.tsv"
    shell:
        "(cp {input.page} {output.page}; for one in {input.figures}; do cp $one docs/blind_$(basename $one); done) 2> {log}"


rule blind:
    input:
        rules.score_cases.output,
        expand("reports/blind/figures/{figure}.{format}", figure=BLIND_FIGURES, format=["pdf", "png"]),
        rules.compile_blind_report.output.report,
