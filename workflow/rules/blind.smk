"""The blind benchmark: sealed cases on an independent simulated robot, diagnosed without their ground truths and scored with them.

`snakemake -j2 blind` runs the size quick, `make proof` the registered size; config/blind.yaml has the cases, sizes and targets.
Writes data/blind/, data/sealed/, results/blind/ and reports/blind/. Only seal_cases and, after the diagnosis, oracle_cases and
score_cases read the sealed ground truths. diagnose_cases, the analyst, runs in separate processes that receive only the campaigns.
"""

from elastocal.io.documents import read_document

PLAN = read_document(f"{CONFIG}/blind.yaml")
if config["blind"] not in PLAN["sizes"]:
    sys.exit(f"config.yaml: blind: found {config['blind']!r}; allowed: {', '.join(PLAN['sizes'])}")
BLIND_SIZE = PLAN["sizes"][config["blind"]]
# Everything that determines the cases. Other targets and other sizes are left out, so that changing them makes no case again.
CASES = {key: PLAN[key] for key in ("tuned", "absent", "settings")} | {
    "sizes": {config["blind"]: BLIND_SIZE}
}
# Each block is a random sample of all cases, so the first blocks alone are a smaller benchmark.
BLIND_BLOCKS = min(config.get("blind_blocks", BLIND_SIZE["blocks"]), BLIND_SIZE["blocks"])
BLIND = [f"{config['blind']}_{number + 1}" for number in range(BLIND_BLOCKS)]
BLIND_ROBOTS = list(
    dict.fromkeys(robot for part in BLIND_SIZE["parts"] for robot in part["robots"])
)


rule make_cases:
    input:
        robots=expand(f"{CONFIG}/robots/{{robot}}.yaml", robot=BLIND_ROBOTS),
    output:
        blind=directory("data/blind/{block}"),
        sealed=directory("data/sealed/{block}"),
    params:
        step="elastocal_proof.blind.cases.make_cases",
        plan=CASES,
        size=config["blind"],
        number=lambda wildcards: int(wildcards.block.rsplit("_", 1)[1]),
        seed=config["seed"],
    script:
        "../scripts/run_step.py"


rule seal_cases:
    input:
        sealed=expand(rules.make_cases.output.sealed, block=BLIND),
    output:
        manifest="reports/blind/manifest.sha256",
    params:
        step="elastocal_proof.blind.folders.seal_cases",
    script:
        "../scripts/run_step.py"


rule diagnose_cases:
    input:
        blind=rules.make_cases.output.blind,
        manifest=rules.seal_cases.output.manifest,
    output:
        verdicts="results/blind/{block}.json",
    params:
        step="elastocal_proof.blind.verdicts.diagnose_cases",
        seed=config["seed"],
        robots=f"{CONFIG}/robots",
    script:
        "../scripts/run_step.py"


rule oracle_cases:
    input:
        blind=rules.make_cases.output.blind,
        sealed=rules.make_cases.output.sealed,
        manifest=rules.seal_cases.output.manifest,
        verdicts=rules.diagnose_cases.output.verdicts,
    output:
        oracle="results/blind/oracle/{block}.json",
    params:
        step="elastocal_proof.blind.oracle.oracle_cases",
        plan=CASES,
        seed=config["seed"],
        robots=f"{CONFIG}/robots",
    script:
        "../scripts/run_step.py"


rule score_cases:
    input:
        sealed=expand(rules.make_cases.output.sealed, block=BLIND),
        manifest=rules.seal_cases.output.manifest,
        verdicts=expand(rules.diagnose_cases.output.verdicts, block=BLIND),
        oracles=expand(rules.oracle_cases.output.oracle, block=BLIND),
    output:
        cases="reports/blind/cases.parquet",
        intervals="reports/blind/intervals.parquet",
        locations="reports/blind/locations.parquet",
        mechanisms="reports/blind/mechanisms.csv",
        summary=shown(
            "reports/blind/summary.csv",
            "blind_targets",
            "Blind benchmark",
            shows="Every figure beside its target",
            kind="table",
        ),
        rates=shown(
            "reports/blind/rates.csv",
            "blind_power",
            "Blind benchmark",
            shows="Rates by group, truth and size",
            kind="table",
        ),
        reliability="reports/blind/reliability.csv",
    params:
        step="elastocal_proof.blind.summary.score_cases",
        plan=PLAN,
        seed=config["seed"],
    script:
        "../scripts/run_step.py"


rule draw_blind:
    input:
        summary=rules.score_cases.output.summary,
        reliability=rules.score_cases.output.reliability,
        rates=rules.score_cases.output.rates,
    output:
        targets=shown(
            "reports/blind/figures/targets.png",
            "blind_targets",
            "Blind benchmark",
            shows="Figures against targets",
            kind="figure",
        ),
        reliability=shown(
            "reports/blind/figures/reliability.png",
            "blind_reliability",
            "Blind benchmark",
            shows="Probabilities against frequencies",
            kind="figure",
        ),
        power=shown(
            "reports/blind/figures/power.png",
            "blind_power",
            "Blind benchmark",
            shows="What is detected by size",
            kind="figure",
        ),
        targets_pdf="reports/blind/figures/targets.pdf",
        reliability_pdf="reports/blind/figures/reliability.pdf",
        power_pdf="reports/blind/figures/power.pdf",
    params:
        step="elastocal_proof.figures.blind.draw_blind",
    script:
        "../scripts/run_step.py"


rule write_blind_page:
    input:
        summary=rules.score_cases.output.summary,
        cases=rules.score_cases.output.cases,
        locations=rules.score_cases.output.locations,
        mechanisms=rules.score_cases.output.mechanisms,
        robots=rules.make_cases.input.robots,
    output:
        page="reports/blind/targets.md",
    params:
        step="elastocal_proof.report.blind_page.write_blind_page",
        plan=PLAN,
        size=config["blind"],
        seed=config["seed"],
    script:
        "../scripts/run_step.py"


rule blind_pictures:
    """Pictures, tables and scores by case of docs/, from a finished benchmark."""
    input:
        sources=[
            rules.write_blind_page.output.page,
            rules.draw_blind.output.targets,
            rules.draw_blind.output.reliability,
            rules.draw_blind.output.power,
            rules.score_cases.output.cases,
        ],
    output:
        copies=[
            "docs/blind_tables.md",
            "docs/blind_targets.png",
            "docs/blind_reliability.png",
            "docs/blind_power.png",
            "docs/blind_cases.parquet",
        ],
    script:
        "../scripts/copy_into_docs.py"


rule blind:
    input:
        rules.score_cases.output,
        rules.draw_blind.output,
        rules.write_blind_page.output,
